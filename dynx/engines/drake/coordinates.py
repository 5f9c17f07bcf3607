"""Conversion between the coordinates of dynx and those of Drake.

**In the backend** a floating base has the position (quaternion wxyz, origin in the world) and the velocity V
= (angular, linear), both in world axes; in dynx (origin, quaternion xyzw) and (linear, angular) in base axes.
With R = R_world_base, V = (R w, R u) for the dynx velocity (u, w), so dV/dt = (R dw, R (du + w x u)), and the
transpose converts forces back (virtual work). Joint coordinates only change their order.

Source: Drake's documentation of `QuaternionFloatingJoint`; Featherstone, Rigid Body Dynamics Algorithms,
section 2.10, for the two time derivatives.

A ball joint of a file (`BallJointCoordinates`) has in Drake the angles (roll, pitch, yaw) of the frame M on
the child in the frame F on the parent, and its angular velocity in the axes of F (`BallRpyJoint`); in dynx
the quaternion of the child in its attitude at 0, and its angular velocity in its own axes. M is fixed in the
child by R_CM, and at 0 it is F. So R_FM = R_CM' R(q) R_CM, and the angular velocity is W v, W = R_CM' R(q).
W' W = 1, so torques are W tau; dW/dt v = W (v x v) = 0, so accelerations are W a.

**In the stepper** it is a body at the centre of mass of the root, with the axes of the base frame: then a
free body keeps its momentum. Its position is (quaternion wxyz, point), its velocity (angular, linear) in
world axes; forces likewise. A body of a scene is a floating base.

Drake's step leaves quaternions longer than one, by (omega dt)^2 / 8; Drake itself normalises what it reads.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.model import Model
from dynx.model.elements import Joint
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat
from dynx.steppers.state import BodyState, RobotState

_QUATERNION_THEN_ORIGIN = (6, 3, 4, 5, 0, 1, 2)
_ANGULAR_THEN_LINEAR = (3, 4, 5, 0, 1, 2)


class DrakeCoordinates:
    """The map between the tree coordinates of dynx and those of a plant, one sample at a time.

    `q_index` and `v_index` are the plant's indices of the joints of dynx, in tree order. `n_q` and `n_v` are
    the sizes of the plant's q and v, in which entries that dynx does not have are zero. `base` is the index
    of the floating base in both, or None for a fixed base. The argument R of methods is the result of
    `attitude` at the configuration.
    """

    def __init__(
        self,
        q_index: Sequence[int],
        v_index: Sequence[int],
        n_q: int,
        n_v: int,
        base: tuple[int, int] | None = None,
    ) -> None:
        self._floating = base is not None
        at_q, at_v = base or (0, 0)
        base_q = [at_q + _QUATERNION_THEN_ORIGIN.index(k) for k in range(7)] if base else []
        base_v = [at_v + _ANGULAR_THEN_LINEAR.index(k) for k in range(6)] if base else []
        self._from_q, self._pad_q = _gather([*base_q, *q_index], n_q)
        self._from_v, self._pad_v = _gather([*base_v, *v_index], n_v)
        self._columns = np.array([*base_v, *v_index], dtype=int)
        # No conversion is needed where the coordinates are the same.
        self._same = base is None and list(q_index) == list(range(n_q)) and list(v_index) == list(range(n_v))

    def attitude(self, q: Floats) -> Floats:
        """Return R_world_base (3, 3); an unused empty array for a fixed base."""
        if not self._floating:
            return _EMPTY
        # Written in plain Python, because NumPy takes ten times as long for such small arrays.
        x, y, z, w = q[3:7].tolist()
        xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
        wx, wy, wz = w * x, w * y, w * z
        return np.array(
            (
                (1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)),
                (2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)),
                (2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)),
            )
        )

    def positions(self, q: Floats) -> Floats:
        """Return the plant's q at the configuration `q` of dynx."""
        if self._same:
            return q
        return (np.append(q, 0.0) if self._pad_q else q)[self._from_q]

    def velocities(self, R: Floats, v: Floats) -> Floats:
        """Return the plant's v at the velocity `v` of dynx."""
        return v if self._same else self._to_plant(R, v)

    def accelerations(self, R: Floats, v: Floats, a: Floats) -> Floats:
        """Return the plant's dv/dt at the velocity `v` and the acceleration `a` of dynx."""
        if self._same:
            return a
        if self._floating:
            a = a.copy()
            a[:3] += _cross_product(v)
        return self._to_plant(R, a)

    def accelerations_back(self, R: Floats, v: Floats, vdot: Floats) -> Floats:
        """Return the acceleration of dynx at the plant's dv/dt."""
        a = self.forces_back(R, vdot)
        if self._floating:
            a[:3] -= _cross_product(v)
        return a

    def forces(self, R: Floats, tau: Floats) -> Floats:
        """Return the plant's generalized force for the torque `tau` of dynx."""
        return tau if self._same else self._to_plant(R, tau)

    def forces_back(self, R: Floats, force: Floats) -> Floats:
        """Return the torque of dynx for the plant's generalized force, or for rows of a matrix (..., n_v)."""
        if self._same:
            return force
        out: Floats = force[..., self._columns]
        if self._floating:
            # Rows of three in world axes, times R, are rows in base axes.
            pairs = out[..., :6].reshape(*out.shape[:-1], 2, 3) @ R
            out[..., :6] = pairs.reshape(*out.shape[:-1], 6)
        return out

    def matrix_back(self, R: Floats, M: Floats) -> Floats:
        """Return the mass matrix of dynx for the plant's."""
        if self._same:
            return M
        return self.forces_back(R, self.forces_back(R, M).T)

    def _to_plant(self, R: Floats, x: Floats) -> Floats:
        if self._floating:
            x = np.concatenate([(x[:6].reshape(2, 3) @ R.T).ravel(), x[6:]])
        return (np.append(x, 0.0) if self._pad_v else x)[self._from_v]


