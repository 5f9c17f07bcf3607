"""Invalid simulations are refused by name; a failure during the run keeps the steps computed."""

from __future__ import annotations

import inspect
import pickle
from typing import Any, cast

import numpy as np
import pytest

from dynx import ExternalForce
from dynx.control import (
    BulletPositionMotor,
    ComputedTorque,
    DiscreteComputedTorque,
    GravityCompensatedPD,
    Measurement,
)
from dynx.control.base import Controller
from dynx.errors import (
    ArgumentError,
    ControlError,
    DivergedError,
    GainError,
    LimitError,
    SingularMassMatrixError,
    UnknownBackendError,
    UnknownNameError,
    UnsupportedFeatureError,
)
from dynx.model import Inertial, Joint, Link, Model
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Scenario, simulate, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from tests.sim.bars import tutorial_motion, tutorial_robot

ARM = tutorial_robot()
LAW = ComputedTorque(ARM, kp=400, kd=40)
REST = np.zeros(6)


@pytest.mark.parametrize(
    ("options", "error", "says"),
    [
        ({"dt": 0.0}, ArgumentError, "dt is '0.0'"),
        ({"dt": -1e-3}, ArgumentError, "dt is"),
        ({"dt": float("nan")}, ArgumentError, "dt is"),
        ({"dt": "fast"}, ArgumentError, "dt is 'fast'"),
        ({"duration": 0.0}, ArgumentError, "duration"),
        ({"duration": -1.0}, ArgumentError, "duration"),
        ({"control_dt": 1.5e-3}, ArgumentError, "control_dt is 0.0015 s.*the nearest one is 0.002 s"),
        ({"control_dt": 5e-4}, ArgumentError, "control_dt"),
        ({"delay": 5e-4}, ArgumentError, "delay"),
        ({"delay": -1.0}, ArgumentError, "delay"),
        ({"substeps": 0}, ArgumentError, "substeps"),
        ({"substeps": 1.5}, ArgumentError, "substeps"),
        ({"plant": "bulet"}, UnknownBackendError, "no plant 'bulet'.*pybullet"),
        ({"plant": ["pybullet"]}, ArgumentError, "plant is of type list; wanted the name"),
        ({"noise": 0.1}, ArgumentError, r"noise is '0\.1'; wanted a dynx\.Noise"),
        ({"pushes": [1]}, ArgumentError, r"pushes is .*; wanted an ExternalForce"),
        ({"pushes": 1}, ArgumentError, r"pushes is .*; wanted an ExternalForce"),
        ({"payload": 2.0}, ArgumentError, r"payload is '2\.0'; wanted a Payload"),
        ({"integrator": "rk5"}, ArgumentError, "rk4"),
        ({"integrator": "engine"}, ArgumentError, "no stepper"),
        ({"integrator": "adaptive", "method": "DOP85"}, ArgumentError, "DOP853"),
        ({"integrator": "adaptive", "rtol": 0.0}, ArgumentError, "rtol"),
        ({"q0": np.zeros(5)}, ArgumentError, "q0"),
        ({"q0": np.zeros((2, 6))}, ArgumentError, "one state"),
        ({"v0": np.full(6, np.nan)}, ArgumentError, "v0"),
        ({"joint_damping": -1.0}, GainError, "damping is negative"),
        ({"joint_friction": np.zeros(3)}, GainError, "friction has shape"),
        ({"joint_armature": "much"}, GainError, "armature"),
        ({"joint_friction": {"elbow_join": 2.0}}, UnknownNameError, "^joint_friction: .*'elbow_joint'"),
        ({"joint_friction": {"elbow_joint": -2.0}}, GainError, "friction is negative"),
        ({"joint_damping": {"elbow_joint": "much"}}, ArgumentError, "damping of 'elbow_joint'"),
        ({"joint_armature": {"elbow_joint": [1.0, 2.0]}}, GainError, "armature has shape"),
        ({"effort_limits": {"elbow_joint": 0.0}}, LimitError, "elbow_joint.*is 0"),
        (
            {"joint_friction": "urdf"},
            GainError,
            "friction is 'urdf'; wanted .* or True for the values of the desc",
        ),
        ({"joint_friction": 1.0, "friction_slip": -1.0}, ArgumentError, "slip"),
        ({"effort_limits": 0.0}, LimitError, "shoulder_pan_joint.*is 0"),
        ({"effort_limits": [1.0, 2.0]}, GainError, "limit"),
        ({"payload": Payload("too0", 1.0)}, UnknownNameError, "tool0"),
        ({"mass_scale": 0.0}, ArgumentError, "mass_scale"),
        ({"mass_scale": {"forearm": 2.0}}, UnknownNameError, "forearm_link"),
        ({"noise": Noise(-1.0)}, GainError, "noise"),
        ({"noise": Noise(seed=-1)}, ArgumentError, "seed"),
        ({"noise": Noise(rollout=2**63)}, ArgumentError, "rollout"),
        ({"pushes": [ExternalForce("tool", np.zeros(6))]}, UnknownNameError, "tool0"),
    ],
)
def test_options_that_cannot_be_used(options: dict[str, Any], error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        simulate(ARM, LAW, tutorial_motion(), **{"duration": 0.01, **options})


def test_a_reference_outside_the_limits_is_refused_before_anything_moves() -> None:
    too_fast = tutorial_motion(0.2)
    with pytest.raises(LimitError, match=r"velocity of(.|\n)*check_reference=False") as caught:
        simulate(ARM, LAW, too_fast)
    assert {violation.quantity for violation in caught.value.violations} == {"velocity"}
    with pytest.raises(LimitError, match=r"position of 'elbow_joint' is 4.*check_reference=False"):
        simulate(ARM, LAW, np.array([0.0, 0.0, 4.0, 0.0, 0.0, 0.0]), duration=0.01)
    assert len(simulate(ARM, LAW, too_fast, duration=0.01, check_reference=False)) == 10


def test_what_is_missing_or_of_another_robot() -> None:
    other, no_law = load("panda"), cast(Any, "pd")
    with pytest.raises(ArgumentError, match="duration"):
        simulate(ARM)
    with pytest.raises(ArgumentError, match=r"needs a reference: a trajectory, or a configuration to hold$"):
        simulate(ARM, LAW, duration=0.01)
    own = Faulty(lambda _: np.zeros(3))
    with pytest.raises(ArgumentError, match=r"needs a reference.*needs_setpoint = False"):
        simulate(ARM, own, duration=0.01)
    with pytest.raises(
        ArgumentError, match=r"reference is None.*needs_setpoint = False: errors are measured"
    ):
        simulate_batch(ARM, own, None, rollouts=2, duration=0.01)
    with pytest.raises(ArgumentError, match=r"made for control_dt = 0\.002 s; it is 0\.001 s"):
        simulate(ARM, DiscreteComputedTorque(ARM, control_dt=2e-3), REST, duration=0.01)
    with pytest.raises(ArgumentError, match="joints are not"):
        simulate(other, LAW, other.neutral(), duration=0.01)
    with pytest.raises(ArgumentError, match="nq 6"):
        simulate(other, GravityCompensatedPD(other, kp=1, kd=1), tutorial_motion())
    with pytest.raises(ArgumentError, match=r"wanted a controller of dynx\.control"):
        simulate(ARM, no_law, REST, duration=0.01)


def test_a_motor_of_the_engine_needs_the_engine() -> None:
    with pytest.raises(UnsupportedFeatureError, match="plant='pybullet'"):
        simulate(ARM, BulletPositionMotor(ARM), REST, duration=0.01)
    with pytest.raises(ArgumentError, match="force"):
        simulate(ARM, BulletPositionMotor(ARM), REST, duration=0.01, effort_limits=True)


def test_a_floating_base_has_no_motor() -> None:
    robot = load("solo12", base="floating")
    with pytest.raises(UnsupportedFeatureError, match="floating base"):
        ComputedTorque(robot, kp=1, kd=1)


def test_a_robot_without_an_acceleration() -> None:
    links = [Link("base"), Link("arm", Inertial(1.0, ixx=1, iyy=1, izz=1)), Link("flag")]
    joints = [Joint("a", "revolute", "base", "arm"), Joint("b", "revolute", "arm", "flag")]
    with pytest.raises(SingularMassMatrixError, match="'b'"):
        simulate(Model.build("flagpole", links, joints), duration=0.01)


class Faulty(Controller[None]):
    """Gives `answer` from step 5 on, and nothing before."""

    def __init__(self, answer: Any) -> None:
        self.model = ARM
        self.answer = answer

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        if measurement.t < 4.5e-3:
            return np.zeros(6), None
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer, None


@pytest.mark.parametrize("plant", ["pinocchio", "pybullet"])
@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (np.full(6, np.nan), "not finite"),
        (np.array([0, 0, np.inf, 0, 0, 0.0]), "not finite"),
        (np.zeros(5), r"its torque has shape \(5,\); wanted \(6,\)"),
        (0.0, r"its torque has shape \(\); wanted \(6,\)"),
        (["1"] * 6, r"its torque is of type list, not numbers \(6,\)"),
        ([[1.0], [1.0, 2.0]], "not numbers"),
        (np.zeros(6, dtype=complex), "not numbers"),
        (None, "of type NoneType, not numbers"),
        (RuntimeError("no idea"), "RuntimeError: no idea"),
    ],
)
def test_a_controller_that_fails_leaves_what_was_before(plant: str, answer: Any, says: str) -> None:
    pytest.importorskip(plant)
    with pytest.raises(ControlError, match=says) as caught:
        simulate(ARM, Faulty(answer), REST, plant=plant, duration=0.01)
    error = caught.value
    assert (error.step, error.time) == (5, 5e-3)
    assert len(error.rollout) == 5
    np.testing.assert_array_equal(error.state[0], error.rollout.q[-1])
    np.testing.assert_array_equal(error.rollout.q, simulate(ARM, None, REST, plant=plant, duration=0.005).q)
    again = pickle.loads(pickle.dumps(error))
    assert (again.step, again.time, str(again)) == (error.step, error.time, str(error))


