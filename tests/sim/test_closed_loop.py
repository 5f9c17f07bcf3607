"""Options mean the same in every plant, and what they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx import ExternalForce
from dynx.backends import backend, installed_backends
from dynx.control import PD, GravityCompensatedPD, Measurement, OpenLoop, Saturated
from dynx.control.base import Controller
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Rollout, plant_model, simulate
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from tests.backends.robots import mixed_robot
from tests.oracles.closed_form import MODELS
from tests.sim.bars import EXACT_ON_DYNX, PLANTS_AGREE, apart, tutorial_robot

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
POSTURE = np.array([0.3, -1.2, 1.0, 0.2, 0.4, 0.1])
OPTIONS: dict[str, dict[str, Any]] = {
    "damping": {"joint_damping": [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]},
    "friction": {"joint_friction": 0.5},
    "armature": {"joint_armature": 0.1},
    "payload": {"payload": Payload("tool0", 2.0, (0.0, 0.0, 0.1), np.diag([0.01, 0.02, 0.015]))},
    "masses": {"mass_scale": {"forearm_link": 1.5}},
    "pushes": {"pushes": [ExternalForce("tool0", [10, 5, 0, 1, 0, 0], 0.02, 0.04, "local")]},
    "stops": {"joint_limits": True, "v0": [20.0, 0.0, 40.0, 30.0, 10.0, 60.0]},
    "efforts": {"effort_limits": [150, 35, 18, 2.5, 2, 2]},
    "noise": {"noise": Noise(1e-3, 1e-2, seed=3)},
    "delay": {"delay": 3e-3},
    "rate": {"control_dt": 4e-3},
    "substeps": {"substeps": 3},
    "all": {
        "joint_damping": 0.3,
        "joint_friction": 0.2,
        "joint_armature": 0.05,
        "payload": Payload("tool0", 1.0),
        "mass_scale": 1.1,
        "pushes": [ExternalForce("tool0", [5, 0, 0, 0, 0, 0], 0.03)],
        "noise": Noise(1e-4, 1e-3),
        "delay": 2e-3,
        "control_dt": 2e-3,
        "substeps": 2,
        "effort_limits": True,
    },
}


def held(robot: Model, plant: str = "pinocchio", **options: Any) -> Rollout:
    """Return an arm held a little away from where it starts."""
    law = GravityCompensatedPD(robot, kp=60, kd=6)
    return simulate(robot, law, POSTURE, q0=POSTURE + 0.05, plant=plant, duration=0.1, **options)


@needs_bullet
@pytest.mark.parametrize("option", OPTIONS)
def test_bullet_s_plant_takes_an_option_as_dynx_s_does(option: str) -> None:
    robot = tutorial_robot()
    by_dynx = held(robot, **OPTIONS[option])
    by_bullet = held(robot, "pybullet", **OPTIONS[option])
    assert apart(by_bullet.q, by_dynx.q) <= PLANTS_AGREE
    assert apart(by_bullet.tau, by_dynx.tau) <= PLANTS_AGREE
    np.testing.assert_array_equal(by_bullet.saturated, by_dynx.saturated)
    if option != "substeps":
        # It is another motion than without, so the option did something.
        assert apart(by_dynx.q, held(robot).q) > 100 * PLANTS_AGREE


@needs_bullet
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_bullet_s_plant_knows_mimic_joints_and_the_description_s_losses(base: str) -> None:
    robot = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(0)
    law = OpenLoop(robot, rng.uniform(-2.0, 2.0, (50, robot.nv)), control_dt=1e-3)
    options: dict[str, Any] = {
        "joint_damping": True,
        "joint_friction": True,
        "joint_armature": True,
        "substeps": 2,
    }
    start: dict[str, Any] = {"q0": robot.random(rng), "v0": rng.uniform(-1, 1, robot.nv)}
    by_dynx, by_bullet = (
        simulate(
            robot, law, start["q0"], plant=plant, duration=0.05, check_reference=False, **start, **options
        )
        for plant in ("pinocchio", "pybullet")
    )
    assert apart(by_bullet.q, by_dynx.q) <= PLANTS_AGREE
    assert apart(by_bullet.a, by_dynx.a) <= PLANTS_AGREE


def test_the_description_s_losses_are_those_of_the_backends() -> None:
    """Where all joints move, `joint_dynamics=True` of a backend is what they feel at the start of a step."""
    robot = mixed_robot(mimic=True)
    rng = np.random.default_rng(1)
    q0, v0 = robot.random(rng), rng.uniform(-1.0, 1.0, robot.nv)
    dt = 1e-11
    rollout = simulate(
        robot, q0=q0, v0=v0, dt=dt, duration=dt, joint_damping=True, joint_friction=True, joint_armature=True
    )
    with backend("pinocchio", robot) as engine:
        a = engine.forward_dynamics(q0, v0, np.zeros(robot.nv), joint_dynamics=True)
    np.testing.assert_allclose(rollout.a[0], a, rtol=1e-9)


def test_a_stop_is_an_inelastic_impact() -> None:
    arm = tutorial_robot()
    q0, v0 = np.zeros(6), np.zeros(6)
    q0[2], v0[2] = 3.0, 10.0
    rollout = simulate(arm, q0=q0, v0=v0, duration=0.1, joint_limits=True)
    assert np.all(rollout.q <= arm.upper)
    assert np.all(rollout.q >= arm.lower)
    first = int(np.argmax(rollout.q[:, 2] == arm.upper[2]))
    assert first > 0
    assert rollout.v[first, 2] == 0.0
    # The others are struck too, and no energy comes in.
    assert np.abs(rollout.v[first, [1, 3]] - rollout.v[first - 1, [1, 3]]).max() > 1.0
    assert rollout.kinetic_energy[first] < rollout.kinetic_energy[first - 1]


def test_torque_beyond_the_limits_is_cut_and_flagged() -> None:
    robot = tutorial_robot()
    limit = np.array([150.0, 35.0, 18.0, 2.5, 2.0, 2.0])
    rollout = held(robot, effort_limits=limit)
    assert np.all(np.abs(rollout.tau) <= limit)
    assert rollout.saturated.any()
    np.testing.assert_array_equal(rollout.saturated, np.abs(rollout.tau) == limit)
    law = Saturated(GravityCompensatedPD(robot, kp=60, kd=6), limit=limit)
    inside = simulate(robot, law, POSTURE, q0=POSTURE + 0.05, duration=0.1)
    np.testing.assert_array_equal(inside.q, rollout.q)
    assert not inside.saturated.any()


class Witness(Controller[None]):
    """Remembers, against the rules, what it was shown."""

    def __init__(self, robot: Model) -> None:
        self.model = robot
        self.seen: list[Measurement] = []

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        self.seen.append(measurement)
        return np.zeros(self.model.nv), None


def test_a_controller_sees_the_past() -> None:
    robot = tutorial_robot()
    witness = Witness(robot)
    rollout = simulate(robot, witness, POSTURE, duration=0.02, delay=3e-3, control_dt=2e-3)
    assert [m.t for m in witness.seen] == pytest.approx([2e-3 * k for k in range(10)])
    for k, measurement in enumerate(witness.seen):
        np.testing.assert_array_equal(measurement.q, rollout.q[max(2 * k - 3, 0)])
        np.testing.assert_array_equal(measurement.v, rollout.v[max(2 * k - 3, 0)])


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_noise_has_the_size_and_the_seed_that_were_asked(base: str) -> None:
    robot = load(MODELS / "free_body.urdf", base="floating") if base == "floating" else tutorial_robot()

    def noise(seed: int) -> tuple[Floats, Floats]:
        witness = Witness(robot)
        rollout = simulate(
            robot,
            witness,
            robot.neutral(),
            duration=0.5,
            noise=Noise(1e-3, 2e-2, seed),
            check_reference=False,
        )
        off_q = [robot.difference(q, m.q) for q, m in zip(rollout.q, witness.seen, strict=False)]
        off_v = [m.v - v for v, m in zip(rollout.v, witness.seen, strict=False)]
        return np.array(off_q), np.array(off_v)

    q, v = noise(1)
    # The standard error of a standard deviation from n numbers is 1 / sqrt(2 n) of it.
    assert q.std() == pytest.approx(1e-3, rel=5 / np.sqrt(2 * q.size))
    assert v.std() == pytest.approx(2e-2, rel=5 / np.sqrt(2 * v.size))
    np.testing.assert_array_equal(noise(1)[1], v)
    assert np.abs(noise(2)[1] - v).max() > 1e-2


def test_a_held_torque_stays_between_control_steps() -> None:
    rollout = held(tutorial_robot(), control_dt=5e-3)
    blocks = rollout.tau.reshape(-1, 5, 6)
    assert np.all(blocks == blocks[:, :1])
    assert np.all(np.any(blocks[1:, 0] != blocks[:-1, 0], axis=1))


def test_substeps_are_steps() -> None:
    """Ten sub-steps of a tenth are ten steps."""
    robot = tutorial_robot()
    torques = np.tile([0.0, -20.0, 10.0, 0.0, 1.0, 0.0], (100, 1))
    fine = simulate(
        robot, OpenLoop(robot, torques, control_dt=1e-3), POSTURE, q0=POSTURE, dt=1e-4, duration=0.01
    )
    coarse = simulate(
        robot, OpenLoop(robot, torques, control_dt=1e-3), POSTURE, q0=POSTURE, substeps=10, duration=0.01
    )
    assert apart(coarse.q[-1], fine.q[-1]) <= EXACT_ON_DYNX


def test_a_payload_is_a_link_of_the_plant() -> None:
    robot = tutorial_robot()
    tool = Payload("tool0", 2.0, (0.1, 0.0, 0.2), np.diag([0.1, 0.2, 0.15]))
    loaded = plant_model(robot, [tool, Payload("forearm_link", 1.0)], {"base_link": 2.0})
    assert loaded.joint_names == robot.joint_names
    with backend("pinocchio", loaded) as engine, backend("pinocchio", robot) as bare:
        q = robot.random(0)
        T = bare.forward_kinematics(q, "tool0")
        J = bare.jacobian(q, "tool0", point=[0.1, 0.0, 0.2])
        elbow = bare.jacobian(q, "forearm_link")
        added = 2.0 * 9.8 * J[2] + 1.0 * 9.8 * elbow[2]
        np.testing.assert_allclose(engine.gravity_torque(q) - bare.gravity_torque(q), added, atol=1e-12)
        R = T[:3, :3]
        spin = R @ np.diag([0.1, 0.2, 0.15]) @ R.T
        M = 2.0 * J[:3].T @ J[:3] + J[3:].T @ spin @ J[3:] + elbow[:3].T @ elbow[:3]
        np.testing.assert_allclose(engine.mass_matrix(q) - bare.mass_matrix(q), M, atol=1e-12)


def test_a_law_on_joints_leaves_a_floating_base_alone() -> None:
    robot = load("solo12", base="floating")
    rollout = simulate(robot, PD(robot, kp=2.0, kd=0.05), robot.neutral(), duration=0.05, dt=1e-3)
    assert np.all(rollout.tau[:, :6] == 0.0)
    fallen = 0.5 * 9.81 * rollout.t[-1] ** 2
    with backend("reference", robot) as engine:
        height = engine.center_of_mass(rollout.q)[:, 2]
    assert height[0] - height[-1] == pytest.approx(fallen, rel=0.05)
