"""A data set of transitions for offline learning."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import RULE, given_policy, step
from tests.tasks.robots import cart_pole
from tests.tasks.task import Task, Wrong, existing, numbers, require, require_close

EPISODES, STEPS = 200, 50
NAMES = ("observations", "actions", "rewards", "next_observations")


def check(folder: Path) -> None:
    """Check every transition by the equations of motion, and the statistics of starts and noise."""
    try:
        with np.load(existing(folder, "answer.npz"), allow_pickle=False) as archive:
            data = {name: archive[name] for name in archive.files}
    except ValueError as error:
        raise Wrong(f"answer.npz cannot be read: {error}") from None
    missing = [name for name in NAMES if name not in data]
    require(not missing, f"answer.npz lacks {', '.join(missing)}")
    before, after = (
        numbers(name, data[name], EPISODES, STEPS, 4) for name in ("observations", "next_observations")
    )
    actions, rewards = (numbers(name, data[name], EPISODES, STEPS) for name in ("actions", "rewards"))
    require(bool(np.all(np.abs(actions) <= 10 + 1e-6)), "an action is outside [-10, 10]")
    require_close("next_observations", after, step(before, actions, fineness=2), 5e-3)
    require_close("the next row's observation", before[:, 1:], after[:, :-1], 1e-5)
    require_close("rewards", rewards, 1 - after[..., 1] ** 2 - 0.001 * actions**2, 1e-4)
    starts = before[:, 0]
    require(bool(np.all(np.abs(starts) <= 0.2 + 1e-6)), "a start is outside +-0.2")
    require(
        bool(np.all(np.abs(starts.std(axis=0) - 0.4 / np.sqrt(12)) < 0.025)), "the starts are not uniform"
    )
    noise = (actions - given_policy(before))[np.abs(actions) < 9.99]
    require(abs(noise.std() - 1) < 0.05, f"the noise has the standard deviation {noise.std():.2f}, not 1")
    require(abs(noise.mean()) < 0.05, f"the noise has the mean {noise.mean():.2f}, not 0")
    require(len(np.unique(np.round(noise, 9))) > 0.99 * noise.size, "the noise repeats itself")


TASK = Task(
    "A data set for offline learning",
    f"""
Record {EPISODES} episodes of {STEPS} steps of this policy on the cart-pole of cart_pole.urdf:
{RULE}.
To each force, normal noise with standard deviation 1 N is added; then it is clipped to [-10, 10] N and
held for 20 ms. There is no friction.
Each episode starts with position, angle and both velocities uniform in +-0.2.
None ends early. The reward of a step is 1 - theta^2 - 0.001 force^2: theta after the step, the force
that acted.

Write answer.npz with the arrays
    observations       ({EPISODES}, {STEPS}, 4)   position, angle, velocity, angular velocity before each step
    actions            ({EPISODES}, {STEPS})      the force that acted, in N
    rewards            ({EPISODES}, {STEPS})
    next_observations  ({EPISODES}, {STEPS}, 4)   the state after each step
Each transition must obey the equations of motion to 0.005.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
