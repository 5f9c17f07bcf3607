"""Calls of PyBullet's own binding, each with the work and the outputs of one method of a backend.

A pose of a link's frame (entries 4 and 5 of `getLinkState`) is rounded to single precision, so poses and
velocities of links differ from those of dynx by some 1e-7.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.bindings.sample import FRAME, Call, Sample
from benchmarks.bindings.urdf_text import spelled_out
from dynx.engines.pybullet.library import bullet
from dynx.model import Model
from dynx.spatial.scalar import Floats


def binding_calls(model: Model, sample: Sample) -> dict[str, Call]:
    """Return the calls of PyBullet's binding on a body that its own parser reads.

    Motors are released and damping is off. A step of one second adds the acceleration to the velocity.
    """
    engine: Any = bullet()
    client = engine.connect(engine.DIRECT)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.urdf"
        path.write_text(spelled_out(model), encoding="utf-8")
        flags = engine.URDF_USE_INERTIA_FROM_FILE
        arm = engine.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=client)
    engine.setGravity(*model.gravity, physicsClientId=client)
    engine.setPhysicsEngineParameter(fixedTimeStep=1.0, numSubSteps=0, physicsClientId=client)
    info = [
        engine.getJointInfo(arm, k, physicsClientId=client) for k in range(engine.getNumJoints(arm, client))
    ]
    joints = [entry[0] for entry in info if entry[2] != engine.JOINT_FIXED]
    link_of = {entry[12].decode(): entry[0] for entry in info}
    tool, links = link_of[FRAME], [link_of.get(name, -1) for name in model.frame_names]
    children = [link for link in links if link >= 0]
    rows = [row for row, link in enumerate(links) if link >= 0]
    engine.setJointMotorControlArray(
        arm, joints, engine.VELOCITY_CONTROL, forces=[0.0] * len(joints), physicsClientId=client
    )
    for link in (-1, *link_of.values()):
        engine.changeDynamics(
            arm, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client
        )
    engine.changeDynamics(arm, -1, maxJointVelocity=1e300, physicsClientId=client)
    q, v, a, tau, rest = sample.q, sample.v, sample.a, sample.tau, [0.0] * model.nv
    origin = [0.0, 0.0, 0.0]

    def positions() -> None:
        engine.resetJointStatesMultiDof(arm, joints, [[x] for x in q.tolist()], physicsClientId=client)

    def state() -> None:
        engine.resetJointStatesMultiDof(
            arm, joints, [[x] for x in q.tolist()], [[x] for x in v.tolist()], physicsClientId=client
        )

    def pose(position: Any, quat_xyzw: Any) -> Floats:
        T = np.eye(4)
        T[:3, :3] = np.array(engine.getMatrixFromQuaternion(quat_xyzw)).reshape(3, 3)
        T[:3, 3] = position
        return T

    def forward_kinematics() -> Floats:
        positions()
        found = engine.getLinkState(arm, tool, 0, 1, physicsClientId=client)
        return pose(found[4], found[5])

    def all_frames() -> Floats:
        positions()
        T = np.tile(np.eye(4), (len(links), 1, 1))
        found = engine.getLinkStates(arm, children, 0, 1, physicsClientId=client)
        T[rows] = [pose(each[4], each[5]) for each in found]
        return T

    def jacobian() -> Floats:
        linear, angular = engine.calculateJacobian(
            arm, tool, origin, q.tolist(), rest, rest, physicsClientId=client
        )
        return np.array([*linear, *angular])

    def frame_velocity() -> Floats:
        state()
        found = engine.getLinkState(arm, tool, 1, 1, physicsClientId=client)
        return np.array([*found[6], *found[7]])

    def inverse_dynamics() -> Floats:
        return np.array(
            engine.calculateInverseDynamics(arm, q.tolist(), v.tolist(), a.tolist(), physicsClientId=client)
        )

    def forward_dynamics() -> Floats:
        state()
        engine.setJointMotorControlArray(
            arm, joints, engine.TORQUE_CONTROL, forces=tau.tolist(), physicsClientId=client
        )
        engine.stepSimulation(physicsClientId=client)
        after = engine.getJointStates(arm, joints, physicsClientId=client)
        return np.array([each[1] for each in after]) - v

    def mass_matrix() -> Floats:
        return np.array(engine.calculateMassMatrix(arm, q.tolist(), physicsClientId=client))

    def bias_torque() -> Floats:
        return np.array(
            engine.calculateInverseDynamics(arm, q.tolist(), v.tolist(), rest, physicsClientId=client)
        )

    def gravity_torque() -> Floats:
        return np.array(engine.calculateInverseDynamics(arm, q.tolist(), rest, rest, physicsClientId=client))

    return {
        "forward_kinematics": forward_kinematics,
        "all frames": all_frames,
        "jacobian": jacobian,
        "frame_velocity": frame_velocity,
        "inverse_dynamics": inverse_dynamics,
        "forward_dynamics": forward_dynamics,
        "mass_matrix": mass_matrix,
        "bias_torque": bias_torque,
        "gravity_torque": gravity_torque,
    }
