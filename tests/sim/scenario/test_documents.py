"""A scenario goes to JSON and back without losing a bit; what cannot be rebuilt can still be compared."""

from __future__ import annotations

import json
import pickle
import sys
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx import ExternalForce, control, trajectory
from dynx.control.base import Controller, Measurement
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Scenario, simulate
from dynx.sim.scenario.documents import Unknown
from dynx.testing.strategies import models
from dynx.trajectory.base import Setpoint

ARM = load("ur5")
START, END = np.zeros(6), np.full(6, 0.3)
CONTROLLERS: list[Controller[Any] | None] = [
    None,
    control.PD(ARM, kp=[1.1, 2, 3, 4, 5, 6], kd=0.1),
    control.PID(ARM, kp=1 / 3, ki=2, kd=3, control_dt=1e-3, limit=5.0),
    control.ComputedTorque(ARM, natural_frequency=20.0, backend="reference"),
    control.DiscreteComputedTorque(ARM, control_dt=1e-3),
    control.FeedForward(ARM, kp=1.0, kd=0.1),
    control.OpenLoop(ARM, np.cos(np.arange(12.0)).reshape(2, 6), control_dt=1e-3),
    control.Saturated(control.GravityCompensatedPD(ARM, kp=1, kd=0.1), limit=20.0),
    control.FrictionCompensation(control.PD(ARM, kp=1, kd=0.1), damping=0.1, friction=0.2),
    control.OperationalSpace(ARM, "tool0", kp=100, kd=20),
    control.BulletPositionMotor(ARM),
    control.PD(load("ur5").with_gravity([0, 0, -1.62]), kp=1.0, kd=0.1),
]
REFERENCES: list[Any] = [
    None,
    END,
    trajectory.cycloidal(START, END, duration=1 / 3),
    trajectory.quintic(START, END, duration=1.0),
    trajectory.trapezoidal(START, END, velocity=1.0, acceleration=2.0),
    trajectory.spline([0.0, 1.0, 2.0], [START, END, START]),
    trajectory.concatenate(
        trajectory.cubic(START, END, duration=1.0), trajectory.cubic(END, START, duration=1.0)
    ),
]
LIMITS: list[Any] = [False, True, 3.0, [1.0, 2.0, 3.0, 4.0, 5.0, np.inf]]
LINKS = [link.name for link in ARM.links][1:4]
numbers = st.floats(min_value=1e-6, max_value=1e6)


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    push = ExternalForce("tool0", draw(st.lists(numbers, min_size=6, max_size=6)), start=draw(numbers))
    return Scenario(
        ARM,
        draw(st.sampled_from(CONTROLLERS)),
        draw(st.sampled_from(REFERENCES)),
        plant=draw(st.sampled_from(["pinocchio", "pybullet", "compiled"])),
        duration=draw(st.none() | numbers),
        noise=draw(st.none() | st.builds(Noise, numbers, numbers, st.integers(0, 9))),
        joint_damping=draw(st.booleans() | numbers),
        effort_limits=draw(st.sampled_from(LIMITS)),
        payload=draw(st.none() | st.builds(Payload, st.just("tool0"), numbers)),
        mass_scale=draw(numbers | st.dictionaries(st.sampled_from(LINKS), numbers)),
        pushes=draw(st.sampled_from([[], [push]])),
    )


@settings(max_examples=40)
@given(scenario=scenarios())
def test_a_scenario_survives_json_and_pickling(scenario: Scenario) -> None:
    text = scenario.to_json()
    read = Scenario.from_json(text)
    assert read == scenario
    assert hash(read) == hash(scenario)
    assert read.to_json() == text
    assert pickle.loads(pickle.dumps(scenario)) == scenario
    assert repr(scenario).startswith("Scenario(ur5")


@settings(max_examples=20)
@given(model=models())
def test_any_robot_survives(model: Any) -> None:
    assert Scenario.from_json(Scenario(model).to_json()) == Scenario(model)


