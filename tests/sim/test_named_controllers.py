"""Laws by name: gains that suit the robot, and those that a law does not take."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import backend
from dynx.control import PD, PID, BulletPositionMotor, ComputedTorque, Impedance, OperationalSpace, Velocity
from dynx.control.base import ModelBased
from dynx.errors import GainError, LimitError, UnknownNameError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import simulate
from dynx.sim.named_controllers import CONTROLLERS, ControllerRequest, Gains, named_controller
from dynx.sim.overshoot import joint_inertia
from dynx.trajectory import Setpoint
from tests.sim.bars import tutorial_robot

ARM = tutorial_robot()
START = np.array([0.2, -1.3, 1.1, 0.3, 0.4, 0.1])


def law(name: str, model: Model = ARM, **options: Any) -> Any:
    gains = {key: options.pop(key) for key in list(options) if key in Gains.__dataclass_fields__}
    options.setdefault("start", START if model is ARM else model.neutral())
    return named_controller(name, ControllerRequest(model, control_dt=1e-3, gains=Gains(**gains), **options))


@pytest.mark.parametrize("name", CONTROLLERS)
def test_every_law_can_be_had_by_its_name(name: str) -> None:
    needed: dict[str, Any] = {"impedance": {"kp": 1.0, "kd": 1.0}}.get(name, {})
    made = law(name, frame="tool0", **needed)
    assert made.model is ARM


@pytest.mark.parametrize("name", CONTROLLERS)
def test_joint_dynamics_are_known_to_the_controllers_with_a_model(name: str) -> None:
    needed: dict[str, Any] = {"impedance": {"kp": 1.0, "kd": 1.0}}.get(name, {})
    if not isinstance(law(name, frame="tool0", **needed), ModelBased):
        with pytest.raises(UnsupportedFeatureError, match=f"^{name} computes without .* such as computed-"):
            law(name, frame="tool0", joint_dynamics=True, **needed)
        return
    for known in (False, True):
        assert law(name, frame="tool0", joint_dynamics=known, **needed).joint_dynamics is known


def test_gains_are_those_of_one_error_whatever_the_law() -> None:
    inertia = np.diag(backend("pinocchio", ARM).mass_matrix(START))
    np.testing.assert_allclose(joint_inertia(ARM, START), inertia, rtol=1e-12)
    rates: ComputedTorque = law("computed-torque")
    np.testing.assert_array_equal(rates.kp, np.full(6, 400.0))
    np.testing.assert_array_equal(rates.kd, np.full(6, 40.0))
    torques: PD = law("pd")
    np.testing.assert_allclose(torques.kp, 400.0 * inertia, rtol=1e-12)
    np.testing.assert_allclose(torques.kd, 40.0 * inertia, rtol=1e-12)
    slower: PD = law("pd", natural_frequency=5.0, damping_ratio=0.5)
    np.testing.assert_allclose(slower.kp, 25.0 * inertia, rtol=1e-12)
    np.testing.assert_allclose(slower.kd, 5.0 * inertia, rtol=1e-12)


def test_kp_alone_is_damped() -> None:
    inertia = joint_inertia(ARM, START)
    alone: PD = law("pd", kp=100.0)
    np.testing.assert_allclose(alone.kd, 2.0 * np.sqrt(100.0 * inertia), rtol=1e-12)
    less: ComputedTorque = law("computed-torque", kp=100.0, damping_ratio=0.7)
    np.testing.assert_allclose(less.kd, np.full(6, 14.0), rtol=1e-12)


def test_what_is_given_is_taken() -> None:
    pid: PID = law("pid", kp=8.0, kd=2.0, ki=3.0, limit=5.0)
    assert (pid.kp[0], pid.kd[0], pid.ki[0], pid.limit[0]) == (8.0, 2.0, 3.0, 5.0)
    own: PID = law("pid", kp=8.0, kd=2.0)
    assert own.ki[0] == 16.0
    velocity: Velocity = law("velocity", kd=3.0)
    assert velocity.kd.tolist() == [3.0] * 6
    task: OperationalSpace = law("operational-space", frame="tool0", posture_kp=7.0)
    assert (task.kp.shape, task.posture_kp[0]) == ((6,), 7.0)
    spring: Impedance = law("impedance", frame="tool0", kp=500.0, kd=[50.0] * 3 + [5.0] * 3, posture_kd=1.0)
    assert (spring.stiffness[0], spring.damping[5], spring.joint_damping[0]) == (500.0, 5.0, 1.0)
    motor: BulletPositionMotor = law("position-motor", kp=0.2)
    command = motor.command(*[_still(motor)] * 2)
    assert command.position_gains == [0.2] * 6


def _still(motor: BulletPositionMotor) -> Any:
    return Setpoint(START, np.zeros(6), np.zeros(6))


def test_a_floating_base_has_gains_for_its_joints_only() -> None:
    robot = load("solo12", base="floating")
    made: PD = law("pd", robot)
    assert made.kp.shape == (12,)
    rollout = simulate(robot, made, robot.neutral(), duration=0.05)
    # In free fall the legs feel no weight.
    assert np.abs(rollout.error[:, 6:]).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "options", "says"),
    [
        ("computed-torque", {"ki": 1.0}, "takes no ki; it takes kp, kd"),
        ("discrete-computed-torque", {"kp": 1.0}, "it has no gains"),
        ("velocity", {"kp": 1.0}, "takes no kp"),
        ("pd", {"kd": 1.0}, "without kp"),
        ("pd", {"kp": 1.0, "kd": 1.0, "damping_ratio": 1.0}, "twice"),
        ("pd", {"kp": 1.0, "natural_frequency": 1.0}, "twice"),
        ("pd", {"kp": [1.0, 2.0]}, "kp has shape"),
        ("pd", {"kp": -1.0}, "negative"),
        ("pid", {"kp": 1.0, "kd": 0.0}, "ki is not given"),
        ("impedance", {"frame": "tool0"}, "impedance needs kp"),
    ],
)
def test_gains_that_a_law_does_not_take(name: str, options: dict[str, Any], says: str) -> None:
    with pytest.raises(GainError, match=says):
        law(name, **options)


def test_a_wrong_name_is_told_the_nearest() -> None:
    with pytest.raises(UnknownNameError, match="'computed-torque'"):
        law("computed-torqe")
    with pytest.raises(UnknownNameError, match="none is given"):
        law("operational-space")


def test_a_motor_limit_of_0_is_refused() -> None:
    for name in ("pid", "position-motor", "velocity-motor", "pd-motor"):
        with pytest.raises(LimitError, match="is 0"):
            law(name, limit=0.0)


@pytest.mark.parametrize("name", ["pd", "pid"])
def test_gains_of_a_floating_robot_do_not_overshoot(name: str) -> None:
    """A base that yields makes joints lighter than the diagonal of the mass matrix says, up to 600 times."""
    robot = load("ur5", base="floating")
    start = robot.neutral()
    law = named_controller(name, ControllerRequest(robot, start, 1e-3))
    rollout = simulate(robot, law, start, duration=0.2)
    assert np.abs(rollout.v[:, 6:]).max() < 1.0
