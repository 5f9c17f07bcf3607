"""Spherical joints of URDF: PyBullet's own motion of a file, against the ball joint that dynx reads."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.spatial.scalar import Floats

bullet = pytest.importorskip("pybullet")

STEP, RATE = 1e-4, np.array([1.0, 2.0, -1.5])
"""Step [s], and angular velocity of the joint at the start [rad/s]."""


def description(inside: str = "") -> str:
    """Return a pendulum on a spherical joint that is placed askew."""
    return f"""<robot name="pendulum"><link name="base"/><link name="bob"><inertial>
      <origin xyz="0.1 0.05 -0.3"/><mass value="2"/>
      <inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="ball" type="spherical"><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/>
      <parent link="base"/><child link="bob"/>{inside}</joint></robot>"""


def acceleration(text: str, folder: Path, quat: Floats) -> Floats:
    """Return the change of the joint's velocity in one step of PyBullet, by the step [rad/s^2]."""
    path = folder / "robot.urdf"
    path.write_text(text)
    client: Any = {"physicsClientId": bullet.connect(bullet.DIRECT)}
    try:
        bullet.setPhysicsEngineParameter(enableFileCaching=0, **client)
        bullet.setGravity(0.0, 0.0, -9.81, **client)
        bullet.setTimeStep(STEP, **client)
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(str(path), useFixedBase=True, flags=flags, **client)
        bullet.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0, **client)
        # Its own motor holds the joint.
        at_rest = {"positionGain": 0, "velocityGain": 0, "force": [0.0] * 3}
        bullet.setJointMotorControlMultiDof(
            body, 0, bullet.POSITION_CONTROL, targetPosition=[0.0, 0.0, 0.0, 1.0], **at_rest, **client
        )
        bullet.resetJointStateMultiDof(body, 0, quat.tolist(), RATE.tolist(), **client)
        bullet.stepSimulation(**client)
        found = np.array(bullet.getJointStateMultiDof(body, 0, **client)[1])
    finally:
        bullet.disconnect(**client)
    return np.asarray((found - RATE) / STEP)


@pytest.mark.parametrize("turned", [0.0, 1.2])
@pytest.mark.parametrize(
    ("inside", "damping"),
    [
        ("", 0.0),
        ('<axis xyz="0 1 0"/>', 0.0),
        ('<dynamics damping="0.7"/>', 0.7),
        ('<limit effort="10" velocity="100"/>', 0.0),
    ],
)
def test_a_spherical_joint_moves_in_pybullet_as_a_ball_joint_does(
    inside: str, damping: float, turned: float, tmp_path: Path
) -> None:
    text = description(inside)
    model = dynx.load(text)
    quat = dynx.quat_from_rpy((turned, -0.5 * turned, 0.3 * turned))
    tau = -damping * RATE
    exact = dynx.backend("reference", model).forward_dynamics(quat, RATE, tau)
    found = acceleration(text, tmp_path, quat)
    # The step is semi-implicit Euler, so that rounding of the velocities alone is divided by it.
    rounding = 16.0 * np.finfo(float).eps * float(np.abs(RATE).max()) / STEP
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=rounding)
