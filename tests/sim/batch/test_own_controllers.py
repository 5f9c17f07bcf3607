"""Controllers of a user's own in batches: what is compiled, and what is refused with its line."""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.backends import installed_backends
from dynx.backends.dynamics import EngineDynamics
from dynx.control.base import Controller, Measurement, parameter
from dynx.errors import ArgumentError, ControlError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim import Scenario, Simulation, simulate, simulate_batch
from dynx.trajectory.base import Setpoint
from tests.sim.batch.batches import assert_same, batch_and_one

ARM = dynx.load("ur5").with_gravity((0.0, 0.0, -9.8))
GOAL = np.array([0.3, -0.5, 0.4, 0.1, 0.2, 0.3])
ENGINES = [name for name in ("pinocchio", "compiled", "reference") if name in installed_backends()]
count = 0
"""Number of torques that `global_variable` computed."""


class Own(Controller[None]):
    """A controller whose torque is a function of itself, the measurement and the setpoint."""

    def __init__(self, law: Callable[..., Any], model: Model = ARM) -> None:
        self.model, self.law = model, law
        self.kp, self.kd, self.limit = np.full(6, 50.0), np.full(6, 10.0), np.arange(1.0, 7.0)
        self.dynamics = control.model_dynamics(model, ENGINES[0])

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
        return self.law(self, measurement, setpoint), None


