"""Vectors of three floats as tuples: in loops over single points faster than arrays."""

from __future__ import annotations

import math

from dynx.spatial.plain import Vector3


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
