"""What a force-torque sensor reads under a tool that moves."""

from pathlib import Path

import numpy as np
import pinocchio as pin

from tests.tasks.robots import example_robot, pinocchio_model
from tests.tasks.task import Array, Task, numbers, read_answer, require_close

ANGLES = (0.4, -1.0, 1.2, -0.5, 0.8, 0.3)
VELOCITIES = (0.5, -0.8, 0.6, 1.0, -0.4, 1.2)
ACCELERATIONS = (2.0, -1.0, 3.0, 0.5, 1.5, -2.0)
MASS, OFFSET, MOMENTS = 0.9, (0.01, 0.0, 0.12), (0.004, 0.005, 0.002)


def wrench(v: Array, a: Array) -> Array:
    """Return force and moment on the tool at the flange's origin in its axes, by Newton and Euler."""
    model = pinocchio_model(example_robot("ur5_robot.urdf"))
    data, frame = model.createData(), model.getFrameId("tool0")
    pin.forwardKinematics(model, data, np.array(ANGLES), v, a)
    pin.updateFramePlacements(model, data)
    rotation = data.oMf[frame].rotation
    velocity = pin.getFrameVelocity(model, data, frame, pin.LOCAL)
    acceleration = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL)
    centre, omega, alpha = np.array(OFFSET), velocity.angular, acceleration.angular
    linear = acceleration.linear + np.cross(alpha, centre) + np.cross(omega, np.cross(omega, centre))
    force = MASS * (linear - rotation.T @ np.array([0, 0, -9.81]))
    inertia = np.diag(MOMENTS)
    moment = inertia @ alpha + np.cross(omega, inertia @ omega) + np.cross(centre, force)
    return np.concatenate([force, moment])


def check(folder: Path) -> None:
    """Compare with Newton and Euler's equations of the tool."""
    answer = read_answer(folder, "at_rest", "moving")
    rest, moving = (numbers(name, answer[name], 6) for name in ("at_rest", "moving"))
    zero = np.zeros(6)
    require_close("at_rest", rest, wrench(zero, zero), 1e-3)
    require_close("moving", moving, wrench(np.array(VELOCITIES), np.array(ACCELERATIONS)), 1e-3)


TASK = Task(
    "What does the force-torque sensor read?",
    f"""
A UR5 (robot ur5_robot.urdf of example-robot-data) has a force-torque sensor at its flange, link tool0. The
sensor has no mass. Under it there is a tool: mass {MASS} kg, centre of mass at {OFFSET} m in the frame
of tool0, principal moments of inertia {MOMENTS} kg m2 about the axes of tool0 through the centre of mass.
The robot's joints are at {ANGLES} rad. Gravity is 9.81 m/s2 along -z of `world`.

The sensor reads the force and the moment that the flange puts on the tool, about the origin of tool0 and in
the axes of tool0. What does it read
1. at rest,
2. with the joint velocities {VELOCITIES} rad/s
   and accelerations {ACCELERATIONS} rad/s2?

Write answer.json: {{"at_rest": [fx, fy, fz, mx, my, mz], "moving": [the same six]}}, in N and N m, to 1e-3.
""",
    check,
)
