"""Classes of a user's own in a scenario: their code is not compared; a file may have a fingerprint alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
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


def damper(gain: float) -> Any:
    """Return a new class of a controller with its own code."""

    class Damper(Controller[None]):
        def __init__(self, model: Any, number: float) -> None:
            self.model, self.number = model, number

        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            return -gain * measurement.v, None

    return Damper


def test_the_code_of_a_class_is_not_compared_and_the_document_says_so() -> None:
    one, other = (
        Scenario(PENDULUM, damper(gain)(PENDULUM, 1.0), [0.0], q0=[0.3], duration=0.02) for gain in (2.0, 3.0)
    )
    assert one == other == Scenario.from_json(one.to_json())
    assert json.loads(one.to_json())["controller"]["code"] == "not checked"
    assert one != replace(one, controller=damper(2.0)(PENDULUM, 1.5))
    whole = simulate(one)
    resumed = simulate(other, resume=whole.first(5))
    assert np.array_equal(resumed.q[:6], whole.q[:6])
    assert not np.array_equal(resumed.q, whole.q)


def test_a_checksum_of_code_in_an_older_file_is_ignored(registered: None) -> None:
    scenario = Scenario(PENDULUM, Registered(PENDULUM), Sloped(0.02, REST, REST))
    older = Scenario.from_json(scenario.to_json().replace("not checked", "0" * 64))
    assert older == scenario
    assert isinstance(older.controller, Registered)
    own = Scenario(PENDULUM, damper(2.0)(PENDULUM, 1.0), [0.0], duration=0.02)
    assert Scenario.from_json(own.to_json().replace("not checked", "0" * 64)) == own


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
