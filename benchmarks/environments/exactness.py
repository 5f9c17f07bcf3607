"""How exactly environments of dynx repeat those of Gymnasium.

    python -m benchmarks.environments.exactness [--states 100000] [--episodes 1000] [--engine NAME ...]

For each task and engine, single and in the vector environment: the largest difference of a state after one
step from states that episodes under random actions visit, and the number of whole episodes under random
actions that end in another step. Actions are float64: Gymnasium's ``Pendulum-v1`` multiplies a float32 action
in float32. With ``--batch`` the dynamics of all episodes are one batch of the engine, because half a million
steps of Acrobot on the engine ``reference``, one by one, take twenty minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from dynx.backends import backend, installed_backends
from dynx.backends.dynamics import EngineDynamics
from dynx.envs import RobotTask, State, TaskEnvironment
from dynx.envs.library import AutoresetMode
from dynx.envs.tasks.acrobot import Acrobot
from dynx.envs.tasks.cart_pole import CartPole
from dynx.envs.tasks.pendulum import Pendulum
from dynx.envs.vector import RobotVectorEnvironment
from dynx.spatial.scalar import Floats

VECTOR = "vector"
"""Stands for the vector environment among the names of engines."""


class Pair(NamedTuple):
    """A task, and Gymnasium's environment; `order` are the columns of its state in dynx's order."""

    name: str
    task: RobotTask
    gymnasium_id: str
    order: tuple[int, ...]


PAIRS = (
    Pair("CartPole", CartPole(), "CartPole-v1", (0, 2, 1, 3)),
    Pair("Pendulum", Pendulum(actions="torque"), "Pendulum-v1", (0, 1)),
    Pair("Acrobot", Acrobot(), "Acrobot-v1", (0, 1, 2, 3)),
)


class Visited(NamedTuple):
    """Steps of Gymnasium's environment under random actions; states are in dynx's order (n, nq + nv)."""

    before: Floats
    actions: Any
    after: Floats
    rewards: Floats
    ended: Any
    """True where the step terminated or was the last of the time limit."""


def visited(pair: Pair, states: int, episodes: int) -> Visited:
    """Take at least that many steps and whole episodes in Gymnasium's environment."""
    env: Any = gymnasium.make(pair.gymnasium_id)
    rng, order = np.random.default_rng(0), list(pair.order)
    steps: list[tuple[Any, ...]] = []
    done = 0
    while len(steps) < states or done < episodes:
        env.reset(seed=done)
        over = False
        while not over:
            before = np.array(env.unwrapped.state, dtype=np.float64)
            action = draw(env.action_space, rng)
            _, reward, terminated, truncated, _ = env.step(action)
            over = terminated or truncated
            after = np.array(env.unwrapped.state, dtype=np.float64)
            steps.append((before[order], action, after[order], reward, over))
        done += 1
    return Visited(*(np.array(column) for column in zip(*steps, strict=True)))


def draw(space: Any, rng: np.random.Generator) -> Any:
    """Return a random action, of float64 where it is no choice."""
    if isinstance(space, gymnasium.spaces.Discrete):
        return int(rng.integers(space.n))
    return rng.uniform(space.low, space.high)


Stepper = Callable[[Floats, Any], tuple[Floats, Floats]]
"""Function of states (n, size) and actions that returns the states after one step, and the rewards."""


def stepper(task: RobotTask, engine: str) -> Stepper:
    """Return the step of a task on an engine, or of the vector environment."""
    nq = task.model.nq
    if engine == VECTOR:

        def all_at_once(states: Floats, actions: Any) -> tuple[Floats, Floats]:
            envs = RobotVectorEnvironment(task, len(states), autoreset_mode=AutoresetMode.DISABLED)
            envs.reset(seed=0)
            envs.set_states(states)
            rewards = envs.step(actions)[1]
            return envs.states, rewards

        return all_at_once
    env: Any = TaskEnvironment(task, engine)
    env.reset(seed=0)

    def one_by_one(states: Floats, actions: Any) -> tuple[Floats, Floats]:
        found, rewards = np.empty_like(states), np.empty(len(states))
        for k, (row, action) in enumerate(zip(states, actions, strict=True)):
            env.episodes.state = State(row[:nq], row[nq:])
            outcome = env.episodes.step(action)
            found[k], rewards[k] = np.concatenate(env.episodes.state[:2]), outcome.reward
        return found, rewards

    return one_by_one


def largest_difference(steps: Visited, step: Stepper) -> tuple[float, float]:
    """Return the largest difference of a state, and of a reward, after one step from each visited state."""
    found, rewards = step(steps.before, steps.actions)
    return float(abs(found - steps.after).max()), float(abs(rewards - steps.rewards).max())


