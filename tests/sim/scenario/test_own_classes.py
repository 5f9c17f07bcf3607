"""Classes of a user's own in a scenario: their code is compared; a fingerprint in a file is named as one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from dynx import control
from dynx.control import registry
from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Scenario, simulate
from dynx.sim.scenario.documents import Unknown
from dynx.trajectory.base import Setpoint, Trajectory

PENDULUM = load("pendulum")
REST = Setpoint(np.zeros(1), np.zeros(1), np.zeros(1))


def damper(gain: Any, code: str = "-gain * measurement.v", head: str = "", scale: float = 1.0) -> Any:
    """Return a class of a controller with a text for its torque and an enclosed constant."""
    text = (
        "def made(Controller, gain):\n"
        "    class Damper(Controller):\n"
        "        def __init__(self, model, number):\n"
        "            self.model, self.number = model, number\n"
        f"{head}"
        "        def torque(self, measurement, setpoint, state):\n"
        f"            return (lambda: SCALE * ({code}))(), None\n"
        "    return Damper\n"
    )
    space: dict[str, Any] = {"__name__": "notebook", "SCALE": scale}
    exec(text, space)
    return space["made"](Controller, gain)


SAME: dict[str, Callable[[], Any]] = {
    "again": lambda: damper(2.0),
    "other lines": lambda: damper(2.0, head="\n\n        # a comment\n\n"),
}
OTHERS: dict[str, Callable[[], Any]] = {
    "closure": lambda: damper(2.5),
    "closure type": lambda: damper(2),
    "array closure": lambda: damper(np.array([2.0])),
    "constant": lambda: damper(2.0, "-1.5 * gain * measurement.v"),
    "operator": lambda: damper(2.0, "gain * measurement.v"),
    "attribute": lambda: damper(2.0, "-gain * measurement.q"),
    "class attribute": lambda: damper(2.0, head="        lead = 1\n"),
    "method": lambda: damper(2.0, head="        def name(self): return 1\n"),
    "number of the module": lambda: damper(2.0, scale=2.0),
    "not comparable": lambda: damper(iter([2.0]), "-2.0 * measurement.v if gain else 0"),
}


def scenario_with(kind: Any) -> Scenario:
    return Scenario(PENDULUM, kind(PENDULUM, 1.0), [0.0], q0=[0.3], duration=0.02)


@pytest.mark.parametrize("name", SAME)
def test_equal_code_is_equal_and_resumes(name: str) -> None:
    one, other = scenario_with(damper(2.0)), scenario_with(SAME[name]())
    assert one == other == Scenario.from_json(one.to_json())
    whole = simulate(one)
    assert np.array_equal(simulate(other, resume=whole.first(5)).q, whole.q)


@pytest.mark.parametrize("name", OTHERS)
def test_other_code_is_unequal_and_is_not_resumed(name: str) -> None:
    one, other = scenario_with(damper(2.0)), scenario_with(OTHERS[name]())
    assert one != other
    assert Scenario.from_json(one.to_json()) != other
    with pytest.raises(
        ArgumentError, match=r"had controller\.code of the class .*now it is|had controller\."
    ):
        simulate(other, resume=simulate(one).first(5))


def test_what_cannot_be_compared_equals_itself_alone() -> None:
    code = "-2.0 * measurement.v if gain else 0"
    one, other = (scenario_with(damper(iter([2.0]), code)) for _ in range(2))
    assert one == replace(one, duration=0.02)
    assert one != other


def test_the_content_key_of_a_controller_has_the_code_of_its_class() -> None:
    keys = [kind(PENDULUM, 1.0).content_key() for kind in (damper(2.0), damper(2.0), damper(3.0))]
    assert keys[0] == keys[1] != keys[2]


class Waving(Trajectory):
    """A trajectory that is no dataclass of its own."""

    def inside(self, t: Any) -> Setpoint:
        q = np.sin(np.outer(t, [1.0]))
        return Setpoint(q, q, q)


def test_a_trajectory_of_ones_own_survives_its_file_as_a_fingerprint() -> None:
    scenario = Scenario(PENDULUM, control.PD(PENDULUM, kp=1.0, kd=1.0), Waving(0.02, REST, REST))
    read = Scenario.from_json(scenario.to_json())
    assert isinstance(read.reference, Unknown)
    assert read == scenario
    assert read != replace(scenario, reference=Waving(0.03, REST, REST))
    with pytest.raises(ArgumentError, match=r"Waving was read from a file.*only its fingerprint.*dataclass"):
        simulate(read)


@dataclass(frozen=True, eq=False, repr=False)
class Sloped(Trajectory):
    """A declared trajectory."""

    def inside(self, t: Any) -> Setpoint:
        q = np.outer(t, [1.0])
        return Setpoint(q, q, q)


@dataclass(frozen=True, eq=False, repr=False)
class Registered(Controller[None]):
    """A controller that a file rebuilds."""

    model: Any
    gain: float = 1.0

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
        return -self.gain * measurement.v, None


@pytest.fixture
def registered() -> Iterator[None]:
    control.register_controller("registered", lambda: Registered)
    yield
    registry.unregister("registered")


def test_a_class_whose_code_changed_since_is_not_rebuilt(
    registered: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = Scenario(PENDULUM, Registered(PENDULUM), Sloped(0.02, REST, REST))
    read = Scenario.from_json(scenario.to_json())
    assert isinstance(read.controller, Registered)
    assert isinstance(read.reference, Sloped)
    assert read == scenario
    text = scenario.to_json()
    for kind, name in ((Registered, "torque"), (Sloped, "inside")):
        with monkeypatch.context() as patch:
            patch.setattr(kind, name, lambda *given: given)
            changed = Scenario.from_json(text)
            assert changed != Scenario(PENDULUM, Registered(PENDULUM), Sloped(0.02, REST, REST))
            with pytest.raises(ArgumentError, match=f"(?i){kind.__name__} was read.*code of its class"):
                simulate(changed)


def test_a_controller_that_is_not_registered_is_told_to_be(registered: None) -> None:
    text = Scenario(PENDULUM, Registered(PENDULUM), [0.0], duration=0.02).to_json()
    registry.unregister("registered")
    try:
        with pytest.raises(ArgumentError, match=r"dynx\.controllers or dynx\.control\.register_controller"):
            simulate(Scenario.from_json(text))
        other = Scenario(PENDULUM, Registered(PENDULUM), [0.0], duration=0.02)
        with pytest.raises(ArgumentError, match=r"not registered:.*register_controller"):
            simulate(Scenario.from_json(other.to_json()))
    finally:
        control.register_controller("registered", lambda: Registered)


def test_a_resumed_scenario_names_the_attribute_that_differs() -> None:
    arm = load("ur5")
    whole = simulate(arm, q0=np.zeros(6), duration=0.005)
    heavy = replace(arm.links[2], inertial=replace(arm.links[2].inertial, mass=9.0))  # type: ignore[type-var]
    links = (*arm.links[:2], heavy, *arm.links[3:])
    for model, hint in (
        (arm.with_gravity([0, 0, -1.0]), r"gravity \(0\.0, 0\.0, -9\.81\); now it is \(0.*-1\.0\)"),
        (load("ur5", lock={"elbow_joint": 0.1}), r"type of joint 'elbow_joint' revolute; now it is fixed"),
        (replace(arm, links=links), r"mass of inertial of link '.*' .*; now it is 9\.0"),
        (replace(arm, name="other"), r"name ur5.*; now it is other"),
    ):
        with pytest.raises(ArgumentError, match=hint):
            simulate(model, duration=0.005, resume=whole)
    stiff = Scenario(arm, control.PD(arm, kp=1.0, kd=1.0), np.zeros(6), duration=0.005)
    whole = simulate(stiff)
    with pytest.raises(ArgumentError, match=r"had controller\.kp \[1\.0.*now it is \[2\.0"):
        simulate(replace(stiff, controller=control.PD(arm, kp=2.0, kd=1.0)), resume=whole)
    with pytest.raises(ArgumentError, match=r"had controller PD\(kp .*; now it is Velocity\(kd"):
        simulate(replace(stiff, controller=control.Velocity(arm, kd=1.0)), resume=whole)
