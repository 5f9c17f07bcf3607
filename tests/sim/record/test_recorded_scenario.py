"""The scenario of a record says what ran, whatever is done to a controller of the user's own afterwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.control.base import Controller, Measurement
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

ARM = dynx.load("double_pendulum")


class Damper(Controller[None]):
    """A controller whose attributes can be changed."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.kd = np.ones(model.nv)
        self.table = {"gain": 1.0}

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return -self.kd * self.table["gain"] * measurement.v, None


def scenarios() -> list[dynx.Scenario]:
    shared: dict[str, Any] = {
        "reference": ARM.neutral(),
        "duration": 0.01,
        "v0": np.ones(2),
        "plant": "compiled",
    }
    return [
        dynx.Scenario(ARM, Damper(ARM), **shared),
        dynx.Scenario(ARM, control.Saturated(Damper(ARM), limit=5.0), **shared),
    ]


def innermost(scenario: Any) -> Any:
    return list(control.base.chain_of(scenario.controller))[-1]


def record_of(kind: str, scenario: dynx.Scenario) -> Any:
    """Return what has the scenario of a simulation."""
    if kind == "batch":
        return dynx.simulate_batch(scenario, v0=np.ones((3, 2)))
    if kind == "rollout":
        return dynx.simulate(scenario)
    return dynx.Simulation(scenario)


@pytest.mark.parametrize("kind", ["rollout", "simulation", "batch"])
@pytest.mark.parametrize("scenario", scenarios(), ids=["own", "wrapped"])
def test_a_change_of_the_controller_of_a_record_has_no_effect(kind: str, scenario: dynx.Scenario) -> None:
    record = record_of(kind, scenario)
    before = record.scenario.to_json()
    changes: tuple[Callable[[Any], None], ...] = (
        lambda own: own.__setattr__("kd", np.zeros(2)),
        lambda own: own.__setattr__("new", 1.0),
        lambda own: own.table.__setitem__("gain", 7.0),
        lambda own: own.kd.__setitem__(0, 9.0),
    )
    for change in changes:
        change(innermost(record.scenario))
        assert record.scenario.to_json() == before
        change(innermost(scenario))
        assert record.scenario.to_json() == before
    assert record.scenario == record.scenario


def test_a_record_without_a_scenario_and_a_record_with_another_one_are_made_by_replace() -> None:
    first, second = scenarios()
    rollout = dynx.simulate(first)
    assert replace(rollout, scenario=None).scenario is None
    other = replace(rollout, scenario=second)
    assert other.scenario is not None
    assert other.scenario == second
    assert rollout.scenario == first


def test_a_scenario_with_dynx_controllers_is_not_copied() -> None:
    law = control.PD(ARM, kp=1.0, kd=1.0)
    scenario = dynx.Scenario(ARM, law, ARM.neutral(), duration=0.01)
    rollout = dynx.simulate(scenario)
    assert rollout.scenario is scenario
