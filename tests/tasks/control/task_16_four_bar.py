"""The motion of a four-bar linkage."""

from functools import cache
from pathlib import Path

import numpy as np

from tests.tasks.motion import GRAVITY, advance
from tests.tasks.robots import revolute, robot, rod
from tests.tasks.task import Array, Task, read_table, require_close

GROUND = 0.5
LENGTHS = (0.2, 0.5, 0.4)  # crank, coupler, rocker [m]
MASSES = (0.4, 1.0, 0.8)
START = 1.0  # [rad] of the crank
COLUMNS = ("t", "crank", "coupler", "rocker")
ROWS = 26


def description() -> str:
    """Return the linkage as a tree, open between the ends of coupler and rocker."""
    axis = "0 -1 0"
    return robot(
        "four_bar",
        '  <link name="ground"/>\n',
        rod("crank", MASSES[0], LENGTHS[0], "x"),
        rod("coupler", MASSES[1], LENGTHS[1], "x"),
        rod("rocker", MASSES[2], LENGTHS[2], "x"),
        revolute("crank_joint", "ground", "crank", "0 0 0", axis=axis),
        revolute("coupler_joint", "crank", "coupler", f"{LENGTHS[0]} 0 0", axis=axis),
        revolute("rocker_joint", "ground", "rocker", f"{GROUND} 0 0", axis=axis),
    )


def directions(crank: float) -> Array:
    """Return the angles of crank, coupler and rocker from the x axis; the pin is above the diagonal."""
    end = LENGTHS[0] * np.array([np.cos(crank), np.sin(crank)])
    diagonal = np.array([GROUND, 0.0]) - end
    length = np.linalg.norm(diagonal)
    cosine = (length**2 + LENGTHS[1] ** 2 - LENGTHS[2] ** 2) / (2 * length * LENGTHS[1])
    coupler = np.arctan2(diagonal[1], diagonal[0]) + np.arccos(cosine)
    point = end + LENGTHS[1] * np.array([np.cos(coupler), np.sin(coupler)]) - [GROUND, 0.0]
    return np.array([crank, coupler, np.arctan2(point[1], point[0])])


def energies(crank: float) -> tuple[float, float]:
    """Return twice the kinetic energy at crank velocity 1, and the potential energy."""
    step = 1e-5
    rates = (directions(crank + step) - directions(crank - step)) / (2 * step)
    angles = directions(crank)
    normals = np.stack([-np.sin(angles), np.cos(angles)])
    a, b, c = (LENGTHS[index] * normals[:, index] * rates[index] for index in range(3))
    centres = (a / 2, a + b / 2, c / 2)
    inertia = sum(
        mass * (centre @ centre) + mass * length**2 / 12 * rate**2
        for mass, length, centre, rate in zip(MASSES, LENGTHS, centres, rates, strict=True)
    )
    heights = np.array(LENGTHS) * np.sin(angles)
    centre_heights = np.array([heights[0] / 2, heights[0] + heights[1] / 2, heights[2] / 2])
    return float(inertia), GRAVITY * float(np.array(MASSES) @ centre_heights)


@cache
def motion() -> Array:
    """Return time and joint angles every 20 ms, by Lagrange's equation of the one degree of freedom."""

    def derivative(state: Array) -> Array:
        angle, velocity, step = float(state[0]), float(state[1]), 1e-3
        low, high = energies(angle - step), energies(angle + step)
        inertia_slope, potential_slope = ((b - a) / (2 * step) for a, b in zip(low, high, strict=True))
        alpha = -(inertia_slope * velocity**2 / 2 + potential_slope) / energies(angle)[0]
        return np.array([velocity, alpha])

    state, rows = np.array([START, 0.0]), []
    for index in range(ROWS):
        crank, coupler, rocker = directions(float(state[0]))
        rows.append([0.02 * index, crank, coupler - crank, rocker])
        state = advance(derivative, state, 0.02, 4)
    return np.array(rows)


def check(folder: Path) -> None:
    """Compare with Lagrange's equation."""
    require_close("answer.csv", read_table(folder, "answer.csv", COLUMNS, ROWS), motion(), 1e-2)


TASK = Task(
    "A four-bar linkage falls",
    f"""
The file linkage.urdf describes a four-bar linkage, cut open: a pin joins the end of the coupler (the point
({LENGTHS[1]}, 0, 0) of its frame) to the end of the rocker (the point ({LENGTHS[2]}, 0, 0) of its frame).
In PyBullet you would use createConstraint with JOINT_POINT2POINT.
The crank starts at rest at {START} rad. The closed linkage is the one whose pin is above the line from the
crank's end to the rocker's bearing. There is no motor, no friction and no contact between the bars; gravity
is 9.81 m/s2 along -z.
How do the joints move during half a second?

Write answer.csv with the header {",".join(COLUMNS)} and {ROWS} rows, every 20 ms from t = 0: the angles of
crank_joint, coupler_joint and rocker_joint in rad, to 0.01.
""",
    check,
    {"linkage.urdf": description},
)
