"""Likely slips of a caller: accepted where the meaning is plain, else an error that states what is wanted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.errors import ArgumentError, DynxError, GainError, RobotNotFoundError, UnknownBackendError
from tests.sim.bars import tutorial_robot

ARM = tutorial_robot()
PD = control.PD(ARM, kp=100.0, kd=10.0)
REST = np.zeros(6)
WRENCH = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
# Untyped, as in a script: types would show most of these slips.
untyped: Any = dynx
laws: Any = control
simulate, simulate_batch, payload = untyped.simulate, untyped.simulate_batch, untyped.Payload
robot: Any = ARM


class TorqueOnly(control.Controller[None]):
    """A controller whose author forgot the state."""

    def __init__(self) -> None:
        self.model = ARM

    def torque(self, *_: Any) -> Any:
        return np.zeros(6)


def test_a_single_push_and_a_name_are_accepted() -> None:
    push = dynx.ExternalForce("tool0", WRENCH, duration=0.002)
    options: dict[str, Any] = {"plant": "compiled", "duration": 0.004}
    one = simulate(ARM, PD, REST, pushes=push, **options)
    np.testing.assert_array_equal(one.q, simulate(ARM, PD, REST, pushes=[push], **options).q)
    named = dynx.load("ur5")
    controller = control.PD(named, kp=100.0, kd=10.0)
    assert simulate("ur5", controller, REST, **options).model == named
    assert simulate_batch("ur5", controller, REST, rollouts=2, duration=0.004, pushes=push).done.all()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((WRENCH, "1"), "start of an external force on 'tool0' is '1'; wanted a finite time"),
        ((WRENCH, np.nan), "start of .* is nan"),
        ((WRENCH, np.inf), "start of .* is inf"),
        ((WRENCH, -1), "start of .* is -1; wanted a finite time .s. of at least 0"),
        ((WRENCH, 0.0, -1.0), "duration of .* is -1.0; wanted a positive number of seconds, or inf"),
        ((WRENCH, 0.0, 1.0, "here"), "reference of .* is 'here'; known: local_world_aligned, local, world"),
        ((WRENCH, 0.0, 1.0, "wrold"), "'wrold'; did you mean 'world'"),
        ((WRENCH, 0.0, 1.0, "local", [1.0]), r"point of .* has shape \(1,\); wanted \(3,\)"),
        ((WRENCH, 0.0, 1.0, "world", [1.0, 0.0, 0.0]), r"the point \[1.0, 0.0, 0.0\] in the reference world"),
        ((np.zeros(3),), r"wrench of an external force on 'tool0' has shape \(3,\); wanted \(6,\), a force"),
        (([0.0, 0.0, np.nan, 0.0, 0.0, 0.0],), r"wrench of an external force on 'tool0'\[2\] is nan"),
    ],
)
def test_a_push_is_checked_when_it_is_made(values: tuple[Any, ...], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        dynx.ExternalForce("tool0", *values)


SIMULATIONS: dict[str, tuple[dict[str, Any], type[DynxError], str]] = {
    "payload=2.0": ({"payload": 2.0}, ArgumentError, "payload is '2.0'; wanted a Payload, or a list of them"),
    "payload of a pair": ({"payload": ("tool0", 2.0)}, ArgumentError, "wanted a Payload"),
    "noise=1e-3": ({"noise": 1e-3}, ArgumentError, r"noise is '0.001'; wanted a dynx\.Noise"),
    "pushes=None": ({"pushes": None}, ArgumentError, "wanted an ExternalForce"),
    "dt=1e-300": (
        {"dt": 1e-300},
        ArgumentError,
        r"0.01 s, more than 1e\+12 steps of dt = 1e-300 s",
    ),
    "dt=5e-324": ({"dt": 5e-324}, ArgumentError, "more than"),
    "dt=1e-11": ({"dt": 1e-11}, ArgumentError, "1000000000 steps need about .* GB; this machine has"),
    "duration=1e12": ({"duration": 1e12}, ArgumentError, r"duration is 1e\+12 s, more than 1e\+12 steps"),
    "duration=1e8": ({"duration": 1e8}, ArgumentError, "100000000000 steps need about .* GB"),
    "effort_limits=None": ({"effort_limits": None}, ArgumentError, "effort_limits is None; wanted True"),
    **{
        f"{name}='much'": (
            {name: "much"},
            GainError,
            f"^{name} is 'much'; wanted one number, an array .* or True for the values of the description",
        )
        for name in ("joint_damping", "joint_friction", "joint_armature", "effort_limits")
    },
    "friction_slip='much'": (
        {"friction_slip": "much"},
        ArgumentError,
        "^friction_slip is 'much'; wanted a speed: 0, or",
    ),
    "mass_scale=array": ({"mass_scale": np.ones(6)}, ArgumentError, "^mass_scale of .* wanted a positive"),
    "check_reference=1": (
        {"check_reference": 1},
        ArgumentError,
        "check_reference is '1'; wanted True",
    ),
    "progress=True": ({"progress": True}, ArgumentError, "progress is 'True'; wanted a function"),
    "reference='home'": ({"reference": "home"}, ArgumentError, "reference is 'home'; wanted a trajectory"),
    "reference a function": ({"reference": lambda t: REST}, ArgumentError, "wanted a trajectory"),
    "the class": (
        {"controller": control.PD},
        ArgumentError,
        "controller is the class PD; wanted an object",
    ),
    "a function": ({"controller": lambda m, s, x: REST}, ArgumentError, "type function; wanted a controller"),
    "no robot": ({"model": None}, ArgumentError, "model is of type NoneType; wanted a Model, a Scenario"),
    "another name": ({"model": "ur55"}, RobotNotFoundError, "ur5"),
}


@pytest.mark.parametrize("function", [simulate, simulate_batch], ids=["one", "batch"])
@pytest.mark.parametrize("slip", SIMULATIONS)
def test_a_simulation_states_what_is_wanted(function: Callable[..., Any], slip: str) -> None:
    changed, error, message = SIMULATIONS[slip]
    given = {"model": ARM, "controller": PD, "reference": REST, "duration": 0.01, **changed}
    with pytest.raises(error, match=message):
        function(**given)


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: simulate(ARM, TorqueOnly(), REST, duration=0.01), DynxError, r"must return \(tau, state\)"),
        (
            lambda: simulate_batch(ARM, TorqueOnly(), REST, duration=0.01),
            DynxError,
            r"must return \(tau, state",
        ),
        (lambda: simulate_batch(ARM, None, REST, duration=0.01), ArgumentError, "controller is None"),
        (
            lambda: simulate_batch(ARM, PD, REST, duration=0.01, rollouts=10**9),
            ArgumentError,
            "need about",
        ),
        (lambda: simulate_batch(ARM, PD, REST, duration=0.01, gains=2.0), ArgumentError, "wanted a mapping"),
        (
            lambda: simulate_batch(ARM, PD, REST, duration=0.01, threads=np.ones(2)),
            ArgumentError,
            "^threads is .* wanted a positive integer",
        ),
        (lambda: laws.Saturated(PD, limit="much"), GainError, "^limit is 'much'.* or None for the values"),
        (lambda: simulate_batch(ARM, PD, REST, duration=0.01, keep=3), ArgumentError, "keep is '3'"),
        (
            lambda: simulate_batch(ARM, PD, REST, duration=0.01, executor="x"),
            ArgumentError,
            "concurrent",
        ),
        (lambda: simulate(ARM, PD, REST, controller_backend="pin"), UnknownBackendError, "no backend 'pin'"),
        (lambda: payload("tool0", -1.0), ArgumentError, "the mass of a payload is '-1.0'; wanted"),
        (lambda: payload("tool0", "2"), ArgumentError, "the mass of a payload is '2'"),
        (lambda: payload(2.0, "tool0"), ArgumentError, "the frame of a payload is '2.0'"),
        (lambda: payload("tool0", float("nan")), ArgumentError, "the mass of a payload is 'nan'"),
        (lambda: payload("tool0", 1.0, 0.1), ArgumentError, r"center has shape \(\)"),
        (lambda: payload("tool0", 1.0, inertia=np.eye(2)), ArgumentError, "inertia"),
        (
            lambda: laws.PD("ur5", kp=1, kd=1),
            ArgumentError,
            r"dynx\.load\('ur5'\)",
        ),
        (lambda: laws.ComputedTorque("ur5", kp=1, kd=1), ArgumentError, r"dynx\.load\('ur5'\)"),
        (lambda: laws.FrictionCompensation(ARM), ArgumentError, "the inner controller is of type Model"),
        (lambda: untyped.inertial_parameters("ur5"), ArgumentError, r"dynx\.load\('ur5'\)"),
        (lambda: untyped.load("ur5", lock=["elbow_joint"]), ArgumentError, "wanted positions by the name"),
        (lambda: robot.random("seed"), ArgumentError, "rng is 'seed'; wanted a NumPy generator, or a seed"),
        (lambda: robot.random(-1), ArgumentError, "rng is '-1'"),
        (lambda: robot.random(0, -1), ArgumentError, "size is '-1'; wanted a number of samples"),
        (lambda: robot.random(0, 2.5), ArgumentError, "size is '2.5'"),
        (lambda: untyped.Rollout.load(3), ArgumentError, "a path is '3'; wanted a str"),
        (lambda: untyped.Scenario.from_json(3), ArgumentError, "the text is not JSON"),
        (lambda: untyped.Scenario("ur5"), ArgumentError, r"dynx\.load\('ur5'\)"),
        (lambda: untyped.Noise("a").deviations(6), GainError, "noise.q has dtype"),
    ],
)
def test_an_argument_is_named(make: Callable[[], Any], error: type[DynxError], message: str) -> None:
    with pytest.raises(error, match=message):
        make()


def test_a_simulation_is_not_stepped_beyond_memory() -> None:
    with dynx.Simulation(dynx.Scenario(ARM, PD, REST, plant="compiled")) as simulation:
        with pytest.raises(ArgumentError, match="1000000000000 steps need about"):
            simulation.step(10**12)
        with pytest.raises(ArgumentError, match="until is 1e\\+12 s, more than"):
            simulation.run(1e12)
        simulation.step()
        rollout = simulation.rollout
    with pytest.raises(ArgumentError, match="a path is '3'"):
        untyped.Rollout.save(rollout, 3)