class BallJointCoordinates(DrakeCoordinates):
    """The map for a tree with ball joints, each of which has three entries in q and in v of the plant.

    `balls` has the index of each ball joint in q and in v of dynx, and the rotation R_child_M (3, 3) of its
    frame on the child, in tree order. `attitude` returns R_world_base, or zeros for a fixed base, and the
    matrices W of the joints: (1 + number of them, 3, 3).
    """

    def __init__(
        self,
        q_index: Sequence[int],
        v_index: Sequence[int],
        n_q: int,
        n_v: int,
        base: tuple[int, int] | None,
        balls: Sequence[tuple[int, int, Floats]],
    ) -> None:
        super().__init__(q_index, v_index, n_q, n_v, base)
        self._same = False
        self._balls = balls

    def attitude(self, q: Floats) -> Floats:
        """Return the rotations of the base and of the ball joints."""
        base = super().attitude(q) if self._floating else np.zeros((3, 3))
        turned = [R_CM.T @ rotation_from_quat(q[at : at + 4]) for at, _, R_CM in self._balls]
        return np.array([base, *turned])

    def positions(self, q: Floats) -> Floats:
        """Return the plant's q at the configuration `q` of dynx."""
        parts, done = [], 0
        for at, _, R_CM in self._balls:
            R_FM = R_CM.T @ rotation_from_quat(q[at : at + 4]) @ R_CM
            parts += [q[done:at], _roll_pitch_yaw(R_FM)]
            done = at + 4
        return super().positions(np.concatenate([*parts, q[done:]]))

    def forces_back(self, R: Floats, force: Floats) -> Floats:
        """Return the torque of dynx for the plant's generalized force, or for rows of a matrix (..., n_v)."""
        out = super().forces_back(R[0], force)
        for (_, at, _), W in zip(self._balls, R[1:], strict=True):
            out[..., at : at + 3] = out[..., at : at + 3] @ W
        return out

    def _to_plant(self, R: Floats, x: Floats) -> Floats:
        x = x.copy()
        for (_, at, _), W in zip(self._balls, R[1:], strict=True):
            x[at : at + 3] = W @ x[at : at + 3]
        return super()._to_plant(R[0], x)


def _roll_pitch_yaw(R: Floats) -> Floats:
    """Return the angles (3,) of a rotation about x, then y, then z, all in fixed axes."""
    (xx, _, _), (yx, _, _), (zx, zy, zz) = R.tolist()
    return np.array([np.arctan2(zy, zz), np.arctan2(-zx, np.hypot(zy, zz)), np.arctan2(yx, xx)])


def _gather(indices: Sequence[int], length: int) -> tuple[Array, bool]:
    """Return, for each entry of the plant, the index of the entry of dynx (one past the end if there is
    none), and whether some entries have none."""
    source = np.full(length, len(indices))
    source[list(indices)] = range(len(indices))
    return source, len(indices) != length


def _cross_product(v: Floats) -> tuple[float, float, float]:
    """Return w x u for a base velocity (u, w)."""
    a, b, c, x, y, z = v[:6].tolist()
    return (y * c - z * b, z * a - x * c, x * b - y * a)


_EMPTY: Floats = np.zeros((0, 0))


_POINT_THEN_XYZW = (4, 5, 6, 1, 2, 3, 0)
_LINEAR_THEN_ANGULAR = (3, 4, 5, 0, 1, 2)


class RobotCoordinates:
    """The coordinates of one robot in the plant's q and v."""

    def __init__(
        self, model: Model, joints_q: Sequence[int], joints_v: Sequence[int], base: tuple[int, int] | None
    ) -> None:
        """`joints_q` and `joints_v` are the plant's indices of the joints of the mechanism, `base` those of
        a floating base."""
        mechanism = model.mechanism
        self._floating = model.floating
        self._center = np.asarray(mechanism.root_center, dtype=float)
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
