"""Laws that a user writes: what they may remember, give and do, and what is said where they may not."""

from __future__ import annotations

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.control import PID, ComputedTorque, OpenLoop, Saturated
from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError, ControlError, UnsupportedFeatureError
from dynx.sim import Payload, Rollout, Scenario, Simulation, simulate, simulate_batch
from dynx.trajectory import cycloidal
from dynx.trajectory.base import Setpoint
from tests.sim.bars import tutorial_motion, tutorial_robot
from tests.sim.test_resume import the_same

ARM = tutorial_robot()
REST = np.zeros(6)
PLANTS = [name for name in ("pinocchio", "compiled", "pybullet") if name in installed_backends()]


class Remembering(Controller[Any]):
    """A damper that remembers how often it was asked, in the form that it is told."""

    def __init__(self, start: Any, counted: Any) -> None:
        self.model = ARM
        self._begin, self._counted = start, counted

    def initial_state(self) -> Any:
        return copy.deepcopy(self._begin)

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Any) -> tuple[Any, Any]:
        return -measurement.v, self._counted(state)


STATES: dict[str, Remembering] = {
    "float": Remembering(0.0, lambda state: state + 1.0),
    "int": Remembering(0, lambda state: state + 1),
    "tuple": Remembering((0, 0), lambda state: (state[0] + 1, 0)),
    "list": Remembering([], lambda state: [*state, 1]),
    "dict": Remembering({"n": 0}, lambda state: {"n": state["n"] + 1}),
    "table": Remembering(np.zeros((2, 6)), lambda state: state + 1.0),
    "integers": Remembering(np.zeros(3, dtype=int), lambda state: state + 1),
    "later": Remembering(None, lambda state: 1 if state is None else state + 1),
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("kind", STATES)
def test_a_controller_state_may_be_anything(kind: str, plant: str) -> None:
    law = STATES[kind]
    whole = simulate(ARM, law, REST, plant=plant, duration=0.3)
    the_same(simulate(ARM, law, REST, plant=plant, duration=0.3, resume=whole.first(20)), whole)


@pytest.mark.parametrize("kind", STATES)
def test_in_a_batch_the_controller_state_is_numbers(kind: str) -> None:
    with pytest.raises(UnsupportedFeatureError, match=r"state"):
        simulate_batch(ARM, STATES[kind], REST, rollouts=4, duration=0.01)


class Giving(Controller[None]):
    """A law that gives what it is told to."""

    def __init__(self, given: Any) -> None:
        self.model = ARM
        self._given = given

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
        return self._given, None


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    "given", [[1.0] * 6, (1,) * 6, np.ones(6, dtype=np.float32), np.ones(12)[::2], np.ones(6, dtype=">f8")]
)
def test_a_torque_may_be_any_numbers(given: Any, plant: str) -> None:
    found = simulate(ARM, Giving(given), REST, plant=plant, duration=0.02)
    the_same(found, simulate(ARM, Giving(np.ones(6)), REST, plant=plant, duration=0.02))


@pytest.mark.parametrize("given", [np.ones(5), 1.0])
def test_a_torque_of_another_shape_is_refused_in_a_batch(given: Any) -> None:
    with pytest.raises(UnsupportedFeatureError, match=r"shape .* wanted \(6,\)"):
        simulate_batch(ARM, Giving(given), REST, rollouts=4, duration=0.01)


class Integrating(Controller[None]):
    """A controller that keeps its integral in itself: by another array, in place, or in an object inside."""

    def __init__(self, kind: str) -> None:
        self.model = ARM
        self.total: Any = Total() if kind == "inside" else np.zeros(6)
        self._kind = kind

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
        error = setpoint.q - measurement.q
        if self._kind == "inside":
            self.total.value = self.total.value + error
            return 10.0 * error + self.total.value, None
        if self._kind == "in place":
            self.total += error
        else:
            self.total = self.total + error
        return 10.0 * error + self.total, None


class Total:
    """A sum in an object of its own."""

    def __init__(self) -> None:
        self.value = np.zeros(6)


