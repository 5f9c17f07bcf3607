"""Objects without declared fields are compared by all that they hold: values, closures and engines."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from dynx import ExternalForce
from dynx.backends import backend
from dynx.control import PD, register_controller, unregister_controller
from dynx.control.base import Controller, Measurement, Wrapper
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim import Payload, Scenario, simulate
from dynx.trajectory.base import Setpoint

ARM = load("pendulum")
LIGHT = ARM.with_gravity([0.0, 0.0, -1.0])


class Holder(Controller[None]):
    """A controller that holds anything."""

    def __init__(self, held: Any) -> None:
        self.model, self.held = ARM, held

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
        return np.zeros(1), None


def times(factor: float) -> Callable[[float], float]:
    return lambda x: factor * x


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (lambda x, k=1: k * x, lambda x, k=2: k * x),
        (times(1.0), times(2.0)),
        (partial(max, 1), partial(max, 2)),
        (np.sin, np.cos),
        (int, float),
        ([1].index, [2].index),
        (b"a", b"b"),
        (1j, 2j),
        (np.array([1j]), np.array([2j])),
        ({"a", "b"}, {"a", "c"}),
        (deque([1]), deque([2])),
        (np.random.default_rng(1), np.random.default_rng(2)),
        (backend("reference", ARM), backend("reference", LIGHT)),
    ],
)
def test_another_content_is_another_scenario(one: Any, other: Any) -> None:
    scenario = Scenario(ARM, Holder(one), duration=0.01)
    assert scenario == replace(scenario, controller=Holder(one))
    assert scenario == Scenario.from_json(scenario.to_json())
    assert scenario != replace(scenario, controller=Holder(other))


def test_equal_closures_are_equal() -> None:
    assert Scenario(ARM, Holder(times(2.0))) == Scenario(ARM, Holder(times(2.0)))


def test_an_inner_controller_of_another_model_is_compared_with_its_model() -> None:
    @dataclass(frozen=True)
    class Around(Wrapper[None]):
        def __init__(self, inner: Controller[None]) -> None:
            super().__init__(inner)
            self._set(model=ARM)

        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> Any:
            return self.inner.torque(measurement, setpoint, state)

    register_controller("Around", lambda: Around)
    try:
        ours, theirs = (Scenario(ARM, Around(PD(model, kp=1, kd=1))) for model in (ARM, LIGHT))
        assert ours != theirs
        assert Scenario.from_json(ours.to_json()) == ours
    finally:
        unregister_controller("Around")


def test_a_list_an_array_and_another_order_are_equal() -> None:
    arm = load("ur5")
    scenarios = [
        Scenario(
            arm,
            payload=Payload("tool0", 1.0, center=kind([0.0, 0.0, 0.1])),
            pushes=[ExternalForce("tool0", kind([1.0, 0, 0, 0, 0, 0]))],
            mass_scale={"forearm_link": 1.1, "wrist_1_link": 1.2},
        )
        for kind in (list, np.array, tuple)
    ]
    backwards = replace(scenarios[0], mass_scale={"wrist_1_link": 1.2, "forearm_link": 1.1})
    assert all(each == scenarios[0] for each in (*scenarios, backwards))


def test_a_zero_beside_a_scenario_is_no_default() -> None:
    damped = Scenario(ARM, joint_damping=0.5, duration=0.01)
    with pytest.raises(ArgumentError, match="joint_damping is given in addition to a scenario"):
        simulate(damped, joint_damping=0)
    assert "damping=0" in repr(replace(damped, joint_damping=0))


def test_payloads_and_pushes_of_another_type_are_refused() -> None:
    wrong: Any = 5.0
    for name in ("payload", "pushes"):
        for value in (wrong, [wrong]):
            options: dict[str, Any] = {name: value}
            with pytest.raises(ArgumentError, match=f"{name} is .*; wanted a"):
                Scenario(ARM, **options)
