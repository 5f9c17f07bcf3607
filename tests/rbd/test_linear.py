"""Linear equations of floats and of 50 digits have the same solutions."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.rbd.linear import solve_columns
from tests.rbd.exact import distance, exactly, fifty_digits

EPS = float(np.finfo(float).eps)


@given(st.integers(1, 5), st.integers(1, 3), st.integers(0, 999))
def test_columns_of_any_scalars_are_solved_to_their_precision(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    root, X = rng.integers(-4, 5, (n, n)), rng.integers(-9, 10, (n, m))
    # Whole numbers, so that B is exact: the eigenvalues of A are between 1 and 1 + 16 n^2.
    A = root @ root.T + np.eye(n, dtype=int)
    B = (A @ X).astype(float)
    A = A.astype(float)
    error = np.abs(solve_columns(A, B) - X)
    assert error.max() <= 16 * n * EPS * np.linalg.cond(A) * max(1.0, np.abs(X).max())
    with fifty_digits():
        for a, b in ((exactly(A), exactly(B)), (exactly(A), B)):
            assert distance(solve_columns(a, b), X) <= 1e-40
