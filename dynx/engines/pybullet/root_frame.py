"""The root's inertial frame C in Bullet, and the base frame of dynx."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.engines.pybullet.connection import Reals
from dynx.engines.pybullet.inertia import PrincipalInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_from_rotation, quat_product, rotate_back, rotation_from_quat


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
        self._axes_back: Floats = self._axes * np.array([-1.0, -1.0, -1.0, 1.0])

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

    def coordinates(self, base: BaseState, near: Floats) -> tuple[Floats, Floats]:
        """Return position and quaternion (7,), and velocity (6,), of the base.

        Of the two quaternions of an attitude, the one nearer to the quaternion `near` is returned.
        """
        quat = quat_product(np.array(base.quat_xyzw), self._axes_back)
        quat /= np.copysign(np.sqrt(quat.dot(quat)), quat.dot(near))
        R = rotation_from_quat(quat)
        w = rotate_back(R, np.array(base.angular))
        linear = rotate_back(R, np.array(base.linear)) - cross(w, self.center)
        position = np.array(base.position) - R @ self.center
        return np.concatenate([position, quat]), np.concatenate([linear, w])
