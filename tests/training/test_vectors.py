"""Environments in a kernel, as stable-baselines3 steps them, beside the same environments one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.vector import RobotVectorEnvironment
from dynx.training import TaskSpec
from dynx.training.environments import make_vector
from dynx.training.library import VecMonitor
from dynx.training.vectors import BatchedEnvironments
from tests.training.runs import small_run


def test_a_kernel_gives_what_single_environments_give() -> None:
    """Start both from the states of the kernel's reset, and step them past the ends of episodes."""
    spec = small_run(envs=6, task=TaskSpec("dynx/CartPole-v0", "compiled"))
    batched = make_vector(spec)
    assert isinstance(batched, VecMonitor)
    assert isinstance(batched.venv, BatchedEnvironments)
    batched.seed(3)
    observations = batched.reset()
    assert observations.shape == (6, 4)
    rng, ended = np.random.default_rng(0), 0
    lengths = np.zeros(6, dtype=int)
    for _ in range(120):
        actions = rng.integers(0, 2, 6)
        before = observations
        observations, rewards, done, infos = batched.step(actions)
        lengths += 1
        assert np.all(rewards == 1.0)
        for k in range(6):
            last = infos[k]["terminal_observation"] if done[k] else observations[k]
            # One explicit Euler step moves positions by the velocity before it.
            np.testing.assert_allclose(last[[0, 2]], before[k][[0, 2]] + 0.02 * before[k][[1, 3]], atol=1e-5)
            if done[k]:
                ended += 1
                assert abs(last[0]) > 2.4 or abs(last[2]) > 0.2
                assert np.all(np.abs(observations[k]) <= 0.05)
                assert infos[k]["TimeLimit.truncated"] is False
                assert infos[k]["episode"]["l"] == lengths[k] == infos[k]["episode"]["r"]
                lengths[k] = 0
            else:
                assert infos[k] == {}
    assert ended > 10
    batched.close()


def test_an_end_by_the_time_limit_is_told_apart() -> None:
    spec = small_run(envs=2, task=TaskSpec("dynx/CartPole-v0", "compiled", {"max_episode_steps": 5}))
    batched = make_vector(spec)
    batched.seed(0)
    batched.reset()
    for _ in range(4):
        assert not batched.step(np.array([0, 1]))[2].any()
    _, _, done, infos = batched.step(np.array([0, 1]))
    assert done.all()
    assert [each["TimeLimit.truncated"] for each in infos] == [True, True]
    batched.close()


@pytest.mark.parametrize("task", [TaskSpec("CartPole-v1"), TaskSpec("dynx/CartPole-v0", "reference")])
def test_other_engines_step_one_by_one(task: TaskSpec) -> None:
    vector = make_vector(small_run(task=task))
    assert not isinstance(vector, VecMonitor)
    vector.close()


class Kicked(CartPole):
    """A cart that the action 1 kicks so hard that the step diverges."""

    def torque(self, robot: Any, state: Any, action: Any) -> Any:
        return np.stack([1e14 * action, 0.0 * action])


def test_one_that_diverges_is_truncated_and_named() -> None:
    vector = RobotVectorEnvironment(Kicked(), 3, autoreset_mode="SameStep")
    batched = BatchedEnvironments(vector)
    batched.seed(2)
    before = batched.reset()
    observations, rewards, done, infos = batched.step(np.array([0, 1, 0]))
    assert done.tolist() == [False, True, False]
    assert rewards.tolist() == [1.0, 0.0, 1.0]
    assert infos[1]["TimeLimit.truncated"] is True
    assert "not finite" in infos[1]["diverged"]
    assert np.array_equal(infos[1]["terminal_observation"], before[1])
    assert not np.array_equal(observations[1], before[1])
    assert infos[0] == infos[2] == {}
    batched.close()
