"""Why PyBullet and Pinocchio compute different torques from one file."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.bullet import inverse_dynamics
from tests.tasks.robots import ball, fixed, pinocchio_model, revolute, robot, rod
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

ANGLES = (0.5, -0.7, 0.4)
CAUSE = "force_sensor"


def description() -> str:
    """Return an arm of three joints whose force sensor has no inertial element."""
    return robot(
        "lab_arm",
        '  <link name="pedestal"/>\n',
        rod("upper_arm", 2.5, 0.45),
        rod("forearm", 1.6, 0.35),
        rod("wrist", 0.4, 0.1),
        '  <link name="force_sensor">\n    <visual>\n'
        '      <geometry><box size="0.05 0.05 0.03"/></geometry>\n'
        "    </visual>\n  </link>\n",
        ball("tool", 0.3, 0.04, "1 0 0 1"),
        revolute("shoulder", "pedestal", "upper_arm", "0 0 0.2"),
        revolute("elbow", "upper_arm", "forearm", "0 0 0.45"),
        revolute("wrist_pitch", "forearm", "wrist", "0 0 0.35"),
        fixed("sensor_mount", "wrist", "force_sensor", "0 0 0.1"),
        fixed("tool_mount", "force_sensor", "tool", "0 0 0.06"),
    )


def difference() -> Array:
    """Return PyBullet's torques less Pinocchio's."""
    model = pinocchio_model(description())
    q, zero = np.array(ANGLES), np.zeros(3)
    own = np.array(pin.rnea(model, model.createData(), q, zero, zero))
    return np.asarray(inverse_dynamics(description(), q, zero, zero) - own)


def check(folder: Path) -> None:
    """Compare with both engines and with the line of the link."""
    answer = read_answer(folder, "link", "line", "difference")
    got = numbers("difference", answer["difference"], 3)
    require_close("difference", got, difference(), 1e-4)
    require(answer["link"] == CAUSE, f"{answer['link']} is not the link")
    lines = description().splitlines()
    line = next(index for index, text in enumerate(lines, 1) if f'<link name="{CAUSE}">' in text)
    require(answer["line"] == line, f"the link does not begin in line {answer['line']}")


TASK = Task(
    "Why do PyBullet and Pinocchio disagree?",
    f"""
Load arm.urdf in PyBullet (fixed base, URDF_USE_INERTIA_FROM_FILE) and in Pinocchio. At
{ANGLES} rad, at rest, with gravity -9.81 m/s2, the two engines compute different joint torques.
1. By how much (PyBullet less Pinocchio)?
2. Which link of the file is the cause, and in which line does it begin (the first line is 1)?

Write answer.json: {{"difference": [three torques in N m, to 1e-4], "link": "name", "line": number}}.
""",
    check,
    {"arm.urdf": description},
)
