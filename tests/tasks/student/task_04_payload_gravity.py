"""Torques of a Panda that holds a payload still."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, require_close

ANGLES = (0.1, 0.5, -0.3, -1.8, 0.2, 2.0, 0.6)
MASS = 1.5
OFFSET = (0.02, 0.0, 0.16)


def holding_torques() -> Array:
    """Return the torques of the seven joints by Pinocchio: gravity of the arm, and the payload's weight."""
    model = pinocchio_model(example_robot("panda.urdf"))
    data = model.createData()
    q = np.array([*ANGLES, 0.0, 0.0])
    gravity = np.array(pin.computeGeneralizedGravity(model, data, q))
    frame = model.getFrameId("panda_hand")
    jacobian = np.array(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))
    arm = data.oMf[frame].rotation @ np.array(OFFSET)
    weight = np.array([0.0, 0.0, -9.81 * MASS])
    wrench = np.concatenate([weight, np.cross(arm, weight)])
    return np.array((gravity - jacobian.T @ wrench)[:7])


def check(folder: Path) -> None:
    """Compare with Pinocchio."""
    torques = numbers("torques", read_answer(folder, "torques")["torques"], 7)
    require_close("torques", torques, holding_torques(), 1e-3)


TASK = Task(
    "Hold a payload with a Panda",
    f"""
A Panda (robot panda.urdf of example-robot-data, its hand and fingers included, fingers closed) stands
still at the angles {ANGLES} rad. It holds a payload of {MASS} kg.
The payload's centre of mass is at {OFFSET} m in the frame of link panda_hand.
Gravity is 9.81 m/s2 along -z of the base. There is no friction.

Which torques must its seven arm joints make so that nothing moves?

Write answer.json: {{"torques": [seven numbers]}}, in N m, to 1e-3.
""",
    check,
)
