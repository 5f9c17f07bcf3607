"""Canonical subproblems of inverse kinematics, in array code for any scalar that branches on no value.

They go back to Paden (Kinematics and Control of Robot Manipulators, 1986, section 4) and Kahan; names and
numbers here follow Elias and Wen (IK-Geo: Unified robot inverse kinematics using subproblem decomposition,
2022). An angle is a pair of cosine and sine, so that no angle is computed from an angle. Where a subproblem
has no solution its nearest approach is returned, and where an angle is arbitrary a given one.

Elias and Wen's subproblems 5 and 6, and the general spherical-wrist arm (Pieper, The kinematics of
manipulators under computer control, 1968), reduce to

    f(cos, sin) = k0 + k1 c + k2 s + k3 c^2 + k4 c s + k5 s^2 = 0.

With the tangent of half the angle this is a quartic (Ferrari). The angle is first measured from a direction
where f is far from 0, so the leading coefficient is not small. A few steps of Newton's method on f remove the
rounding errors of the closed formula, which are large near double roots.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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


Conic = tuple[Array, Array, Array, Array, Array, Array]
"""Coefficients (k0, ..., k5) of f, each (...,)."""

_DIRECTIONS = 7
"""Number of directions among which one is chosen where f is far from 0; more than f has roots."""

_CUBIC_STEPS = 60
"""Steps of bisection and Newton's method for a root of the resolvent cubic: where two of its roots meet, each
step only halves the error."""

_NEWTON_STEPS = 3

_DOUBLE = 0.03
"""Slope of f, whose coefficients add up to 1, below which two roots may be one in an arm whose axes deviate
from those of the equation."""

_SMALL = 1e-6
"""Relative size of the root of the resolvent below which it is not divided by."""


def squared(a: tuple[Array, Array, Array]) -> Conic:
    """Return the coefficients of (a0 + a1 c + a2 s)^2."""
    return a[0] * a[0], 2.0 * a[0] * a[1], 2.0 * a[0] * a[2], a[1] * a[1], 2.0 * a[1] * a[2], a[2] * a[2]


def multiplied(a: tuple[Array, Array, Array], b: tuple[Array, Array, Array]) -> Conic:
    """Return the coefficients of (a0 + a1 c + a2 s) (b0 + b1 c + b2 s)."""
    return (
        a[0] * b[0],
        a[0] * b[1] + a[1] * b[0],
        a[0] * b[2] + a[2] * b[0],
        a[1] * b[1],
        a[1] * b[2] + a[2] * b[1],
        a[2] * b[2],
    )


def linear(a: tuple[Array, Array, Array]) -> Conic:
    """Return the coefficients of a0 + a1 c + a2 s."""
    return a[0], a[1], a[2], 0.0 * a[0], 0.0 * a[0], 0.0 * a[0]


def combined(*terms: tuple[Array | float, Conic]) -> Conic:
    """Return the sum of conics, each times a factor."""
    return _conic(lambda i: np.asarray(sum(factor * conic[i] for factor, conic in terms)))


def conic_root(conic: Conic, first: Array, second: Array) -> Angle:
    """Return the root of f that two signs (...,), each 1 or -1, choose among four.

    Where that root is not real, an angle near its real part is returned, at which f does not vanish.
    """
    size = 1e-300 + sum(abs(each) for each in conic)
    k = _conic(lambda i: conic[i] / size)
    c0, s0 = _far_direction(k)
    k0, k1, k2, k3, k4, k5 = _rotated(k, c0, s0)
    # Coefficients of the quartic in the tangent of half the angle.
    lead = k0 - k1 + k3
    lead = where_less(abs(lead), 1e-300, 1.0, lead)
    b, c = 2.0 * (k2 - k4) / lead, 2.0 * (k0 - k3 + 2.0 * k5) / lead
    d, e = 2.0 * (k2 + k4) / lead, (k0 + k1 + k3) / lead
    t, real = _quartic_root(b, c, d, e, first, second)
    w = 1.0 + t * t
    x, y = (1.0 - t * t) / w, 2.0 * t / w
    c, s = _polished(k, c0 * x - s0 * y, s0 * x + c0 * y)
    # The slope of f at a root vanishes with its distance from another. From the real part of a root that is
    # not real Newton's method may reach one that is; if the slope is small there, both may be one.
    slope = abs(_slope(k, c, s))
    none = where_less(slope, _DOUBLE, 0.0, -1.0)
    return Angle(c, s, separation=where_less(0.5, real, slope, none))


def _conic(coefficient: Callable[[int], Array]) -> Conic:
    """Return the conic whose coefficients a function gives by their index."""
    k0, k1, k2, k3, k4, k5 = (coefficient(i) for i in range(6))
    return k0, k1, k2, k3, k4, k5


def _value(k: Conic, c: Array | float, s: Array | float) -> Array:
    return np.asarray(k[0] + c * (k[1] + c * k[3] + s * k[4]) + s * (k[2] + s * k[5]))


def _far_direction(k: Conic) -> tuple[Array, Array]:
    """Return cosine and sine of the angle opposite to the direction where |f| is largest."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    largest, c0, s0 = 0.0 * k[0] - 1.0, 1.0 + 0.0 * k[0], 0.0 * k[0]
    for x, y in zip(np.cos(angles).tolist(), np.sin(angles).tolist(), strict=True):
        here = abs(_value(k, x, y))
        c0, s0 = where_less(largest, here, -x, c0), where_less(largest, here, -y, s0)
        largest = where_less(largest, here, here, largest)
    return c0, s0


