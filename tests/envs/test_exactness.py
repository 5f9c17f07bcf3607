"""CartPole, Pendulum and Acrobot repeat Gymnasium's environments step by step and episode by episode."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from benchmarks.environments.exactness import (
    PAIRS,
    VECTOR,
    Pair,
    Visited,
    largest_difference,
    parted_episodes,
    stepper,
    visited,
)
from dynx.backends import installed_backends
from dynx.envs.tasks.cart_pole import CartPole

MAX_DIFFERENCE = 1e-13
"""Largest difference of a state after one step: the bar of the environments (docs/environments.md)."""

ENGINES = ("compiled", "mujoco", "pinocchio", VECTOR)


@pytest.fixture(scope="module", params=PAIRS, ids=lambda pair: pair.name)
def pair_and_steps(request: pytest.FixtureRequest) -> tuple[Pair, Visited]:
    return request.param, visited(request.param, 200, 2)


@pytest.mark.parametrize("engine", ENGINES)
def test_steps_and_episodes_are_those_of_gymnasium(engine: str, pair_and_steps: tuple[Pair, Visited]) -> None:
    if engine not in (*installed_backends(), VECTOR):
        pytest.skip(f"needs {engine}")
    pair, steps = pair_and_steps
    few = Visited(*(column[:200] for column in steps))
    assert max(largest_difference(few, stepper(pair.task, engine))) < MAX_DIFFERENCE
    assert parted_episodes(pair.task, steps, engine, 2) == 0


def test_episodes_in_batches_end_where_those_of_gymnasium_do() -> None:
    pair = PAIRS[0]
    steps = visited(pair, 1, 10)
    assert parted_episodes(pair.task, steps, "reference", 10, batch=True) == 0
    assert parted_episodes(CartPole(pole_mass=0.3), steps, "reference", 10, batch=True) > 0


@pytest.mark.parametrize("name", ["CartPole", "Pendulum"])
def test_seeds_start_the_episodes_of_gymnasium(name: str) -> None:
    ours: Any = gymnasium.make(f"dynx/{name}-v0", engine="reference")
    theirs: Any = gymnasium.make(f"{name}-v1")
    for seed in (0, 7):
        assert np.array_equal(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0])
    assert np.array_equal(ours.reset()[0], theirs.reset()[0])