@pytest.mark.parametrize("reference", REFERENCES[2:])
def test_a_trajectory_that_was_read_gives_the_same_bits(reference: Any) -> None:
    read: Any = Scenario.from_json(Scenario(ARM, reference=reference).to_json()).reference
    times = np.linspace(-0.1, 2.5, 50)
    for one, other in zip(reference(times), read(times), strict=True):
        assert np.array_equal(one, other)


class Opaque(Controller[None]):
    """A controller whose class declares no fields."""

    def __init__(self, gain: float) -> None:
        self.model, self.gain = ARM, gain

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
        return -self.gain * measurement.v, None


@dataclass(frozen=True, eq=False, repr=False)
class Ramp(trajectory.Trajectory):
    """A trajectory of somebody else's that declares its fields."""

    slope: float = 1.0

    def inside(self, t: Any) -> Setpoint:
        q = np.outer(t, np.full(6, self.slope))
        return Setpoint(q, np.full_like(q, self.slope), np.zeros_like(q))


def test_a_controller_without_declared_fields_is_compared_and_not_rebuilt() -> None:
    scenario = Scenario(ARM, Opaque(0.5), END, duration=0.01)
    read = Scenario.from_json(scenario.to_json())
    assert isinstance(read.controller, Unknown)
    assert read == scenario
    assert read != replace(scenario, controller=Opaque(0.6))
    assert read.controller.numbers["gain"] == 0.5
    with pytest.raises(ArgumentError, match="Opaque was read from a file"):
        simulate(read)


def test_a_declared_trajectory_of_ones_own_is_rebuilt() -> None:
    rest = Setpoint(np.zeros(6), np.zeros(6), np.zeros(6))
    ramp = Ramp(1.0, rest, rest, slope=0.3)
    read = Scenario.from_json(Scenario(ARM, reference=ramp).to_json()).reference
    assert isinstance(read, Ramp)
    assert np.array_equal(read([0.5]).q, ramp([0.5]).q)


@pytest.mark.parametrize(
    ("change", "hint"),
    [
        ({"schema": "dynx.scenario/0"}, "schema"),
        ({"joint_damqing": 1.0}, "did you mean 'joint_damping'"),
        ({"model": {"model": {"urdf": "<robot/>"}}}, "cannot be read"),
        ({"reference": {"class": "dynx.no_such:Thing", "fields": {}}}, "cannot be read"),
        ({"reference": {"class": "dynx.trajectory.base:Setpoint", "fields": {"x": 1}}}, "cannot be read"),
    ],
)
def test_a_document_of_another_form_is_refused(change: dict[str, Any], hint: str) -> None:
    with pytest.raises(ArgumentError, match=hint):
        Scenario.from_dict({**json.loads(Scenario(ARM).to_json()), **change})
    for text in ("{", "[]", "{}"):
        with pytest.raises(ArgumentError):
            Scenario.from_json(text)


@pytest.mark.parametrize(
    "name",
    [
        "this:Zen",
        "dynx.training.library:Monitor",
        "dynx.viewer.page:Page",
        "dynx.__main__:main",
        "dynx.testing.plugin:Any",
        "dynx.cli.shell.main:LazyCommand",
        "dynx.sim.scenario.documents:json.decoder.JSONDecoder",
        "dynx.sim.scenario.scenario:Rollout",
        "sys:flags.__class__",
        "os:stat_result",
    ],
)
def test_a_file_imports_nothing(name: str) -> None:
    document = json.loads(Scenario(ARM).to_json())
    document["reference"] = {"class": name, "fields": {}}
    before = set(sys.modules)
    assert isinstance(Scenario.from_dict(document).reference, Unknown)
    assert set(sys.modules) == before


def test_a_controller_that_is_not_registered_is_named() -> None:
    document = json.dumps({"controller": {"controller": "Absent"}, "model": {}})
    assert "no controller 'Absent' is registered here" in Unknown("Absent", document).why