def _rotated(k: Conic, c0: Array, s0: Array) -> Conic:
    """Return the coefficients of f in cosine and sine of the angle measured from that of (c0, s0)."""
    cc, ss, cs = c0 * c0, s0 * s0, c0 * s0
    return (
        k[0],
        k[1] * c0 + k[2] * s0,
        k[2] * c0 - k[1] * s0,
        k[3] * cc + k[4] * cs + k[5] * ss,
        2.0 * (k[5] - k[3]) * cs + k[4] * (cc - ss),
        k[3] * ss - k[4] * cs + k[5] * cc,
    )


def _quartic_root(b: Array, c: Array, d: Array, e: Array, first: Array, second: Array) -> tuple[Array, Array]:
    """Return a root of t^4 + b t^3 + c t^2 + d t + e, or the real part of one that is not real, and whether
    (1 or 0) it is real."""
    h = 0.25 * b
    p = c - 6.0 * h * h
    q = d + h * (8.0 * h * h - 2.0 * c)
    r = e + h * (h * (c - 3.0 * h * h) - d)
    m = _resolvent_root(p, q, r)
    # Factors y^2 + alpha y + beta and y^2 - alpha y + gamma with alpha^2 = m.
    alpha = positive_root(m)
    total = p + m
    apart = positive_root(total * total - 4.0 * r)
    signed = where_less(q, 0.0, -apart, apart)
    safe = where_less(0.0, alpha, alpha, 1.0)
    size = abs(p) + sqrt(abs(r)) + m
    difference = where_less(m, _SMALL * size, signed, q / safe)
    beta = 0.5 * (total - first * difference)
    alpha = first * alpha
    square = alpha * alpha - 4.0 * beta
    real = where_less(square, 0.0, 0.0, 1.0)
    return 0.5 * (second * positive_root(square) - alpha) - h, real


def _resolvent_root(p: Array, q: Array, r: Array) -> Array:
    """Return a real root m >= 0 of m^3 + 2 p m^2 + (p^2 - 4 r) m - q^2.

    Newton's method, within a bracket that is halved where a step would leave it.
    """
    a2, a1, a0 = 2.0 * p, p * p - 4.0 * r, -q * q
    low = 0.0 * p
    # Cauchy's bound on positive roots (Lagrange's form).
    high = 2.0 * (abs(a2) + sqrt(abs(a1)) + abs(q) + positive_root(abs(q))) + 1e-150
    m = high
    for _ in range(_CUBIC_STEPS):
        value = ((m + a2) * m + a1) * m + a0
        slope = (3.0 * m + 2.0 * a2) * m + a1
        low = where_less(value, 0.0, m, low)
        high = where_less(value, 0.0, high, m)
        step = m - value / where_less(abs(slope), 1e-300, 1e-300, slope)
        middle = 0.5 * (low + high)
        m = where_less(step, low, middle, where_less(high, step, middle, step))
    return m


def _slope(k: Conic, c: Array, s: Array) -> Array:
    """Return the derivative of f by the angle."""
    return np.asarray(c * (k[2] + c * k[4] + 2.0 * s * (k[5] - k[3])) - s * (k[1] + s * k[4]))


def _polished(k: Conic, c: Array, s: Array) -> tuple[Array, Array]:
    for _ in range(_NEWTON_STEPS):
        slope = _slope(k, c, s)
        # Damped, so that a double root, where the slope vanishes, causes no large step.
        half = -0.5 * _value(k, c, s) * slope / (slope * slope + 1e-20)
        half = where_less(abs(half), 0.05, half, 0.0)
        w = 1.0 + half * half
        x, y = (1.0 - half * half) / w, 2.0 * half / w
        c, s = c * x - s * y, s * x + c * y
    return c, s
