"""Single vectors and rotation matrices as tuples of floats.

For one vector of three, NumPy's functions take ten times as long; steps of worlds and searches for nearest
points are made of such vectors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Vector3 = tuple[float, float, float]
Rows = tuple[Vector3, Vector3, Vector3]
"""Rows of a rotation matrix."""


def rotation_rows(x: float, y: float, z: float, w: float) -> Rows:
    """Return the rotation matrix of a unit quaternion (x, y, z, w)."""
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


def rotate(R: Rows, a: Sequence[float]) -> Vector3:
    """Return R a."""
    (r, s, t), (x, y, z) = R, a
    return (
        r[0] * x + r[1] * y + r[2] * z,
        s[0] * x + s[1] * y + s[2] * z,
        t[0] * x + t[1] * y + t[2] * z,
    )


def rotate_back(R: Rows, a: Sequence[float]) -> Vector3:
    """Return R^T a."""
    (r, s, t), (x, y, z) = R, a
    return (
        r[0] * x + s[0] * y + t[0] * z,
        r[1] * x + s[1] * y + t[1] * z,
        r[2] * x + s[2] * y + t[2] * z,
    )


def minus_cross(u: Sequence[float], a: Sequence[float], b: Sequence[float]) -> Vector3:
    """Return u - a x b."""
    return (
        u[0] - (a[1] * b[2] - a[2] * b[1]),
        u[1] - (a[2] * b[0] - a[0] * b[2]),
        u[2] - (a[0] * b[1] - a[1] * b[0]),
    )


def dot(a: Vector3, b: Vector3) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def minus(a: Vector3, b: Vector3) -> Vector3:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def norm(a: Vector3) -> float:
    """Return the Euclidean length, also of vectors whose squares would overflow or vanish."""
    return math.hypot(*a)


def combination(weights: tuple[float, ...], points: list[Vector3]) -> Vector3:
    """Return the sum of weighted points."""
    x = y = z = 0.0
    for weight, point in zip(weights, points, strict=True):
        x += weight * point[0]
        y += weight * point[1]
        z += weight * point[2]
    return x, y, z
