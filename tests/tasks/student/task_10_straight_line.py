"""A straight line of a UR5's flange."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Task, read_table, require, require_close

START = (0.3, -1.4, 1.7, -1.2, 0.9, 0.2)
STEP = (0.0, 0.25, -0.1)
ROWS = 51
COLUMNS = ("q1", "q2", "q3", "q4", "q5", "q6")


def check(folder: Path) -> None:
    """Compare the pose of each row by Pinocchio with the line."""
    rows = read_table(folder, "answer.csv", COLUMNS, ROWS)
    require_close("first row", rows[0], np.array(START), 1e-6)
    require(np.max(np.abs(np.diff(rows, axis=0))) < 0.1, "a joint jumps between two rows")
    model = pinocchio_model(example_robot("ur5_robot.urdf"))
    data = model.createData()
    frame = model.getFrameId("tool0")
    pin.framesForwardKinematics(model, data, np.array(START))
    want = data.oMf[frame].homogeneous
    for index, q in enumerate(rows):
        pose = want.copy()
        pose[:3, 3] += np.array(STEP) * index / (ROWS - 1)
        pin.framesForwardKinematics(model, data, q)
        require_close(f"pose of row {index}", data.oMf[frame].homogeneous, pose, 1e-4)


TASK = Task(
    "Draw a straight line with a UR5",
    f"""
A UR5 (robot ur5_robot.urdf of example-robot-data) starts at {START} rad.
Its flange (link tool0) shall move by {STEP} m in the axes of the link `world`, along a straight line,
at constant speed and without turning.

Write answer.csv with the header {",".join(COLUMNS)} and {ROWS} rows: the joint angles in rad at equal steps
along the line, the first row being the start and the last one the end. The joints must not jump; each pose
must be met to 1e-4.
""",
    check,
)
