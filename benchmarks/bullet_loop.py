"""The tutorial's own loop in PyBullet, in two forms.

`run` is the shortest form there is: PyBullet and nothing else, the reference computed before the loop, as
lists, which PyBullet takes fastest. `run_with_numpy` is how a user of NumPy writes it, the reference
computed in each step. What dynx does on the plant `pybullet` is done here by hand: motors released, damping
off, a file without meshes.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.bindings.urdf_text import spelled_out
from benchmarks.tutorial_motion import DT, END, GRAVITY, KD, KP, STEPS, Task
from dynx.engines.pybullet.library import bullet
from dynx.spatial.scalar import Floats

Rows = list[list[float]]


class BulletStepper:
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

    def run_with_numpy(self) -> Floats:
        """Run the loop with NumPy arrays, evaluating the cycloid in each step."""
        engine, client, arm, joints = self._engine, self.client, self.arm, self.joints
        for joint in joints:
            engine.resetJointState(arm, joint, 0.0, 0.0, physicsClientId=client)
        n, tf, way = len(self._wanted[0]), STEPS * DT, np.array(END)
        positions, velocities, torques = np.empty((n + 1, 6)), np.empty((n + 1, 6)), np.empty((n, 6))
        for k in range(n):
            phase = 2.0 * np.pi * k * DT / tf
            q_wanted = way / tf * (k * DT - tf / (2.0 * np.pi) * np.sin(phase))
            v_wanted = way / tf * (1.0 - np.cos(phase))
            a_wanted = way / tf * (2.0 * np.pi / tf) * np.sin(phase)
            states = engine.getJointStates(arm, joints, physicsClientId=client)
            q = np.array([state[0] for state in states])
            v = np.array([state[1] for state in states])
            a = a_wanted + KD * (v_wanted - v) + KP * (q_wanted - q)
            tau = engine.calculateInverseDynamics(arm, list(q), list(v), list(a), physicsClientId=client)
            engine.setJointMotorControlArray(
                arm, joints, engine.TORQUE_CONTROL, forces=tau, physicsClientId=client
            )
            engine.stepSimulation(physicsClientId=client)
            positions[k], velocities[k], torques[k] = q, v, tau
        states = engine.getJointStates(arm, joints, physicsClientId=client)
        positions[n] = [state[0] for state in states]
        return positions

    def close(self) -> None:
        """End the world."""
        self._engine.disconnect(physicsClientId=self.client)
