"""A motion from rest to rest and the torques that it takes."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, read_table, require_close

START = (0.0, 0.2, 0.0, 0.8, 0.0, 0.6, 0.0)
END = (1.0, -0.4, 0.5, 1.6, -0.7, 1.2, 0.9)
DURATION = 1.5
ROWS = 151
COLUMNS = ("t", "q1", "q2", "q3", "q4", "q5", "q6", "q7")


def motion() -> tuple[Array, Array, Array, Array]:
    """Return times, angles, velocities and accelerations of the polynomial of degree five."""
    times = np.linspace(0, DURATION, ROWS)
    s = times / DURATION
    step = np.array(END) - np.array(START)
    position = 10 * s**3 - 15 * s**4 + 6 * s**5
    velocity = (30 * s**2 - 60 * s**3 + 30 * s**4) / DURATION
    acceleration = (60 * s - 180 * s**2 + 120 * s**3) / DURATION**2
    q = np.array(START) + np.outer(position, step)
    return times, q, np.outer(velocity, step), np.outer(acceleration, step)


def peak_torques() -> Array:
    """Return the largest magnitude of each joint's torque at the rows, by Pinocchio."""
    _, q, v, a = motion()
    model = pinocchio_model(example_robot("xarm7.urdf"))
    model.armature[:] = 0  # only the links' inertia counts
    data = model.createData()
    torques = [np.array(pin.rnea(model, data, *row)) for row in zip(q, v, a, strict=True)]
    return np.array(np.abs(torques).max(axis=0))


def check(folder: Path) -> None:
    """Compare with the polynomial and with Pinocchio."""
    times, q, _, _ = motion()
    got = read_table(folder, "answer.csv", COLUMNS, ROWS)
    require_close("answer.csv", got, np.column_stack([times, q]), 1e-5)
    peak = numbers("peak_torques", read_answer(folder, "peak_torques")["peak_torques"], 7)
    require_close("peak_torques", peak, peak_torques(), 1e-2)


TASK = Task(
    "A smooth motion and its torques",
    f"""
An xArm 7 (robot xarm7.urdf of example-robot-data) moves from
    {START} rad
to  {END} rad
in {DURATION} s. Each angle is one polynomial of degree five in time; velocity and acceleration are zero at
both ends. Gravity is 9.81 m/s2 along -z. Friction, damping and rotor inertia do not count.

Write answer.csv with the header {",".join(COLUMNS)} and {ROWS} rows, every 10 ms (rad, to 1e-5).
Write answer.json: {{"peak_torques": [seven numbers]}}: for each joint the largest magnitude of its torque at
these rows, in N m, to 0.01.
""",
    check,
)
