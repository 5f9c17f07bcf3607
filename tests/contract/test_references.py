"""Rows of Jacobians in each reference, at the frame's origin and at another point."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from dynx.agreement.identities import time_derivative
from dynx.backends import Backend
from dynx.model import Model, Pose
from dynx.rbd.jacobians import REFERENCES
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import Sample, samples
from tests.contract.conftest import Make
from tests.contract.engine_calls import random_state
from tests.contract.robots import each_model
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import one_robot

FRAME, POINT = "tool", np.array([0.3, -0.2, 0.1])

each_reference = pytest.mark.parametrize("reference", REFERENCES)


def cross_matrix(x: Floats) -> Floats:
    """[x] with [x] y = x x y."""
    return np.asarray(np.cross(x, np.eye(3)).T)


def columns_from_poses(model: Model, engine: Backend, q: Floats, frame: str) -> Floats:
    """Return the geometric Jacobian by definition: z x (p - o) and z, or z and 0, from poses alone.

    The axis z of a joint goes through the origin o of its child link.
    """
    chain, at = [], frame
    while at != model.root:
        joint = next(joint for joint in model.joints if joint.child == at)
        chain.append(joint)
        at = joint.parent
    J = np.zeros((6, model.nv))
    p = engine.forward_kinematics(q, frame)[:3, 3]
    for joint in chain:
        if not joint.moves:
            continue
        T = engine.forward_kinematics(q, joint.child)
        z, o = T[:3, :3] @ np.array(joint.axis), T[:3, 3]
        prismatic = joint.type == "prismatic"
        column = np.concatenate([z, 0 * z] if prismatic else [np.cross(z, p - o), z])
        if joint.mimic is None:
            J[:, model.coordinate_index(joint.name)] += column
        else:
            J[:, model.coordinate_index(joint.mimic.joint)] += joint.mimic.multiplier * column
    if model.floating:
        T = engine.forward_kinematics(q, model.root)
        R, o = T[:3, :3], T[:3, 3]
        J[:3, :3] = J[3:, 3:6] = R
        J[:3, 3:6] = np.cross(R, p - o, axisa=0, axisb=0, axisc=0)
    return J


@each_model
def test_default_is_the_geometric_jacobian(make: Make, model: Model) -> None:
    engine = make(model)
    for seed in range(3):
        q = random_state(model, seed).q
        close = ErrorBounds(samples_at(model, q))
        for frame in model.frame_names:
            J = engine.jacobian(q, frame)
            close.check("jacobian", J, columns_from_poses(model, engine, q, frame))
            np.testing.assert_array_equal(J, engine.jacobian(q, frame, reference="local_world_aligned"))


@each_model
def test_local_and_world_follow_from_the_default(make: Make, model: Model) -> None:
    """`local` has the axes of the frame; `world` is about the origin of the world."""
    engine = make(model)
    for seed in range(3):
        q = random_state(model, seed).q
        close = ErrorBounds(samples_at(model, q))
        for frame in model.frame_names:
            J, T = engine.jacobian(q, frame), engine.forward_kinematics(q, frame)
            R, p = T[:3, :3], T[:3, 3]
            local = np.concatenate([R.T @ J[:3], R.T @ J[3:]])
            close.check("jacobian", engine.jacobian(q, frame, reference="local"), local)
            world = np.concatenate([J[:3] + cross_matrix(p) @ J[3:], J[3:]])
            close.check("jacobian", engine.jacobian(q, frame, reference="world"), world)


@each_model
@each_reference
def test_derivative_of_the_jacobian(make: Make, model: Model, reference: str) -> None:
    """Against the difference quotient along a motion at constant velocity."""
    engine = make(model)

    @one_robot
    @given(samples(model))
    def holds(state: Sample) -> None:
        q, v, _ = state
        close = ErrorBounds(samples_at(model, q, v))

        def jacobians(t: Floats) -> Floats:
            return engine.jacobian(model.integrate(q, v * t[..., None]), FRAME, reference=reference)

        rate = time_derivative(jacobians, close.magnitudes.frequency)[0]
        close.check_rate("jacobian", engine.jacobian_derivative(q, v, FRAME, reference=reference), rate)

    holds()


@each_model
@each_reference
def test_velocity_and_acceleration_follow_from_the_jacobian(make: Make, model: Model, reference: str) -> None:
    engine = make(model)
    for seed in range(3):
        state = random_state(model, seed)
        q, v, a = state.q, state.v, state.a
        close = ErrorBounds(samples_at(model, q, v, a))
        J = engine.jacobian(q, FRAME, reference=reference)
        dJ = engine.jacobian_derivative(q, v, FRAME, reference=reference)
        close.check("frame_velocity", engine.frame_velocity(q, v, FRAME, reference=reference), J @ v)
        acceleration = engine.frame_acceleration(q, v, a, FRAME, reference=reference)
        close.check("frame_acceleration", acceleration, J @ a + dJ @ v)


@each_model
@each_reference
def test_a_point_is_a_frame_at_that_point(make: Make, model: Model, reference: str) -> None:
    """The point is given in the axes of the frame. In `world` a point changes nothing."""
    placement = Pose() if reference == "world" else Pose((0.3, -0.2, 0.1))
    marked = model.with_frame("marked", FRAME, placement)
    plain, helped = make(model), make(marked)
    for size in ((), (3,)):
        state = random_state(model, 31, size)
        q, v, a = state.q, state.v, state.a
        close = ErrorBounds(samples_at(marked, q, v, a))
        J = plain.jacobian(q, FRAME, reference=reference, point=POINT)
        close.check("jacobian", J, helped.jacobian(q, "marked", reference=reference))
        dJ = plain.jacobian_derivative(q, v, FRAME, reference=reference, point=POINT)
        wanted = helped.jacobian_derivative(q, v, "marked", reference=reference)
        close.check("jacobian_derivative", dJ, wanted)
        velocity = plain.frame_velocity(q, v, FRAME, reference=reference, point=POINT.tolist())
        wanted = helped.frame_velocity(q, v, "marked", reference=reference)
        close.check("frame_velocity", velocity, wanted)
        acceleration = plain.frame_acceleration(q, v, a, FRAME, reference=reference, point=POINT)
        wanted = helped.frame_acceleration(q, v, a, "marked", reference=reference)
        close.check("frame_acceleration", acceleration, wanted)
