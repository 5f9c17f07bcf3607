"""The cart-pole: a cart along x, a pole about y that stands upright at zero."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tests.oracles.closed_form import FixedBaseForm, Floats, G, matrix, vector
from tests.oracles.pendulums import pose_about_y


class CartPole(FixedBaseForm):
    """(M + m) x'' + m c (cos(q) q'' - sin(q) q'^2) = F and
    m c cos(q) x'' + (I + m c^2) q'' - m g c sin(q) = tau (Barto, Sutton and Anderson 1983, with a rod).
    """

    robot: ClassVar[str] = "cart_pole"
    tip: ClassVar[str] = "tip"
    M, m, c, inertia, length, h = 2.0, 0.3, 0.4, 0.01, 0.8, 0.1

    def placement(self, q: Floats) -> Floats:
        x, angle = q[..., 0], q[..., 1]
        return pose_about_y(angle, x + self.length * np.sin(angle), self.h + self.length * np.cos(angle))

    def jacobian(self, q: Floats) -> Floats:
        c, s = np.cos(q[..., 1]), np.sin(q[..., 1])
        return matrix([[1, self.length * c], [0, 0], [0, -self.length * s], [0, 0], [0, 1], [0, 0]])

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        c, s, w = np.cos(q[..., 1]), np.sin(q[..., 1]), v[..., 1]
        return matrix([[0, -self.length * s * w], [0, 0], [0, -self.length * c * w], [0, 0], [0, 0], [0, 0]])

    def mass_matrix(self, q: Floats) -> Floats:
        both = self.m * self.c * np.cos(q[..., 1])
        return matrix([[self.M + self.m, both], [both, self.inertia + self.m * self.c**2]])

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        return matrix([[0, -self.m * self.c * np.sin(q[..., 1]) * v[..., 1]], [0, 0]])

    def gravity_torque(self, q: Floats) -> Floats:
        return vector([0, -self.m * G * self.c * np.sin(q[..., 1])])

    def potential_energy(self, q: Floats) -> Floats:
        return np.asarray(self.m * G * (self.h + self.c * np.cos(q[..., 1])))
