"""Where the hand of a Panda is."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Task, numbers, read_answer, require_close

ANGLES = (0.3, -0.6, 0.2, -2.1, 0.4, 1.9, -0.5)


def check(folder: Path) -> None:
    """Compare with Pinocchio; a quaternion and its negative are one rotation."""
    answer = read_answer(folder, "position", "quat_xyzw")
    model = pinocchio_model(example_robot("panda.urdf"))
    data = model.createData()
    pin.framesForwardKinematics(model, data, np.array([*ANGLES, 0.0, 0.0]))
    pose = data.oMf[model.getFrameId("panda_hand_tcp")]
    require_close("position", numbers("position", answer["position"], 3), pose.translation, 1e-5)
    got = numbers("quat_xyzw", answer["quat_xyzw"], 4)
    want = pin.Quaternion(pose.rotation).coeffs()
    require_close("quat_xyzw", got * np.sign(got @ want), want, 1e-5)


TASK = Task(
    "Where is the hand of the Panda?",
    f"""
The seven joints of a Panda arm (robot panda.urdf of example-robot-data) stand at
{ANGLES} rad, from the base to the hand. Its fingers are closed (0 m).
Where is its tool centre point (link panda_hand_tcp) in the frame of the base, and how is it turned?

Write answer.json: {{"position": [x, y, z], "quat_xyzw": [x, y, z, w]}}, in metres, to 1e-5.
""",
    check,
)
