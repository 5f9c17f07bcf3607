"""`check` reports exactly the limits that a motion violates, with time and value."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, LimitError, ShapeError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Model, Pose
from dynx.trajectory import check, concatenate, cubic, cycloidal, s_curve, trapezoidal, violations
from tests.trajectory.motions import floating, ur5

MASS, ARM, SPIN = 2.0, 0.5, 0.1
"""Pendulum: mass [kg], distance of its centre from the joint [m], central inertia about the axis."""


def pendulum(limits: Limits, friction: float = 0.0) -> Model:
    body = Inertial(MASS, Pose((0.0, 0.0, -ARM)), ixx=SPIN, iyy=SPIN, izz=0.01)
    hinge = Joint(
        "hinge",
        "revolute",
        "base",
        "bob",
        axis=(0.0, 1.0, 0.0),
        limits=limits,
        dynamics=JointDynamics(friction=friction),
    )
    return Model.build("pendulum", [Link("base"), Link("bob", body)], [hinge])


def slow(displacement: float) -> dynx.trajectory.Trajectory:
    return cycloidal([0.0], [displacement], 100.0)


def test_what_is_within_limits_passes() -> None:
    model = ur5()
    motion = cycloidal(np.zeros(6), [-1.5, -1.0, 1.0, -1.57, -1.57, -1.57], 2.0)
    assert violations(model, motion) == []
    check(model, motion)


def test_position_velocity_and_effort_by_their_closed_forms() -> None:
    """A slow swing of 2 rad: m g l sin q at its end; a fast one: the largest speed is 2 d / T, at T/2."""
    model = pendulum(Limits(-1.0, 1.5, 3.0, 5.0))
    position, effort = violations(model, slow(2.0))
    assert (position.joint, position.quantity, position.limit) == ("hinge", "position", 1.5)
    assert [each.unit for each in (position, effort)] == ["rad", "N m"]
    assert str(position) == "position of 'hinge' is 2 rad at 100 s; its limit is 1.5 rad"
    assert position.time == pytest.approx(100.0, rel=1e-12)
    assert position.value == pytest.approx(2.0, rel=1e-12)
    assert (effort.quantity, effort.limit) == ("effort", 5.0)
    # The motion is slow, so the largest effort occurs where the pendulum is horizontal, q = pi / 2.
    assert effort.value == pytest.approx(MASS * 9.81 * ARM, rel=1e-3)
    (velocity,) = violations(model, cycloidal([0.0], [1.4], 0.5), effort=False)
    assert (velocity.quantity, velocity.unit) == ("velocity", "rad/s")
    assert velocity.time == pytest.approx(0.25, abs=1e-3)
    assert velocity.value == pytest.approx(2.0 * 1.4 / 0.5, rel=1e-6)


def test_violations_of_a_prismatic_joint_are_in_its_units() -> None:
    body = Inertial(2.0, ixx=0.1, iyy=0.1, izz=0.1)
    slide = Joint(
        "slide", "prismatic", "base", "car", axis=(0.0, 0.0, 1.0), limits=Limits(-1.0, 1.0, 0.1, 1.0)
    )
    lift = Model.build("lift", [Link("base"), Link("car", body)], [slide])
    found = violations(lift, cycloidal([0.0], [2.0], 10.0))
    units = {"position": "m", "velocity": "m/s", "effort": "N"}
    assert {each.quantity: each.unit for each in found} == units
    with pytest.raises(LimitError, match=r"position of 'slide' is 2 m at 0 s; its limit is 1 m \("):
        dynx.simulate(lift, dynx.control.PD(lift, kp=1.0, kd=1.0), [2.0], duration=0.1)


def test_lower_limits_are_negative() -> None:
    model = pendulum(Limits(-1.0, 1.5, 3.0, 5.0))
    position, effort = violations(model, slow(-2.0))
    assert (position.limit, position.value) == (-1.0, -2.0)
    assert effort.limit == -5.0
    assert effort.value < -5.0


def test_effort_includes_friction_with_joint_dynamics() -> None:
    limits = Limits(-3.0, 3.0, 10.0, MASS * 9.81 * ARM + 0.5)
    model = pendulum(limits, friction=1.0)
    assert violations(model, slow(2.0)) == []
    (effort,) = violations(model, slow(2.0), joint_dynamics=True)
    assert effort.value == pytest.approx(MASS * 9.81 * ARM + 1.0, rel=1e-3)


@given(st.floats(0.5, 1.5), st.floats(0.5, 1.5))
def test_a_motion_planned_for_the_model_respects_its_limits(part: float, acceleration: float) -> None:
    model = pendulum(Limits(-1.0, part, 0.9))
    for motion in (
        trapezoidal([-1.0], [part], acceleration=acceleration, model=model),
        s_curve([-1.0], [part], acceleration=acceleration, jerk=2.0, model=model),
    ):
        check(model, motion)


def test_a_brief_excess_at_a_knot_is_found() -> None:
    """The effort jumps where the deceleration of a trapezoid begins, between two samples."""
    swing = 1e-4
    acceleration = 40.0
    motion = concatenate(
        slow(0.01), trapezoidal([0.01], [0.01 + swing], velocity=np.inf, acceleration=acceleration)
    )
    assert motion.duration - 100.0 < 100.0 / 500.0
    inertia = SPIN + MASS * ARM**2
    model = pendulum(Limits(-1.0, 1.0, 10.0, 0.5 * inertia * acceleration))
    (effort,) = violations(model, motion)
    assert effort.time > 100.0 - 1e-9
    assert effort.value == pytest.approx(inertia * acceleration, rel=0.02)


def test_the_error_lists_all_violations() -> None:
    model = ur5()
    motion = cubic(np.zeros(6), [7.0, 0.0, -3.0, 0.0, 0.0, 8.0], 1.0)
    with pytest.raises(LimitError, match="the motion breaks 5 limits of ur5") as caught:
        check(model, motion, effort=False)
    found = [(one.joint, one.quantity) for one in caught.value.violations]
    assert found == [
        ("shoulder_pan_joint", "position"),
        ("shoulder_pan_joint", "velocity"),
        ("elbow_joint", "velocity"),
        ("wrist_3_joint", "position"),
        ("wrist_3_joint", "velocity"),
    ]
    text = str(caught.value)
    for one in caught.value.violations:
        assert str(one) in text
    copy = pickle.loads(pickle.dumps(caught.value))
    assert copy.violations == caught.value.violations
    assert str(copy) == text


def test_a_floating_base_has_no_limits_itself() -> None:
    model = floating()
    q0 = model.neutral()
    q1 = q0.copy()
    q1[0], q1[-1] = 1000.0, 100.0
    named = {one.joint for one in violations(model, cycloidal(q0, q1, 1.0, model=model))}
    assert named <= set(model.joint_names)


def test_other_robots_and_backends_are_refused() -> None:
    with pytest.raises(ShapeError, match="the trajectory has nq 1"):
        check(ur5(), slow(1.0))
    with dynx.backend("reference", ur5()) as engine:
        with pytest.raises(ArgumentError, match="not of this model"):
            check(pendulum(Limits()), slow(1.0), backend=engine)
        motion = cycloidal(np.zeros(6), np.ones(6), 2.0)
        assert violations(ur5(), motion, backend=engine) == violations(ur5(), motion)
