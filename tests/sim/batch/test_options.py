"""Options of `simulate` mean the same in a batch of rollouts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx import ExternalForce
from dynx.compiled.step import StepText
from dynx.control import BulletPositionMotor, ComputedTorque, FrictionCompensation, GravityCompensatedPD
from dynx.errors import (
    ArgumentError,
    GainError,
    SingularMassMatrixError,
    UnknownNameError,
    UnsupportedFeatureError,
)
from dynx.model import Link, Model
from dynx.sim import Payload, plant_model, simulate, simulate_batch
from dynx.sim.batch_rollouts import BatchRollouts
from dynx.sim.loop_step import LoopStep
from tests.backends.robots import mixed_robot
from tests.sim.bars import apart
from tests.sim.batch.batches import assert_same, batch_and_each, batch_and_one
from tests.sim.rigid_bodies import RIGID_BODIES

POSTURE = np.array([0.3, -1.2, 1.0, 0.2, 0.4, 0.1])
TOOL = Payload("tool0", 2.0, (0.0, 0.0, 0.1), np.diag([0.01, 0.02, 0.015]))
PUSHES = [
    ExternalForce("tool0", [10, 5, 0, 1, 0, 0], 0.02, 0.02, "local"),
    ExternalForce("forearm_link", [0, 5, 0, 1, 0, 3], 0.03, reference="world"),
]
OPTIONS: dict[str, dict[str, Any]] = {
    "delay": {"delay": 1e-3},
    "long delay": {"delay": 6e-3},
    "delay of controls": {"delay": 3e-3, "control_dt": 2e-3},
    "delay beyond the end": {"delay": 1.0},
    "damping": {"joint_damping": [1.0, 1.0, 1.0, 0.1, 0.1, 0.1]},
    "friction": {"joint_friction": 0.5},
    "slip": {"joint_friction": 0.5, "friction_slip": 0.2, "joint_armature": 0.1},
    "friction and armature": {"joint_friction": 0.5, "joint_damping": 1.0, "joint_armature": 1.0},
    "armature": {"joint_armature": 0.1},
    "of the description": {"joint_damping": True, "joint_friction": True, "joint_armature": True},
    "payload": {"payload": TOOL},
    "masses": {"mass_scale": {"forearm_link": 1.5}},
    "pushes": {"pushes": PUSHES},
    "pushes between controls": {"pushes": PUSHES, "control_dt": 4e-3},
    "efforts": {"effort_limits": [150, 35, 18, 2.5, 2, 2]},
    "efforts between controls": {"effort_limits": [150, 35, 18, 2.5, 2, 2], "control_dt": 7e-3},
    "all": {
        "joint_damping": 0.3,
        "joint_friction": 0.2,
        "joint_armature": 0.05,
        "payload": [TOOL, Payload("forearm_link", 1.0)],
        "mass_scale": 1.1,
        "pushes": PUSHES,
        "delay": 2e-3,
        "control_dt": 2e-3,
        "effort_limits": True,
    },
}


@pytest.fixture(scope="module")
def arm() -> Model:
    return dynx.load("ur5")


def held(arm: Model, **options: Any) -> BatchRollouts:
    """Return an arm held a little away from where it starts, as a batch that was held against one rollout."""
    law = GravityCompensatedPD(arm, kp=60, kd=6)
    return batch_and_one(arm, law, POSTURE, q0=POSTURE + 0.05, duration=0.05, **options)[0]


@pytest.mark.long_cases
@pytest.mark.parametrize("option", OPTIONS)
def test_an_option_means_what_it_means_to_one_rollout(arm: Model, option: str) -> None:
    found = held(arm, **OPTIONS[option])
    if option != "of the description":
        # It is another motion than without, so the option did something.
        assert apart(found.q, held(arm).q) > 1e-6


@pytest.mark.parametrize("control_dt", [1e-3, 4e-3])
def test_pushes_need_no_second_kernel_for_a_large_robot(
    arm: Model, control_dt: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("dynx.sim.loop_step.MAX_NV_WITHOUT_PUSHES", 5)
    kernels, original = [], LoopStep.text

    def text(self: LoopStep, variant: Any) -> StepText:
        kernels.append(variant[1])
        return original(self, variant)

    monkeypatch.setattr(LoopStep, "text", text)
    held(arm, pushes=PUSHES[:1], control_dt=control_dt)
    assert set(kernels) == {True}
    kernels.clear()
    held(arm, control_dt=control_dt)
    assert True not in kernels


@pytest.mark.long_cases
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("through", [True, False])
def test_mimic_joints_feel_what_they_feel_alone(base: str, through: bool) -> None:
    robot = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(3)
    law = dynx.control.PD(robot, kp=2.0, kd=0.2)
    options: dict[str, Any] = {
        "q0": robot.random(rng),
        "v0": rng.uniform(-1.0, 1.0, robot.nv),
        "joint_friction": True if through else 0.3,
        "joint_armature": True,
        "pushes": [ExternalForce("tip", np.ones(6))],
        "duration": 0.03,
        "check_reference": False,
    }
    batch_and_one(robot, law, robot.neutral(), joint_damping=True, **options)
    rows = rng.uniform(0.1, 0.5, (2, len(robot.joint_names)))
    batch_and_each(robot, law, robot.neutral(), {"joint_damping": rows}, **options)


def test_each_rollout_has_coefficients_of_its_own(arm: Model) -> None:
    rng = np.random.default_rng(4)
    each: dict[str, Any] = {
        "joint_damping": rng.uniform(0.1, 0.5, 3),
        "joint_friction": rng.uniform(0.1, 0.5, (3, 6)),
    }
    law = GravityCompensatedPD(arm, kp=60, kd=6)
    options: dict[str, Any] = {"q0": POSTURE + 0.05, "duration": 0.05, "friction_slip": 0.05}
    many = batch_and_each(arm, law, POSTURE, {**each, "joint_armature": rng.uniform(0.05, 0.1, 3)}, **options)
    column = simulate_batch(arm, law, POSTURE, **each, joint_armature=np.full((3, 1), 0.07), **options)
    row = simulate_batch(arm, law, POSTURE, **each, joint_armature=0.07, **options)
    np.testing.assert_array_equal(column.q, row.q)
    assert apart(many.q, row.q) > 1e-6


def test_parameters_of_a_plant_with_a_payload_scaled_masses_and_rotors(arm: Model) -> None:
    masses = np.array([0.5, 1.5])
    loaded = plant_model(arm, TOOL, 1.1)
    law = GravityCompensatedPD(arm, kp=60, kd=6)
    options: dict[str, Any] = {
        "q0": POSTURE + 0.05,
        "duration": 0.03,
        "mass_scale": 1.1,
        "joint_armature": 0.1,
        "joint_friction": 0.2,
    }
    many = simulate_batch(
        arm,
        law,
        POSTURE,
        parametric=dynx.parametric(loaded, point_payload="forearm_link"),
        parameters=np.column_stack([masses, np.full((2, 3), 0.1)]),
        payload=TOOL,
        record_every=1,
        **options,
    )
    for row, mass in enumerate(masses.tolist()):
        # The factor is for links, not for what they carry.
        payload = [TOOL, Payload("forearm_link", mass, (0.1, 0.1, 0.1))]
        assert_same(many, row, simulate(arm, law, POSTURE, plant="compiled", payload=payload, **options))
    with pytest.raises(ArgumentError, match="payload and scaled masses"):
        simulate_batch(arm, law, POSTURE, parametric=dynx.parametric(arm, point_payload="tool0"), **options)


def test_friction_is_compensated(arm: Model) -> None:
    law = FrictionCompensation(ComputedTorque(arm, kp=400, kd=40), damping=0.3, friction=0.5)
    many, _ = batch_and_one(
        arm, law, POSTURE, q0=POSTURE + 0.05, duration=0.05, joint_damping=0.3, joint_friction=0.5
    )
    without, _ = batch_and_one(arm, law, POSTURE, q0=POSTURE + 0.05, duration=0.05)
    assert apart(many.q, without.q) > 1e-6


def test_where_the_limits_cut_is_counted(arm: Model) -> None:
    limit = [150, 35, 18, 2.5, 2, 2]
    found = held(arm, effort_limits=limit)
    assert np.any(found.saturated == 1.0)
    assert np.any(found.saturated == 0.0)
    assert not held(arm, effort_limits=1e6).saturated.any()
    # 50 steps are not a multiple of 7: the last torque acts in one step only.
    last = held(arm, effort_limits=limit, control_dt=7e-3)
    assert np.all(last.saturated <= 1.0)


def test_without_a_start_the_speed_is_that_of_the_reference(arm: Model) -> None:
    motion = dynx.trajectory.spline([0.0, 1.0], [POSTURE, POSTURE + 0.1], v0=np.full(6, 0.3))
    law = ComputedTorque(arm, kp=400, kd=40)
    starts: list[dict[str, Any]] = [
        {},
        {"q0": POSTURE},
        {"v0": np.full(6, 0.1)},
        {"q0": POSTURE, "v0": np.full(6, 0.1)},
    ]
    for start in starts:
        batch_and_one(arm, law, motion, duration=0.01, **start)


def test_what_no_option_can_be_is_refused(arm: Model) -> None:
    law = GravityCompensatedPD(arm, kp=60, kd=6)
    six = np.full(6, 0.1)
    bad: list[tuple[type[Exception], str, dict[str, Any]]] = [
        (ArgumentError, "not a multiple", {"delay": 1.5e-3}),
        (ArgumentError, "delay", {"delay": -1.0}),
        (GainError, "damping has shape", {"joint_damping": np.zeros((3, 4))}),
        (GainError, "friction has shape", {"joint_friction": np.zeros((3, 6, 1))}),
        (GainError, "negative", {"joint_friction": -np.ones((3, 6))}),
        (GainError, "not finite", {"joint_armature": np.full((3, 1), np.nan)}),
        (GainError, "negative", {"joint_damping": -1.0}),
        (ArgumentError, "6 joints and 6 rollouts", {"joint_damping": six, "rollouts": 6}),
        (
            ArgumentError,
            "6 joints and 6 rollouts",
            {"joint_friction": six, "joint_armature": np.ones((6, 6))},
        ),
        (
            ArgumentError,
            "3 rows, joint_damping says 4",
            {"joint_damping": np.ones(4), "joint_friction": np.ones((3, 6))},
        ),
        (ArgumentError, "slip", {"joint_friction": 0.1, "friction_slip": -1.0}),
        (UnknownNameError, "^joint_friction: .*'elbow_joint'", {"joint_friction": {"elbow": 2.0}}),
        (GainError, "negative", {"joint_friction": {"elbow_joint": [2.0, -1.0]}}),
        (
            GainError,
            "one for each rollout",
            {"joint_friction": {"elbow_joint": np.ones(2), "wrist_1_joint": np.ones(3)}},
        ),
        (GainError, "or True for the values of the description", {"joint_damping": "urdf"}),
    ]
    for error, said, options in bad:
        with pytest.raises(error, match=said):
            simulate_batch(arm, law, POSTURE, **{"duration": 0.01, **options})
    simulate_batch(arm, law, POSTURE, duration=0.002, joint_damping=six[:, None])
    simulate_batch(arm, law, POSTURE, duration=0.002, joint_damping=six[None], rollouts=1)
    with pytest.raises(UnsupportedFeatureError):
        simulate_batch(arm, BulletPositionMotor(arm), POSTURE, duration=0.01)


def test_a_robot_without_an_acceleration_is_refused() -> None:
    robot = mixed_robot()
    links = [Link(link.name) if link.name in ("link6", "link7", "link8") else link for link in robot.links]
    hollow = Model.build("hollow", links, robot.joints)
    law = dynx.control.PD(hollow, kp=1.0, kd=0.1)
    with pytest.raises(SingularMassMatrixError):
        simulate_batch(hollow, law, hollow.neutral(), duration=0.01, check_reference=False, **RIGID_BODIES)
    batch_and_one(hollow, law, hollow.neutral(), duration=0.01, check_reference=False, joint_armature=1.0)


def test_the_memory_that_a_batch_needs_is_compared_with_the_machine(
    arm: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []
    monkeypatch.setattr("dynx.sim.batch.require_memory", lambda what, size: asked.append(size))
    law, goal = GravityCompensatedPD(arm, kp=1.0, kd=1.0), arm.neutral()
    simulate_batch(arm, law, goal, rollouts=64, record_every=1, duration=0.02)
    # 20 recorded states of q, v and torque, of 8 bytes each.
    assert max(asked) >= 64 * 20 * 8 * (arm.nq + 2 * arm.nv)


def test_a_start_with_other_rows_is_named(arm: Model) -> None:
    law, goal = GravityCompensatedPD(arm, kp=1.0, kd=1.0), arm.neutral()
    with pytest.raises(ArgumentError, match="q0"):
        simulate_batch(arm, law, goal, rollouts=5, q0=np.zeros((3, arm.nq)), duration=0.02)
