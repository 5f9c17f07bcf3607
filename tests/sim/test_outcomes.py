"""What `torque` returns has one meaning for plain and compiled steps and for batches."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest

from dynx.control import Controller
from dynx.control.base import Measurement
from dynx.errors import ArgumentError, ControlError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim import Scenario, Simulation, simulate, simulate_batch
from dynx.trajectory.base import Setpoint
from tests.backends.robots import chain
from tests.sim.test_compiled_loop import both, glue
from tests.sim.test_resume import the_same

ROBOT = chain(2, "prismatic")
GOAL = np.array([0.1, -0.2])
DURATION = 0.04


class Returning(Controller[Any], pure=True):
    """Spring whose state changes its form from one control step to the next."""

    def __init__(self, model: Model, start: Any = None) -> None:
        self.model = model
        self._start = start

    def initial_state(self) -> Any:
        return None if self._start is None else np.array(self._start)


class Surprising(Returning, pure=True):
    """The spring acts only while there is no state."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> Any:
        stiffness = 9.0 if state is None else 0.0
        return stiffness * (setpoint.q - measurement.q), measurement.q + 1.0


class Growing(Returning, pure=True):
    """The state gets an entry more in each control step."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> Any:
        return state[0] * (setpoint.q - measurement.q), np.concatenate([state, state[:1]])


class Forgetting(Returning, pure=True):
    """The state is dropped after the first control step."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> Any:
        stiffness = 0.0 if state is None else 9.0
        return stiffness * (setpoint.q - measurement.q), None


class Alone(Returning, pure=True):
    """Returns a torque without a state."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> Any:
        return setpoint.q - measurement.q


class Short(Returning, pure=True):
    """Returns a torque for the first joint only."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> Any:
        return (setpoint.q - measurement.q)[:1], None


@pytest.mark.parametrize(
    ("controller", "words"),
    [
        (Surprising(ROBOT), r"it returns a state, but its initial_state\(\) returns None"),
        (Growing(ROBOT, [4.0]), r"it returns a state of shape \(2,\); that of initial_state\(\) is \(1,\)"),
        (
            Forgetting(ROBOT, [4.0]),
            r"it returns None as its state, but its initial_state\(\) returns an",
        ),
    ],
)
def test_compiled_steps_never_lose_a_state(controller: Controller[Any], words: str) -> None:
    found = both(ROBOT, controller, GOAL, plant="compiled", duration=DURATION, glued=False)
    with glue(on=True):
        again = simulate(ROBOT, controller, GOAL, plant="compiled", duration=DURATION)
    the_same(again, found)
    assert re.match(f"plain: {words}", again.executor)
    with Simulation(Scenario(ROBOT, controller, GOAL, plant="compiled", duration=DURATION)) as simulation:
        for _ in range(len(found)):
            simulation.step()
        np.testing.assert_array_equal(simulation.state.q, found.q[-1])
    with pytest.raises(UnsupportedFeatureError, match=f"cannot be compiled together with the plant: {words}"):
        simulate_batch(ROBOT, controller, GOAL, rollouts=2, duration=DURATION)


@pytest.mark.parametrize(
    ("controller", "in_batch", "words"),
    [
        (
            Alone(ROBOT),
            ArgumentError,
            r"torque must return \(tau, state\).*it returned an array of shape \(2,\)",
        ),
        (Short(ROBOT), UnsupportedFeatureError, r"its torque has shape \(1,\); wanted \(2,\)"),
    ],
)
def test_a_wrong_torque_has_one_message(
    controller: Controller[Any], in_batch: type[Exception], words: str
) -> None:
    name = type(controller).__name__
    with glue(on=True), pytest.raises(ControlError, match=f"controller {name} failed in step 0.*: {words}"):
        simulate(ROBOT, controller, GOAL, plant="compiled", duration=DURATION)
    with pytest.raises(in_batch, match=f"{name}.*: {words}"):
        simulate_batch(ROBOT, controller, GOAL, rollouts=2, duration=DURATION)
