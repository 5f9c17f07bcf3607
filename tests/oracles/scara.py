"""The SCARA robot: a planar 2R arm that carries a quill and a tool on a vertical axis."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from tests.oracles.closed_form import FixedBaseForm, Floats, G, matrix, vector


class Scara(FixedBaseForm):
    """Quill and tool have their centres of mass on their axis, so that for the arm they are a point
    mass at its end, their moments of inertia about that axis add to the turning ones, and the quill
    is coupled to nothing (Siciliano et al., Robotics, problem 7.3).
    """

    robot: ClassVar[str] = "scara"
    tip: ClassVar[str] = "tip"
    m1, c1, I1, l1 = 8.0, 0.15, 0.12, 0.325
    m2, c2, I2, l2 = 5.0, 0.12, 0.06, 0.275
    m3, I3, above = 1.0, 0.001, 0.06
    m4, I4, below = 0.5, 0.002, 0.02
    h, t = 0.4, 0.05

    def placement(self, q: Floats) -> Floats:
        first, both, turn = q[..., 0], q[..., 0] + q[..., 1], q[..., 0] + q[..., 1] + q[..., 3]
        x = self.l1 * np.cos(first) + self.l2 * np.cos(both)
        y = self.l1 * np.sin(first) + self.l2 * np.sin(both)
        z = self.h - q[..., 2] - self.t
        c, s = np.cos(turn), np.sin(turn)
        return matrix([[c, -s, 0, x], [s, c, 0, y], [0, 0, 1, z], [0, 0, 0, 1]])

    def jacobian(self, q: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        x2, y2 = -self.l2 * np.sin(both), self.l2 * np.cos(both)
        x1, y1 = x2 - self.l1 * np.sin(first), y2 + self.l1 * np.cos(first)
        still = [0, 0, 0, 0]
        return matrix([[x1, x2, 0, 0], [y1, y2, 0, 0], [0, 0, -1, 0], still, still, [1, 1, 0, 1]])

    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        first, both = q[..., 0], q[..., 0] + q[..., 1]
        w1, w12 = v[..., 0], v[..., 0] + v[..., 1]
        x2, y2 = -self.l2 * np.cos(both) * w12, -self.l2 * np.sin(both) * w12
        x1, y1 = x2 - self.l1 * np.cos(first) * w1, y2 - self.l1 * np.sin(first) * w1
        return matrix([[x1, x2, 0, 0], [y1, y2, 0, 0], *[[0, 0, 0, 0]] * 4])

    def mass_matrix(self, q: Floats) -> Floats:
        load, turning = self.m3 + self.m4, self.I2 + self.I3 + self.I4
        arm, reach = self.m2 * self.c2 + load * self.l2, np.cos(q[..., 1])
        m22 = self.m2 * self.c2**2 + load * self.l2**2 + turning
        m12 = m22 + arm * self.l1 * reach
        m11 = m12 + arm * self.l1 * reach + self.m1 * self.c1**2 + (self.m2 + load) * self.l1**2 + self.I1
        return matrix(
            [[m11, m12, 0, self.I4], [m12, m22, 0, self.I4], [0, 0, load, 0], [self.I4, self.I4, 0, self.I4]]
        )

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        arm = self.m2 * self.c2 + (self.m3 + self.m4) * self.l2
        h = -arm * self.l1 * np.sin(q[..., 1])
        still = [0, 0, 0, 0]
        return matrix(
            [[h * v[..., 1], h * (v[..., 0] + v[..., 1]), 0, 0], [-h * v[..., 0], 0, 0, 0], still, still]
        )

    def gravity_torque(self, q: Floats) -> Floats:
        return vector([0 * q[..., 0], 0, -(self.m3 + self.m4) * G, 0])

    def potential_energy(self, q: Floats) -> Floats:
        arm = (self.m1 + self.m2) * self.h
        hanging = self.m3 * (self.h - q[..., 2] + self.above) + self.m4 * (self.h - q[..., 2] - self.below)
        return np.asarray(G * (arm + hanging))
