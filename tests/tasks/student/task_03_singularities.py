"""Which configurations of a UR5 are singular."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

CONFIGURATIONS = (
    (0.2, -1.1, 1.3, -0.4, 0.9, 0.3),
    (0.7, -1.0, 1.5, -2.0, 0.0, 0.4),
    (-0.5, -1.2, 0.0, -0.9, 1.1, 0.2),
    (1.0, -0.8, 0.9, -1.3, -1.2, 0.0),
)


def jacobian(q: Array) -> Array:
    """Return the geometric Jacobian of the flange, in the axes of the world."""
    model = pinocchio_model(example_robot("ur5_robot.urdf"))
    frame = model.getFrameId("tool0")
    return np.array(pin.computeFrameJacobian(model, model.createData(), q, frame, pin.LOCAL_WORLD_ALIGNED))


def check(folder: Path) -> None:
    """Compare with singular values by NumPy; the lost direction may have either sign."""
    answer = read_answer(folder, "smallest", "singular", "lost_twist")
    factors = [np.linalg.svd(jacobian(np.array(q))) for q in CONFIGURATIONS]
    smallest = np.array([values[-1] for _, values, _ in factors])
    require_close("smallest", numbers("smallest", answer["smallest"], 4), smallest, 1e-5)
    singular = [index for index, value in enumerate(smallest) if value < 1e-3]
    require(answer["singular"] == singular, "singular names the wrong configurations")
    lost = numbers("lost_twist", answer["lost_twist"], 6)
    want = factors[2][0][:, -1]
    require_close("lost_twist", lost * np.sign(lost @ want), want, 1e-4)


TASK = Task(
    "Singularities of a UR5",
    f"""
Here are four configurations of a UR5 (robot ur5_robot.urdf of example-robot-data), in rad:

    {chr(10).join(f"    {index}: {list(q)}" for index, q in enumerate(CONFIGURATIONS)).strip()}

Take the 6 x 6 Jacobian of the flange (origin of link tool0, axes of the link `world`, rows: three of the
linear velocity [m], then three of the angular velocity [rad]).
1. What is its smallest singular value in each of the four?
2. Which of the four are singular (smallest singular value below 1e-3)?
3. In configuration 2, which unit twist (linear, then angular; same axes) can the flange not make?

Write answer.json:
{{"smallest": [four numbers], "singular": [numbers of configurations], "lost_twist": [six numbers]}}.
""",
    check,
)
