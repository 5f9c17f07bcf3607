"""Evaluations: every episode counts once, under its own seed."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t

from dynx.errors import ArgumentError
from dynx.training.evaluation import Evaluation, confidence_interval, evaluate, mean_of_runs


class Countdown(gymnasium.Env[Any, Any]):
    """An episode of ``seed % 7 + 1`` steps that gives the seed in the last of them."""

    observation_space = spaces.Box(0.0, 1e6, (1,), np.float64)
    action_space = spaces.Discrete(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        assert seed is not None
        self._seed, self._left = seed, seed % 7 + 1
        return np.array([float(self._left)]), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        assert self._left > 0, "a step after the end"
        self._left -= 1
        ended = self._left == 0
        by_task = ended and self._seed % 2 == 0
        return np.array([float(self._left)]), float(self._seed * ended), by_task, ended and not by_task, {}


def nothing(seen: Any) -> Any:
    return np.zeros(len(seen), dtype=np.int64)


@given(envs=st.integers(1, 9), episodes=st.integers(1, 30), seed=st.integers(0, 100))
def test_each_episode_counts_once(envs: int, episodes: int, seed: int) -> None:
    found = evaluate(nothing, [Countdown() for _ in range(envs)], episodes, seed)
    expected = np.arange(seed, seed + episodes)
    np.testing.assert_array_equal(found.returns, expected)
    np.testing.assert_array_equal(found.lengths, expected % 7 + 1)


class Diverging(Countdown):
    """A countdown whose odd seeds diverge at their end."""

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        *found, _ = super().step(action)
        return *found, {"diverged": "too fast"} if found[3] else {}


def test_episodes_that_diverge_are_counted_and_named() -> None:
    found = evaluate(nothing, [Diverging(), Diverging()], 7, seed=1)
    assert found.diverged == 4
    assert "over 7 episodes, 4 of which diverged, mean" in repr(found)
    assert "diverged" not in repr(evaluate(nothing, [Countdown()], 2))


def test_the_interval_is_students() -> None:
    values = np.array([1.0, 2.0, 3.0, 6.0])
    low, high = confidence_interval(values)
    expected = t.interval(0.95, 3, loc=3.0, scale=values.std(ddof=1) / 2.0)
    np.testing.assert_allclose((low, high), expected)
    assert confidence_interval(values[:1]) == (-np.inf, np.inf)


def test_runs_count_once_however_many_episodes_they_have() -> None:
    a = Evaluation(np.array([0.0, 0.0, 0.0, 0.0]), np.ones(4, dtype=np.int64), 0)
    b = Evaluation(np.array([2.0]), np.ones(1, dtype=np.int64), 0)
    assert mean_of_runs([a.mean, b.mean])[0] == 1.0


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ArgumentError, match="at least one environment"):
        evaluate(nothing, [], 3)
    with pytest.raises(ArgumentError, match="episodes"):
        evaluate(nothing, [Countdown()], 0)
