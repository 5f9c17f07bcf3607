"""Mass and centre of mass of a quadruped."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

LEG = {"HAA": 0.1, "HFE": 0.8, "KFE": -1.6}


def configuration(names: list[str]) -> Array:
    """Return the joint angles by their names."""
    return np.array([LEG[name.split("_")[1]] for name in names])


def check(folder: Path) -> None:
    """Compare with Pinocchio."""
    answer = read_answer(folder, "mass", "centre_of_mass", "foot")
    model = pinocchio_model(example_robot("solo12.urdf"), floating=True)
    data = model.createData()
    q = np.concatenate([[0, 0, 0, 0, 0, 0, 1], configuration(list(model.names)[2:])])
    mass = float(pin.computeTotalMass(model))
    require(abs(numbers("mass", answer["mass"]) - mass) < 1e-4, "mass is wrong")
    centre = np.array(pin.centerOfMass(model, data, q))
    require_close("centre_of_mass", numbers("centre_of_mass", answer["centre_of_mass"], 3), centre, 1e-5)
    pin.framesForwardKinematics(model, data, q)
    foot = data.oMf[model.getFrameId("HL_FOOT")].translation
    require_close("foot", numbers("foot", answer["foot"], 3), foot, 1e-5)


TASK = Task(
    "The centre of mass of a quadruped",
    """
Solo 12 (robot solo12.urdf of example-robot-data) has four legs with the joints HAA, HFE and KFE.
In every leg they stand at HAA = 0.1 rad, HFE = 0.8 rad, KFE = -1.6 rad.
What does the robot weigh? Where is its centre of mass, and where is its foot HL_FOOT,
both in the frame of its base?

Write answer.json: {"mass": kg, "centre_of_mass": [x, y, z], "foot": [x, y, z]}, in metres, to 1e-5.
""",
    check,
)
