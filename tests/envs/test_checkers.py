"""The checkers of Gymnasium and of stable-baselines3 find nothing in any task on any engine."""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env as check_by_gymnasium

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.backends import installed_backends
from dynx.envs.registration import NAMESPACE, TASKS, task_class
from dynx.steppers.registry import installed_worlds

INSTALLED = {*installed_backends(), *installed_worlds()}
PAIRS = [(name, engine) for name, task in TASKS.items() for engine in task_class(task).engines()]
"""Every environment with each engine that it runs on."""

VARIANTS: list[tuple[str, dict[str, Any]]] = [
    ("CartPole-v0", {"sutton_barto_reward": True}),
    ("Pendulum-v0", {"randomize": {"mass_scale": (0.5, 2.0), "delay": (0.0, 0.1), "action_noise": 3.0}}),
    ("Push-v0", {"randomize": {"mass_scale": (0.5, 2.0), "observation_noise": 3.0, "action_noise": 3.0}}),
    ("Push-v0", {"reward_kind": "sparse"}),
    ("Reach-v0", {"actions": "velocity", "robot": "panda"}),
]
"""Options that change spaces, rewards or random numbers."""


def check_by_stable_baselines3(env: Any, **options: Any) -> None:
    """Check an environment; the test is skipped without the extra train."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs the extra train")
    checker.check_env(env, **options)


CHECKERS = [check_by_gymnasium, check_by_stable_baselines3]


@contextmanager
def made(name: str, **options: Any) -> Iterator[Any]:
    """Make an environment, in which warnings are errors."""
    env = gymnasium.make(f"{NAMESPACE}/{name}", **options).unwrapped
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield env
    finally:
        env.close()


@pytest.mark.parametrize("check", CHECKERS)
@pytest.mark.parametrize(("name", "engine"), PAIRS)
def test_checkers_warn_of_nothing(name: str, engine: str, check: Callable[..., None]) -> None:
    if engine not in INSTALLED:
        pytest.skip(f"needs {engine}")
    with made(name, engine=engine) as env:
        check(env, skip_render_check=True)


@pytest.mark.long_cases
@pytest.mark.parametrize("check", CHECKERS)
@pytest.mark.parametrize(("name", "options"), VARIANTS)
def test_options_pass_the_checkers(name: str, options: dict[str, Any], check: Callable[..., None]) -> None:
    with made(name, **options) as env:
        check(env, skip_render_check=True)


@pytest.mark.skipif(importlib.util.find_spec("viser") is None, reason="needs the extra viewer")
@pytest.mark.parametrize("check", CHECKERS)
@pytest.mark.parametrize("name", ["Acrobot-v0", "Push-v0"])
def test_render_modes_pass_the_checkers(name: str, check: Callable[..., None]) -> None:
    with made(name, render_mode="rgb_array", width=32, height=24) as env:
        check(env)