def saturated(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
    """Return a PD torque within limits, and at least half a newton metre away from the goal."""
    error = setpoint.q - measurement.q
    tau = np.clip(self.kp * error - self.kd * measurement.v, -self.limit, self.limit)
    return np.where(np.abs(error) > 0.01, tau, np.sign(error) * np.minimum(np.abs(tau), 0.5))


def operational_space(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
    """Return the torque of a force of at most 50 N on the tool, by the inverse of its inertia."""
    d, (_, q, v) = self.dynamics, measurement
    M, J = d.mass_matrix(q), d.jacobian(q, "tool0")[:3]
    error = (d.forward_kinematics(setpoint.q, "tool0") - d.forward_kinematics(q, "tool0"))[:3, 3]
    mobility = J @ np.linalg.solve(M, J.T) + 0.05 * np.eye(3)
    force = np.linalg.solve(mobility, 20.0 * error - 5.0 * (J @ v))
    norm = np.linalg.norm(force)
    force = np.where(norm > 50.0, force * (50.0 / np.maximum(norm, 50.0)), force)
    return d.bias_torque(q, v) + J.T @ force - 2.0 * v


def inverse_of_the_mass_matrix(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
    """Return the torque of an acceleration that is found twice."""
    d, (_, q, v) = self.dynamics, measurement
    a = 100.0 * (setpoint.q - q) - 20.0 * v
    tau = d.inverse_dynamics(q, v, a)
    again = np.linalg.inv(d.mass_matrix(q)) @ (tau - d.bias_torque(q, v))
    return d.inverse_dynamics(q, v, 0.5 * (a + again)) + 0.0 * d.gravity_torque(q)


@pytest.mark.parametrize("law", [saturated, operational_space, inverse_of_the_mass_matrix])
def test_a_batch_equals_single_rollouts(law: Callable[..., Any]) -> None:
    many, one = batch_and_one(ARM, Own(law), GOAL, q0=np.zeros(6), duration=0.1)
    assert np.abs(one.tau).max() > 1.0
    on_engine = simulate(ARM, Own(law), GOAL, q0=np.zeros(6), plant=ENGINES[0], duration=0.1)
    np.testing.assert_allclose(many.q_record[1], on_engine.q[1:], rtol=0.0, atol=1e-9)


def test_gains_and_starts_that_differ_between_rollouts() -> None:
    limits = np.array([[1.0] * 6, [20.0] * 6])
    q0 = np.array([np.zeros(6), np.full(6, 0.1)])
    many = simulate_batch(
        ARM, Own(saturated), GOAL, gains={"limit": limits}, q0=q0, duration=0.05, record_every=1
    )
    for row in range(2):
        alone = Own(saturated)
        alone.limit = limits[row]
        assert_same(many, row, simulate(ARM, alone, GOAL, q0=q0[row], plant="compiled", duration=0.05))


@dataclass(frozen=True)
class Fields(Controller[None], pure=True):
    """A controller whose numbers are plain fields, as a user writes them."""

    model: Model
    stiffness: float
    coupling: np.ndarray[Any, Any]
    limit: float = parameter("N m")
    axis: int = 1

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
        error = self.stiffness * (setpoint.q - measurement.q)
        return self.coupling @ error - 2.0 * measurement.v, None


def test_plain_fields_of_an_own_controller_differ_between_rollouts() -> None:
    rng = np.random.default_rng(4)
    stiffness, coupling = np.array([20.0, 40.0]), np.eye(6) + rng.uniform(-0.2, 0.2, (2, 6, 6))
    gains = {"stiffness": stiffness, "coupling": coupling.reshape(2, 36)}
    law = Fields(ARM, 1.0, np.eye(6), 5.0)
    options: dict[str, Any] = {"q0": np.zeros(6), "duration": 0.05}
    many = simulate_batch(ARM, law, GOAL, gains=gains, record_every=1, **options)
    for row in range(2):
        alone = Fields(ARM, stiffness[row], coupling[row], 5.0)
        assert_same(many, row, simulate(ARM, alone, GOAL, plant="compiled", **options))
    with pytest.raises(ArgumentError, match=r"no gain 'stifness'; it has stiffness, coupling, axis"):
        simulate_batch(ARM, law, GOAL, gains={"stifness": [1.0]}, **options)
    with pytest.raises(ArgumentError, match="no gain 'limit'"):
        simulate_batch(ARM, law, GOAL, gains={"limit": [1.0]}, **options)


class Averaging(Controller[np.ndarray[Any, Any]]):
    """A controller with a state, inside and outside of controllers of dynx."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def initial_state(self) -> np.ndarray[Any, Any]:
        return np.zeros(self.model.nv)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> tuple[Any, Any]:
        state = np.maximum(0.9 * state + 0.1 * measurement.v, -1.0)
        return 20.0 * (setpoint.q - measurement.q) - 5.0 * state + np.sin(measurement.t), state


def test_a_state_and_a_wrapper() -> None:
    batch_and_one(ARM, control.Saturated(Averaging(ARM), limit=4.0), GOAL, q0=np.zeros(6), duration=0.05)


class Pure(Own, pure=True):
    """A controller that is declared pure."""


@pytest.mark.parametrize(
    ("law", "executor"),
    [
        (saturated, "compiled pieces"),
        (lambda self, m, s: np.diag(self.kp) @ (s.q - m.q) - m.v, "plain: np.matmul is not rounded as"),
        (lambda self, m, s: -self.kd * m.v * np.sum(m.v**2), "plain: np.add is not rounded as"),
        (lambda self, m, s: -self.kd * m.v + random.random(), "plain: Pure.torque() depends on more"),
    ],
)
def test_compiled_steps_have_the_bits_of_numpy(law: Callable[..., Any], executor: str) -> None:
    scenario = Scenario(ARM, Pure(law), GOAL, q0=np.zeros(6), plant=ENGINES[0], duration=0.3)
    whole = simulate(scenario)
    assert whole.executor.startswith(executor)
    if "depends" in executor:
        return
    with Simulation(scenario) as simulation:
        simulation.step(300)
        np.testing.assert_array_equal(simulation.rollout.q, whole.q)
        np.testing.assert_array_equal(simulation.rollout.tau, whole.tau)


def global_variable(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
    """Return a damper's torque, and count."""
    global count
    count += 1
    return -measurement.v


def branching(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
    """Return a torque that depends on the side on which the robot is."""
    if measurement.q[0] > 0.0:
        return -measurement.v
    return -2.0 * measurement.v


ENGINE = dynx.backend("reference", ARM)
GENERATOR = np.random.default_rng(0)
REFUSED: dict[str, tuple[Callable[..., Any], str]] = {
    "generator": (
        lambda self, m, s: -m.v + GENERATOR.normal(size=6),
        "depends on more than .* in one call and",
    ),
    "global generator": (lambda self, m, s: -m.v * np.random.random(), "random numbers"),  # noqa: NPY002
    "module random": (lambda self, m, s: random.gauss(0.0, 1.0) * m.v, "one call"),
    "random branch": (lambda self, m, s: m.v * (1.0 if random.random() < 0.5 else 2.0), "depends on more"),
    "time": (lambda self, m, s: -m.v * time.perf_counter(), "the time"),
    "numbers alone": (lambda self, m, s: np.full(6, random.random()), "depends on more"),
    "argument of the dynamics": (
        lambda self, m, s: self.dynamics.inverse_dynamics(m.q, m.v, random.random() * m.v),
        "depends on more",
    ),
    "variable of the module": (global_variable, "changes count, a variable of its module"),
    "if": (branching, r"branches on a traced value .* use np\.where"),
    "engine": (lambda self, m, s: ENGINE.gravity_torque(m.q), r"control\.model_dynamics\(model, backend\)"),
    "array of floats": (lambda self, m, s: np.zeros(6).__setitem__(0, m.v[0]), r"np\.zeros_like"),
    "function": (lambda self, m, s: np.log(m.q), r"np\.log, which has no traced form"),
    "index": (lambda self, m, s: m.v[m.q > 0.0], "IndexError"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_compiled_is_refused_with_its_line(name: str) -> None:
    law, message = REFUSED[name]
    random.seed(1)
    with pytest.raises(UnsupportedFeatureError, match=message) as caught:
        simulate_batch(ARM, Own(law), GOAL, rollouts=3, duration=0.01)
    assert "(test_own_controllers.py, line " in str(caught.value)
    assert "Own cannot be compiled together with the plant" in str(caught.value)


def test_a_random_start_of_the_state_is_refused() -> None:
    class Starting(Averaging):
        def initial_state(self) -> np.ndarray[Any, Any]:
            return GENERATOR.normal(size=6)

    with pytest.raises(UnsupportedFeatureError, match=r"initial_state\(\) returns another state"):
        simulate_batch(ARM, Starting(ARM), GOAL, rollouts=3, duration=0.01)


def test_numbers_of_a_seed_are_the_same_in_every_call() -> None:
    def seeded(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
        return -measurement.v + np.random.default_rng(3).normal(size=6)

    batch_and_one(ARM, Own(seeded), GOAL, duration=0.02)


def test_dynamics_on_another_engine_and_of_another_robot() -> None:
    other = Own(saturated).on("reference").dynamics
    assert isinstance(other, EngineDynamics)
    assert other.backend.name == "reference"
    two = Own(lambda self, m, s: self.light.gravity_torque(m.q) - self.dynamics.gravity_torque(m.q))
    two.light = control.model_dynamics(ARM.with_gravity((0.0, 0.0, -1.0)), "reference")  # type: ignore[attr-defined]
    batch_and_one(ARM, two, GOAL, duration=0.02)
    with pytest.raises(dynx.errors.ArgumentError, match="the backend is for"):
        control.model_dynamics(dynx.load("panda"), ENGINE)


def test_divergence_has_the_time_of_the_step_whose_torque_is_not_finite() -> None:
    def root(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
        return np.sqrt(np.where(measurement.t > 0.0305, self.kp, 1.0)) - measurement.v

    law = Own(root)
    law.kp = np.full(6, -1.0)
    with np.errstate(invalid="ignore"), pytest.raises(ControlError, match=r"step 31, at 0\.031 s") as alone:
        simulate(ARM, law, GOAL, q0=np.zeros(6), plant="compiled", duration=0.05)
    several: tuple[tuple[float, dict[str, Any]], ...] = ((0.04, {}), (0.4, {"effort_limits": True}))
    for duration, options in several:
        gains = {"kp": np.array([-1.0, 1.0, -1.0])}
        many = simulate_batch(ARM, law, GOAL, q0=np.zeros(6), gains=gains, duration=duration, **options)
        np.testing.assert_array_equal(many.diverged, [alone.value.time, np.nan, alone.value.time])
        assert many.worst[[0, 2]].tolist() == [np.inf, np.inf]
        assert "3 of 3 done, 2 diverged, the first at 0.031 s>" in repr(many)
        assert "2 diverged, the first at 0.031 s" in many._repr_html_()


@pytest.mark.parametrize("torque", [np.inf, -np.inf])
def test_an_infinite_torque_ends_a_rollout_though_limits_would_make_it_finite(torque: float) -> None:
    def overflow(self: Own, measurement: Measurement, setpoint: Setpoint) -> Any:
        return np.where(measurement.t > 4.5e-3, torque, 0.0) - measurement.v

    for limits in (True, False):
        options: dict[str, Any] = {"q0": np.zeros(6), "duration": 0.01, "effort_limits": limits}
        with pytest.raises(ControlError, match=r"in step 5, .* not finite") as alone:
            simulate(ARM, Own(overflow), GOAL, plant="compiled", **options)
        many = simulate_batch(ARM, Own(overflow), GOAL, rollouts=2, **options)
        np.testing.assert_array_equal(many.diverged, 2 * [alone.value.time])
