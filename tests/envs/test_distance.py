"""How far apart engines are on a task: a planted difference is found at its step, and nothing else."""

from __future__ import annotations

import io
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from rich.console import Console

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.cli.learning.documents import distance_document as document
from dynx.cli.learning.env import show
from dynx.envs.distance import engine_distance
from dynx.envs.registration import bare_name, is_of_dynx, task_class, task_id
from dynx.errors import ArgumentError, UnknownNameError


class Drifting(gymnasium.Env[Any, Any]):
    """The sum of all actions, and on the engine `other` a jump of the second entry at step 5."""

    observation_space = spaces.Box(-1e3, 1e3, (2,), np.float64)
    action_space = spaces.Box(-1.0, 1.0, (), np.float64)

    def __init__(self, engine: str) -> None:
        self._engine = engine

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._step, self._sum = 0, float(self.np_random.uniform())
        return np.array([self._sum, 0.0]), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._step += 1
        self._sum += float(action)
        jump = 0.5 if self._engine == "other" and self._step >= 5 else 0.0
        ends = self._engine == "short" and self._step == 8
        return np.array([self._sum, jump]), self._sum, ends, False, {}


def test_engines_that_agree_do_not_differ() -> None:
    found = engine_distance(Drifting, ["one", "same"], seeds=[0, 1, 2], steps=12)
    assert [each.step for each in found.differences] == [None] * 3
    assert all(each.largest == 0.0 and each.returns[0] == each.returns[1] for each in found.differences)
    # Seeds draw different episodes, of as many steps as were wanted.
    assert len({each.episode_return for each in found.records}) == 3
    assert {each.steps for each in found.records} == {12}


def test_a_planted_difference_is_found_at_its_step_and_entry() -> None:
    found = engine_distance(Drifting, ["one", "other"], seeds=[3], steps=12, tolerance=0.1)
    (difference,) = found.of("one", "other")
    assert (difference.step, difference.entry, difference.largest) == (5, 1, 0.5)
    assert found.entry_name(difference.entry) == "entry 1"
    assert engine_distance(Drifting, ["one", "other"], seeds=[3], tolerance=0.6).differences[0].step is None


def test_an_early_end_is_a_difference() -> None:
    found = engine_distance(Drifting, ["one", "short"], seeds=[0], steps=12)
    assert found.differences[0].step == 8
    assert found.differences[0].lengths == (12, 8)


def test_a_policy_acts_on_the_first_engine_for_all() -> None:
    seen: list[Any] = []

    def policy(observations: Any) -> Any:
        seen.append(observations)
        return np.array([0.25])

    found = engine_distance(Drifting, ["one", "other", "same"], seeds=[0], steps=4, policy=policy)
    assert len(seen) == 4
    assert all(each.step is None for each in found.differences)
    assert len(found.differences) == 3


def test_wrong_arguments_are_refused() -> None:
    for engines in ([], ["one"], ["one", "one"]):
        with pytest.raises(ArgumentError, match="two engines or more"):
            engine_distance(Drifting, engines)
    for tolerance in (0.0, float("nan"), float("inf")):
        with pytest.raises(ArgumentError, match="tolerance"):
            engine_distance(Drifting, ["one", "same"], tolerance=tolerance)


def test_short_names_of_tasks() -> None:
    assert task_id("CartPole") == "dynx/CartPole-v0"
    assert task_id("CartPole-v1") == "CartPole-v1"
    assert bare_name("dynx/CartPole-v0") == bare_name("CartPole-v1") == "CartPole"
    with pytest.raises(UnknownNameError, match="did you mean 'CartPole'"):
        task_id("CartPol")


@pytest.mark.parametrize("env_id", [each for each in gymnasium.registry if is_of_dynx(each)])
def test_the_tasks_of_dynx_name_each_entry_of_their_observation(env_id: str) -> None:
    task = task_class(gymnasium.registry[env_id].kwargs["task"])()
    names = task.observation_names
    assert (len(names),) == task.observation_space.shape
    assert len(set(names)) == len(names)


def test_the_table_names_what_parts_first() -> None:
    class Named(Drifting):
        observation_names = ("sum", "jump")

    found = engine_distance(Named, ["one", "other", "short"], seeds=[3, 4], steps=12, tolerance=0.1)
    report = document("task", {}, found, [])
    assert [each["first_entry"] for each in report["pairs"]] == ["jump", None, "jump"]
    assert [each["entry_name"] for each in report["pairs"][0]["episodes"]] == ["jump", "jump"]
    out = Console(file=io.StringIO(), width=200)
    show(out, report)
    rows = [line.split() for line in out.file.getvalue().splitlines()]  # type: ignore[attr-defined]  # StringIO
    assert rows[3][:7] == ["one,", "other", "2", "of", "2", "5", "jump"]
    assert "end of the episode" in " ".join(rows[4])
    same = document("task", {}, engine_distance(Named, ["one", "same"], seeds=[3], steps=12), [])
    assert same["pairs"][0]["first_entry"] is None
