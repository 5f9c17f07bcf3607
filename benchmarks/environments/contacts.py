"""Steps a second of `Walk` in compiled kernels, with its feet as contacts.

    python -m benchmarks.environments.contacts [--envs 8192] [--threads 2] [--steps 50]

Actions are uniform random numbers in the whole action space. A step of the environment is 20 ms: five steps
of the robot, observation, reward, and the starts of the episodes that ended. In the same run, and in turn,
`mujoco.rollout` steps the same robot (`benchmarks.contact_steps`) with the same gains and random targets on
as many threads, without observation and reward; they begin anew every half second. A time is the processor
time of all threads for a step of one environment, as the median of the rounds. Steps a second are by the
clock, and too few where other programs run.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence

import numpy as np

from benchmarks.contact_steps import MujocoRobots, quadruped
from dynx.envs.library import AutoresetMode
from dynx.envs.tasks.quadruped import ACTION_SCALE, KD, KP, POSTURE
from dynx.envs.tasks.walk import Walk
from dynx.envs.vector import RobotVectorEnvironment


def main(arguments: Sequence[str] | None = None) -> int:
    """Print steps a second of dynx and of MuJoCo."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.environments.contacts", description=__doc__)
    parser.add_argument("--envs", type=int, default=8192, help="default: 8192")
    parser.add_argument("--mujoco-envs", type=int, default=64, help="default: 64")
    parser.add_argument("--threads", type=int, default=2, help="default: 2")
    parser.add_argument("--steps", type=int, default=50, help="default: 50")
    options = parser.parse_args(arguments)
    task = Walk(contacts="feet")
    envs = RobotVectorEnvironment(
        task,
        options.envs,
        threads=options.threads,
        copy=False,
        autoreset_mode=AutoresetMode.NEXT_STEP,
        max_episode_steps=task.max_episode_steps,
    )
    from mujoco import MjData, rollout

    robot = quadruped(h=task.control_dt / task.substeps, kp=KP, kd=KD)
    theirs = MujocoRobots(robot, options.mujoco_envs)
    datas = [MjData(theirs.model) for _ in range(options.threads)]
    rng = np.random.default_rng(0)
    envs.reset(seed=0)
    first = theirs.state.copy()
    ours: list[tuple[float, float]] = []
    others: list[tuple[float, float]] = []
    residual = 0.0
    for step in range(options.steps):
        actions = rng.uniform(-1.0, 1.0, (options.envs, len(POSTURE))).astype(np.float32)
        start = time.perf_counter(), time.process_time()
        envs.step(actions)
        ours.append(_rates(options.envs, *start))
        residual = max(residual, float(envs.contact_residuals.max()))
        targets = np.array(POSTURE) + ACTION_SCALE * rng.uniform(-1.0, 1.0, (options.mujoco_envs, 12))
        sequence = np.repeat(targets[:, None], task.substeps, axis=1)
        start = time.perf_counter(), time.process_time()
        states, _ = rollout.rollout(theirs.model, datas, theirs.state, sequence)
        others.append(_rates(options.mujoco_envs, *start))
        theirs.state = states[:, -1] if (step + 1) % 25 else first
    (rate, spent), (their_rate, theirs_spent) = np.median(ours, axis=0), np.median(others, axis=0)
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    print(
        f"{options.envs} environments, {options.threads} threads{load}: dynx {rate:,.0f} steps/s, "
        f"{spent:.2f} us of a processor a step; MuJoCo {their_rate:,.0f} steps/s, {theirs_spent:.1f} us "
        f"({theirs_spent / spent:.0f}x); residual of the contacts at most {residual:.1e} m/s"
    )
    return 0


def _rates(count: int, wall: float, processor: float) -> tuple[float, float]:
    """Return steps a second, and processor time of a step [us], since two times."""
    now = time.perf_counter(), time.process_time()
    return count / (now[0] - wall), 1e6 * (now[1] - processor) / count


if __name__ == "__main__":
    sys.exit(main())
