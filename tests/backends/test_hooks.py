"""Solving with a mass matrix that is singular, exactly or up to rounding."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dynx.backends.hooks import solve_mass_matrix
from dynx.errors import SingularMassMatrixError


@given(
    hnp.arrays(np.float64, (4, 2), elements=st.floats(-1.0, 1.0).map(lambda x: x + 0.1)),
    st.integers(-8, 8),
)
def test_a_matrix_singular_but_for_rounding_is_not_solved(B: np.ndarray, power: int) -> None:
    """B B' has rank 2; elimination alone rarely meets an exact zero pivot and would return garbage."""
    M = (B @ B.T) * 10.0**power
    with pytest.raises(SingularMassMatrixError):
        solve_mass_matrix(M, np.ones(4))


@given(
    hnp.arrays(np.float64, (5, 5), elements=st.floats(-1.0, 1.0)),
    hnp.arrays(np.float64, 5, elements=st.integers(-6, 6)),
)
def test_one_sample_is_solved_to_rounding_at_any_scale(B: np.ndarray, powers: np.ndarray) -> None:
    M = (B @ B.T + np.eye(5)) * np.outer(10.0**powers, 10.0**powers)
    torque = M @ np.ones(5)
    a = solve_mass_matrix(M, torque)
    size = np.sqrt(np.diagonal(M))
    assert np.max(np.abs(M @ a - torque) / size) <= 1e-13 * np.max(np.abs(M) @ np.abs(a) / size)
    # Rounding in the solution of a stable method is relative to the largest entry in these units.
    difference = size * (a - solve_mass_matrix(M[None], torque[None])[0])
    assert np.max(np.abs(difference)) <= 1e-13 * np.linalg.cond(M / np.outer(size, size)) * np.max(size * a)


def test_an_indefinite_matrix_is_solved_and_a_singular_one_refused() -> None:
    """The determinant tells neither from the other without its sign."""
    np.testing.assert_allclose(solve_mass_matrix(np.diag([2.0, -1.0]), np.ones(2)), [0.5, -1.0], rtol=1e-15)
    for singular in (np.ones((3, 3)), np.diag([1.0, 0.0]), np.full((2, 2), np.nan)):
        with pytest.raises(SingularMassMatrixError):
            solve_mass_matrix(singular, np.ones(len(singular)))
