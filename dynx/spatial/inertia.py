"""Rigid-body inertia as ten linear parameters: mass, first moment of mass, rotational inertia about a point.

Linear parameters add when bodies are rigidly connected, and need no division by a mass that may be zero
(Featherstone, Rigid Body Dynamics Algorithms, section 2.13).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import cross, rotate, skew

TENSOR_ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Row and column in the inertia tensor of each of the last six parameters."""


@dataclass(frozen=True)
class RigidInertia:
    """Inertia of a rigid body about the origin O of a frame, in the axes of that frame."""

    mass: Array  # (...) [kg]
    first_moment: Array  # (..., 3) mass times centre of mass, measured from O [kg m]
    rotational_inertia: Array  # (..., 3, 3) inertia tensor about O, not about the centre of mass [kg m^2]

    @property
    def second_moment_matrix(self) -> Array:
        """Integral of r r' over the mass (..., 3, 3), r measured from O [kg m^2]: tr(I) / 2 times 1, minus I.

        With mass and first moment it forms the pseudo-inertia matrix (Wensing, Kim and Slotine 2018).
        """
        tensor = self.rotational_inertia
        half = (tensor[..., 0, 0] + tensor[..., 1, 1] + tensor[..., 2, 2]) / 2
        return np.asarray(np.eye(3, dtype=int) * append_axis(append_axis(half)) - tensor)

    def __add__(self, other: RigidInertia) -> RigidInertia:
        """Return the inertia of two rigidly connected bodies; both must be given in the same frame."""
        return RigidInertia(
            np.asarray(self.mass + other.mass),
            self.first_moment + other.first_moment,
            self.rotational_inertia + other.rotational_inertia,
        )

    def transform(self, R: Array, p: Array) -> RigidInertia:
        """Return the inertia about the origin of frame A, in its axes; (R, p) is the pose of this frame in A.

        Featherstone 2008, eq. 2.66.
        """
        h = rotate(R, self.first_moment)
        P, H = skew(p), skew(h)
        rotated = R @ self.rotational_inertia @ np.swapaxes(R, -1, -2)
        mass = append_axis(self.mass)
        shifted = rotated - P @ H - H @ P - append_axis(mass) * (P @ P)
        return RigidInertia(self.mass, h + p * mass, symmetric_from_upper(shifted))

    def __getitem__(self, index: int) -> RigidInertia:
        """Return one of several inertias."""
        return RigidInertia(self.mass[index, ...], self.first_moment[index], self.rotational_inertia[index])

    def momentum(self, linear: Array, angular: Array) -> tuple[Array, Array]:
        """Return linear and angular momentum about O, given the velocity of O and the angular velocity."""
        return (
            linear * self.mass + cross(angular, self.first_moment),
            rotate(self.rotational_inertia, angular) + cross(self.first_moment, linear),
        )


def inertia_about_origin(mass: Array, center: Array, rotation: Array, tensor: Array) -> RigidInertia:
    """Return the inertia about the origin from mass, centre of mass and central inertia tensor, as in URDF.

    `tensor` (..., 3, 3) is about `center` (..., 3), in the axes `rotation` (..., 3, 3).
    """
    central = rotation @ tensor @ np.swapaxes(rotation, -1, -2)
    C, along = skew(center), append_axis(mass)
    return RigidInertia(np.asarray(mass), center * along, central - (C @ C) * append_axis(along))


def parameters_from_inertia(inertia: RigidInertia) -> Array:
    """Return the ten parameters (..., 10) of a rigid body, about the origin of its frame."""
    tensor = [inertia.rotational_inertia[..., i, j] for i, j in TENSOR_ENTRIES]
    first_moment = [inertia.first_moment[..., k] for k in range(3)]
    return np.stack([np.asarray(x) for x in (inertia.mass, *first_moment, *tensor)], axis=-1)


def inertia_from_parameters(parameters: Array) -> RigidInertia:
    """Return the inertia that has the ten `parameters` (..., 10)."""
    tensor = {ij: parameters[..., 4 + k] for k, ij in enumerate(TENSOR_ENTRIES)}
    rows = [[tensor[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]
    rotational_inertia = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    return RigidInertia(np.asarray(parameters[..., 0]), parameters[..., 1:4], rotational_inertia)


_UPPER = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2]]), np.array([[0, 1, 2], [1, 1, 2], [2, 2, 2]])


def symmetric_from_upper(A: Array) -> Array:
    """Return the symmetric matrix (..., 3, 3) with the upper triangle of `A`.

    In traced code the lower triangle of `A` is then never computed.
    """
    return np.asarray(A[..., _UPPER[0], _UPPER[1]])
