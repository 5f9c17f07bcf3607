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
