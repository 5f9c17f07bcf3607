"""Conversion between the coordinates of dynx and those of a plant, for robots and for bodies of a scene.

A floating base is in Drake a body at the centre of mass of the root, with the axes of the base frame: then a
free body keeps its momentum. Its position is (quaternion wxyz, point), its velocity (angular, linear) in
world axes; forces likewise. A body of a scene is a floating base.

Drake's step leaves quaternions longer than one, by (omega dt)^2 / 8; Drake itself normalises what it reads.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.model import Model
from dynx.model.elements import Joint
from dynx.model.mechanism import Mechanism
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat
from dynx.steppers.state import BodyState, RobotState

_POINT_THEN_XYZW = (4, 5, 6, 1, 2, 3, 0)
_LINEAR_THEN_ANGULAR = (3, 4, 5, 0, 1, 2)


def root_center(mechanism: Mechanism) -> Floats:
    """Return the centre of mass (3,) of the root in the base frame [m]; zero without mass, and for a fixed
    base."""
    mass = mechanism.root.mass
    if not mechanism.floating or mass == 0.0:
        return np.zeros(3)
    return np.asarray(mechanism.root.first_moment / mass, dtype=float)


class RobotCoordinates:
    """The coordinates of one robot in the plant's q and v."""

    def __init__(
        self, model: Model, joints_q: Sequence[int], joints_v: Sequence[int], base: tuple[int, int] | None
    ) -> None:
        """`joints_q` and `joints_v` are the plant's indices of the joints of the mechanism, `base` those of
        a floating base."""
        mechanism = model.mechanism
        self._floating = model.floating
        self._center = root_center(mechanism)
        self._coupling = mechanism.coupling
        self._S = np.eye(mechanism.nv) if self._coupling is None else self._coupling.matrix()
        own = np.array([k for k, joint in enumerate(_moving(model)) if joint.mimic is None], dtype=np.intp)
        at_q = [] if base is None else [base[0] + k for k in _POINT_THEN_XYZW]
        at_v = [] if base is None else [base[1] + k for k in _LINEAR_THEN_ANGULAR]
        self._tree_q: Array = np.array([*at_q, *joints_q], dtype=np.intp)
        self._tree_v: Array = np.array([*at_v, *joints_v], dtype=np.intp)
        self._own_q: Array = np.concatenate([self._tree_q[: len(at_q)], self._tree_q[len(at_q) + own]])
        self._own_v: Array = np.concatenate([self._tree_v[: len(at_v)], self._tree_v[len(at_v) + own]])

    def read(self, q_plant: Floats, v_plant: Floats) -> RobotState:
        """Return new arrays q, v in the coordinates of the model."""
        q, v = q_plant[self._own_q], v_plant[self._own_v]
        if self._floating:
            q[3:7] /= np.sqrt(q[3:7].dot(q[3:7]))
            R = rotation_from_quat(q[3:7])
            q[:3] -= R @ self._center
            v[3:6] = v[3:6] @ R
            v[:3] = v[:3] @ R - cross(v[3:6], self._center)
        return RobotState(q, v)

    def write(self, q: Floats, v: Floats, q_plant: Floats, v_plant: Floats) -> None:
        """Write the state q, v in the coordinates of the model into arrays of the plant."""
        if self._coupling is not None:
            q, v = self._coupling.expand_q(q), self._S @ v
        if self._floating:
            q, v = q.copy(), v.copy()
            R = rotation_from_quat(q[3:7])
            q[:3] += R @ self._center
            v[:3] = R @ (v[:3] + cross(v[3:6], self._center))
            v[3:6] = R @ v[3:6]
        q_plant[self._tree_q] = q
        v_plant[self._tree_v] = v

    def write_forces(self, tau: Floats, q_plant: Floats, forces: Floats) -> None:
        """Write a torque, with the wrench on a floating base, `tau[:6]` at its origin in its axes, into the
        generalized forces of the plant."""
        if self._floating:
            quat = q_plant[self._tree_q[3:7]]
            R, force = rotation_from_quat(quat / np.sqrt(quat.dot(quat))), tau[:3]
            moment = tau[3:6] - cross(self._center, force)
            tau = np.concatenate([R @ force, R @ moment, tau[6:]])
        forces[self._own_v] = tau


class BodyCoordinates:
    """The coordinates of one moving body of a scene in the plant's q and v."""

    def __init__(self, center: Floats, first_q: int, first_v: int) -> None:
        self._center = center
        self._q = slice(first_q, first_q + 7)
        self._v = slice(first_v, first_v + 6)
        self.forces = self._v
        """Part of the plant's generalized forces: moment, then force, in world axes."""

    def read(self, q_plant: Floats, v_plant: Floats) -> BodyState:
        """Return new arrays: the pose (4, 4) and the twist (6,) in world axes."""
        w, x, y, z, *point = q_plant[self._q]
        quat = np.array([x, y, z, w])
        R = rotation_from_quat(quat / np.sqrt(quat.dot(quat)))
        omega, linear = v_plant[self._v][:3], v_plant[self._v][3:]
        lever = R @ self._center
        twist = np.concatenate([linear - cross(omega, lever), omega])
        return BodyState(homogeneous(R, np.array(point) - lever), twist)

    def write(self, T: Floats, twist: Floats, q_plant: Floats, v_plant: Floats) -> None:
        """Write the pose and the twist into arrays of the plant."""
        R = T[:3, :3]
        lever = R @ self._center
        x, y, z, w = quat_from_rotation(R)
        q_plant[self._q] = [w, x, y, z, *(T[:3, 3] + lever)]
        v_plant[self._v] = [*twist[3:], *(twist[:3] + cross(twist[3:], lever))]


def _moving(model: Model) -> list[Joint]:
    return [joint for joint in model.joints if joint.moves]
