"""The motion of a double pendulum."""

from functools import cache
from pathlib import Path

import numpy as np

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import pinocchio_model, two_link_arm
from tests.tasks.task import Array, Task, read_table, require_close

COLUMNS = ("t", "shoulder", "elbow")
START = (2.0, 0.5)
ROWS = 101


def description() -> str:
    """Return the double pendulum."""
    return two_link_arm((1.2, 0.8), (0.5, 0.4))


@cache
def motion() -> Array:
    """Return time and angles every 20 ms."""
    derivative = arm_derivative(pinocchio_model(description()), np.zeros(2))
    state = np.array([*START, 0.0, 0.0])
    rows = []
    for index in range(ROWS):
        rows.append([0.02 * index, *state[:2]])
        state = advance(derivative, state, 0.02, 10)
    return np.array(rows)


def check(folder: Path) -> None:
    """Compare with a Runge-Kutta method at 2 ms."""
    require_close("answer.csv", read_table(folder, "answer.csv", COLUMNS, ROWS), motion(), 5e-3)


TASK = Task(
    "Let a double pendulum swing",
    f"""
The file pendulum.urdf describes a double pendulum without friction. At zero it stands upright.
It is released at rest at shoulder = {START[0]} rad, elbow = {START[1]} rad. Gravity is 9.81 m/s2 along -z.
How does it move during two seconds?

Write answer.csv with the header t,shoulder,elbow and 101 rows: every 20 ms from t = 0 to t = 2.
Angles in rad, not wrapped, to 0.005.
""",
    check,
    {"pendulum.urdf": description},
)
