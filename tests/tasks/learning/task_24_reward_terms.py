"""The terms of a reward over an episode."""

from pathlib import Path

import numpy as np

from tests.tasks.motion import advance, arm_derivative
from tests.tasks.robots import damping, pinocchio_model, two_link_arm
from tests.tasks.student.task_06_picture import tip
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close, table

START = (0.6, 0.8)
TARGET = (0.45, 0.0, 0.25)
VISCOUS = 0.8
STEPS = 100
COLUMNS = ("shoulder", "elbow")


def description() -> str:
    """Return an arm with damped joints."""
    return two_link_arm(shoulder=damping(VISCOUS), elbow=damping(VISCOUS))


def actions() -> Array:
    """Return the torques of the episode [N m]."""
    times = np.arange(STEPS) * 0.02
    shoulder = -7.0 + 2.0 * np.sin(5 * times)
    elbow = -1.0 + 1.2 * np.cos(4 * times)
    return np.round(np.column_stack([shoulder, elbow]), 4)


def terms() -> dict[str, float]:
    """Return the sum of each term over the episode."""
    model = pinocchio_model(description())
    state = np.array([*START, 0.0, 0.0])
    sums = {"distance": 0.0, "effort": 0.0, "close": 0.0}
    for action in actions():
        state = advance(arm_derivative(model, action, VISCOUS), state, 0.02, 10)
        distance = float(np.linalg.norm(tip(state[:2]) - TARGET))
        sums["distance"] -= distance
        sums["effort"] -= 0.01 * float(action @ action)
        sums["close"] += distance < 0.15
    return sums


def check(folder: Path) -> None:
    """Compare with the equations of motion."""
    want = terms()
    answer = read_answer(folder, *want)
    for name, tolerance in (("distance", 0.01 * abs(want["distance"])), ("effort", 1e-3), ("close", 1.0)):
        require_close(name, numbers(name, answer[name]), np.array(want[name]), tolerance)
    require(float(answer["close"]).is_integer(), "close is no count")


TASK = Task(
    "What did my reward pay for?",
    f"""
The arm of arm.urdf stands on the world's origin and shall bring its tip (link tip) to {TARGET} m.
Its joints have the damping of the file. An episode starts at rest at {START} rad and has {STEPS} steps
of 20 ms; actions.csv holds the torques [N m] of each step, which are held during the step.
Gravity is -9.81 m/s2.
After each step the reward is the sum of three terms:
- distance: minus the distance between tip and target in m;
- effort: minus 0.01 times the sum of the squared torques of the step;
- close: 1 if the distance is below 0.15 m, else 0.

What does each term sum to over the episode?
Write answer.json: {{"distance": sum to 1 %, "effort": sum to 0.001, "close": count to 1}}.
""",
    check,
    {"arm.urdf": description, "actions.csv": lambda: table(COLUMNS, actions())},
)
