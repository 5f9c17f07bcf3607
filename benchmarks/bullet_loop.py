"""The tutorial's own loop: PyBullet and nothing else, as its user writes it.

What dynx does on the plant `pybullet` is done here by hand: motors released, damping off. The file that it
reads has no meshes, and the reference is computed before the loop, as lists, which PyBullet takes fastest.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from benchmarks.tutorial_motion import DT, GRAVITY, KD, KP, Task
from benchmarks.urdf_for_peers import spelled_out
from dynx.engines.pybullet import bullet

Rows = list[list[float]]


class BulletWorld:
    """UR5 in a Bullet world of its own, with nothing on its joints but what is commanded.

    Raises NotInstalledError without PyBullet.
    """

    def __init__(self, task: Task, substeps: int) -> None:
        self._wanted: list[Rows] = [rows[:-1].tolist() for rows in task.wanted]
        engine = self._engine = bullet()
        client = self.client = engine.connect(engine.DIRECT)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(spelled_out(task.model), encoding="utf-8")
            flags = engine.URDF_USE_INERTIA_FROM_FILE
            arm = self.arm = engine.loadURDF(
                str(path), useFixedBase=True, flags=flags, physicsClientId=client
            )
        engine.setGravity(*GRAVITY, physicsClientId=client)
        engine.setPhysicsEngineParameter(fixedTimeStep=DT, numSubSteps=substeps, physicsClientId=client)
        links = range(engine.getNumJoints(arm, physicsClientId=client))
        kinds = [engine.getJointInfo(arm, link, physicsClientId=client)[2] for link in links]
        self.joints = [link for link in links if kinds[link] != engine.JOINT_FIXED]
        engine.setJointMotorControlArray(
            arm, self.joints, engine.VELOCITY_CONTROL, forces=[0.0] * len(self.joints), physicsClientId=client
        )
        for link in (-1, *links):
            engine.changeDynamics(
                arm, link, linearDamping=0.0, angularDamping=0.0, jointDamping=0.0, physicsClientId=client
            )

    def run(self) -> Rows:
        """Follow the motion from the start; positions (n_steps + 1, 6)."""
        engine, client, arm, joints = self._engine, self.client, self.arm, self.joints
        joint_states, inverse_dynamics = engine.getJointStates, engine.calculateInverseDynamics
        command, torque_control, advance = (
            engine.setJointMotorControlArray,
            engine.TORQUE_CONTROL,
            engine.stepSimulation,
        )
        for joint in joints:
            engine.resetJointState(arm, joint, 0.0, 0.0, physicsClientId=client)
        positions, velocities, torques = [], [], []
        for q_wanted, v_wanted, a_wanted in zip(*self._wanted, strict=True):
            states = joint_states(arm, joints, physicsClientId=client)
            q, v = [state[0] for state in states], [state[1] for state in states]
            a = [
                a_ + KD * (v_ - v_now) + KP * (q_ - q_now)
                for q_, v_, a_, q_now, v_now in zip(q_wanted, v_wanted, a_wanted, q, v, strict=True)
            ]
            tau = inverse_dynamics(arm, q, v, a, physicsClientId=client)
            command(arm, joints, torque_control, forces=tau, physicsClientId=client)
            advance(physicsClientId=client)
            positions.append(q)
            velocities.append(v)
            torques.append(tau)
        states = joint_states(arm, joints, physicsClientId=client)
        positions.append([state[0] for state in states])
        return positions

    def close(self) -> None:
        """End the world."""
        self._engine.disconnect(physicsClientId=self.client)
