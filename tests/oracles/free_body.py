"""One rigid body, free in space: Newton's and Euler's equations about the origin of its frame."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from tests.oracles.closed_form import ClosedForm, Floats, G


def cross_matrix(w: Floats) -> Floats:
    """[w] with [w] x = w x x, (..., 3, 3)."""
    return np.stack([np.cross(w, axis) for axis in np.eye(3)], axis=-1)


class FreeBody(ClosedForm):
    """f = m (v' + w x v + w' x c + w x (w x c) - R'g), n = I w' + w x I w + c x f, body axes."""

    robot: ClassVar[str] = "free_body"
    tip: ClassVar[str] = "mark"
    base: ClassVar[Literal["fixed", "floating"]] = "floating"
    m = 2.0
    c = np.array([0.05, -0.02, 0.08])
    inertia = np.diag([0.02, 0.05, 0.06])
    mark = np.array([0.3, 0.0, 0.1])
    mark_yaw = 0.5

    def rotation(self, q: Floats) -> Floats:
        """R (..., 3, 3) from body to world."""
        flat = Rotation.from_quat(q[..., 3:7].reshape(-1, 4)).as_matrix()
        return np.asarray(flat).reshape(*q.shape[:-1], 3, 3)

    def placement(self, q: Floats) -> Floats:
        R = self.rotation(q)
        T = np.zeros((*q.shape[:-1], 4, 4))
        T[..., :3, :3] = R @ Rotation.from_rotvec([0.0, 0.0, self.mark_yaw]).as_matrix()
        T[..., :3, 3] = q[..., :3] + R @ self.mark
        T[..., 3, 3] = 1.0
        return T

    def jacobian(self, q: Floats) -> Floats:
        return self._jacobian_at_mark(self.rotation(q))

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        return self._jacobian_at_mark(self.rotation(q) @ cross_matrix(v[..., 3:]))

    def mass_matrix(self, q: Floats) -> Floats:
        C = cross_matrix(self.c)
        M = np.block([[self.m * np.eye(3), -self.m * C], [self.m * C, self.inertia - self.m * C @ C]])
        return np.broadcast_to(M, (*q.shape[:-1], 6, 6))

    def velocity_torque(self, q: Floats, v: Floats) -> Floats:
        linear, w = v[..., :3], v[..., 3:]
        f = self.m * (np.cross(w, linear) + np.cross(w, np.cross(w, self.c)))
        return np.concatenate([f, np.cross(w, w @ self.inertia) + np.cross(self.c, f)], axis=-1)

    def gravity_torque(self, q: Floats) -> Floats:
        f = -self.m * np.asarray(self.gravity) @ self.rotation(q)
        return np.concatenate([f, np.cross(self.c, f)], axis=-1)

    def potential_energy(self, q: Floats) -> Floats:
        return np.asarray(self.m * G * (q[..., 2] + (self.rotation(q) @ self.c)[..., 2]))

    def momentum(self, q: Floats, v: Floats) -> Floats:
        """Linear momentum, and angular momentum about the centre of mass, in world axes (..., 6)."""
        w = v[..., 3:]
        body = np.stack([self.m * (v[..., :3] + np.cross(w, self.c)), w @ self.inertia], axis=-2)
        world = body @ np.swapaxes(self.rotation(q), -1, -2)
        return np.concatenate([world[..., 0, :], world[..., 1, :]], axis=-1)

    def _jacobian_at_mark(self, R: Floats) -> Floats:
        upper = np.concatenate([R, -R @ cross_matrix(self.mark)], axis=-1)
        return np.concatenate([upper, np.concatenate([0 * R, R], axis=-1)], axis=-2)