@pytest.mark.parametrize("q0", [REST, REST + 0.1])
@pytest.mark.parametrize("kind", ["in place", "another array", "inside"])
@pytest.mark.parametrize("wrapped", [True, False])
def test_a_controller_that_changes_itself_is_recorded_and_not_repeated(
    kind: str, wrapped: bool, q0: np.ndarray[Any, Any]
) -> None:
    def scenario() -> Scenario:
        inner = Integrating(kind)
        controller = Saturated(inner, limit=100.0) if wrapped else inner
        return Scenario(ARM, controller, REST, q0=q0, payload=Payload("tool0", 1.0), duration=0.04)

    error = r"changes itself \(attribute total\).*neither repeated nor resumed"
    rollout = simulate(scenario())
    assert ["changes itself (attribute total)" in each for each in rollout.departures] == [True]
    with pytest.raises(ArgumentError, match=r"does not follow from its scenario alone|changes itself"):
        simulate(scenario(), resume=rollout.first(20))
    stepped = [Simulation(scenario()) for _ in range(2)]
    for simulation, use in zip(stepped, ("save", "reset"), strict=True):
        saved = simulation.save()
        simulation.step(20)
        with pytest.raises(ArgumentError, match=error):
            getattr(simulation, use)()
        with pytest.raises(ArgumentError, match=error):
            simulation.restore(saved)
    with pytest.raises(ArgumentError, match=error):
        simulate(scenario(), resume=stepped[0].rollout)
    with pytest.raises(UnsupportedFeatureError, match=r"changes itself|cannot be compiled"):
        simulate_batch(replace(scenario(), plant="compiled"), rollouts=4)


@pytest.mark.parametrize("torque", [REST, [0.0] * 6, (0.0,) * 6, None])
def test_a_torque_without_a_state_is_named_as_such(torque: Any) -> None:
    class Alone(Giving):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            return self._given

    error = r"torque must return \(tau, state\).*it returned"
    with pytest.raises(ControlError, match=f"controller Alone failed in step 0, at 0 s: {error}"):
        simulate(ARM, Alone(torque), REST, duration=0.01)
    with pytest.raises(ControlError, match=error), Simulation(Scenario(ARM, Alone(torque), REST)) as one:
        one.step()
    with pytest.raises(ArgumentError, match=f"Alone: {error}"):
        simulate_batch(ARM, Alone(torque), REST, rollouts=4, duration=0.01)


def test_a_law_without_a_model_is_told_so() -> None:
    class Nowhere(Controller[None]):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
            return np.zeros(6), None

    for ask in (simulate, simulate_batch):
        with pytest.raises(ArgumentError, match=r"Nowhere has no model; a controller sets self\.model"):
            ask(ARM, Nowhere(), REST, duration=0.01)


def test_an_exception_reads_as_what_it_is() -> None:
    class Dividing(Giving):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
            return 1 / 0, None

    with pytest.raises(ControlError, match=r"Dividing failed in step 0, at 0 s: ZeroDivisionError: division"):
        simulate(ARM, Dividing(None), REST, duration=0.01)


def resumed(whole: Rollout, law: Controller[Any], reference: Any) -> Rollout:
    return simulate(ARM, law, reference, duration=0.05, resume=whole, step=20)


def test_a_record_is_not_resumed_with_other_gains_or_another_reference() -> None:
    law = ComputedTorque(ARM, kp=400, kd=40)
    whole = simulate(ARM, law, tutorial_motion(), duration=0.05)
    the_same(
        resumed(whole, ComputedTorque(ARM, kp=400, kd=40, backend="pinocchio"), tutorial_motion()), whole
    )
    with pytest.raises(ArgumentError, match=r"had controller.*now it is"):
        resumed(whole, ComputedTorque(ARM, kp=401, kd=40), tutorial_motion())
    with pytest.raises(ArgumentError, match=r"had reference.*now it is"):
        resumed(whole, law, cycloidal(REST, REST + 0.01, duration=2.0))
    with pytest.raises(ArgumentError, match=r"had reference.*now it is"):
        resumed(whole, law, REST)


def test_the_numbers_of_a_law_are_in_the_record() -> None:
    inner = PID(ARM, kp=1, ki=2, kd=3, control_dt=1e-3, limit=5.0)
    found = simulate(ARM, Saturated(inner, limit=4.0), REST, duration=0.01).settings["law"]
    assert found["limit"] == [4.0] * 6
    assert found["inner"]["law"] == "PID"
    assert (found["inner"]["ki"], found["inner"]["limit"]) == ([2.0] * 6, [5.0] * 6)
    table = simulate(ARM, OpenLoop(ARM, np.ones((40, 6)), control_dt=1e-3), duration=0.01).settings["law"]
    assert table["torques"].startswith("sha256 ")
