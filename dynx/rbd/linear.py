"""Solve A x = b for a symmetric positive definite A of any scalar type, without branching on values."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dynx.spatial.scalar import Array

Factors = tuple[list[dict[int, Array]], list[Array]]
"""Rows of L left of its diagonal of ones, as entries by column, and the diagonal of D."""


def solve_positive_definite(A: Array, b: Array) -> Array:
    """Return x (..., n) with A x = b, for A (..., n, n), by A = L D L' (Golub and Van Loan, algorithm 4.1.2).

    The factorisation needs no square roots. A singular A causes a division by zero: floats
    become NaN or infinite, and 50 digits raise an exception.
    """
    return solve_ldl(*ldl_factors(A), b)


def solve_columns(A: Array, B: Array) -> Array:
    """Return X (n, m) with A X = B: floats by LAPACK, any other scalar by `solve_positive_definite`."""
    if A.dtype != object and B.dtype != object:
        return np.asarray(np.linalg.solve(A, B))
    return np.asarray(solve_positive_definite(A, B.T).T)


def ldl_factors(A: Array, filled: Iterable[tuple[int, int]] | None = None) -> Factors:
    """Return L and D with A = L D L'.

    `filled` are the positions left of the diagonal where L may differ from zero, row by row from left to
    right; by default all of them.
    """
    n = A.shape[-1]
    columns = [list(range(i)) for i in range(n)]
    if filled is not None:
        columns = [[] for _ in range(n)]
        for i, j in filled:
            columns[i].append(j)
    L: list[dict[int, Array]] = []
    D: list[Array] = []
    for i in range(n):
        scaled: dict[int, Array] = {}
        row: dict[int, Array] = {}
        for j in columns[i]:
            entry = A[..., i, j]
            for k, factor in L[j].items():
                if k in scaled:
                    entry = entry - scaled[k] * factor
            scaled[j] = entry
            row[j] = entry / D[j]
        pivot = A[..., i, i]
        for k, factor in row.items():
            pivot = pivot - scaled[k] * factor
        L.append(row)
        D.append(pivot)
    return L, D


def solve_ldl(L: list[dict[int, Array]], D: list[Array], b: Array) -> Array:
    """Return x (..., n) with L D L' x = b, by forward and back substitution."""
    if not D:
        return b
    x: list[Array] = []
    for i, row in enumerate(L):
        entry = b[..., i]
        for k, factor in row.items():
            entry = entry - factor * x[k]
        x.append(entry)
    x = [entry / pivot for entry, pivot in zip(x, D, strict=True)]
    for i in reversed(range(len(L))):
        for k in range(i + 1, len(L)):
            if i in L[k]:
                x[i] = x[i] - L[k][i] * x[k]
    return np.stack(x, axis=-1)
