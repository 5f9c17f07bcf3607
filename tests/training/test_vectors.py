"""Environments in a kernel, as stable-baselines3 steps them, beside the same environments one by one."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy

from dynx.envs import make_environment
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError
from dynx.training import TaskSpec, make_vector
from dynx.training.library import VecMonitor
from dynx.training.vectors import BatchedEnvironments, make_training_vector
from tests.training.runs import small_run


def test_a_kernel_gives_what_single_environments_give() -> None:
    """Start both from the states of the kernel's reset, and step them past the ends of episodes."""
    spec = small_run(envs=6, task=TaskSpec("dynx/CartPole-v0", "compiled"))
    batched = make_training_vector(spec)
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
    batched = make_training_vector(spec)
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
    vector = make_training_vector(small_run(task=task))
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


CART_POLE = TaskSpec("dynx/CartPole-v0", "compiled")


def batched_cart_poles(count: int, **options: Any) -> BatchedEnvironments:
    """Return environments of Gymnasium as stable-baselines3 takes them."""
    vector = gymnasium.make_vec("dynx/CartPole-v0", num_envs=count, autoreset_mode="SameStep", **options)
    return BatchedEnvironments(vector)


def test_an_algorithm_learns_and_is_evaluated_on_them() -> None:
    vector = make_vector(CART_POLE, 8)
    model = PPO("MlpPolicy", vector, n_steps=16, batch_size=64, n_epochs=1, seed=0, device="cpu").learn(512)
    assert len(model.ep_info_buffer) > 0
    mean, _ = evaluate_policy(model, vector, n_eval_episodes=8)  # warns about environments without returns
    assert 8.0 <= mean <= 500.0
    vector.close()


def test_each_begins_with_the_seed_of_a_single_environment() -> None:
    vector = batched_cart_poles(3)
    assert vector.seed(7) == [7, 8, 9]
    rows = vector.reset()
    for k in range(3):
        single = make_environment("dynx/CartPole-v0", "compiled")
        np.testing.assert_array_equal(rows[k], single.reset(seed=7 + k)[0])
        single.close()
    assert not np.array_equal(vector.reset(), rows)  # a seed counts once
    vector.close()


def test_drawn_parameters_are_in_the_infos_of_the_episodes() -> None:
    vector = batched_cart_poles(2, randomize={"mass_scale": (0.5, 1.5)}, max_episode_steps=3)
    vector.seed(1)
    vector.reset()
    first = [each["parameters"] for each in vector.reset_infos]
    assert first[0] != first[1]
    assert vector.get_attr("parameters") == first
    for _ in range(2):
        assert vector.step(np.array([0, 1]))[3] == [{}, {}]
    _, _, done, infos = vector.step(np.array([0, 1]))
    assert done.all()
    assert set(infos[0]) == {"terminal_observation", "TimeLimit.truncated"}
    second = [each["parameters"] for each in vector.reset_infos]
    assert second[0] != first[0]
    assert vector.get_attr("parameters", indices=1) == second[1:]
    vector.close()


def test_attributes_methods_and_pictures() -> None:
    vector = batched_cart_poles(3, render_mode="rgb_array", width=32, height=24)
    vector.reset()
    assert vector.get_attr("action_space", indices=[0, 2]) == [vector.action_space] * 2
    assert [each.shape for each in vector.get_attr("states")] == [vector.get_attr("states")[0].shape] * 3
    assert vector.has_attr("task")
    assert not vector.has_attr("tasks")
    assert [each.shape for each in vector.env_method("render", indices=[1])] == [(24, 32, 3)]
    assert vector.env_method("get_wrapper_attr", "num_envs", indices=0) == [3]
    assert vector.env_is_wrapped(gymnasium.Wrapper) == [False] * 3
    picture = vector.render()
    assert picture is not None
    assert picture.ndim == 3
    with pytest.raises(NotImplementedError, match="method push"):
        vector.env_method("push")
    with pytest.raises(NotImplementedError, match="gravity"):
        vector.set_attr("gravity", 1.0)
    vector.close()


def test_options_are_those_of_all() -> None:
    vector = batched_cart_poles(2)
    vector.set_options([{}, {"low": -0.1}])
    with pytest.raises(ArgumentError, match="different options"):
        vector.reset()
    vector.set_options({"no_such": 1})
    with pytest.raises(ArgumentError, match="no_such"):
        vector.reset()
    vector.close()


def test_others_than_vectors_with_this_autoreset_are_refused() -> None:
    with pytest.raises(ArgumentError, match="autoreset_mode='SameStep'"):
        BatchedEnvironments(gymnasium.make_vec("dynx/CartPole-v0", num_envs=2))
    with pytest.raises(ArgumentError, match=r"wanted a gymnasium\.vector\.VectorEnv"):
        BatchedEnvironments(make_environment("dynx/CartPole-v0", "compiled"))  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="envs is '0'"):
        make_vector(CART_POLE, 0)
