"""All configurations of a UR5 that reach a pose."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Task, numbers, read_answer, require, require_close

POSE = (
    (0.0, 0.0, 1.0, 0.35),
    (0.6, 0.8, 0.0, 0.20),
    (-0.8, 0.6, 0.0, 0.30),
    (0.0, 0.0, 0.0, 1.0),
)
COUNT = 8  # found by 700 random starts of a numerical solver


def check(folder: Path) -> None:
    """Require eight distinct configurations, each of which reaches the pose by Pinocchio."""
    solutions = numbers("solutions", read_answer(folder, "solutions")["solutions"], -1, 6)
    require(len(solutions) == COUNT, f"{len(solutions)} solutions is not the right number")
    require(np.all(np.abs(solutions) <= np.pi + 1e-6), "an angle lies outside (-pi, pi]")
    model = pinocchio_model(example_robot("ur5_robot.urdf"))
    data = model.createData()
    for index, q in enumerate(solutions):
        pin.framesForwardKinematics(model, data, q)
        reached = data.oMf[model.getFrameId("tool0")].homogeneous
        require_close(f"pose of solution {index}", reached, np.array(POSE), 1e-4)
        for other in solutions[:index]:
            difference = np.angle(np.exp(1j * (q - other)))
            require(np.max(np.abs(difference)) > 1e-2, f"solution {index} is there twice")


TASK = Task(
    "All ways for a UR5 to reach a pose",
    f"""
The flange of a UR5 (robot ur5_robot.urdf of example-robot-data, link tool0) shall reach this pose in
the frame of the link `world`, as a 4 x 4 matrix:

    {chr(10).join("    " + str(list(row)) for row in POSE).strip()}

Find all joint configurations that reach it, each angle in (-pi, pi].

Write answer.json: {{"solutions": [[six angles], [six angles], ...]}}, in rad, the joints from the base to
the flange. Poses must be met to 1e-4.
""",
    check,
)