@pytest.mark.parametrize("plant", ["pinocchio", "pybullet"])
def test_a_simulation_that_runs_away_says_when_and_where(plant: str) -> None:
    pytest.importorskip(plant)
    # So fast that an explicit step of the centrifugal forces overshoots.
    with pytest.raises(DivergedError, match="diverged in step") as caught:
        simulate(ARM, None, q0=REST, v0=np.full(6, 1e3), plant=plant, duration=1.0, joint_limits=False)
    error = caught.value
    assert 0 < error.step < 100
    assert error.time == pytest.approx(error.step * 1e-3)
    assert np.isfinite(error.rollout.q).all()
    assert len(error.rollout) == error.step
    np.testing.assert_array_equal(error.state[1], error.rollout.v[-1])


def test_what_an_engine_raises_is_ours_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*args: Any) -> Any:
        raise OverflowError("the engine has enough")

    monkeypatch.setattr("dynx.steppers.integrators.SemiImplicitEuler.moved", broken)
    with pytest.raises(DivergedError, match="OverflowError: the engine has enough") as caught:
        simulate(ARM, None, REST, duration=0.01)
    assert len(caught.value.rollout) == 0


def test_a_law_of_inverse_dynamics_that_overflows_is_the_law_s_fault() -> None:
    law = ComputedTorque(ARM, kp=1e308, kd=0.0)
    with pytest.raises(ControlError, match="not finite"):
        simulate(ARM, law, REST, q0=REST + 3.0, duration=0.01)


