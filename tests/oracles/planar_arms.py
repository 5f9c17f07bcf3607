"""The planar arms with two and three revolute joints, with gravity in their plane."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tests.oracles.closed_form import FixedBaseForm, Floats, G, Vector, matrix, vector


def pose_about_z(angle: Floats, x: Floats, y: Floats) -> Floats:
    """Return a frame at (x, y, 0), rotated by `angle` about z."""
    c, s = np.cos(angle), np.sin(angle)
    return matrix([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, 0], [0, 0, 0, 1]])


class Planar2R(FixedBaseForm):
    """Spong, Hutchinson and Vidyasagar, Robot Modeling and Control, section 7.4."""

    robot: ClassVar[str] = "planar_2r"
    tip: ClassVar[str] = "tip"
    gravity: ClassVar[Vector] = (0.0, -G, 0.0)
    m1, c1, I1, l1 = 4.0, 0.25, 0.10, 0.5
    m2, c2, I2, l2 = 2.5, 0.18, 0.04, 0.4

    def placement(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        x = self.l1 * np.cos(first) + self.l2 * np.cos(both)
        y = self.l1 * np.sin(first) + self.l2 * np.sin(both)
        return pose_about_z(both, x, y)

    def jacobian(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        x2, y2 = -self.l2 * np.sin(both), self.l2 * np.cos(both)
        x1, y1 = x2 - self.l1 * np.sin(first), y2 + self.l1 * np.cos(first)
        return matrix([[x1, x2], [y1, y2], [0, 0], [0, 0], [0, 0], [1, 1]])

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        w1, w12 = v[..., 0], v[..., 0] + v[..., 1]
        x2, y2 = -self.l2 * np.cos(both) * w12, -self.l2 * np.sin(both) * w12
        x1, y1 = x2 - self.l1 * np.cos(first) * w1, y2 - self.l1 * np.sin(first) * w1
        return matrix([[x1, x2], [y1, y2], [0, 0], [0, 0], [0, 0], [0, 0]])

    def mass_matrix(self, q: Floats) -> Floats:
        reach = self.l1 * self.c2 * np.cos(q[..., 1])
        m22 = self.m2 * self.c2**2 + self.I2
        m12 = self.m2 * (self.c2**2 + reach) + self.I2
        m11 = self.m1 * self.c1**2 + self.m2 * (self.l1**2 + self.c2**2 + 2 * reach) + self.I1 + self.I2
        return matrix([[m11, m12], [m12, m22]])

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        h = -self.m2 * self.l1 * self.c2 * np.sin(q[..., 1])
        return matrix([[h * v[..., 1], h * (v[..., 0] + v[..., 1])], [-h * v[..., 0], 0]])

    def gravity_torque(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        outer = self.m2 * self.c2 * G * np.cos(both)
        inner = (self.m1 * self.c1 + self.m2 * self.l1) * G * np.cos(first)
        return vector([inner + outer, outer])

    def potential_energy(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        height2 = self.l1 * np.sin(first) + self.c2 * np.sin(both)
        return np.asarray(G * (self.m1 * self.c1 * np.sin(first) + self.m2 * height2))


class Planar3R(FixedBaseForm):
    """In the absolute angles phi_i = q_1 + ... + q_i, in which a planar chain has the Lagrangian

        T = sum_ij A_ij cos(phi_i - phi_j) phi'_i phi'_j / 2,   U = g sum_i b_i sin(phi_i)

    with constant A and b, hence the Christoffel matrix A_ij sin(phi_i - phi_j) phi'_j; carried to
    the joint angles by phi = L q.
    """

    robot: ClassVar[str] = "planar_3r"
    tip: ClassVar[str] = "tip"
    gravity: ClassVar[Vector] = (0.0, -G, 0.0)
    m = np.array([5.0, 3.0, 1.2])
    c = np.array([0.30, 0.20, 0.10])
    inertia = np.array([0.15, 0.06, 0.01])
    length = np.array([0.60, 0.45, 0.20])
    L = np.tril(np.ones((3, 3)))

    def placement(self, q: Floats) -> Floats:
        phi = q @ self.L.T
        return pose_about_z(phi[..., 2], np.cos(phi) @ self.length, np.sin(phi) @ self.length)

    def jacobian(self, q: Floats) -> Floats:
        phi = q @ self.L.T
        turn = np.stack([-self.length * np.sin(phi), self.length * np.cos(phi)], axis=-2) @ self.L
        rest = np.zeros((*turn.shape[:-2], 3, 3))
        return np.concatenate([turn, rest, np.ones_like(turn[..., :1, :])], axis=-2)

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        phi, rate = q @ self.L.T, v @ self.L.T
        turn = (
            np.stack([-self.length * np.cos(phi) * rate, -self.length * np.sin(phi) * rate], axis=-2) @ self.L
        )
        return np.concatenate([turn, np.zeros((*turn.shape[:-2], 4, 3))], axis=-2)

    @property
    def coupling(self) -> Floats:
        """A (3, 3): A_ij = l_i (m_j c_j + l_j sum of the masses outboard of j) for i < j."""
        A = np.zeros((3, 3))
        for j in range(3):
            beyond = float(np.sum(self.m[j + 1 :]))
            A[j, j] = self.inertia[j] + self.m[j] * self.c[j] ** 2 + self.length[j] ** 2 * beyond
            for i in range(j):
                A[i, j] = A[j, i] = self.length[i] * (self.m[j] * self.c[j] + self.length[j] * beyond)
        return A

    @property
    def first_moments(self) -> Floats:
        """b (3,): b_i = m_i c_i + l_i sum of the masses outboard of i."""
        beyond = np.array([self.m[1] + self.m[2], self.m[2], 0.0])
        return np.asarray(self.m * self.c + self.length * beyond)

    def mass_matrix(self, q: Floats) -> Floats:
        phi = q @ self.L.T
        apart = phi[..., :, None] - phi[..., None, :]
        return np.asarray(self.L.T @ (self.coupling * np.cos(apart)) @ self.L)

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        phi, rate = q @ self.L.T, v @ self.L.T
        apart = phi[..., :, None] - phi[..., None, :]
        return np.asarray(self.L.T @ (self.coupling * np.sin(apart) * rate[..., None, :]) @ self.L)

    def gravity_torque(self, q: Floats) -> Floats:
        return np.asarray(G * self.first_moments * np.cos(q @ self.L.T) @ self.L)

    def potential_energy(self, q: Floats) -> Floats:
        return np.asarray(G * np.sin(q @ self.L.T) @ self.first_moments)
