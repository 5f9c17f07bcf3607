"""One policy on two engines."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import RULE, given_policy, step
from tests.tasks.robots import cart_pole
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

STARTS = ((0.0, 0.35, 0.0, 0.0), (0.5, -0.2, 0.0, 1.0), (-0.3, 0.1, -0.8, 0.6))
STEPS = 30


def final_states() -> Array:
    """Return the states after the steps."""
    states = np.array(STARTS)
    for _ in range(STEPS):
        states = step(states, given_policy(states))
    return states


def check(folder: Path) -> None:
    """Compare with the equations of motion."""
    answer = read_answer(folder, "pybullet", "mujoco")
    results = [numbers(name, answer[name], 3, 4) for name in ("pybullet", "mujoco")]
    for name, got in zip(("pybullet", "mujoco"), results, strict=True):
        require_close(name, got, final_states(), 0.01)
    require(np.any(results[0] != results[1]), "both engines have exactly the same result; are they two?")


TASK = Task(
    "Does my policy work on another engine?",
    f"""
You have a policy for the cart-pole of cart_pole.urdf:
{RULE}.
Every 20 ms the force is computed from the state and held. The hinge has no motor; there is no friction.
Run it on the physics of PyBullet and on that of MuJoCo, from each of the three states
(position, angle, velocity, angular velocity)
    {STARTS[0]},  {STARTS[1]},  {STARTS[2]},
with a time step of 1 ms or finer. Which states are reached after {STEPS * 0.02:.1f} s?

Write answer.json: {{"pybullet": [three states], "mujoco": [three states]}}, to 0.01.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