def parted_episodes(
    task: RobotTask, steps: Visited, engine: str, episodes: int, *, batch: bool = False
) -> int:
    """Return how many of the first episodes end in another step than Gymnasium's, with the same actions."""
    ends = np.flatnonzero(steps.ended)[:episodes]
    starts = np.concatenate([[0], ends[:-1] + 1])
    limit = task.max_episode_steps or 0
    if engine == VECTOR:
        lengths = _vector_lengths(task, steps, starts, ends)
    elif batch:
        lengths = _batch_lengths(task, steps, engine, starts)
    else:
        lengths = [_length(task, steps, engine, first, limit) for first in starts.tolist()]
    return int(np.count_nonzero(np.array(lengths) != ends - starts + 1))


def _length(task: RobotTask, steps: Visited, engine: str, first: int, limit: int) -> int:
    nq = task.model.nq
    env: Any = _single.setdefault((task, engine), TaskEnvironment(task, engine))
    env.reset(seed=0)
    env.episodes.state = State(steps.before[first][:nq], steps.before[first][nq:])
    for k in range(limit):
        # Beyond the end of Gymnasium's episode the actions of the next ones follow.
        if env.step(steps.actions[min(first + k, len(steps.actions) - 1)])[2]:
            return k + 1
    return limit


_single: dict[tuple[RobotTask, str], TaskEnvironment] = {}


def _vector_lengths(task: RobotTask, steps: Visited, starts: Any, ends: Any) -> list[int]:
    envs = RobotVectorEnvironment(task, len(starts), max_episode_steps=task.max_episode_steps)
    envs.reset(seed=0)
    envs.set_states(steps.before[starts])
    lengths = np.zeros(len(starts), dtype=int)
    for k in range(task.max_episode_steps or 0):
        rows = np.minimum(starts + k, len(steps.actions) - 1)
        _, _, terminated, truncated, _ = envs.step(steps.actions[rows])
        lengths = np.where((lengths == 0) & (terminated | truncated), k + 1, lengths)
    return [int(length) for length in lengths]


def _batch_lengths(task: RobotTask, steps: Visited, engine: str, starts: Any) -> list[int]:
    """Return the lengths of the episodes; the engine evaluates the dynamics of all that go on at once."""
    dynamics, nq = backend(engine, task.model, validate=False), task.model.nq
    robot, limit = EngineDynamics(dynamics), task.max_episode_steps or 0
    lengths = np.full(len(starts), limit)
    going, states = np.arange(len(starts)), steps.before[starts].copy()
    for k in range(limit):
        actions = steps.actions[np.minimum(starts[going] + k, len(steps.actions) - 1)]
        before = [State(row[:nq], row[nq:]) for row in states]
        each = zip(before, actions, strict=True)
        tau = np.stack([task.torque(robot, state, np.asarray(action, dtype=float)) for state, action in each])

        def accelerate(q: Floats, v: Floats, tau: Floats = tau) -> Floats:
            a: Floats = dynamics.forward_dynamics(q.T, v.T, tau).T
            return a

        # Integrators work on columns, too.
        q, v = task.advance(accelerate, states[:, :nq].T, states[:, nq:].T)
        after = [task.settle(State(*pair)) for pair in zip(q.T, v.T, strict=True)]
        over = np.array([bool(task.terminated(robot, state)) for state in after])
        lengths[going[over]] = np.minimum(k + 1, limit)
        going = going[~over]
        states = np.array([np.concatenate(state[:2]) for state in after])[~over]
        if not len(going):
            break
    dynamics.close()
    return [int(length) for length in lengths]


def main(given: Sequence[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--engine", action="append", help="name of an engine, or vector; by default all")
    parser.add_argument("--task", action="append", help="name of a task; by default all")
    parser.add_argument("--batch", action="store_true", help="whole episodes by batches of the engine")
    chosen = parser.parse_args(given)
    print("| task | engine | states | largest difference | of a reward | episodes | that end elsewhere |")
    print("|---|---|---|---|---|---|---|")
    for pair in PAIRS:
        if chosen.task and pair.name not in chosen.task:
            continue
        steps = visited(pair, chosen.states, chosen.episodes)
        first = Visited(*(column[: chosen.states] for column in steps))
        for engine in chosen.engine or (*installed_backends(), VECTOR):
            state, reward = largest_difference(first, stepper(pair.task, engine))
            parted = parted_episodes(pair.task, steps, engine, chosen.episodes, batch=chosen.batch)
            print(
                f"| {pair.name} | {engine} | {chosen.states:,} | {state:.1e} | {reward:.1e} "
                f"| {chosen.episodes:,} | {parted} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
