"""A robot in Bullet, with arguments and results in the conventions of dynx.

At every instant, Bullet's world is the inertial frame C of the root (centre of mass, principal axes): the
base never moves in Bullet, gravity is rotated instead, and the pose of the base is composed in NumPy. Unlike
Bullet's own decoding of the attitude, that is exact at every attitude, and one conversion X serves every
quantity:

    (angular, linear) of C  =  X (linear, angular) of the base frame.

With a fixed base C is the base frame and there is nothing to convert.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from dynx.engines.pybullet.canonical_urdf import bullet_tree
from dynx.engines.pybullet.client import BulletClient
from dynx.engines.pybullet.inertia import Ballast, PrincipalInertia
from dynx.model.mechanism import ROOT, BodyFrame, Mechanism, float64
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, skew

_IDENTITY = np.eye(4)


class BulletRobot:
    """A mechanism, with `times` copies of the ballast, in a Bullet client. Each call takes one sample."""

    def __init__(
        self, engine: ModuleType, mechanism: Mechanism, ballast: tuple[Ballast, ...], times: int
    ) -> None:
        """`mechanism` was merged in long double, and is rounded only once, when Bullet gets it."""
        tree = bullet_tree(mechanism, ballast, times)
        self._floating = mechanism.floating
        self._gravity: Floats = float64(mechanism.gravity)
        self._gravity_numbers: list[float] = self._gravity.tolist()
        self._T_base_C = float64(homogeneous(tree.root.axes, tree.root.center))
        self._X = float64(base_conversion(tree.root.axes, tree.root.center))
        self._X_inverse = float64(inverse_base_conversion(tree.root.axes, tree.root.center))
        # Bullet's unit of mass, a power of two, so that conversions are exact.
        self._unit = tree.unit
        self._inertias = [link.inertia for link in tree.links]
        # Frames in the inertial frames of their bodies, whose poses Bullet reports.
        self._frame_body = [frame.body for frame in mechanism.frames]
        self._offsets = np.array([self._offset(frame) for frame in mechanism.frames])
        self._points = [self._point(frame, tree.root) for frame in mechanism.frames]
        self._frame_in_body = [float64(homogeneous(frame.R, frame.p)) for frame in mechanism.frames]
        self._client = BulletClient(engine, tree, mechanism.name)

    def close(self) -> None:
        """Disconnect the client."""
        self._client.close()

    # -- kinematics ---------------------------------------------------------------------------

    def frame_placements(self, q: Floats) -> Floats:
        """Return T_world_frame of all frames (n, 4, 4)."""
        joints = self._joints(q)
        T_world_base, T_world_C = self._base(q)
        # The root comes last, so that the index ROOT = -1 selects it.
        T = np.zeros((len(joints) + 1, 4, 4))
        T[-1] = T_world_base
        if joints:
            T[:-1] = T_world_C @ pose_matrices(*self._client.com_poses(joints))
        return np.asarray(T[self._frame_body] @ self._offsets)

    def frame_placement(self, q: Floats, frame: int) -> Floats:
        """Return T_world_frame of one frame (4, 4)."""
        body = self._frame_body[frame]
        if body == ROOT:
            return np.asarray(self._base(q)[0].dot(self._offsets[frame]))
        T_C_frame = pose_matrix(*self._client.com_pose(self._joints(q), body)).dot(self._offsets[frame])
        return np.asarray(self._base(q)[1].dot(T_C_frame) if self._floating else T_C_frame)

    def jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        """Return J (6, nv) of one frame, linear rows first."""
        J = self._jacobian_in_C(q, frame)
        if reference == LOCAL_WORLD_ALIGNED and not self._floating:
            return J
        R_world_C = self._base(q)[1][:3, :3]
        if reference == "local":
            R_frame_C = self.frame_placement(q, frame)[:3, :3].T @ R_world_C
            return np.concatenate([R_frame_C @ J[:3], R_frame_C @ J[3:]])
        linear, angular = R_world_C @ J[:3], R_world_C @ J[3:]
        if reference == "world":
            linear = linear + skew(self.frame_placement(q, frame)[:3, 3]) @ angular
        return np.concatenate([linear, angular])

    # -- dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return tau (nv,)."""
        if not self._floating:
            joints = q.tolist()
            if not joints:
                return np.zeros(0)
            tau = self._client.inverse_dynamics(joints, v.tolist(), a.tolist(), self._gravity_numbers)
            return tau if self._unit == 1.0 else self._unit * tau
        gravity = self._gravity_in_C(q)
        v_C, a_C = self._X @ v[:6], self._X @ a[:6]
        # dv/dt in rotating axes to the classical acceleration of the centre of mass.
        a_C[3:] += cross(v_C[:3], v_C[3:])
        tau = self._client.inverse_dynamics(
            self._joints(q), [*v_C.tolist(), *v[6:].tolist()], [*a_C.tolist(), *a[6:].tolist()], gravity
        )
        # Bullet returns the force first.
        tau[:6] = self._X.T @ np.concatenate([tau[3:6], tau[:3]])
        return self._unit * tau

    def mass_matrix(self, q: Floats) -> Floats:
        """Return M (nv, nv), symmetric."""
        joints = self._joints(q)
        if not (joints or self._floating):
            return np.zeros((0, 0))
        M = self._client.mass_matrix(joints)
        if not self._floating:
            # Bullet copies one triangle to the other.
            return M if self._unit == 1.0 else self._unit * M
        M[:6] = self._X.T @ M[:6]
        M[:, :6] = M[:, :6] @ self._X
        return np.asarray(0.5 * self._unit * (M + M.T))

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return a (nv,): the change of velocity in one step of Bullet's articulated-body algorithm."""
        if not v.size:
            return np.zeros(0)
        gravity = self._gravity_in_C(q)
        if self._unit != 1.0:
            tau = tau / self._unit
        if not self._floating:
            return self._client.velocity_step(q.tolist(), v.tolist(), tau.tolist(), gravity)
        v_C = self._X @ v[:6]
        tau_C = self._X_inverse.T @ tau[:6]
        a = self._client.velocity_step(
            self._joints(q), [*v_C.tolist(), *v[6:].tolist()], [*tau_C.tolist(), *tau[6:].tolist()], gravity
        )
        if not isfinite(sum(a.tolist())):
            return a
        a[3:6] -= cross(v_C[:3], v_C[3:])
        a[:6] = self._X_inverse @ a[:6]
        return a

    # -- inverse kinematics -------------------------------------------------------------------

    def inverse_kinematics(
        self,
        T_world_target: Floats,
        frame: int,
        q: Floats,
        limits: tuple[Floats, Floats] | None,
        iterations: int,
        residual: float,
    ) -> Floats:
        """Return the joints (n,) at which Bullet's solver stopped, from `q` on; the base does not move."""
        body = self._frame_body[frame]
        if body == ROOT:
            return np.array(self._joints(q))
        T_world_C = self._base(q)[1]
        R_C_world = T_world_C[:3, :3].T
        T_world_body = T_world_target @ np.linalg.inv(self._frame_in_body[frame])
        position = R_C_world @ (T_world_body[:3, 3] - T_world_C[:3, 3])
        axes = R_C_world @ T_world_body[:3, :3] @ float64(self._inertias[body].axes)
        return self._client.inverse_kinematics(
            self._joints(q),
            body,
            position.tolist(),
            quat_from_rotation(axes).tolist(),
            None if limits is None else (limits[0].tolist(), limits[1].tolist()),
            iterations,
            residual,
        )

    # -- frames -------------------------------------------------------------------------------

    def _joints(self, q: Floats) -> list[float]:
        joints: list[float] = (q[7:] if self._floating else q).tolist()
        return joints

    def _base(self, q: Floats) -> tuple[Floats, Floats]:
        """Return T_world_base and T_world_C, (4, 4) each."""
        if not self._floating:
            return _IDENTITY, _IDENTITY
        T = pose_matrix(q[:3].tolist(), q[3:7].tolist())
        return T, np.asarray(T.dot(self._T_base_C))

    def _gravity_in_C(self, q: Floats) -> list[float]:
        if not self._floating:
            return self._gravity_numbers
        numbers: list[float] = (self._base(q)[1][:3, :3].T @ self._gravity).tolist()
        return numbers

    def _jacobian_in_C(self, q: Floats, frame: int) -> Floats:
        """Return J (6, nv) of the velocity of the frame's origin, in the axes of C."""
        joints = self._joints(q)
        body = self._frame_body[frame]
        if body != ROOT:
            J = self._client.jacobian(joints, body, self._points[frame])
            if self._floating:
                J[:, :6] = J[:, :6] @ self._X
            return J
        J = np.zeros((6, len(q) - 1 if self._floating else len(q)))
        if self._floating:
            # A frame fixed to the base: the velocity of C, shifted to the frame's origin.
            angular, linear = self._X[:3], self._X[3:]
            J[:3, :6] = linear - skew(np.array(self._points[frame])) @ angular
            J[3:, :6] = angular
        return J

    def _offset(self, frame: BodyFrame) -> Floats:
        T = homogeneous(frame.R, frame.p)
        if frame.body != ROOT:
            inertia = self._inertias[frame.body]
            R = inertia.axes.T @ frame.R
            T = homogeneous(R, inertia.axes.T @ (frame.p - inertia.center))
        return float64(T)

    def _point(self, frame: BodyFrame, root: PrincipalInertia) -> list[float]:
        """Return the frame's origin relative to its body's (for the root: to C), along the principal axes."""
        if frame.body == ROOT:
            point = root.axes.T @ (frame.p - root.center)
        else:
            point = self._inertias[frame.body].axes.T @ frame.p
        numbers: list[float] = float64(point).tolist()
        return numbers


