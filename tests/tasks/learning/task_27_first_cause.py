"""Why two rollouts part."""

from functools import cache
from pathlib import Path

import numpy as np

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import ball, damping, pinocchio_model, two_link_arm
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close, table

COLUMNS = ("t", "shoulder", "elbow", "shoulder_velocity", "elbow_velocity")
START = (2.3, 0.9)
SHOULDER, ELBOW = 0.25, 0.12
ROWS = 151
TORQUES = (1.5, -0.8)
CAUSE = "elbow damping ignored"
CAUSES = (
    "shoulder damping ignored",
    CAUSE,
    "gravity is 9.80 instead of 9.81",
    "tip without mass",
    "rotor inertia of 0.01 kg m2 at both joints",
    "torque starts 20 ms late",
)


def description() -> str:
    """Return an arm with damped joints."""
    tip = ball("tip", 0.3, 0.04, "1 0 0 1")
    return two_link_arm(shoulder=damping(SHOULDER), elbow=damping(ELBOW), tip=tip)


@cache
def rollout(shoulder: float, elbow: float) -> Array:
    """Return the log of a rollout with these viscous dampings."""
    model = pinocchio_model(description())
    state, rows = np.array([*START, 0.0, 0.0]), []
    derivative = arm_derivative(model, np.array(TORQUES), np.array([shoulder, elbow]))
    for index in range(ROWS):
        rows.append([0.01 * index, *state])
        state = advance(derivative, state, 0.01, 5)
    return np.array(rows)


def check(folder: Path) -> None:
    """Compare with how the logs were made."""
    answer = read_answer(folder, "time", "cause", "final")
    first, second = rollout(SHOULDER, ELBOW), rollout(SHOULDER, 0.0)
    apart = np.abs(first[:, 1:3] - second[:, 1:3]).max(axis=1) > 0.01
    require_close("time", numbers("time", answer["time"]), first[np.argmax(apart), 0], 1e-6)
    require(answer["cause"] in CAUSES, "cause is none of those in the text")
    require(answer["cause"] == CAUSE, "that is not the cause")
    want = rollout(0.0, ELBOW)[-1, 1:]
    require_close("final", numbers("final", answer["final"], 4), want, 0.03)


TASK = Task(
    "Why do the two rollouts part?",
    f"""
Two simulators ran the arm of arm.urdf from rest at {START} rad with constant torques {TORQUES} N m
(shoulder, elbow). Their logs are a.csv and b.csv. a.csv is right; the second simulator made one mistake.
1. What is the time of the first row in which an angle differs by more than 0.01 rad?
2. Which mistake explains b.csv? One of:
{chr(10).join("   - " + cause for cause in CAUSES)}
3. For comparison, what state would the simulation end in (t = 1.5 s) if the only mistake were
   "shoulder damping ignored"?

Write answer.json: {{"time": s, "cause": "one of the lines above", "final": [shoulder, elbow, and their two
velocities, to 0.03]}}.
""",
    check,
    {
        "arm.urdf": description,
        "a.csv": lambda: table(COLUMNS, rollout(SHOULDER, ELBOW)),
        "b.csv": lambda: table(COLUMNS, rollout(SHOULDER, 0.0)),
    },
)
