"""Judging a trained policy on a task, such as its own on another engine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dynx.argument_types import checks_types
from dynx.envs.library import Env
from dynx.model.numbers import whole_number
from dynx.training.environments import make
from dynx.training.evaluation import AT_ONCE, MAX_EPISODES, Evaluation, evaluate
from dynx.training.policy import Policy
from dynx.training.specification import TaskSpec


@checks_types
def judge(
    policy: Policy,
    task: TaskSpec,
    episodes: int = 100,
    seed: int = 0,
    *,
    deterministic: bool = True,
    progress: Callable[[int], object] = lambda _: None,
) -> Evaluation:
    """Run whole episodes of a policy on a task, as `evaluate` does, in environments that it makes and
    closes."""
    whole_number("episodes", episodes, 1, MAX_EPISODES)
    envs: list[Env[Any, Any]] = []
    try:
        envs.extend(make(task) for _ in range(min(AT_ONCE, episodes)))
        return evaluate(lambda seen: policy(seen, deterministic), envs, episodes, seed, progress)
    finally:
        for env in envs:
            env.close()
