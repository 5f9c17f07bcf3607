"""Solids that stand for the inertia of a link."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model import Inertial, Pose
from dynx.spatial.so3 import rotation_from_rpy
from dynx.viewer.marks import equivalent_solid

lengths = st.floats(0.01, 2.0)


@given(st.tuples(lengths, lengths, lengths), st.floats(0.1, 50.0), st.tuples(*[st.floats(-3.0, 3.0)] * 3))
@pytest.mark.parametrize("factor", [12.0, 20.0], ids=["box", "ellipsoid"])
def test_a_solid_of_the_lengths_found_has_the_inertia(
    factor: float, size: tuple[float, float, float], mass: float, rpy: tuple[float, float, float]
) -> None:
    squares = np.square(size)
    moments = mass * (squares.sum() - squares) / factor
    inertial = Inertial(mass, Pose((0.1, 0.2, 0.3), rpy), moments[0], 0.0, 0.0, moments[1], 0.0, moments[2])
    solid = equivalent_solid(inertial, factor)
    assert solid.possible
    found = mass * (np.square(solid.lengths).sum() - np.square(solid.lengths)) / factor
    R = rotation_from_rpy(np.array(rpy))
    assert np.allclose(solid.R @ np.diag(found) @ solid.R.T, R @ np.diag(moments) @ R.T, atol=1e-9 * mass)
    assert np.linalg.det(solid.R) == pytest.approx(1.0)


def test_moments_that_no_body_has_are_told() -> None:
    assert not equivalent_solid(Inertial(1.0, Pose(), 1.0, 0.0, 0.0, 1.0, 0.0, 3.0), 12.0).possible
    assert equivalent_solid(Inertial(1.0, Pose(), 1.0, 0.0, 0.0, 1.0, 0.0, 2.0), 12.0).possible
