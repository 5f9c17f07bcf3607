"""Rigid-body inertia as ten linear parameters: mass, first moment, second moment about a point.

Linear parameters add when bodies are welded together and need no division by a mass that may be
zero (Featherstone, Rigid Body Dynamics Algorithms, section 2.13).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Array, along
from dynx.spatial.so3 import cross, rotate, skew


@dataclass(frozen=True)
class RigidInertia:
    """Inertia of a rigid body about the origin O of a frame, in the axes of that frame."""

    mass: Array  # () [kg]
    first_moment: Array  # (3,) mass times centre of mass [kg m]
    second_moment: Array  # (3, 3) rotational inertia about O [kg m^2]

    @property
    def spread(self) -> Array:
        """The sum of r r' over the mass (..., 3, 3), r from O [kg m^2]: half the trace less the tensor.

        With mass and first moment it makes the pseudo-inertia (Wensing, Kim and Slotine 2018).
        """
        tensor = self.second_moment
        half = (tensor[..., 0, 0] + tensor[..., 1, 1] + tensor[..., 2, 2]) / 2
        return np.asarray(np.eye(3, dtype=int) * along(along(half)) - tensor)

    def __add__(self, other: RigidInertia) -> RigidInertia:
        """Two bodies welded together; both must be about the same frame."""
        return RigidInertia(
            np.asarray(self.mass + other.mass),
            self.first_moment + other.first_moment,
            self.second_moment + other.second_moment,
        )

    def seen_from(self, R: Array, p: Array) -> RigidInertia:
        """The same body about the origin of frame A, where (R, p) is the pose of this frame in A."""
        h = rotate(R, self.first_moment)
        shift, H = skew(p), skew(h)
        rotated = R @ self.second_moment @ np.swapaxes(R, -1, -2)
        moved = rotated - shift @ H - H @ shift - self.mass * (shift @ shift)
        return RigidInertia(self.mass, h + p * self.mass, mirrored(moved))

    def momentum(self, linear: Array, angular: Array) -> tuple[Array, Array]:
        """Linear and angular momentum about O of a body with this velocity at O."""
        return (
            linear * self.mass + cross(angular, self.first_moment),
            rotate(self.second_moment, angular) + cross(self.first_moment, linear),
        )


def inertia_about_origin(mass: Array, center: Array, rotation: Array, tensor: Array) -> RigidInertia:
    """From what a URDF says: mass, centre of mass, axes and central inertia tensor in those axes."""
    central = rotation @ tensor @ np.swapaxes(rotation, -1, -2)
    C = skew(center)
    return RigidInertia(np.asarray(mass), center * mass, central - (C @ C) * mass)


_UPPER = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2]]), np.array([[0, 1, 2], [1, 1, 2], [2, 2, 2]])


def mirrored(A: Array) -> Array:
    """The symmetric matrix (..., 3, 3) that has the upper triangle of `A`.

    Where symmetry is known it need not be computed: on traced symbols the other half costs nothing.
    """
    return np.asarray(A[..., _UPPER[0], _UPPER[1]])
