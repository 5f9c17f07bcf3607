"""The root's inertial frame C in Bullet, and the base frame of dynx."""

from __future__ import annotations

from math import copysign, nan, sqrt
from typing import NamedTuple

import numpy as np

from dynx.engines.pybullet.connection import Reals
from dynx.engines.pybullet.inertia import PrincipalInertia
from dynx.spatial.plain import minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_from_rotation, quat_product, rotation_from_quat


class BaseState(NamedTuple):
    """Pose of the root's inertial frame in the world, and its velocity along the world's axes."""

    position: Reals
    quat_xyzw: Reals
    linear: Reals
    angular: Reals


class RootFrame:
    """Conversion between the state of C and the coordinates of a floating base."""

    def __init__(self, root: PrincipalInertia) -> None:
        self.center: Floats = np.asarray(root.center, dtype=np.float64)
        """Centre of mass of the root (3,) in the base frame [m]."""
        self.axes: Floats = np.asarray(root.axes, dtype=np.float64)
        """Principal axes of the root (3, 3), in the axes of the base frame."""
        self._axes: Floats = quat_from_rotation(self.axes)
        self._axes_back: Reals = (self._axes * np.array([-1.0, -1.0, -1.0, 1.0])).tolist()
        self._center: Reals = self.center.tolist()

    def base_state(self, q: Floats, v: Floats) -> BaseState:
        """Return the state of C at the first 7 entries of `q` and the first 6 of `v`."""
        R = rotation_from_quat(q[3:7])
        w, c = v[3:6], self.center
        return BaseState(
            (q[:3] + R @ c).tolist(),
            quat_product(q[3:7], self._axes).tolist(),
            (R @ (v[:3] + cross(w, c))).tolist(),
            (R @ w).tolist(),
        )

    def coordinates(self, base: BaseState, near: Reals) -> tuple[Reals, Reals]:
        """Return position and quaternion (7,), and velocity (6,), of the base.

        Of the two quaternions of an attitude, the one nearer to the quaternion `near` is returned.
        """
        quat = self._quaternion(base.quat_xyzw, near)
        R, c = rotation_rows(*quat), self._center
        w, lever = rotate_back(R, base.angular), rotate(R, c)
        linear = minus_cross(rotate_back(R, base.linear), w, c)
        return [*(p - x for p, x in zip(base.position, lever, strict=True)), *quat], [*linear, *w]

    def pose_and_twist(self, base: BaseState) -> tuple[Floats, Floats]:
        """Return the pose (4, 4) of the base frame, and its velocity (6,) in the axes of the world."""
        R = rotation_rows(*self._quaternion(base.quat_xyzw, base.quat_xyzw))
        lever = rotate(R, self._center)
        rows = [[*row, p - x] for row, p, x in zip(R, base.position, lever, strict=True)]
        linear = minus_cross(base.linear, base.angular, lever)
        return np.array([*rows, [0.0, 0.0, 0.0, 1.0]]), np.array([*linear, *base.angular])

    def _quaternion(self, principal: Reals, near: Reals) -> Reals:
        """Return the unit quaternion of the base frame from that of the principal axes."""
        x, y, z, w = principal
        ax, ay, az, aw = self._axes_back
        qx = aw * x + w * ax + y * az - z * ay
        qy = aw * y + w * ay + z * ax - x * az
        qz = aw * z + w * az + x * ay - y * ax
        qw = w * aw - x * ax - y * ay - z * az
        towards = qx * near[0] + qy * near[1] + qz * near[2] + qw * near[3]
        # A quaternion of zeros, of a state that diverged, has no attitude.
        norm = copysign(sqrt(qx * qx + qy * qy + qz * qz + qw * qw), towards) or nan
        return [qx / norm, qy / norm, qz / norm, qw / norm]
