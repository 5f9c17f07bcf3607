"""A body's pose in its parent, and what it does to vectors, matrices and inertias.

A matrix turned about z by an angle with cosine c and sine s needs few products, of which those of c and s
are shared by all matrices that turn together:

    xx' = cc xx + ss yy - cs (xy + yx),   xy' = cs (xx - yy) + cc xy - ss yx

and so on. There are formulas with fewer, such as xx - s (s (xx - yy) + c (xy + yx)), but they find a small
moment as the difference of two large ones: where a joint gives way to nearly all of a body's inertia, forward
dynamics would lose half of its digits.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import Body, joint_motion
from dynx.spatial.inertia import RigidInertia, mirrored
from dynx.spatial.scalar import Array, cos, sin
from dynx.spatial.so3 import cross, rotate, rotate_back

Pair = tuple[Array, Array]
"""A linear and an angular vector (..., 3): a twist, an acceleration, or a force and a moment."""


@dataclass(frozen=True)
class Placement:
    """(R, p), the pose of a body in its parent at a position of its joint.

    `fixed` is the part of R before the joint's own rotation, and `turn` the cosine and the sine of
    that, if it is about z.
    """

    R: Array
    p: Array
    fixed: Array
    turn: tuple[Array, Array] | None

    @classmethod
    def of(cls, body: Body, value: Array) -> Placement:
        """That of a body whose joint is at `value` (...,)."""
        R, p = joint_motion(body, value)
        return cls(R, p, body.R, (cos(value), sin(value)) if body.about_z else None)

    def motion_of_child(self, linear: Array, angular: Array) -> Pair:
        """A velocity or acceleration of the parent at the child's origin, in the child's axes."""
        return rotate_back(self.R, linear + cross(angular, self.p)), rotate_back(self.R, angular)

    def wrench_of_parent(self, force: Array, moment: Array) -> Pair:
        """A wrench about the child's origin about the parent's, in the parent's axes."""
        below = rotate(self.R, force)
        return below, rotate(self.R, moment) + cross(self.p, below)

    def symmetric(self, S: Array) -> Array:
        """R S R' of a symmetric matrix (..., 3, 3)."""
        return mirrored(self.similar(S))

    def similar(self, A: Array) -> Array:
        """R A R' (..., 3, 3)."""
        if self.turn is None:
            return np.asarray(self.R @ A @ np.swapaxes(self.R, -1, -2))
        return np.asarray(self.fixed @ _turned(A, *self.turn) @ np.swapaxes(self.fixed, -1, -2))

    def inertia_of_parent(self, inertia: RigidInertia) -> RigidInertia:
        """The same body about the parent's origin and in its axes."""
        turned = RigidInertia(
            inertia.mass, rotate(self.R, inertia.first_moment), self.symmetric(inertia.second_moment)
        )
        return turned.seen_from(np.eye(3, dtype=int), self.p)


def _turned(A: Array, c: Array, s: Array) -> Array:
    """The matrix A (..., 3, 3) turned about z by the angle with this cosine and sine (...,)."""
    xx, xy, yx, yy = A[..., 0, 0], A[..., 0, 1], A[..., 1, 0], A[..., 1, 1]
    xz, yz, zx, zy = A[..., 0, 2], A[..., 1, 2], A[..., 2, 0], A[..., 2, 1]
    cc, ss, cs = c * c, s * s, c * s
    mixed, apart = cs * (xy + yx), cs * (xx - yy)
    rows = [
        [cc * xx + ss * yy - mixed, apart + cc * xy - ss * yx, c * xz - s * yz],
        [apart + cc * yx - ss * xy, ss * xx + cc * yy + mixed, s * xz + c * yz],
        [c * zx - s * zy, s * zx + c * zy, A[..., 2, 2] + 0 * cc],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
