"""Scripted controllers that solve the tasks, and returns of episodes under them.

``python -m tests.envs.scripted TASK ENGINE [EPISODES]`` prints returns of whole episodes with the random
numbers of evaluations, under the controller, under random actions and under zero actions.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, cast

import gymnasium
import numpy as np

import dynx
import dynx.envs  # registers the environments
from dynx.envs.environment import TaskEnvironment
from dynx.envs.tasks.push import SIZE, TIP_START
from dynx.envs.tasks.quadruped import POSTURE
from dynx.envs.tasks.reach import DAMPING_RATE, MAX_ACCELERATION, MAX_SPEED, Reach
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

Controller = Callable[[int, Any], Floats]
"""The action of a step (0 in the first of an episode) and its observation."""

FIRST_SEED = 1_000_000_000
"""Seed of the first episode of an evaluation of `dynx train`."""
REACHING_RATE = 4.0
"""Rate at which joint errors vanish while an arm reaches [1/s]."""
FINGER_HEIGHT, CARRYING_HEIGHT = TIP_START[2], 0.11
"""Height of the finger tips while they push the cube, and while they pass over it [m]."""


class Reaching:
    """The control of the joints to a solution of inverse kinematics for the goal, in episodes of `Reach`.

    Errors of the joints vanish as those of a critically damped oscillator, or of one of first order.
    """

    def __init__(self, env: TaskEnvironment) -> None:
        assert isinstance(env.task, Reach)
        self.task, self.episodes = env.task, cast(Any, env.episodes)
        self.engine = dynx.backend("compiled", env.task.model)

    def __call__(self, step: int, observation: Any) -> Floats:
        if step == 0:
            q, _, goal = self.episodes.state
            T_goal = homogeneous(goal[3:].reshape(3, 3), goal[:3])
            found = self.engine.inverse_kinematics(T_goal, self.task.tool, q)
            assert found.success
            self.q_goal = found.q
        n = self.task.model.nv
        q, v = observation[:n].astype(float), observation[n : 2 * n].astype(float)
        if self.task.actions == "velocity":
            wanted = REACHING_RATE * (self.q_goal - q) / MAX_SPEED
        else:
            acceleration = REACHING_RATE**2 * (self.q_goal - q) - 2.0 * REACHING_RATE * v
            tau = self.engine.inverse_dynamics(q, v, acceleration) - self.engine.gravity_torque(q)
            wanted = (tau / self.task.inertia + DAMPING_RATE * v) / MAX_ACCELERATION
        return np.asarray(np.clip(wanted, -1.0, 1.0))


def pushing(step: int, observation: Any) -> Floats:
    """Carry the finger tips over the cube to the side away from the goal, lower them there, and push."""
    tip, cube, goal = (observation[k : k + 3].astype(float) for k in (0, 6, 21))
    way = goal[:2] - cube[:2]
    distance = float(np.linalg.norm(way))
    if distance < 0.01:
        return np.zeros(3)
    direction = way / distance
    behind = cube[:2] - 1.2 * SIZE * direction
    ahead = float((tip[:2] - cube[:2]) @ direction)
    aside = tip[:2] - cube[:2] - ahead * direction
    if ahead < -0.6 * SIZE and np.linalg.norm(aside) < 0.02 and tip[2] < 0.06:
        velocity = [
            *(direction * min(3.0 * distance + 0.1, 0.5) - 4.0 * aside),
            5.0 * (FINGER_HEIGHT - tip[2]),
        ]
    elif np.linalg.norm(tip[:2] - behind) < 0.015:
        velocity = [*(8.0 * (behind - tip[:2])), 8.0 * (FINGER_HEIGHT - tip[2])]
    elif ahead < -SIZE:
        velocity = [*(8.0 * (behind - tip[:2])), 0.0]
    elif tip[2] > CARRYING_HEIGHT - 0.025:
        velocity = [*(8.0 * (behind - tip[:2])), 8.0 * (CARRYING_HEIGHT - tip[2])]
    else:
        velocity = [0.0, 0.0, 8.0 * (CARRYING_HEIGHT - tip[2])]
    return np.clip(np.array(velocity) / 0.4, -1.0, 1.0)


def posture(step: int, observation: Any) -> Floats:
    """Hold the posture."""
    return np.zeros(len(POSTURE))


def trot(step: int, observation: Any) -> Floats:
    """Return the action of a trot at the wanted velocity: diagonal pairs of legs in turn.

    Legs are front right, front left, rear right, rear left. To turn, one side takes longer steps and front
    and rear legs step to different sides.
    """
    forward, left, yaw_rate = observation[45:48].astype(float)
    side, front = np.array([-1.0, 1.0, -1.0, 1.0]), np.array([1.0, 1.0, -1.0, -1.0])
    phase = 2.0 * np.pi * 4.0 * 0.02 * step + np.array([0.0, np.pi, np.pi, 0.0])
    size = min(1.0, float(np.hypot(np.hypot(forward, left), 0.5 * yaw_rate)) / 0.3)
    swing, lift = np.cos(phase + 0.6), 0.3 * size * np.maximum(np.sin(phase), 0.0)
    thigh = 0.8 * ((forward if forward > 0.0 else 0.65 * forward) - 0.15 * side * yaw_rate) * swing
    hip = -0.9 * (left + 0.15 * front * yaw_rate) * swing
    legs = np.stack([hip, thigh + lift + 0.3 * size, -3.0 * lift], axis=1)
    return np.asarray(np.clip(legs.ravel(), -1.0, 1.0))


CONTROLLERS: dict[str, Controller] = {"Push": pushing, "Stand": posture, "Walk": trot}


def run(
    env: TaskEnvironment, controller: Controller, steps: int, seed: int, **options: Any
) -> tuple[float, Any, dict[str, Any]]:
    """Run an episode of at most `steps`; return its return, and the last observation and info."""
    observation, info = env.reset(seed=seed, options=options)
    total = 0.0
    for step in range(steps):
        action = controller(step, observation).astype(np.float32)
        observation, reward, terminated, _, info = env.step(action)
        total += reward
        if terminated:
            break
    return total, observation, info


def main() -> None:
    """Print the returns of whole episodes."""
    name, engine, episodes = sys.argv[1], sys.argv[2], int([*sys.argv, "100"][3])
    env: Any = gymnasium.make(f"dynx/{name}-v0", engine=engine).unwrapped
    rng = np.random.default_rng(0)
    size = env.action_space.shape
    controllers: dict[str, Controller] = {
        "scripted": Reaching(env) if name == "Reach" else CONTROLLERS[name],
        "random": lambda step, observation: rng.uniform(-1.0, 1.0, size),
        "zero": lambda step, observation: np.zeros(size),
    }
    for label, controller in controllers.items():
        found = [run(env, controller, env.task.max_episode_steps, FIRST_SEED + k) for k in range(episodes)]
        returns = np.array([total for total, *_ in found])
        print(f"{label}: {returns.mean():.1f} +- {returns.std():.1f}, least {returns.min():.1f}")


if __name__ == "__main__":
    main()
