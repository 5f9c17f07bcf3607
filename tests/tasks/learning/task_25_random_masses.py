"""How often a policy copes with a random mass."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import RULE, given_policy, step
from tests.tasks.robots import cart_pole
from tests.tasks.task import Array, Task, numbers, read_answer, require_close

LOWEST, HIGHEST = 0.1, 2.0
START = (0.0, 0.25, 0.0, 0.0)
COUNT = 400
ANGLE = 0.6


def survivors() -> Array:
    """Return whether the pole stays up, for pole masses at equal distances over the range."""
    masses = LOWEST + (HIGHEST - LOWEST) * (np.arange(COUNT) + 0.5) / COUNT
    states = np.tile(START, (COUNT, 1))
    alive = np.ones(COUNT, dtype=bool)
    for _ in range(250):
        states[alive] = step(states[alive], given_policy(states[alive]), masses[alive], fineness=2)
        alive &= np.abs(states[:, 1]) < ANGLE
    return np.asarray(alive, dtype=float)


def check(folder: Path) -> None:
    """Compare with the share of the range; 2,000 samples have a standard deviation of 0.011."""
    answer = read_answer(folder, "survival", "heaviest")
    alive = survivors()
    require_close("survival", numbers("survival", answer["survival"]), alive.mean(), 0.04)
    heaviest = LOWEST + (HIGHEST - LOWEST) * alive.mean()
    require_close("heaviest", numbers("heaviest", answer["heaviest"]), np.array(heaviest), 0.03)


TASK = Task(
    "Is the policy robust to the pole's mass?",
    f"""
You have a policy for the cart-pole of cart_pole.urdf:
{RULE}.
Every 20 ms the force is computed from the state and held. There is no friction.
Randomise the mass of the pole: uniform between {LOWEST} and {HIGHEST} kg. The moment of inertia about
the pole's centre of mass scales with the mass.
Each episode starts at rest at position {START[0]:.0f} m and angle {START[1]} rad.
It fails when |angle| exceeds {ANGLE} rad within 5 s.
The cart's position does not matter.
Run at least 2,000 episodes. Which share of them does not fail? Below which mass do all episodes succeed?

Write answer.json: {{"survival": share to 0.04, "heaviest": mass in kg to 0.03}}.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
