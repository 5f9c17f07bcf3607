"""Solve A x = b for a symmetric positive definite A of any scalar type, without branching on values."""

from __future__ import annotations

import numpy as np

from dynx.spatial.scalar import Array

Factors = tuple[list[list[Array]], list[Array]]


def solve_positive_definite(A: Array, b: Array) -> Array:
    """Return x (..., n) with A x = b, for A (..., n, n), by A = L D L' (Golub and Van Loan, algorithm 4.1.2).

    The factorisation needs no square roots. A singular A causes a division by zero.
    """
    return solve_ldl(*ldl_factors(A), b)


def solve_columns(A: Array, B: Array) -> Array:
    """Return X (n, m) with A X = B: floats by LAPACK, any other scalar by `solve_positive_definite`."""
    if A.dtype != object:
        return np.asarray(np.linalg.solve(A, B))
    return np.asarray(solve_positive_definite(A, B.T).T)


def ldl_factors(A: Array) -> Factors:
    """Return L and D with A = L D L'.

    L has a unit diagonal; its row i holds the i entries left of the diagonal.
    """
    n = A.shape[-1]
    L: list[list[Array]] = [[] for _ in range(n)]
    D: list[Array] = []
    for i in range(n):
        scaled: list[Array] = []
        for j in range(i):
            entry = A[..., i, j]
            for k in range(j):
                entry = entry - scaled[k] * L[j][k]
            scaled.append(entry)
            L[i].append(entry / D[j])
        pivot = A[..., i, i]
        for k in range(i):
            pivot = pivot - scaled[k] * L[i][k]
        D.append(pivot)
    return L, D


def solve_ldl(L: list[list[Array]], D: list[Array], b: Array) -> Array:
    """Return x (..., n) with L D L' x = b, by forward and back substitution."""
    if not D:
        return b
    n = len(D)
    x: list[Array] = []
    for i in range(n):
        entry = b[..., i]
        for k in range(i):
            entry = entry - L[i][k] * x[k]
        x.append(entry)
    x = [entry / pivot for entry, pivot in zip(x, D, strict=True)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            x[i] = x[i] - L[k][i] * x[k]
    return np.stack(x, axis=-1)
