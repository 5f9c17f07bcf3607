"""Train a policy for a cart-pole."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import step, users_policy
from tests.tasks.robots import cart_pole
from tests.tasks.task import Task, require

EPISODES = 40
ANGLE, POSITION = 0.21, 2.4


def check(folder: Path) -> None:
    """Run the policy on the cart-pole's equations of motion from random starts."""
    policy = users_policy(folder)
    states = np.random.default_rng(21).uniform(-0.05, 0.05, (EPISODES, 4))
    alive = np.ones(EPISODES, dtype=bool)
    for _ in range(500):
        states[alive] = step(states[alive], policy(states[alive]), fineness=2)
        alive &= (np.abs(states[:, 1]) < ANGLE) & (np.abs(states[:, 0]) < POSITION)
    require(alive.mean() >= 0.9, f"only {alive.sum()} of {EPISODES} episodes last ten seconds")


TASK = Task(
    "Train a cart-pole",
    f"""
The file cart_pole.urdf describes a cart on a rail (joint slide) with a pole (joint hinge; upright at 0).
The action is a force on the cart between -10 and 10 N, held for 20 ms. The hinge has no motor. There is no
friction. An episode starts with position, angle and both velocities in +-0.05; it ends after ten
seconds, or when |angle| > {ANGLE} rad or |position| > {POSITION} m.
Train a policy by reinforcement learning. Two minutes on two slow cores are enough.

Write policy.py with a function act(observation) that returns the force in N as a number; observation is
the NumPy array [position, angle, velocity, angular velocity]. It may read files that lie beside it, by
paths relative to its own __file__, and import what is installed. At least 90 % of 40 episodes on
another simulator must last ten seconds.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
