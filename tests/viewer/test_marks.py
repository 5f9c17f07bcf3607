"""Marks of a robot and a world: solids of inertia, names, contact forces."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Inertial, Pose
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.spatial.so3 import rotation_from_rpy
from dynx.viewer.controls import slider_step
from dynx.viewer.marks import centre_of, equivalent_solid
from dynx.viewer.triangles import triangles_of
from dynx.world import World, read_scene

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


def test_boxes_and_ellipsoids_of_inertia_are_drawn_as_such() -> None:
    model = dynx.load("six_axis_arm")
    with model.view() as viewer:
        for kind, factor, share in (("inertia boxes", 12.0, 1.0), ("inertia ellipsoids", 20.0, np.pi / 6.0)):
            marks = viewer.view._marks
            marks.show(kind, True)
            links = [link.name for link in model.links if model.inertial(link.name).mass > 0.0]
            assert len(marks._nodes[kind]) == len(links) > 0
            for name, node in zip(links, marks._nodes[kind], strict=True):
                assert node.name.startswith(f"{viewer.view.robot.links[name].name}/")
                inertial = model.inertial(name)
                solid = equivalent_solid(inertial, factor)
                assert np.allclose(node.position, inertial.origin.matrix[:3, 3])
                assert np.allclose(np.ptp(node.vertices, axis=0), solid.lengths, rtol=1e-5)
                a, b, c = np.moveaxis(node.vertices[node.faces].astype(np.float64), 1, 0)
                volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
                # A ball of triangles is smaller than a ball.
                assert volume == pytest.approx(share * np.prod(solid.lengths), rel=0.03)


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


def test_arrows_of_contacts_stand_where_the_forces_act_and_point_along_them() -> None:
    with World(read_scene("stack")) as world, world.view() as viewer:
        viewer.view.step(50)
        found = world.contacts()
        points, ends = np.moveaxis(np.asarray(viewer.view._arrows._node.points, dtype=np.float64), 1, 0)
        assert len(points) == len(found) > 0
        assert np.allclose(points, [contact.point for contact in found], atol=1e-6)
        # What is on the ground shows the force on itself: that on the ground lies below the ground.
        assert any(contact.a == "ground" for contact in found)
        forces = np.array([-c.force if c.a == "ground" else c.force for c in found])
        scale = np.linalg.norm(ends - points) / np.linalg.norm(forces)
        assert np.allclose(ends - points, scale * forces, atol=1e-6)


@given(st.floats(-400.0, 400.0), st.floats(1e-4, 1e4))
def test_a_slider_has_steps_of_few_digits(lower: float, extent: float) -> None:
    step = slider_step(lower, lower + extent)
    assert 1e-4 * extent * (1.0 - 1e-6) <= step <= 1e-3 * extent * (1.0 + 1e-6)
    assert step == float(f"{step:.0e}")