def test_a_batch_has_the_defaults_of_one_rollout() -> None:
    one, batch = (inspect.signature(function).parameters for function in (simulate, simulate_batch))
    for name in (one.keys() & batch.keys()) - {"plant"}:
        assert one[name].default == batch[name].default, name


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({"plant": np.zeros(3)}, "plant is of type ndarray"),
        ({"plant": "pinocchio"}, "plant is 'pinocchio'; a batch takes only 'compiled'"),
        ({"parametric": 3.0}, r"parametric is of type float; wanted dynx\.parametric"),
        ({"noise": 0.1}, r"noise is '0\.1'; wanted a dynx\.Noise"),
        ({"pushes": [1]}, "wanted an ExternalForce"),
        ({"payload": 2.0}, "wanted a Payload"),
    ],
)
def test_arguments_of_a_batch_have_their_types(options: dict[str, Any], hint: str) -> None:
    with pytest.raises(ArgumentError, match=hint):
        simulate_batch(ARM, LAW, REST, rollouts=2, duration=0.01, **options)


@pytest.mark.parametrize("name", ["semi_implicit", "semi-implicit"])
def test_the_integrator_has_one_name_in_python_on_the_command_line_and_in_files(name: str) -> None:
    scenario = Scenario(ARM, LAW, tutorial_motion(), integrator=name)
    assert scenario.integrator == "semi_implicit"
    assert Scenario.from_dict({**scenario.to_dict(), "integrator": name}).integrator == "semi_implicit"
    with pytest.raises(ArgumentError, match="'rk-5'; wanted one of semi_implicit, rk4, adaptive, engine"):
        simulate(ARM, LAW, tutorial_motion(), duration=0.01, integrator="rk-5")
