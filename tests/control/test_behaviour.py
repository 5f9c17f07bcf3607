"""Behaviour of the controllers: rest without error, no windup, compliance, stability."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import ExternalForce
from dynx.backends import backend
from dynx.backends.joint_friction import MIN_SLIP
from dynx.control import (
    PD,
    PID,
    ComputedTorque,
    FrictionCompensation,
    GravityCompensatedPD,
    Impedance,
    JointFriction,
    Measurement,
    OperationalSpace,
)
from dynx.control.saturation import checked_limit
from dynx.model.loading import load
from dynx.sim import simulate
from dynx.trajectory.base import Setpoint
from tests.backends.robots import mixed_robot
from tests.oracles.closed_form import MODELS, G
from tests.oracles.pendulums import Pendulum
from tests.sim.bars import tutorial_robot
from tests.sim.rigid_bodies import RIGID_BODIES

POSTURE = np.array([0.3, -1.2, 1.0, 0.2, 0.4, 0.1])


def test_a_pd_hangs_below_its_setpoint_by_what_the_weight_takes() -> None:
    robot = load(MODELS / "pendulum.urdf")
    rollout = simulate(robot, PD(robot, kp=100.0, kd=30.0), [0.5], duration=4.0, dt=2e-3, **RIGID_BODIES)
    rest = rollout.q[-1, 0]
    assert 100.0 * (0.5 - rest) == pytest.approx(Pendulum.m * G * Pendulum.c * np.sin(rest), rel=1e-6)


def test_an_integral_takes_that_away_and_the_weight_s_knowledge_too() -> None:
    robot = load(MODELS / "pendulum.urdf")
    pid = PID(robot, kp=100.0, ki=200.0, kd=30.0, control_dt=2e-3)
    held = GravityCompensatedPD(robot, kp=100.0, kd=30.0)
    for law in (pid, held):
        rollout = simulate(robot, law, [0.5], q0=[0.4], duration=6.0, dt=2e-3, **RIGID_BODIES)
        assert abs(rollout.error[-1, 0]) < 1e-4


def test_an_integral_does_not_wind_up_while_the_motor_is_at_its_limit() -> None:
    robot = load(MODELS / "pendulum.urdf").with_gravity(np.zeros(3))
    gains: dict[str, Any] = {"kp": 40.0, "ki": 60.0, "kd": 12.0, "control_dt": 2e-3, "limit": 2.0}

    def overshoot(tracking_time: float) -> float:
        law = PID(robot, **gains, tracking_time=tracking_time)
        rollout = simulate(robot, law, [1.5], q0=[0.0], duration=6.0, dt=2e-3, **RIGID_BODIES)
        error = rollout.error[:, 0]
        return float(-error.min())

    # Without anti-windup: the integral is never told what the limit cut off.
    assert overshoot(0.02) < 0.3 * overshoot(1e9)


def test_the_error_of_computed_torque_is_a_damped_oscillation() -> None:
    """e'' + kd e' + kp e = 0 for every coordinate, whatever the others do; to the first order in dt."""
    robot, w, zeta = tutorial_robot(), 10.0, 0.5
    law = ComputedTorque(robot, natural_frequency=w, damping_ratio=zeta)

    def off(dt: float) -> float:
        rollout = simulate(robot, law, POSTURE, q0=POSTURE - 0.1, duration=1.0, dt=dt)
        wd = w * np.sqrt(1 - zeta**2)
        decay = np.exp(-zeta * w * rollout.t)
        exact = 0.1 * decay * (np.cos(wd * rollout.t) + zeta * w / wd * np.sin(wd * rollout.t))
        return float(np.abs(rollout.error - exact[:, None]).max())

    coarse, fine = off(2e-3), off(1e-3)
    assert fine < 2e-3
    assert coarse / fine == pytest.approx(2.0, rel=0.1)


@given(st.integers(0, 2**32 - 1))
def test_operational_space_gives_the_frame_its_acceleration(seed: int) -> None:
    robot = load("panda")
    rng = np.random.default_rng(seed)
    q, wanted = 0.5 * robot.random(rng, 2) + 0.25 * (robot.lower + robot.upper)
    v, v_wanted, a_wanted = rng.uniform(-1.0, 1.0, (3, robot.nv))
    law = OperationalSpace(robot, "panda_hand", kp=100.0, kd=20.0, posture_kp=9.0, damping=0.0)
    setpoint = Setpoint(wanted, v_wanted, a_wanted)
    tau, _ = law.torque(Measurement(0.0, q, v), setpoint, None)
    with backend("reference", robot) as engine:
        a = engine.forward_dynamics(q, v, tau)
        got = engine.frame_acceleration(q, v, a, "panda_hand")
        J = engine.jacobian(q, "panda_hand")
        M = engine.mass_matrix(q)
        T, T_wanted = (engine.forward_kinematics(x, "panda_hand") for x in (q, wanted))
        twist = engine.frame_velocity(wanted, v_wanted, "panda_hand") - engine.frame_velocity(
            q, v, "panda_hand"
        )
        ahead = engine.frame_acceleration(wanted, v_wanted, a_wanted, "panda_hand")
    expected = ahead[:3] + 20.0 * twist[:3] + 100.0 * (T_wanted[:3, 3] - T[:3, 3])
    # What solving with the frame's inertia may lose: its condition number, in roundings.
    lost = np.linalg.cond(J @ np.linalg.solve(M, J.T)) * np.linalg.cond(M) * np.finfo(float).eps
    np.testing.assert_allclose(got[:3], expected, rtol=0.0, atol=100 * lost * np.abs(got).max())


