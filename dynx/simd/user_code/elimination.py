"""Linear systems of traced numbers, by Gaussian elimination with pivots chosen by selection."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.errors import TraceError
from dynx.simd.expr import Symbol, caller_location
from dynx.simd.user_code.numbers import select
from dynx.spatial.scalar import Array

MAX_SOLVED_SIZE = 18
"""Largest number of unknowns: a quadruped has 18 coordinates, and 24 take 8 s to compile."""


def solve(matrix: Array, right: Array) -> Array:
    """Return x of matrix (n, n) x = right, (n,) or (n, k).

    The pivot of each column is its largest entry, as in LAPACK. A singular matrix of symbols gives infinities
    or NaN. Raises TraceError for one of numbers, for other shapes and for more than `MAX_SOLVED_SIZE`
    unknowns.
    """
    n = len(matrix)
    if matrix.shape != (n, n) or right.ndim not in (1, 2) or len(right) != n:
        raise TraceError(
            f"{caller_location()} solves a system of shapes {matrix.shape} and {right.shape}; wanted "
            "(n, n) and (n,) or (n, k)"
        )
    if n > MAX_SOLVED_SIZE:
        raise TraceError(
            f"{caller_location()} solves for {n} unknowns; traced code solves for at most {MAX_SOLVED_SIZE}. "
            "forward_dynamics of control.model_dynamics solves with the mass matrix of any robot"
        )
    columns = right.reshape(n, -1)
    rows = [[*row, *side] for row, side in zip(matrix.tolist(), columns.tolist(), strict=True)]
    for k in range(n):
        for i in range(k + 1, n):
            rows[k], rows[i] = _ordered(rows[k], rows[i], k)
        for i in range(k + 1, n):
            factor = _quotient(rows[i][k], rows[k][k])
            pairs = zip(rows[k][k + 1 :], rows[i][k + 1 :], strict=True)
            rows[i][k + 1 :] = [entry - factor * above for above, entry in pairs]
    for k in reversed(range(n)):
        for j in range(n, n + columns.shape[1]):
            total = rows[k][j]
            for i in range(k + 1, n):
                total = total - rows[k][i] * rows[i][j]
            rows[k][j] = _quotient(total, rows[k][k])
    solution = np.empty(columns.shape, dtype=object)
    for k in range(n):
        solution[k] = rows[k][n:]
    return solution.reshape(right.shape)


def _ordered(one: list[Any], other: list[Any], column: int) -> tuple[list[Any], list[Any]]:
    """Return two rows, the one with the larger entry in the column first."""
    exchanged = abs(other[column]) > abs(one[column])
    pairs = list(zip(one, other, strict=True))
    return [select(exchanged, b, a) for a, b in pairs], [select(exchanged, a, b) for a, b in pairs]


def _quotient(a: Any, b: Any) -> Any:
    if not isinstance(b, Symbol) and not b:
        raise TraceError(f"{caller_location()} solves a system with a singular matrix")
    return a / b
