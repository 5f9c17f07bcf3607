"""Pose of a body in its parent, and the transforms of vectors, tensors and inertias between the two.

Rotating a tensor about z by an angle with cosine c and sine s takes few products, and those of c and s are
shared by all tensors that are rotated by the same angle:

    xx' = cc xx + ss yy - cs (xy + yx),   xy' = cs (xx - yy) + cc xy - ss yx

and so on. Formulas with fewer products exist, such as xx - s (s (xx - yy) + c (xy + yx)), but they compute a
small moment as the difference of two large ones: for a joint whose motion takes nearly all of a body's
inertia, forward dynamics would lose half of its digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import Body, joint_motion
from dynx.spatial.inertia import RigidInertia, symmetric_from_upper
from dynx.spatial.scalar import Array, cos, sin
from dynx.spatial.so3 import cross, rotate, rotate_back

SpatialVector = tuple[Array, Array]
"""A linear and an angular vector (..., 3): a twist, an acceleration, or a wrench (force and moment)."""


@dataclass(frozen=True)
class Placement:
    """Pose (R, p) of a body in its parent at some position of its joint.

    `R_joint_zero` is the rotation of the joint frame at position 0. `cos_sin` holds the cosine and the
    sine of the joint's own rotation, if it is about z; else None.
    """

    R: Array
    p: Array
    R_joint_zero: Array
    cos_sin: tuple[Array, Array] | None

    @classmethod
    def of(cls, body: Body, value: Array) -> Placement:
        """Return the placement of a body whose joint is at position `value` (...,)."""
        R, p = joint_motion(body, value)
        return cls(R, p, body.R, (cos(value), sin(value)) if body.about_z else None)

    def motion_to_child(self, linear: Array, angular: Array) -> SpatialVector:
        """Return a velocity or acceleration of the parent at the child's origin, in the child's axes."""
        return rotate_back(self.R, linear + cross(angular, self.p)), rotate_back(self.R, angular)

    def wrench_to_parent(self, force: Array, moment: Array) -> SpatialVector:
        """Return a wrench about the child's origin as a wrench about the parent's, in the parent's axes."""
        force_parent = rotate(self.R, force)
        return force_parent, rotate(self.R, moment) + cross(self.p, force_parent)

    def rotate_symmetric(self, S: Array) -> Array:
        """Return R S R' for a symmetric S (..., 3, 3)."""
        return symmetric_from_upper(self.rotate_tensor(S))

    def rotate_tensor(self, A: Array) -> Array:
        """Return R A R' for any A (..., 3, 3)."""
        if self.cos_sin is None:
            return np.asarray(self.R @ A @ np.swapaxes(self.R, -1, -2))
        R = self.R_joint_zero
        return np.asarray(R @ _rotate_tensor_about_z(A, *self.cos_sin) @ np.swapaxes(R, -1, -2))

    def inertia_to_parent(self, inertia: RigidInertia) -> RigidInertia:
        """Return the inertia about the parent's origin, in the parent's axes."""
        rotated = RigidInertia(
            inertia.mass,
            rotate(self.R, inertia.first_moment),
            self.rotate_symmetric(inertia.rotational_inertia),
        )
        return rotated.transform(np.eye(3, dtype=int), self.p)


def _rotate_tensor_about_z(A: Array, c: Array, s: Array) -> Array:
    """Return Rz A Rz' (..., 3, 3), Rz rotating about z by an angle with cosine c and sine s (...,)."""
    xx, xy, yx, yy = A[..., 0, 0], A[..., 0, 1], A[..., 1, 0], A[..., 1, 1]
    xz, yz, zx, zy = A[..., 0, 2], A[..., 1, 2], A[..., 2, 0], A[..., 2, 1]
    cc, ss, cs = c * c, s * s, c * s
    products, moments = cs * (xy + yx), cs * (xx - yy)
    rows = [
        [cc * xx + ss * yy - products, moments + cc * xy - ss * yx, c * xz - s * yz],
        [moments + cc * yx - ss * xy, ss * xx + cc * yy + products, s * xz + c * yz],
        [c * zx - s * zy, s * zx + c * zy, A[..., 2, 2] + 0 * cc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
