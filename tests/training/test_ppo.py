"""Updates of PPO in parts beside those of stable-baselines3, on any number of threads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3 import PPO

from dynx.errors import ArgumentError
from dynx.training import Schedule, TaskSpec, make_vector, train
from dynx.training import ppo as module
from dynx.training.algorithms import new_algorithm
from dynx.training.checkpoints import Checkpoints
from dynx.training.library import DummyVecEnv
from dynx.training.ppo import ThreadedPPO
from dynx.training.schedules import MAX_RATE, MIN_RATE, START_RATE, SteadyDivergence, schedule_of
from tests.training.runs import small_run

OPTIONS: dict[str, Any] = {
    "n_steps": 16,
    "batch_size": 64,
    "n_epochs": 3,
    "seed": 0,
    "device": "cpu",
    "learning_rate": 0.01,
    "policy_kwargs": {"optimizer_class": torch.optim.SGD},
}
"""Updates with one mini-batch in each epoch: the order of its samples changes rounding alone, and steps along
the gradient (not its sign, as of Adam) do not enlarge it."""

RTOL, ATOL = 1e-4, 1e-6
"""Rounding of sums of numbers in single precision, in another order."""


def learned(kind: type[PPO], task: str, steps: int = 64, **options: Any) -> dict[str, Any]:
    """Return the weights after the updates by rollouts of 64 steps."""
    vector = make_vector(TaskSpec(task, "compiled"), 4)
    algorithm = kind("MlpPolicy", vector, **{**OPTIONS, **options}).learn(steps)
    vector.close()
    found: dict[str, Any] = algorithm.policy.state_dict()
    return found


@pytest.mark.parametrize("task", ["dynx/CartPole-v0", "dynx/Pendulum-v0"])
@pytest.mark.parametrize("options", [{}, {"clip_range_vf": 0.1, "ent_coef": 0.01}])
def test_updates_in_parts_are_those_of_stable_baselines(
    monkeypatch: pytest.MonkeyPatch, task: str, options: dict[str, Any]
) -> None:
    monkeypatch.setattr(module, "PART", 24)
    ours, theirs = (learned(kind, task, **options) for kind in (ThreadedPPO, PPO))
    for name, weights in theirs.items():
        np.testing.assert_allclose(ours[name], weights, rtol=RTOL, atol=ATOL)


class TwoChoices(gymnasium.Env[Any, Any]):
    """Two choices in each step; the reward is their sum."""

    observation_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
    action_space = gymnasium.spaces.MultiDiscrete([2, 3])

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        return np.zeros(2, dtype=np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        return np.ones(2, dtype=np.float32), float(np.sum(action)), False, False, {}


def test_actions_of_several_choices_are_learned_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART", 24)
    found = []
    for kind in (ThreadedPPO, PPO):
        vector = DummyVecEnv([TwoChoices] * 4)
        found.append(kind("MlpPolicy", vector, **OPTIONS).learn(64).policy.state_dict())
    for name, weights in found[1].items():
        np.testing.assert_allclose(found[0][name], weights, rtol=RTOL, atol=ATOL)


def test_weights_do_not_depend_on_the_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PART", 10)
    found = []
    for threads in (1, 3):
        monkeypatch.setattr(ThreadedPPO, "threads", threads)
        found.append(learned(ThreadedPPO, "dynx/Pendulum-v0", 128, batch_size=32, target_kl=0.05))
    assert all(torch.equal(each, found[1][name]) for name, each in found[0].items())


@given(st.floats(1e-4, 1.0), st.floats(MIN_RATE, MAX_RATE), st.floats(0.0, 10.0))
def test_a_rate_falls_where_updates_are_too_large(target: float, rate: float, divergence: float) -> None:
    after = SteadyDivergence(target).next_rate(rate, divergence)
    assert MIN_RATE <= after <= MAX_RATE
    assert (after > rate) <= (divergence < target)
    assert (after < rate) <= (divergence > target)


def test_a_rate_that_follows_the_divergence_is_in_checkpoints(tmp_path: Path) -> None:
    spec = small_run(64, hyperparameters={"n_steps": 16, "batch_size": 32, "learning_rate": "kl_0.001"})
    train(
        spec,
        tmp_path,
        schedule=Schedule(checkpoint_every=32, evaluate_every=64, episodes=1),
        final_episodes=1,
    )
    found = Checkpoints(tmp_path / "checkpoints").newest(spec)
    assert found is not None
    vector = make_vector(spec.task, 2)
    algorithm = new_algorithm("ppo", vector, spec.hyperparameters, 0)
    assert rate_of(algorithm) == START_RATE
    found.restore(algorithm, vector)
    assert MIN_RATE <= rate_of(algorithm) != START_RATE
    vector.close()


def rate_of(algorithm: Any) -> float:
    return float(algorithm.policy.optimizer.param_groups[0]["lr"])


@pytest.mark.parametrize("wrong", ["kl_", "kl_0", "kl_-1", "kl_nan", "kl_inf", "KL_0.01"])
def test_other_targets_of_the_divergence_are_refused(wrong: str) -> None:
    with pytest.raises(ArgumentError, match=r"^learning_rate is a number, or lin_NUMBER, .* or kl_NUMBER"):
        schedule_of("learning_rate", wrong)


def test_only_ppo_follows_the_divergence() -> None:
    vector = make_vector(TaskSpec("dynx/CartPole-v0", "compiled"), 1)
    with pytest.raises(ArgumentError, match=r"^learning_rate is kl_0\.01, which ppo alone has"):
        new_algorithm("dqn", vector, {"learning_rate": "kl_0.01"}, 0)
    with pytest.raises(ArgumentError, match=r"^clip_range is a number, or lin_NUMBER"):
        new_algorithm("ppo", vector, {"clip_range": "kl_0.01"}, 0)
    vector.close()
