"""A quadruped that stands on its legs."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = ("hip", "thigh", "calf")
STANCE = (0.0, 0.8, -1.6)
STIFFNESS, DAMPING = 80.0, 2.0
FOOT_RADIUS = 0.02


def model_and_orders() -> tuple[Any, list[int]]:
    """Return Pinocchio's model, and where it has the joints in the order of the answer."""
    model = pinocchio_model(example_robot("a1.urdf"), floating=True)
    names = [f"{leg}_{joint}_joint" for leg in LEGS for joint in JOINTS]
    return model, [model.joints[model.getJointId(name)].idx_v - 6 for name in names]


def foot_forces(angles: Array) -> tuple[Array, Array]:
    """Return the force on each foot that the legs' torques balance, and the height of each foot's ball."""
    model, order = model_and_orders()
    data = model.createData()
    q = pin.neutral(model)
    q[7:][order] = angles
    torque = np.zeros(12)
    torque[order] = STIFFNESS * (np.tile(STANCE, 4) - angles)
    gravity = np.array(pin.computeGeneralizedGravity(model, data, q))[6:]
    pin.framesForwardKinematics(model, data, q)
    forces, heights = [], []
    for index, leg in enumerate(LEGS):
        frame = model.getFrameId(f"{leg}_foot")
        jacobian = np.array(pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED))
        columns = order[3 * index : 3 * index + 3]
        block = jacobian[:3, 6:][:, columns]
        forces.append(np.linalg.solve(block.T, (gravity - torque)[columns]))
        heights.append(data.oMf[frame].translation[2])
    return np.array(forces), np.array(heights)


def check(folder: Path) -> None:
    """Check equilibrium: the angles determine the feet's heights and, by the motors, the feet's forces."""
    answer = read_answer(folder, "height", "joint_angles", "foot_forces")
    angles = numbers("joint_angles", answer["joint_angles"], 12)
    reported = numbers("foot_forces", answer["foot_forces"], 4)
    height = float(numbers("height", answer["height"]))
    model, _ = model_and_orders()
    weight = 9.81 * float(pin.computeTotalMass(model))
    forces, heights = foot_forces(angles)
    require(np.ptp(heights) < 0.012, "the feet of these angles are not at one height")
    error = abs(height + heights.mean() - FOOT_RADIUS)
    require(error < 0.006, f"height does not fit the joint angles: off by {error:.3f} m")
    total = abs(reported.sum() / weight - 1)
    require(total < 0.02, f"the foot forces and the weight differ by {100 * total:.1f} %")
    require_close(
        "foot_forces, by the motors' torques,", reported, forces[:, 2], 0.07 * weight / 4 + 0 * reported
    )
    slip = np.linalg.norm(forces[:, :2].sum(axis=0)) / weight
    require(slip < 0.04, "the motors' torques do not balance along the ground")
    left_right = np.abs(reported[[0, 2]] - reported[[1, 3]]).max()
    require(left_right < 0.1 * weight / 4, "left and right feet carry different forces")


TASK = Task(
    "A quadruped stands",
    f"""
The quadruped A1 (robot a1.urdf of example-robot-data) stands on a horizontal plane with coefficient of
friction 1. Each of its twelve joints has a motor with the torque
{STIFFNESS:.0f} (q* - q) - {DAMPING:.0f} q' (N m, rad),
where q* = {STANCE[0]} (hip), {STANCE[1]} (thigh), {STANCE[2]} (calf). Gravity is 9.81 m/s2 along -z.
Let it start level, with q = q* and its base 0.30 m above the plane, and simulate until it stands still
(three seconds are enough).

Write answer.json:
{{"height": height of the base's origin in m,
 "joint_angles": [hip, thigh, calf of FR, then of FL, RR and RL, in rad],
 "foot_forces": [vertical force of the ground on the foot FR, FL, RR, RL, in N]}}.
Give the angles with five digits after the point. The forces must carry the weight to 2 %.
""",
    check,
)
