"""States are equal where their numbers are."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.steppers.state import BodyState, PartStates, RobotState, WorldState


def world_state(q: float = 0.1, time: float = 0.5) -> WorldState:
    body = BodyState(np.eye(4), np.zeros(6))
    return WorldState(time, PartStates(arm=RobotState(np.array([q, 0.2]), np.zeros(2))), PartStates(box=body))


@pytest.mark.parametrize(
    ("state", "other"),
    [
        (lambda: RobotState(np.zeros(2), np.ones(2)), RobotState(np.zeros(2), np.array([1.0, 2.0]))),
        (lambda: RobotState(np.zeros(2), np.ones(2)), RobotState(np.zeros(3), np.ones(2))),
        (lambda: RobotState(np.zeros(2), np.ones(2)), (np.zeros(2), np.ones(2))),
        (lambda: BodyState(np.eye(4), np.zeros(6)), BodyState(np.eye(4), np.ones(6))),
        (lambda: dynx.sim.SimulationState(0.0, np.zeros(2), np.ones(2)), RobotState(np.zeros(2), np.ones(2))),
        (world_state, world_state(q=0.3)),
        (world_state, world_state(time=0.6)),
    ],
)
def test_a_state_equals_one_with_the_same_numbers(state: Any, other: object) -> None:
    ours = state()
    # Both operators: a tuple has its own for each.
    assert operator.eq(ours, state())
    assert not operator.ne(ours, state())
    assert operator.ne(ours, other)
    assert not operator.eq(ours, other)


def test_the_state_of_a_simulation_that_is_set_back_equals_the_first() -> None:
    with dynx.Simulation(dynx.Scenario(dynx.load("six_axis_arm"), duration=0.1)) as simulation:
        first = simulation.state
        assert simulation.step(5) != first
        assert simulation.reset() == first
