"""The checkers of Gymnasium and of stable-baselines3 find nothing in any task, on its default engine."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env as check_by_gymnasium

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.envs.registration import NAMESPACE, TASKS


def check_by_stable_baselines3(env: Any, **options: Any) -> None:
    """Check an environment; the test is skipped without the extra train."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs the extra train")
    checker.check_env(env, **options)


@pytest.mark.parametrize("check", [check_by_gymnasium, check_by_stable_baselines3])
@pytest.mark.parametrize("task", TASKS)
def test_checkers_warn_of_nothing(task: str, check: Callable[..., None]) -> None:
    env = gymnasium.make(f"{NAMESPACE}/{task}").unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("check", [check_by_gymnasium, check_by_stable_baselines3])
@pytest.mark.parametrize("task", ["Pendulum-v0", "Push-v0"])
def test_noise_and_drawn_parameters_stay_in_the_spaces(task: str, check: Callable[..., None]) -> None:
    drawn = {"mass_scale": (0.5, 2.0), "delay": (0.0, 0.1), "observation_noise": 3.0, "action_noise": 3.0}
    env = gymnasium.make(f"{NAMESPACE}/{task}", randomize=drawn).unwrapped
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check(env, skip_render_check=True)
    env.close()