def test_a_compliant_frame_gives_way_by_force_over_stiffness() -> None:
    robot = tutorial_robot()
    stiffness, damping = [800, 800, 800, 50, 50, 50], [80, 80, 80, 2, 2, 2]
    law = Impedance(robot, "tool0", stiffness=stiffness, damping=damping, joint_damping=0.5)
    push = ExternalForce("tool0", [8.0, -4.0, 6.0, 0.0, 0.0, 0.0])
    rollout = simulate(robot, law, POSTURE, q0=POSTURE, duration=3.0, pushes=[push])
    with backend("reference", robot) as engine:
        moved = engine.forward_kinematics(rollout.q[[0, -1]], "tool0")[:, :3, 3]
    np.testing.assert_allclose(moved[1] - moved[0], np.array([8.0, -4.0, 6.0]) / 800.0, rtol=0.02, atol=1e-5)


def test_impedance_gives_no_energy_away() -> None:
    """Kinetic energy and that of the spring never rise together (without gravity, an exact statement)."""
    robot = tutorial_robot().with_gravity(np.zeros(3))
    law = Impedance(robot, "tool0", stiffness=[300, 300, 300, 0, 0, 0], damping=0.0, joint_damping=0.5)
    rollout = simulate(robot, law, POSTURE, q0=POSTURE + 0.1, duration=1.0, dt=1e-3, integrator="rk4")
    with backend("reference", robot) as engine:
        p = engine.forward_kinematics(rollout.q, "tool0")[:, :3, 3]
        home = engine.forward_kinematics(POSTURE, "tool0")[:3, 3]
    stored = rollout.kinetic_energy + 150.0 * np.sum((p - home) ** 2, axis=1)
    # The torque is held for a step, which gives back a part of the order of dt.
    assert np.diff(stored).max() < 1e-3 * stored[0]
    assert stored[-1] < 0.7 * stored[0]


@given(st.integers(0, 2**32 - 1), st.one_of(st.just(0.0), st.floats(MIN_SLIP, 0.1)))
def test_friction_takes_energy_at_every_speed(seed: int, slip: float) -> None:
    robot = mixed_robot(mimic=True)
    losses = JointFriction(robot, slip=slip)
    v = np.random.default_rng(seed).uniform(-1.0, 1.0, (5, robot.nv))
    lost = losses(v)
    assert lost.shape == v.shape
    assert np.all(np.sum(lost * v, axis=1) >= 0.0)
    np.testing.assert_array_equal(losses(-v), -lost)
    if slip == 0.0:
        q, rest = robot.neutral(), np.zeros(robot.nv)
        with backend("reference", robot) as engine:
            both = [engine.inverse_dynamics(q, v[0], rest, joint_dynamics=x) for x in (True, False)]
        np.testing.assert_allclose(lost[0], both[0] - both[1], atol=1e-12)


def test_coefficients_given_are_those_of_coordinates() -> None:
    robot = mixed_robot(mimic=True)
    v = np.linspace(-1.0, 1.0, robot.nv)
    np.testing.assert_array_equal(JointFriction(robot, 2.0, False)(v), 2.0 * v)
    with_dry = JointFriction(robot, 2.0, True, slip=0.0)
    dry = JointFriction(robot, False, True, slip=0.0)
    np.testing.assert_allclose(with_dry(v), 2.0 * v + dry(v), rtol=1e-14)


def test_friction_compensation_has_the_coefficients_of_the_description() -> None:
    robot = mixed_robot()
    joints = [joint.dynamics for joint in robot.joints if joint.moves]
    law = FrictionCompensation(PD(robot, kp=1.0, kd=1.0))
    np.testing.assert_array_equal(law.losses.damping, [joint.damping for joint in joints])
    np.testing.assert_array_equal(law.losses.friction, [joint.friction for joint in joints])
    assert law.losses.friction.any()


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_number_is_for_joints_and_not_for_a_base(base: str) -> None:
    robot = mixed_robot(base)
    joints = robot.nv - (6 if base == "floating" else 0)
    on_base = np.zeros(robot.nv - joints)
    v = np.linspace(-1.0, 1.0, robot.nv)
    for number in (2.0, np.full(joints, 2.0)):
        lost = JointFriction(robot, number, False)(v)
        np.testing.assert_array_equal(lost, np.concatenate([on_base, 2.0 * v[-joints:]]))
        limit = checked_limit(robot, number)
        np.testing.assert_array_equal(limit, np.concatenate([on_base + np.inf, np.full(joints, 2.0)]))
    rollout = simulate(robot, duration=1e-3, joint_armature=0.5)
    np.testing.assert_array_equal(np.diag(rollout.rotors), np.concatenate([on_base, np.full(joints, 0.5)]))
