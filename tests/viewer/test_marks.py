"""Solids that stand for the inertia of a link."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Inertial, Pose
from dynx.model.geometry.visible_shapes import link_shapes
from dynx.spatial.so3 import rotation_from_rpy
from dynx.viewer.controls import slider_step
from dynx.viewer.marks import equivalent_solid
from dynx.viewer.name_labels import centre_of
from dynx.viewer.surfaces.triangles import triangles_of

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


def test_names_of_links_whose_frames_coincide_lie_on_their_shapes() -> None:
    model = dynx.load("six_axis_arm")
    with model.view() as viewer:
        robot = viewer.view.robot
        for link in model.links:
            shapes = [shape for shape, _, _ in link_shapes(model.geometry, link.name)]
            assert len(shapes) == len(robot.visuals[link.name])
            points = [
                T[:3, :3] @ vertex + T[:3, 3]
                for shape, _, T in link_shapes(model.geometry, link.name)
                for vertex in triangles_of(shape).vertices
            ]
            expected = 0.5 * (np.min(points, axis=0) + np.max(points, axis=0)) if points else np.zeros(3)
            assert np.allclose(centre_of(robot.visuals[link.name]), expected, atol=1e-6)


@given(st.floats(-400.0, 400.0), st.floats(1e-4, 1e4))
def test_a_slider_has_steps_of_few_digits(lower: float, extent: float) -> None:
    step = slider_step(lower, lower + extent)
    assert 1e-4 * extent * (1.0 - 1e-6) <= step <= 1e-3 * extent * (1.0 + 1e-6)
    assert step == float(f"{step:.0e}")
