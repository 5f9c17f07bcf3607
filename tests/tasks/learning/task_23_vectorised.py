"""Four thousand cart-poles at once."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import step
from tests.tasks.robots import cart_pole
from tests.tasks.task import Array, Task, Wrong, existing, numbers, require_close

COUNT = 4096
STEPS = 40


def draws() -> tuple[Array, Array]:
    """Return the starts and the forces."""
    random = np.random.default_rng(23)
    return random.uniform(-0.2, 0.2, (COUNT, 4)), random.uniform(-5, 5, (COUNT, STEPS))


def final_states() -> Array:
    """Return the states after the steps."""
    states, forces = draws()
    for index in range(STEPS):
        states = step(states, forces[:, index], fineness=2)
    return states


def check(folder: Path) -> None:
    """Compare with the equations of motion of all rows."""
    try:
        got = np.load(existing(folder, "answer.npy"), allow_pickle=False)
    except ValueError as error:
        raise Wrong(f"answer.npy cannot be read: {error}") from None
    require_close("answer.npy", numbers("answer.npy", got, COUNT, 4), final_states(), 0.03)


TASK = Task(
    "4096 cart-poles at once",
    f"""
Simulate {COUNT} cart-poles (cart_pole.urdf) in parallel. Starts and forces are those of

    random = numpy.random.default_rng(23)
    starts = random.uniform(-0.2, 0.2, ({COUNT}, 4))
    forces = random.uniform(-5, 5, ({COUNT}, {STEPS}))

Row i of `starts` is position, angle, velocity, angular velocity. forces[i, k] acts on cart i [N] during
20 ms, from t = 0.02 k. No episode ends early; there is no friction and no other motor.

Write answer.npy: the states after {STEPS} actions, shape ({COUNT}, 4), to 0.03. It should take you seconds of
computing, not minutes.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
