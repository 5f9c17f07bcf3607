"""Conversion between the coordinates of dynx and those of MuJoCo, for robots and for bodies of a scene.

A floating base is in MuJoCo a body at the centre of mass of the root, with the axes of the base frame: then
MuJoCo's Euler conserves the momentum of a free body, and takes the step of `dynx.simulate`. Its position is
(point, quaternion wxyz), its velocity that of the point in world axes, then the angular velocity in base
axes; forces likewise. A body of a scene is a floating base.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.mjcf import body_coordinates, from_wxyz, robot_coordinates
from dynx.model import Model
from dynx.spatial.plain import minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from dynx.steppers.layout import BodyLayout
from dynx.steppers.state import BodyState, RobotState


class RobotCoordinates:
    """The coordinates of one robot in MuJoCo's q and v, of which it has views."""

    def __init__(self, data: Any, model: Model, first: tuple[int, int]) -> None:
        """`first` are the indices in q and v at which the robot begins."""
        mechanism = model.mechanism
        self._model = model
        self._floating = model.floating
        self._center = np.asarray(mechanism.root_center, dtype=float)
        self._coupling = mechanism.coupling
        self._q: Floats = data.qpos[first[0] : first[0] + mechanism.nq]
        self._v: Floats = data.qvel[first[1] : first[1] + mechanism.nv]
        self._from_wxyz = from_wxyz(mechanism) if mechanism.balls else None
        self._joint_q, self._joint_v = (self._q[7:], self._v[6:]) if model.floating else (self._q, self._v)
        self.applied: Floats = data.qfrc_applied[first[1] : first[1] + mechanism.nv]
        """Generalised forces of MuJoCo that act in the next steps, of the tree."""
        if self._coupling is not None:
            moving = [joint for joint in model.joints if joint.moves]
            owners = [k for k, joint in enumerate(moving) if joint.mimic is None]
            base_q, base_v = (7, 6) if model.floating else (0, 0)
            self._own_q = np.array([*range(base_q), *(base_q + k for k in owners)], dtype=np.intp)
            self._own_v = np.array([*range(base_v), *(base_v + k for k in owners)], dtype=np.intp)

    def read(self) -> RobotState:
        """Return new arrays q, v in the coordinates of the model."""
        if self._from_wxyz is not None:
            q, v = self._q[self._from_wxyz], self._v.copy()
        elif self._coupling is None:
            q, v = self._q.copy(), self._v.copy()
        else:
            q, v = self._q[self._own_q], self._v[self._own_v]
        if self._floating:
            x, y, z, qw, qx, qy, qz = q[:7].tolist()
            base_v, c = v[:6].tolist(), self._center.tolist()
            R = rotation_rows(qx, qy, qz, qw)
            ahead = rotate(R, c)
            q[:7] = x - ahead[0], y - ahead[1], z - ahead[2], qx, qy, qz, qw
            v[:3] = minus_cross(rotate_back(R, base_v[:3]), base_v[3:], c)
        return RobotState(q, v)

    def read_joints(self) -> RobotState:
        """Return new arrays of the positions and velocities of the joints of the model."""
        if self._coupling is not None or self._from_wxyz is not None:
            q, v = self.read()
            return RobotState(q[7:], v[6:]) if self._floating else RobotState(q, v)
        return RobotState(self._joint_q.copy(), self._joint_v.copy())

    def write(self, q: Floats, v: Floats) -> None:
        """Set the state from q, v in the coordinates of the model."""
        self._q[:], self._v[:] = robot_coordinates(self._model, q, v)

    def forces(self, tau: Floats) -> Floats:
        """Return a torque with the wrench on a floating base, `tau[:6]` at its origin in its axes, converted
        to MuJoCo's."""
        if not self._floating or not any(tau[:6].tolist()):
            return tau
        R, force = self._rotation(), tau[:3]
        return np.concatenate([R @ force, tau[3:6] - cross(self._center, force), tau[6:]])

    def _rotation(self) -> Floats:
        """Return the rotation (3, 3) of a floating base."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, self._q[3:7])
        return matrix.reshape(3, 3)


class BodyCoordinates:
    """The state of one moving body of a scene, of which it has views."""

    def __init__(self, model: Any, data: Any, body: int, layout: BodyLayout) -> None:
        joint = model.body_jntadr[body]
        at, first = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        self._center = layout.center
        self._offset = bool(layout.center.any())
        self._q: Floats = data.qpos[at : at + 7]
        self._v: Floats = data.qvel[first : first + 6]

    def read(self) -> BodyState:
        """Return new arrays: the pose (4, 4) and the twist (6,) in world axes."""
        matrix, T, twist = np.empty(9), np.eye(4), np.empty(6)
        mujoco.mju_quat2Mat(matrix, self._q[3:])
        T[:3, :3] = R = matrix.reshape(3, 3)
        T[:3, 3] = self._q[:3]
        twist[:3] = self._v[:3]
        twist[3:] = R @ self._v[3:]
        if self._offset:
            lever = R @ self._center
            T[:3, 3] -= lever
            twist[:3] -= cross(twist[3:], lever)
        return BodyState(T, twist)

    def write(self, T: Floats, twist: Floats) -> None:
        """Set the pose and the twist."""
        self._q[:], self._v[:] = body_coordinates(T, twist, self._center)
