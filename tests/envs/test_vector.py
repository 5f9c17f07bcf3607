"""Vector environments: autoreset as Gymnasium defines it, equal to single environments, and their errors."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import State
from dynx.envs.tasks.acrobot import Acrobot
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.tasks.pendulum import Pendulum
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DTypeError,
    EpisodeError,
    NotFiniteError,
    ShapeError,
    UnknownNameError,
)

N = 6


def make(mode: AutoresetMode, task: Any = None, limit: int = 25, **options: Any) -> RobotVectorEnvironment:
    return RobotVectorEnvironment(
        task or CartPole(), N, max_episode_steps=limit, autoreset_mode=mode, **options
    )


class Replay:
    """Single environments that are set to the states of a vector environment."""

    def __init__(self, task: Any) -> None:
        self.env: Any = TaskEnvironment(task, "compiled")
        self.env.reset(seed=0)
        self.nq = task.model.nq

    def __call__(self, state: Any, action: Any) -> Any:
        self.env.episodes.state = State(state[: self.nq], state[self.nq :])
        outcome = self.env.episodes.step(action)
        return outcome, np.concatenate(self.env.episodes.state[:2])


@pytest.mark.parametrize(
    ("mode", "task"),
    [
        *((mode, CartPole(sutton_barto_reward=True)) for mode in AutoresetMode),
        (AutoresetMode.SAME_STEP, Pendulum()),
        (AutoresetMode.NEXT_STEP, Acrobot()),
    ],
    ids=str,
)
def test_steps_are_those_of_single_environments(mode: AutoresetMode, task: Any) -> None:
    envs, replay = make(mode, task), Replay(task)
    rng = np.random.default_rng(1)
    observation, info = envs.reset(seed=2)
    assert info == {}
    ended, steps = np.zeros(N, dtype=bool), np.zeros(N)
    ends = 0
    for _ in range(40):
        if mode is AutoresetMode.DISABLED and ended.any():
            observation, _ = envs.reset(options={"reset_mask": ended})
            steps[ended], ended = 0, np.zeros(N, dtype=bool)
        before = envs.states
        actions = rng.integers(0, 2, N) if hasattr(task.action_space, "n") else rng.uniform(-1, 1, (N, 1))
        observation, rewards, terminated, truncated, info = envs.step(actions)
        assert observation.dtype == np.float32
        assert terminated.dtype == truncated.dtype == bool
        steps += 1
        for k in range(N):
            if mode is AutoresetMode.NEXT_STEP and ended[k]:
                assert (rewards[k], terminated[k], truncated[k]) == (0.0, False, False)
                assert np.abs(envs.states[k] - before[k]).max() > 0.0
                steps[k] = 0
                continue
            outcome, after = replay(before[k], actions[k])
            assert rewards[k] == pytest.approx(outcome.reward, abs=1e-12)
            assert terminated[k] == outcome.terminated
            assert truncated[k] == (steps[k] >= 25)
            over = terminated[k] or truncated[k]
            if mode is AutoresetMode.SAME_STEP and over:
                assert info["_final_obs"][k]
                assert info["final_obs"][k] == pytest.approx(outcome.observation, abs=1e-6)
                steps[k] = 0
            else:
                assert envs.states[k] == pytest.approx(after, abs=1e-12)
                assert observation[k] == pytest.approx(outcome.observation, abs=1e-6)
        ended = terminated | truncated
        ends += int(ended.sum())
    assert ends > 1


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_new_episodes_start_within_the_bounds_and_differ(mode: AutoresetMode) -> None:
    envs = make(mode)
    starts = [envs.reset(seed=0)[0]]
    for _ in range(200):
        observation, _, terminated, truncated, _ = envs.step(np.ones(N, dtype=int))
        fresh = np.abs(observation).max(axis=1) <= 0.05
        starts.append(observation[fresh])
        assert not (fresh & (terminated | truncated)).any() or mode is AutoresetMode.SAME_STEP
    found = np.concatenate(starts)
    assert len(found) > 10 * N
    assert len(np.unique(found, axis=0)) == len(found)
    assert np.abs(found.mean(axis=0)).max() < 0.02


def test_equal_seeds_give_equal_runs_and_copies_are_independent() -> None:
    def run(*, copy: bool) -> list[Any]:
        envs = make(AutoresetMode.NEXT_STEP, copy=copy)
        envs.reset(seed=5)
        rng = np.random.default_rng(0)
        kept = [envs.step(rng.integers(0, 2, N))[:4] for _ in range(40)]
        return kept if copy else [tuple(each.copy() for each in kept[-1])]

    first, second, reused = run(copy=True), run(copy=True), run(copy=False)
    assert all(
        np.array_equal(a, b)
        for one, two in zip(first, second, strict=True)
        for a, b in zip(one, two, strict=True)
    )
    assert not np.array_equal(first[0][0], first[1][0])
    assert all(np.array_equal(a, b) for a, b in zip(first[-1], reused[-1], strict=True))


def test_results_of_a_step_are_copies() -> None:
    envs, actions = make(AutoresetMode.SAME_STEP, Pendulum(), limit=2), np.zeros((N, 1), dtype=np.float32)
    envs.reset(seed=0)
    first = envs.step(actions)[:4]
    kept = [each.copy() for each in first]
    second = envs.step(actions)[:4]
    for given, before, now in zip(first, kept, second, strict=True):
        assert np.array_equal(given, before)
        assert not np.shares_memory(given, now)
    assert not np.array_equal(first[1], second[1])
    assert second[3].all()


def test_one_environment_steps_as_many_do() -> None:
    task = CartPole()
    one = RobotVectorEnvironment(task, 1)
    many = RobotVectorEnvironment(task, 9)
    one.reset(seed=0)
    many.reset(seed=0)
    many.set_states(np.tile(one.states, (9, 1)))
    for k in range(5):
        one.step(np.array([k % 2]))
        many.step(np.full(9, k % 2))
    assert np.array_equal(np.tile(one.states, (9, 1)), many.states)


@pytest.mark.parametrize(
    ("task", "actions", "error", "message"),
    [
        (CartPole(), [0, 1], ShapeError, r"\(2,\); wanted \(6,\)"),
        (CartPole(), [0, 1, 2, 0, 0, 0], ArgumentError, "environment 2: action is 2; wanted"),
        (CartPole(), [0.0] * N, DTypeError, "whole numbers"),
        (Pendulum(), [[0.0]] * 5 + [[np.nan]], NotFiniteError, r"environment 5: action\[0\] is nan"),
        (Pendulum(), [[0.0], [-1.5]] + [[0.0]] * 4, ArgumentError, "environment 1: action.0. is -1.5"),
        (Pendulum(), np.full((N, 1), None), DTypeError, "numbers"),
    ],
)
def test_wrong_actions_leave_every_environment(
    task: Any, actions: Any, error: type[Exception], message: str
) -> None:
    envs = make(AutoresetMode.NEXT_STEP, task)
    envs.reset(seed=0)
    before = envs.states
    for given in (actions, np.array(actions)):
        with pytest.raises(error, match=message):
            envs.step(given)
    assert np.array_equal(envs.states, before)
    right = np.zeros(N, dtype=int) if isinstance(task, CartPole) else np.zeros((N, 1), dtype=np.float32)
    envs.step(right)
    assert not np.array_equal(envs.states, before)


def test_calls_out_of_order_are_refused() -> None:
    envs, right = make(AutoresetMode.DISABLED), np.ones(N, dtype=int)
    with pytest.raises(EpisodeError, match="before the first reset"):
        envs.step(right)
    with pytest.raises(EpisodeError, match="first reset"):
        envs.reset(options={"reset_mask": np.arange(N) < 2})
    envs.reset(seed=0)
    while not envs.step(right)[2].any():
        pass
    with pytest.raises(EpisodeError, match=r"episode of environment \d ended"):
        envs.step(right)
    with pytest.raises(UnknownNameError, match="'high'"):
        envs.reset(options={"hihg": 1.0})
    with pytest.raises(ShapeError, match="reset_mask"):
        envs.reset(options={"reset_mask": np.ones(3, dtype=bool)})
    envs.close()
    for call in (envs.reset, lambda: envs.step(right)):
        with pytest.raises(ClosedError):
            call()


def test_gymnasium_makes_them_with_the_time_limit() -> None:
    made: Any = gymnasium.make_vec("dynx/CartPole-v0", num_envs=3, vectorization_mode="vector_entry_point")
    assert made.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert made.spec.kwargs["max_episode_steps"] == 500
    made = gymnasium.wrappers.vector.RecordEpisodeStatistics(made)
    made.reset(seed=0)
    found = [made.step(np.ones(3, dtype=int))[4] for _ in range(15)]
    lengths = np.concatenate([info["episode"]["l"][info["_episode"]] for info in found if info])
    assert set(lengths.tolist()) <= {8, 9, 10, 11}
    with pytest.raises(ArgumentError, match="did you mean 'SameStep'"):
        gymnasium.make_vec("dynx/CartPole-v0", autoreset_mode="samestep")
    with pytest.raises(ArgumentError, match="vectorization_mode='sync'"):
        gymnasium.make_vec("dynx/CartPole-v0", engine="mujoco")


def test_pictures_of_all_environments() -> None:
    envs = RobotVectorEnvironment(Pendulum(), 2, render_mode="rgb_array", width=32, height=24)
    envs.reset(seed=0)
    pictures = envs.render()
    assert pictures is not None
    assert [picture.shape for picture in pictures] == [(24, 32, 3)] * 2
    assert not np.array_equal(pictures[0], pictures[1])
