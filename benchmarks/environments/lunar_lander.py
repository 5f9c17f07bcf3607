"""Returns and speed of Gymnasium's heuristic lander: Gymnasium's own LunarLander-v3 beside dynx's engines.

    python -m benchmarks.environments.lunar_lander --episodes 100 --engine pybullet --engine mujoco

Each flies the same seeds. The processor time of a reset and of a step is the median over episodes, without
the controller; the environments take turns, an episode each. Needs ``gymnasium[box2d]``.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.box2d import lunar_lander

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.steppers.registry import installed_worlds

BOX2D = "Box2D"
heuristic: Callable[[Any, Any], int] = lunar_lander.heuristic
DISCRETE = SimpleNamespace(unwrapped=SimpleNamespace(continuous=False))
"""Stands for an environment: all that the heuristic reads of one."""
NEAR = 20.0
"""Largest difference of two returns that count as the same landing."""


@dataclass
class Record:
    """Returns of the episodes of one environment, their lengths, and the processor time of the reset and of a
    step of each [s]."""

    returns: list[float] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    resets: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)


def fly(env: gymnasium.Env[Any, Any], seed: int, record: Record) -> None:
    """Fly one episode, and add it to the record."""
    began = time.process_time()
    observation, _ = env.reset(seed=seed)
    record.resets.append(time.process_time() - began)
    total, steps, seconds, ended = 0.0, 0, 0.0, False
    while not ended:
        action = heuristic(DISCRETE, observation)
        began = time.process_time()
        observation, reward, terminated, truncated, _ = env.step(action)
        seconds += time.process_time() - began
        total += float(reward)
        ended = terminated or truncated
        steps += 1
    record.returns.append(total)
    record.lengths.append(steps)
    record.steps.append(seconds / steps)


def main() -> None:
    """Print a row for each environment."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--episodes", type=int, default=100, help="number of seeds, from 0")
    parser.add_argument("--engine", action="append", choices=installed_worlds(), help="engine (all)")
    given = parser.parse_args()
    engines = given.engine or installed_worlds()
    envs = {BOX2D: gymnasium.make("LunarLander-v3")}
    envs |= {engine: gymnasium.make("dynx/LunarLander-v0", engine=engine) for engine in engines}
    records = {name: Record() for name in envs}
    for seed in range(given.episodes):
        for name, env in envs.items():
            fly(env, seed, records[name])
    own = np.array(records[BOX2D].returns)
    print(
        "| engine | mean return | median | above 200 | below 0 | within 20 of Box2D's "
        "| reset [ms] | step [us] | steps |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name, record in records.items():
        returns = np.array(record.returns)
        error = returns.std(ddof=1) / np.sqrt(len(returns))
        print(
            f"| {name} | {returns.mean():.1f} ± {error:.1f} | {np.median(returns):.1f} "
            f"| {np.mean(returns > 200.0):.0%} | {np.mean(returns < 0.0):.0%} "
            f"| {np.mean(np.abs(returns - own) < NEAR):.0%} | {np.median(record.resets) * 1e3:.2f} "
            f"| {np.median(record.steps) * 1e6:.0f} | {np.mean(record.lengths):.0f} |"
        )


if __name__ == "__main__":
    main()