def pose_matrices(position: ArrayLike, quat_xyzw: ArrayLike) -> Floats:
    """Return the homogeneous matrices (..., 4, 4) from positions (..., 3) and unit quaternions (..., 4).

    The rotation is linear in the products of the quaternion's entries, so one small matrix product computes
    it about ten times as fast as entry by entry.
    """
    quat = np.asarray(quat_xyzw, dtype=np.float64)
    products = quat[..., :, None] * quat[..., None, :]
    T = (products.reshape(*quat.shape[:-1], 16) @ _FROM_PRODUCTS).reshape(*quat.shape[:-1], 4, 4)
    T += _IDENTITY
    T[..., :3, 3] = position
    return np.asarray(T)


def pose_matrix(position: Sequence[float], quat_xyzw: Sequence[float]) -> Floats:
    """Return the homogeneous matrix (4, 4) from one position and one unit quaternion.

    Written in plain Python, which takes a third of the time of `pose_matrices` for one pose.
    """
    px, py, pz = position
    x, y, z, w = quat_xyzw
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    wx, wy, wz = w * x, w * y, w * z
    return np.array(
        (
            (1.0 - 2.0 * (yy + zz), 2.0 * (xy - wz), 2.0 * (xz + wy), px),
            (2.0 * (xy + wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz - wx), py),
            (2.0 * (xz - wy), 2.0 * (yz + wx), 1.0 - 2.0 * (xx + yy), pz),
            (0.0, 0.0, 0.0, 1.0),
        )
    )


def _products_to_rotation() -> Floats:
    """Return the matrix (16, 16) from the products of x, y, z, w to the entries of [[R - 1, 0], [0, 0]]."""
    K = np.zeros((4, 4, 4, 4))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        K[j, j, i, i] = K[k, k, i, i] = -2.0
        K[j, k, j, k] = K[j, k, k, j] = 2.0
        K[i, 3, k, j], K[i, 3, j, k] = 2.0, -2.0
    return K.reshape(16, 16)


_FROM_PRODUCTS = _products_to_rotation()


def base_conversion(axes: Array, center: Array) -> Array:
    """Return X (6, 6), for axes (3, 3) and origin (3,) of C in the base frame; see the module docstring."""
    X = np.zeros((6, 6), dtype=axes.dtype)
    X[:3, 3:] = X[3:, :3] = axes.T
    X[3:, 3:] = -axes.T @ skew(center)
    return X


def inverse_base_conversion(axes: Array, center: Array) -> Array:
    """Return the inverse of `base_conversion`."""
    X = np.zeros((6, 6), dtype=axes.dtype)
    X[3:, :3] = X[:3, 3:] = axes
    X[:3, :3] = skew(center) @ axes
    return X
