"""The distance of an arm's tip from an obstacle, and the time of their first contact."""

from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from tests.tasks.robots import ball, robot, two_link_arm
from tests.tasks.student.task_06_picture import tip
from tests.tasks.task import Task, numbers, read_answer, require

START, END = (-0.4, 0.3), (1.1, 0.9)
RADIUS = 0.05
CENTRE, SIDES = (0.55, 0.0, 0.2), (0.2, 0.3, 0.2)


def distance(share: float) -> float:
    """Return the distance between the ball and the box when the arm has made this share of its way."""
    angles = np.array(START) + share * (np.array(END) - np.array(START))
    outside = np.maximum(np.abs(tip(angles) - CENTRE) - np.array(SIDES) / 2, 0)
    return float(np.linalg.norm(outside)) - RADIUS


def first_contact() -> float:
    """Return the share of the way at which ball and box touch first."""
    shares = np.linspace(0, 1, 1001)
    index = next(index for index, share in enumerate(shares) if distance(float(share)) <= 0)
    return float(brentq(distance, shares[index - 1], shares[index]))


def check(folder: Path) -> None:
    """Compare with the closed form of the distance between a ball and a box."""
    answer = read_answer(folder, "distance", "time")
    error = abs(float(numbers("distance", answer["distance"])) - distance(0.5))
    require(error < 5e-4, f"distance is off by {error:.2g} m")
    error = abs(float(numbers("time", answer["time"])) - 2 * first_contact())
    require(error < 2e-3, f"time is off by {error:.2g} s")


TASK = Task(
    "Will the arm hit the box?",
    f"""
The file arm.urdf describes an arm whose tip is a ball. It stands on the world's origin. In the world there
is a box (box.urdf), fixed, with its centre at {CENTRE} m and its sides along the axes of the world.
Both joints start at the same time at {START} rad (shoulder, elbow) and move with constant velocity
to {END} rad in 2 s.
1. What is the smallest distance between arm and box at t = 1 s? Only the tip's ball has a collision shape.
2. When do they touch first?

Write answer.json: {{"distance": m to 0.0005, "time": s to 0.002}}.
""",
    check,
    {
        "arm.urdf": lambda: two_link_arm(tip=ball("tip", 0.2, RADIUS, "1 0 0 1")),
        "box.urdf": lambda: robot(
            "box",
            '  <link name="box">\n    <inertial><mass value="1"/>'
            '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>\n'
            "    <collision><geometry>"
            f'<box size="{SIDES[0]} {SIDES[1]} {SIDES[2]}"/></geometry></collision>\n'
            "  </link>\n",
        ),
    },
)
