"""The inertia of a link in extended precision: sums, principal axes, and conversion to an element.

All tensors are about the centre of mass, so that no two large numbers are subtracted, and in NumPy's long
double, so that the numbers of an element are right to the last digit of float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np

from dynx.model.elements import Inertial, Pose, Vector
from dynx.spatial.extended import jacobi_eigen, longdouble
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import rotation_from_rpy, rpy_from_rotation


@dataclass(frozen=True, eq=False)
class CentralInertia:
    """Mass [kg], centre of mass (3,) and inertia about it (3, 3), in the axes of some frame."""

    mass: Array
    center: Array
    tensor: Array

    @classmethod
    def of(cls, inertial: Inertial) -> CentralInertia:
        """Return the inertia that an ``<inertial>`` states, in the frame of its link."""
        R = rotation_from_rpy(longdouble(inertial.origin.rpy))
        tensor = longdouble(inertial.tensor)
        return cls(longdouble(inertial.mass), longdouble(inertial.origin.xyz), R @ tensor @ R.T)

    def transform(self, R: Array, p: Array) -> CentralInertia:
        """Return the same body in frame A, where (R, p) is the pose of this frame in A."""
        return CentralInertia(self.mass, R @ self.center + p, R @ self.tensor @ R.T)

    def __add__(self, other: CentralInertia) -> CentralInertia:
        """Return the sum of two rigidly connected bodies in the same frame (parallel axis theorem)."""
        mass = self.mass + other.mass
        if mass == 0:
            return CentralInertia(mass, self.center, self.tensor + other.tensor)
        center = (self.mass * self.center + other.mass * other.center) / mass if other.mass else self.center
        arm = other.center - self.center
        steiner = self.mass * other.mass / mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
        return CentralInertia(mass, center, self.tensor + other.tensor + steiner)

    def about_origin(self) -> Array:
        """Return the inertia about the origin of the frame (3, 3)."""
        c = self.center
        return np.asarray(self.tensor + self.mass * (c @ c * np.eye(3) - np.outer(c, c)))

    def moments(self) -> Array:
        """Return the principal moments (3,), smallest first."""
        return np.sort(jacobi_eigen(self.tensor)[0])

    def principal(self, near: Vector = (0.0, 0.0, 0.0)) -> tuple[Array, Array]:
        """Return the principal moments (3,) and axes (3, 3), the columns of a rotation, in the axes of the
        frame.

        Order and directions of the axes are those nearest to the attitude `near` (rpy).
        """
        values, axes = jacobi_eigen(self.tensor)
        order, R = _nearest_axes(axes, rotation_from_rpy(longdouble(near)))
        return values[order], R

    def inertial(self, near: Vector = (0.0, 0.0, 0.0)) -> Inertial:
        """Return the ``<inertial>`` in principal form: no products of inertia, the axes in its rpy."""
        return self.about(*self.principal(near))

    def about(self, moments: Array, axes: Array) -> Inertial:
        """Return the ``<inertial>`` with other moments (3,), about the columns of a rotation (3, 3)."""
        x, y, z = (float(value) for value in moments)
        origin = Pose(_vector(self.center), _vector(rpy_from_rotation(axes)))
        return Inertial(float(self.mass), origin, ixx=x, iyy=y, izz=z)

    def aligned(self) -> Inertial:
        """Return the ``<inertial>`` in the axes of the link, with its products of inertia."""
        t = [[float(x) for x in row] for row in self.tensor]
        origin = Pose(_vector(self.center))
        return Inertial(float(self.mass), origin, t[0][0], t[0][1], t[0][2], t[1][1], t[1][2], t[2][2])


def _nearest_axes(axes: Array, wanted: Array) -> tuple[list[int], Array]:
    """Return the order and directions of the columns of `axes` that make the rotation nearest to `wanted`."""
    overlap = wanted.T @ axes
    best: tuple[float, list[int], Array] | None = None
    for chosen in permutations(range(3)):
        order = list(chosen)
        along = np.array([overlap[row, column] for row, column in enumerate(order)])
        signs = np.where(along < 0, -1, 1)
        if np.linalg.det(np.asarray(axes[:, order] * signs, dtype=float)) < 0:
            signs[int(np.argmin(np.abs(along)))] *= -1
        trace = float(np.sum(along * signs))
        # Of orders that are equally near, to rounding, the first is kept.
        if best is None or trace > best[0] + 1e-9:
            best = trace, order, axes[:, order] * signs
    assert best is not None
    return best[1], best[2]


def _vector(numbers: Array) -> Vector:
    x, y, z = (float(number) + 0.0 for number in numbers)
    return x, y, z
