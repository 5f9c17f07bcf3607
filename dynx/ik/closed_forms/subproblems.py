"""Canonical subproblems of inverse kinematics, in array code for any scalar that branches on no value.

They go back to Paden (Kinematics and Control of Robot Manipulators, 1986, section 4) and Kahan; names and
numbers here follow Elias and Wen (IK-Geo: Unified robot inverse kinematics using subproblem decomposition,
2022). An angle is a pair of cosine and sine, so that no angle is computed from an angle. Where a subproblem
has no solution its nearest approach is returned, and where an angle is arbitrary a given one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.spatial.scalar import Array, Floats, append_axis, clamp, sqrt, where_less
from dynx.spatial.so3 import cross

ALIGNMENT = 1e-12
"""Relative length below which the direction of a vector counts as arbitrary: rounding determines it."""

_TINY = 1e-300
"""Term that keeps quotients finite where their numerators vanish."""


@dataclass(frozen=True)
class Angle:
    """An angle by its cosine and sine (...,), and 1 (otherwise 0) where it is arbitrary."""

    cos: Array
    sin: Array
    arbitrary: Array | float = 0.0
    separation: Array | float = 1.0
    """Measure, about half a difference of angles [rad], of how far the solution of the other sign is: 0 where
    both are one, and negative where neither is real."""


@dataclass(frozen=True)
class Slide:
    """Position of a prismatic joint (...,), relative to the length of the chain."""

    value: Array
    arbitrary: Array | float = 0.0
    """0: the position is never arbitrary."""
    separation: Array | float = 1.0
    """Measure, half the difference of positions, as that of `Angle`."""


Coordinate = Angle | Slide
"""Position of a joint."""


def dot(a: Array, b: Array) -> Array:
    """Return a' b (...,), for arrays (..., 3)."""
    return np.asarray(np.sum(a * b, axis=-1))


def positive_root(x: Array) -> Array:
    """Return the square root of x, or 0 where x is negative."""
    return sqrt(where_less(0.0, x, x, 0.0))


def turn(axis: Array, angle: Angle, a: Array) -> Array:
    """Return `a` (..., 3) rotated by an angle about a unit vector `axis` (3,) (Rodrigues)."""
    along = axis * append_axis(dot(axis, a))
    return np.asarray(along + append_axis(angle.cos) * (a - along) + append_axis(angle.sin) * cross(axis, a))


def turn_back(axis: Array, angle: Angle, a: Array) -> Array:
    """Return `a` (..., 3) rotated by the opposite angle."""
    return turn(axis, Angle(angle.cos, -angle.sin), a)


def normalised(x: Array, y: Array, scale: Array | float, preferred: float) -> Angle:
    """Return the angle of the point (x, y), or `preferred` [rad] where the point is the origin to rounding.

    `scale` is the magnitude of the terms of x and y.
    """
    square = x * x + y * y
    least = (ALIGNMENT * scale) * (ALIGNMENT * scale)
    length = sqrt(square + _TINY)
    return Angle(
        where_less(square, least, np.cos(preferred), x / length),
        where_less(square, least, np.sin(preferred), y / length),
        where_less(square, least, 1.0, 0.0),
    )


def angle_from_to(axis: Floats, a: Array, b: Array, preferred: float) -> Angle:
    """Return the angle about `axis` that turns `a` into `b` (subproblem 1), as seen along the axis.

    It is arbitrary where a or b lies on the axis.
    """
    scale = 1.0 + dot(a, a) + dot(b, b)
    x = dot(a, b) - dot(axis, a) * dot(axis, b)
    return normalised(x, dot(axis, cross(a, b)), scale, preferred)


def solve_linear(A: Array | float, B: Array | float, D: Array, sign: Array, preferred: float) -> Angle:
    """Return the angle with A cos + B sin = D at which the left side falls if `sign` is 1, and rises if it is
    -1 (subproblem 4 is such an equation).

    Where D is out of reach the angle brings the left side as near as possible.
    """
    length = sqrt(np.asarray(A * A + B * B + _TINY))
    d = clamp(D / length, 1.0)
    separation = positive_root((1.0 - d) * (1.0 + d))
    root = sign * separation
    x, y = (A * d - B * root) / length, (B * d + A * root) / length
    return replace(normalised(x, y, 1.0, preferred), separation=separation)


def quadratic_root(square: float, half_linear: Array | float, constant: Array, sign: Array) -> Slide:
    """Return the root d, which `sign` (1 or -1) selects, of ``square d^2 + 2 half_linear d + constant = 0``.

    Where no root is real, their real part is returned.
    """
    root = positive_root(half_linear * half_linear - square * constant)
    return Slide((sign * root - half_linear) / square, separation=root)


def component_terms(direction: Array, axis: Array, a: Array) -> tuple[Array, Array, Array]:
    """Return (constant, cosine, sine): the terms of direction' R a, with R a rotation about `axis`."""
    along = dot(direction, axis) * dot(axis, a)
    return along, dot(direction, a) - along, dot(direction, cross(axis, a))


def value_at(terms: Sequence[Array | float], q: Angle) -> Array:
    """Return ``terms[0] + terms[1] cos q + terms[2] sin q`` (...,)."""
    return np.asarray(terms[0] + terms[1] * q.cos + terms[2] * q.sin)
