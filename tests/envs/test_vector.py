"""Vector environments: autoreset as Gymnasium defines it, equal to single environments, and their errors."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from dynx.backends import installed_backends
from dynx.backends.dynamics import Dynamics
from dynx.envs.environment import TaskEnvironment
from dynx.envs.task import State
from dynx.envs.tasks.acrobot import Acrobot
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.tasks.pendulum import Pendulum
from dynx.envs.tasks.reach import Reach
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
from dynx.spatial.scalar import Array

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


DRAWN: dict[str, Any] = {
    "mass_scale": (0.5, 2.0),
    "joint_friction": (0.01, 0.1),
    "delay": (0.0, 0.03),
    "observation_noise": 0.01,
    "action_noise": 0.1,
}


DRAWN_POLE: dict[str, Any] = {"mass_scale": {"pole": (0.5, 2.0)}, "observation_noise": 0.01}


class Beside:
    """Single environments on `compiled` with the seeds of those of a vector, beside which they step."""

    def __init__(self, task: Any, count: int, limit: int, **options: Any) -> None:
        self.envs = [TaskEnvironment(task, "compiled", **options) for _ in range(count)]
        self.limit = limit
        self.ended, self.steps = np.zeros(count, dtype=bool), np.zeros(count, dtype=int)

    def reset(self, seed: int | None = None) -> list[Any]:
        """Start the first episode of each after `seed`, else the next of those that ended; return the first
        observations of these."""
        chosen = [k for k in range(len(self.envs)) if seed is not None or self.ended[k]]
        self.ended[chosen], self.steps[chosen] = False, 0
        return [self.envs[k].reset(seed=None if seed is None else seed + k)[0] for k in chosen]

    def step(self, k: int, action: Any) -> tuple[Any, float, bool, bool]:
        observation, reward, terminated, truncated, _ = self.envs[k].step(action)
        self.steps[k] += 1
        truncated = truncated or self.steps[k] >= self.limit
        self.ended[k] = terminated or truncated
        return observation, reward, terminated, truncated


@pytest.mark.long_cases
@pytest.mark.parametrize("mode", AutoresetMode, ids=str)
@pytest.mark.parametrize(
    ("task", "drawn"),
    [
        (CartPole(), None),
        (Pendulum(), DRAWN),
        (Acrobot(), None),
        (Reach(robot="planar_3r"), DRAWN),
        # Beside the start of an episode its step is compiled to other bits.
        (Reach(robot="ur5", actions="velocity"), None),
    ],
    ids=["CartPole", "Pendulum, drawn", "Acrobot", "Reach, drawn", "Reach on UR5"],
)
def test_every_episode_is_that_of_a_single_environment_bit_for_bit(
    mode: AutoresetMode, task: Any, drawn: Any
) -> None:
    n, limit = 5, 9
    envs = RobotVectorEnvironment(
        task, n, max_episode_steps=limit, autoreset_mode=mode, randomize=drawn, copy=False
    )
    beside = Beside(task, n, limit, randomize=drawn)
    for seed in (7, 0):
        assert np.array_equal(envs.reset(seed=seed)[0], beside.reset(seed))
        for _ in range(25):
            actions: Any = np.array([each.action_space.sample() for each in beside.envs])
            if mode is AutoresetMode.DISABLED and beside.ended.any():
                fresh = beside.ended.copy()
                observations, _ = envs.reset(options={"reset_mask": fresh})
                assert np.array_equal(observations[fresh], beside.reset())
            observations, rewards, terminated, truncated, infos = envs.step(actions)
            fresh = beside.ended.copy()
            if mode is AutoresetMode.NEXT_STEP and fresh.any():
                assert np.array_equal(observations[fresh], beside.reset())
                assert not np.any([rewards[fresh], terminated[fresh], truncated[fresh]])
            for k in np.flatnonzero(~fresh).tolist():
                observation, *others = beside.step(k, actions[k])
                assert others == [rewards[k], terminated[k], truncated[k]]
                ended = beside.ended[k] and mode is AutoresetMode.SAME_STEP
                assert np.array_equal(observation, infos["final_obs"][k] if ended else observations[k])
            if mode is AutoresetMode.SAME_STEP and beside.ended.any():
                fresh = beside.ended.copy()
                assert np.array_equal(observations[fresh], beside.reset())
            states = [np.concatenate(each.episodes.state) for each in beside.envs]  # type: ignore[attr-defined]
            assert np.array_equal(envs.states[~beside.ended], np.array(states)[~beside.ended])


@pytest.mark.parametrize("sizes", [(1, 7), (3, 5), (4, 1, 3)], ids=str)
@pytest.mark.parametrize("options", [{}, {"x_init": 1.0}], ids=str)
def test_any_partition_has_the_episodes_of_the_whole(sizes: tuple[int, ...], options: Any) -> None:
    n, rng = sum(sizes), np.random.default_rng(3)
    actions = rng.uniform(-1.0, 1.0, (30, n, 1)).astype(np.float32)
    first = np.cumsum([0, *sizes])

    def run(a: int, b: int) -> Any:
        envs = RobotVectorEnvironment(Pendulum(), b - a, max_episode_steps=4, autoreset_mode="SameStep")
        found = [envs.reset(seed=50 + a, options=options)[0]]
        return np.stack(found + [envs.step(each)[0] for each in actions[:, a:b]], axis=1)

    parts = [run(a, b) for a, b in pairwise(first.tolist())]
    assert np.array_equal(np.concatenate(parts), run(0, n))


@pytest.mark.parametrize("randomize", [None, DRAWN_POLE])
def test_each_environment_may_have_a_seed_of_its_own(randomize: Any) -> None:
    seeds = [41, 3, 20]
    many = RobotVectorEnvironment(CartPole(), 3, randomize=randomize)
    observations, _ = many.reset(seed=seeds)
    for k, seed in enumerate(seeds):
        alone = RobotVectorEnvironment(CartPole(), 1, randomize=randomize)
        assert np.array_equal(alone.reset(seed=seed)[0][0], observations[k])
    counted = many.reset(seed=np.int64(7))[0]
    assert np.array_equal(counted, many.reset(seed=[7, 8, 9])[0])
    assert np.array_equal(counted, many.reset(seed=7)[0])


@pytest.mark.parametrize("seed", [-1, 0.5, "7", True, [1, 2], [1, 2, -3], [1, 2, None], [[1], [2], [3]]])
def test_another_seed_is_an_error_of_dynx(seed: Any) -> None:
    many = RobotVectorEnvironment(CartPole(), 3)
    with pytest.raises(ArgumentError, match="seed"):
        many.reset(seed=seed)


@pytest.mark.parametrize("count", [1, 40])
def test_cart_poles_start_as_those_of_gymnasium(count: int) -> None:
    ours = RobotVectorEnvironment(CartPole(), count, autoreset_mode="Disabled")
    theirs = [gymnasium.make("CartPole-v1") for _ in range(count)]
    observations, _ = ours.reset(seed=11)
    assert np.array_equal(observations, [env.reset(seed=11 + k)[0] for k, env in enumerate(theirs)])
    for _ in range(3):
        ours.reset(options={"reset_mask": np.arange(count) % 2 == 0})
    observations, _ = ours.reset()
    later = [[env.reset()[0] for _ in range(1 if k % 2 else 4)] for k, env in enumerate(theirs)]
    assert np.array_equal(observations, [each[-1] for each in later])


def test_a_seed_of_some_environments_leaves_the_others() -> None:
    envs, same = (RobotVectorEnvironment(CartPole(), 4, randomize=DRAWN_POLE) for _ in range(2))
    for each in (envs, same):
        each.reset(seed=1)
    mask = np.array([True, False, True, False])
    observations, infos = envs.reset(seed=20, options={"reset_mask": mask})
    fresh, drawn = RobotVectorEnvironment(CartPole(), 4, randomize=DRAWN_POLE).reset(seed=20)
    assert np.array_equal(observations[mask], fresh[mask])
    for name, values in infos["parameters"].items():
        assert np.array_equal(values[mask], drawn["parameters"][name][mask])
    for _ in range(40):
        seen, others = (each.step(np.ones(4, dtype=int))[0] for each in (envs, same))
        assert np.array_equal(seen[~mask], others[~mask])


class Kicked(CartPole):
    """A cart that the action 1 kicks so hard that the step diverges."""

    def torque(self, robot: Dynamics, state: Any, action: Array) -> Array:
        return np.stack([1e14 * action, 0.0 * action])


@pytest.mark.parametrize("mode", AutoresetMode, ids=str)
@pytest.mark.parametrize("drawn", [None, DRAWN_POLE], ids=["fixed", "drawn"])
def test_an_environment_that_diverges_is_truncated_alone(mode: AutoresetMode, drawn: Any) -> None:
    envs = RobotVectorEnvironment(Kicked(), N, autoreset_mode=mode, randomize=drawn)
    alone = TaskEnvironment(Kicked(), "compiled", randomize=drawn)
    envs.reset(seed=3)
    alone.reset(seed=5)
    before = envs.states
    observations, rewards, terminated, truncated, infos = envs.step((np.arange(N) == 2).astype(int))
    last, reward, ended, cut, info = alone.step(1)
    named = infos["final_info"] if mode is AutoresetMode.SAME_STEP else infos
    assert truncated.tolist() == named["_diverged"].tolist() == [k == 2 for k in range(N)]
    assert not terminated.any()
    assert rewards.tolist() == [float(k != 2) for k in range(N)]
    assert "not finite or beyond 1e+08" in named["diverged"][2]
    assert "not finite or beyond 1e+08" in info["diverged"]
    assert (reward, ended, cut) == (0.0, False, True)
    final = infos["final_obs"][2] if mode is AutoresetMode.SAME_STEP else observations[2]
    assert np.array_equal(final, last)
    moved = np.abs(envs.states - before).max(axis=1) > 0.0
    assert moved.tolist() == [k != 2 or mode is AutoresetMode.SAME_STEP for k in range(N)]
    if mode is AutoresetMode.DISABLED:
        observations, _ = envs.reset(options={"reset_mask": truncated})
    elif mode is AutoresetMode.NEXT_STEP:
        observations, *_, infos = envs.step(np.zeros(N, dtype=int))
        assert "diverged" not in infos
    assert np.array_equal(observations[2], alone.reset()[0])
    assert not envs.step(np.zeros(N, dtype=int))[3].any()


@pytest.mark.parametrize("engine", installed_backends())
def test_one_after_another_goes_on_when_one_diverges(engine: str) -> None:
    def make() -> Any:
        return TaskEnvironment(Kicked(), engine)

    envs = gymnasium.vector.SyncVectorEnv([make, make])
    envs.reset(seed=0)
    _, rewards, terminated, truncated, infos = envs.step(np.array([0, 1]))
    assert (rewards.tolist(), terminated.tolist(), truncated.tolist()) == ([1, 0], [False] * 2, [False, True])
    assert infos["_diverged"].tolist() == [False, True]
    assert not envs.step(np.zeros(2, dtype=int))[3].any()
    envs.close()


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
