"""Robots and bodies of a scene in Bullet, in the coordinates of dynx.

**The trap.** Bullet gives every joint of a loaded robot a velocity motor that holds it at speed 0, and
POSITION_CONTROL or VELOCITY_CONTROL leave one active when they are no longer called. A torque that is
commanded afterwards is added to that of the motor, which cancels it: the arm does not move, and there is no
message. A motor is released by VELOCITY_CONTROL with a force of 0, as `BulletRobot` does when it is made and
whenever torques follow a command. Bullet also damps every link (0.04 of its speed per second), damps joints
as in the URDF, and limits speeds to 100: dynx switches all of that off.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dynx.backends import Backend, backend
from dynx.backends.solvability import Solvability
from dynx.engines.pybullet.build import UNLIMITED, BaseState, BulletObject, ShapeFiles
from dynx.engines.pybullet.client import BulletClient
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.model.mechanism import Mechanism
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.branchless import quat_exp
from dynx.spatial.inertia import inertia_about_origin
from dynx.spatial.scalar import Floats, longdouble
from dynx.spatial.so3 import cross, quat_from_rotation, quat_product, rotation_from_quat
from dynx.steppers.layout import BodyLayout, Collider, RobotLayout
from dynx.steppers.state import BodyState, RobotState


class BulletBody:
    """A rigid body with shapes; its root frame in Bullet is its centre of mass with the principal axes."""

    def __init__(
        self,
        client: BulletClient,
        layout: BodyLayout,
        colliders: Mapping[int, Collider],
        files: ShapeFiles,
        folder: Path,
    ) -> None:
        inertia = inertia_about_origin(
            longdouble(layout.mass),
            longdouble(layout.center),
            longdouble(np.eye(3)),
            longdouble(layout.inertia),
        )
        mechanism = Mechanism(layout.name, not layout.fixed, longdouble(np.zeros(3)), inertia, (), (), None)
        self.object = BulletObject(client, mechanism, colliders, files, folder, {})
        self._layout = layout
        self._axes = self.object.root.axes
        self.set_state(layout.T, layout.twist)

    def set_state(self, T: Floats, twist: Floats) -> None:
        """Set pose and twist of the body frame."""
        R, lever = T[:3, :3], T[:3, :3] @ self.object.root.center
        self.object.place_base(
            BaseState(
                (T[:3, 3] + lever).tolist(),
                quat_from_rotation(R @ self._axes).tolist(),
                (twist[:3] + cross(twist[3:], lever)).tolist(),
                twist[3:].tolist(),
            )
        )

    def state(self) -> BodyState:
        """Return pose and twist of the body frame."""
        if self._layout.fixed:
            return BodyState(self._layout.T.copy(), np.zeros(6))
        return BodyState(*self.object.root.pose_and_twist(self.object.base_state()))


STIFF = 0.25
"""Share of a joint's speed that damping may remove in a step by Bullet's own, explicit law."""


class BulletRobot:
    """A robot with the shapes of its links, its joint limits, damping and friction.

    Bullet's stepper has no mimic joints. Their robot moves with all joints free during a step; the velocity
    at its end is then projected, in the metric of the mass matrix, on those that the coupling allows. That is
    Gauss' principle, so torques, contacts and limits act on followers and drivers as they should. Bullet's
    damping uses the velocity at the beginning of a step, which diverges where it is stiff; then the velocity
    at the end is damped in the same correction.
    """

    def __init__(
        self,
        client: BulletClient,
        layout: RobotLayout,
        colliders: Mapping[int, Collider],
        files: ShapeFiles,
        folder: Path,
        h: float,
    ) -> None:
        model = layout.model
        self.model = model
        self._h = h
        self._base = 6 if model.floating else 0
        limited = np.flatnonzero(np.isfinite(layout.lower) | np.isfinite(layout.upper)).tolist()
        limits = {
            k: (max(float(layout.lower[k]), -UNLIMITED), min(float(layout.upper[k]), UNLIMITED))
            for k in limited
        }
        mechanism = model.extended_mechanism
        if model.floating and not model.mechanism.root.mass > 0.0:
            Solvability(model).refuse_singular(joint_dynamics=False)
        self.object = BulletObject(client, mechanism, colliders, files, folder, limits)
        self._client = client
        self._coupling = model.mechanism.coupling
        self._S = np.eye(model.nv) if self._coupling is None else self._coupling.matrix()
        joints = self._S[self._base :, self._base :]
        # A driver shares its torque with its followers, at the same power: the contacts of a step, which
        # Bullet solves with all joints free, then press as those of the coupled joints do.
        self._shares = joints @ np.linalg.inv(joints.T @ joints)
        owns = [joint.mimic is None for joint in model.joints if joint.moves]
        self._owners: list[int] = np.flatnonzero(owns).tolist()
        self._friction = layout.friction
        self.near = [0.0, 0.0, 0.0, 1.0]
        """Quaternion (4,) of the last state read, whose sign the next one has."""
        self.placed: BaseState | None = None
        """State of a floating root that was set last."""
        # Looked up once, because every step applies torques.
        self._control = client.engine.setJointMotorControlArray
        self._torque_control = client.engine.TORQUE_CONTROL
        self._body, self._links, self._number = self.object.body, self.object.links, client.number
        stiff = self._is_stiff(layout)
        self.corrected = self._coupling is not None or stiff
        """True if the robot has mimic joints or stiff damping, so that `before_step` and `after_step` must be
        called."""
        base = np.zeros(self._base)
        self._damping = h * self._S.T @ np.diag(np.concatenate([base, layout.damping])) @ self._S
        if not self.corrected:
            self._damp(layout.damping)
        self.release_motors()
        self.set_state(layout.q, layout.v)

    def _is_stiff(self, layout: RobotLayout) -> bool:
        """Check whether damping removes more than `STIFF` of a joint's speed in a step at the start."""
        if not layout.damping.any():
            return False
        M = self._tree_dynamics.mass_matrix(self._tree_q(layout.q))
        inertia = np.linalg.pinv(M).diagonal()[self._base :]
        return bool((self._h * layout.damping * inertia > STIFF).any())

    def _damp(self, damping: Floats) -> None:
        for k, number in zip(self.object.links, damping.tolist(), strict=True):
            if number:
                self._client.call(
                    self._client.engine.changeDynamics, self.object.body, k, jointDamping=number
                )

    def _tree_q(self, q: Floats) -> Floats:
        return q if self._coupling is None else self._coupling.expand_q(q)

    # -- state --------------------------------------------------------------------------------

    def set_state(self, q: Floats, v: Floats) -> None:
        """Set the configuration and velocity of the model."""
        tree_q = self._tree_q(q)
        tree_v = self._S @ v
        if self._base:
            self.near = q[3:7].tolist()
            self.placed = self.object.root.base_state(q, v)
            self.object.place_base(self.placed)
            tree_q = tree_q[7:]
        self.object.place_joints(tree_q.tolist(), tree_v[self._base :].tolist())

    def state(self) -> RobotState:
        """Return the configuration and velocity of the model."""
        positions, rates = self._joint_states()
        if not self._base:
            return RobotState(np.array(positions), np.array(rates))
        q, v = self.object.root.coordinates(self.object.base_state(), self.near)
        self.near = q[3:]
        return RobotState(np.array(q + positions), np.array(v + rates))

    def joint_state(self) -> RobotState:
        """Return the positions and velocities of the joints of the model."""
        positions, rates = self._joint_states()
        return RobotState(np.array(positions), np.array(rates))

    def _joint_states(self) -> tuple[list[float], list[float]]:
        positions, rates = self.object.joint_states()
        if self._coupling is not None:
            return [positions[k] for k in self._owners], [rates[k] for k in self._owners]
        return positions, rates

    # -- forces -------------------------------------------------------------------------------

    def apply(self, forces: list[float]) -> None:
        """Apply a generalised force (nv,) during the next step. The engine's own errors are not
        translated."""
        if self._base:
            if any(forces[:6]):
                self._push_base(forces)
            forces = forces[6:]
        if not any(forces):
            return
        if self._coupling is not None:
            forces = (self._shares @ forces).tolist()
        self._control(
            self._body, self._links, self._torque_control, forces=forces, physicsClientId=self._number
        )

    def _push_base(self, tau: list[float]) -> None:
        """Apply the wrench of a generalised force on a floating base during the next step."""
        q, _ = self.object.root.coordinates(self.object.base_state(), self.near)
        R, force, moment = rotation_from_quat(np.array(q[3:])), np.array(tau[:3]), np.array(tau[3:6])
        moment -= cross(self.object.root.center, force)
        self.object.push_base((R @ force).tolist(), (R @ moment).tolist())

    def command(self, command: BulletMotorCommand | None) -> None:
        """Set Bullet's motors of all joints; None releases them."""
        self.release_motors()
        if command is not None and self.object.links:
            engine = self._client.engine
            mode = getattr(engine, command.mode)
            if command.max_velocities is None:
                self._client.call(
                    engine.setJointMotorControlArray,
                    self.object.body,
                    self.object.links,
                    mode,
                    **command.options(),
                )
                return
            # The call for all joints at once has no largest velocity.
            for k, link in enumerate(self.object.links):
                self._client.call(
                    engine.setJointMotorControl2, self.object.body, link, mode, **command.options(k)
                )

    def motor_torque(self, command: BulletMotorCommand) -> Floats:
        """Return the torque (nv,) of Bullet's motors in the last step; NaN for PD_CONTROL, which Bullet's
        report leaves out."""
        links = self.object.links
        torque = np.zeros(self._base + len(links))
        if command.mode == "TORQUE_CONTROL":
            torque[self._base :] = command.forces or 0.0
        elif command.mode == "PD_CONTROL":
            torque[self._base :] = np.nan
        elif links:
            states = self._client.call(self._client.engine.getJointStates, self._body, links)
            torque[self._base :] = [state[3] for state in states]
        return torque

    def release_motors(self) -> None:
        """Let Bullet's motors, which hold every joint of a loaded robot, give only its Coulomb friction."""
        if self.object.links:
            engine = self._client.engine
            self._client.call(
                engine.setJointMotorControlArray,
                self.object.body,
                self.object.links,
                engine.VELOCITY_CONTROL,
                forces=self._friction.tolist(),
            )

    # -- mimic joints and stiff damping ---------------------------------------------------------

    @cached_property
    def _tree_dynamics(self) -> Backend:
        """The robot with its mimic joints free."""
        joints = tuple(replace(joint, mimic=None) for joint in self.model.joints)
        return backend(DEFAULT_ENGINE, replace(self.model, joints=joints), validate=False)

    def before_step(self) -> None:
        """Note the state at the beginning of a step."""
        self._begun = self.state()

    def after_step(self) -> None:
        """Correct the velocity at the end of a step, and step to it from the noted state."""
        q, h, base = self._begun.q, self._h, self._base
        M = self._tree_dynamics.mass_matrix(self._tree_q(q))
        rates = np.array(self.object.joint_states()[1])
        if not base:
            v = self._correct(M, rates)
            self.set_state(q + h * v, v)
            return
        R, c = rotation_from_quat(q[3:7]), self.object.root.center
        after = self.object.base_state()
        # The velocity of the base frame as it was placed when the step began.
        w = R.T @ np.array(after.angular)
        linear = R.T @ np.array(after.linear) - cross(w, c)
        v = self._correct(M, np.concatenate([linear, w, rates]))
        angular, linear = R @ v[3:6], R @ (v[:3] + cross(v[3:6], c))
        quat = quat_product(quat_exp(h * angular), q[3:7])
        quat = quat / np.sqrt(quat.dot(quat))
        R_next = rotation_from_quat(quat)
        position = q[:3] + R @ c + h * linear - R_next @ c
        w = R_next.T @ angular
        v = np.concatenate([R_next.T @ linear - cross(w, c), w, v[6:]])
        self.set_state(np.concatenate([position, quat, q[7:] + h * v[6:]]), v)

    def _correct(self, M: Floats, v: Floats) -> Floats:
        """Return the velocity of the model nearest to that of the tree in the metric M, damped."""
        S = self._S
        A, momentum = S.T @ M @ S + self._damping, S.T @ (M @ v)
        try:
            return np.asarray(np.linalg.solve(A, momentum))
        except np.linalg.LinAlgError:
            # A joint that moves no mass keeps no speed.
            return np.asarray(np.linalg.lstsq(A, momentum)[0])

    def close(self) -> None:
        """Close the clients of its own."""
        if "_tree_dynamics" in self.__dict__:
            self._tree_dynamics.close()
