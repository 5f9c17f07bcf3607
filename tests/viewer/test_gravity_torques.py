"""Gravity torques are drawn outside of the links, with numbers, at joints that have one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.viewer import Viewer
from dynx.viewer.robot_view import _LEAST

ROBOTS = ("six_axis_arm", "seven_axis_arm", "scara", "planar_3r", "cart_pole")


def depth_inside(viewer: Viewer, point: Floats) -> float:
    """Return how far a point lies inside of a convex shape of the robot, along the axes of the world [m]."""
    model, deepest = viewer.view.model, 0.0
    ways = np.concatenate([np.eye(3), -np.eye(3)])
    for link, T in link_poses(model, viewer.view.q):
        for shape, _, T_link_shape in link_shapes(model.geometry, link):
            # A ray from inside hits where it leaves, seen along the outward normal.
            distance, normal = cast_on_shape(shape, T @ T_link_shape, np.tile(point, (6, 1)), ways)
            if np.isfinite(distance).all() and (np.einsum("ij,ij->i", normal, ways) > 0.0).all():
                deepest = max(deepest, float(distance.min()))
    return deepest


@pytest.fixture(scope="module", params=ROBOTS)
def viewer(request: pytest.FixtureRequest) -> Any:
    with dynx.load(request.param).view() as opened:
        opened.view._torques.shown = True
        yield opened


@settings(max_examples=10)
@given(st.integers(0, 10**6))
def test_arrows_begin_outside_of_the_robot_and_have_numbers(viewer: Viewer, seed: int) -> None:
    view = viewer.view
    q = view.model.random(np.random.default_rng(seed))
    view.put(q)
    drawn = {name: (text, ends) for name, text, ends in view._torques._arrows_at(q)}
    tau = dynx.backend("reference", view.model).gravity_torque(q)
    for k, joint in enumerate(view.model.coordinate_joints):
        if joint.name not in drawn:
            limit = view.model.effort_limit[k]
            assert abs(tau[k]) <= _LEAST * (limit if 0.0 < limit < np.inf else np.abs(tau).max()) + 1e-12
            continue
        text, (start, end) = drawn[joint.name]
        number, _, unit = text.partition(" ")
        assert float(number) == pytest.approx(tau[k], rel=6e-3, abs=1e-9)
        assert unit == ("N" if joint.type == "prismatic" else "N m")
        axis = dict(link_poses(view.model, q))[joint.child][:3, :3] @ joint.axis
        assert (end - start) @ axis * tau[k] > 0.0
        assert depth_inside(viewer, start) < 1e-3
    shown = {label.text for label in view._torques._numbers.values() if label.visible}
    assert shown == {text for text, _ in drawn.values()}


def test_a_joint_that_carries_nothing_has_no_arrow() -> None:
    model = dynx.load("six_axis_arm", gravity=(0.0, 0.0, 0.0))
    with model.view() as viewer:
        viewer.view._torques.shown = True
        viewer.view.put(model.neutral())
        assert viewer.view._torques._arrows is None
    with dynx.load("six_axis_arm").view() as viewer:
        torques = viewer.view._torques
        torques.shown = True
        viewer.view.put(viewer.view.q + 0.3)
        assert torques._arrows.visible
        # The first axis is vertical.
        assert viewer.view.model.joint_names[0] not in torques._numbers
        torques.shown = False
        viewer.view.put(viewer.view.q)
        assert not torques._arrows.visible
        assert not any(label.visible for label in torques._numbers.values())
