"""The pendulum and the double pendulum, hanging along -z and turning about y."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tests.oracles.closed_form import FixedBaseForm, Floats, G, matrix, vector


def pose_about_y(angle: Floats, x: Floats, z: Floats) -> Floats:
    """Return a frame at (x, 0, z), rotated by `angle` about y."""
    c, s = np.cos(angle), np.sin(angle)
    return matrix([[c, 0, s, x], [0, 1, 0, 0], [-s, 0, c, z], [0, 0, 0, 1]])


class Pendulum(FixedBaseForm):
    """(m c^2 + I) a + m g c sin q = tau."""

    robot: ClassVar[str] = "pendulum"
    tip: ClassVar[str] = "tip"
    m, c, inertia, length = 1.5, 0.8, 0.02, 1.0

    def placement(self, q: Floats) -> Floats:
        angle = q[..., 0]
        return pose_about_y(angle, -self.length * np.sin(angle), -self.length * np.cos(angle))

    def jacobian(self, q: Floats) -> Floats:
        c, s = np.cos(q[..., 0]), np.sin(q[..., 0])
        return matrix([[-self.length * c], [0], [self.length * s], [0], [1], [0]])

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        c, s, w = np.cos(q[..., 0]), np.sin(q[..., 0]), v[..., 0]
        return matrix([[self.length * s * w], [0], [self.length * c * w], [0], [0], [0]])

    def mass_matrix(self, q: Floats) -> Floats:
        return matrix([[self.m * self.c**2 + self.inertia + 0 * q[..., 0]]])

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        return matrix([[0 * v[..., 0]]])

    def gravity_torque(self, q: Floats) -> Floats:
        return self.m * G * self.c * np.sin(q)

    def potential_energy(self, q: Floats) -> Floats:
        return np.asarray(-self.m * G * self.c * np.cos(q[..., 0]))


class DoublePendulum(FixedBaseForm):
    """Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 7.4, rotated to hang down."""

    robot: ClassVar[str] = "double_pendulum"
    tip: ClassVar[str] = "tip"
    m1, c1, I1, l1 = 1.0, 0.4, 0.05, 0.7
    m2, c2, I2, l2 = 0.6, 0.3, 0.02, 0.5

    def placement(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        x = -self.l1 * np.sin(first) - self.l2 * np.sin(both)
        z = -self.l1 * np.cos(first) - self.l2 * np.cos(both)
        return pose_about_y(both, x, z)

    def jacobian(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        x2, z2 = -self.l2 * np.cos(both), self.l2 * np.sin(both)
        x1, z1 = x2 - self.l1 * np.cos(first), z2 + self.l1 * np.sin(first)
        return matrix([[x1, x2], [0, 0], [z1, z2], [0, 0], [1, 1], [0, 0]])

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        w1, w12 = v[..., 0], v[..., 0] + v[..., 1]
        x2, z2 = self.l2 * np.sin(both) * w12, self.l2 * np.cos(both) * w12
        x1, z1 = x2 + self.l1 * np.sin(first) * w1, z2 + self.l1 * np.cos(first) * w1
        return matrix([[x1, x2], [0, 0], [z1, z2], [0, 0], [0, 0], [0, 0]])

    def mass_matrix(self, q: Floats) -> Floats:
        reach = self.l1 * self.c2 * np.cos(q[..., 1])
        m22 = self.I2 + self.m2 * self.c2**2
        m12 = m22 + self.m2 * reach
        m11 = self.I1 + self.m1 * self.c1**2 + m22 + self.m2 * (self.l1**2 + 2 * reach)
        return matrix([[m11, m12], [m12, m22]])

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        h = -self.m2 * self.l1 * self.c2 * np.sin(q[..., 1])
        return matrix([[h * v[..., 1], h * (v[..., 0] + v[..., 1])], [-h * v[..., 0], 0]])

    def gravity_torque(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        lower = self.m2 * G * self.c2 * np.sin(both)
        upper = (self.m1 * self.c1 + self.m2 * self.l1) * G * np.sin(first)
        return vector([upper + lower, lower])

    def potential_energy(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        height1 = -self.c1 * np.cos(first)
        height2 = -self.l1 * np.cos(first) - self.c2 * np.cos(both)
        return np.asarray(G * (self.m1 * height1 + self.m2 * height2))
