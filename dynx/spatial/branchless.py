"""Exponentials and logarithms of rotations and poses for any scalar type, without branches.

Formulas that choose by the magnitude of the angle cannot be traced. Those here hold for every angle. A
divisor vanishes only where its numerator does, and `TINY` keeps the quotient finite there. Where a formula
cancels digits, as 1 - sin(x) / x does, its result is multiplied by squares of the angle, so that the error
stays at a few roundings of the neighbouring entries.

The formulas are written in components, which are floats of Python, arrays or traced symbols: for one
configuration floats take a thirtieth of the time of arrays with three entries. Quaternions are (x, y, z, w).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import Array, arctan, cos, sign, sin, sqrt
from dynx.spatial.so3 import rotate, rotation_from_quat

TINY = 1e-300
"""Term added to squared angles [rad^2] before division; rounding absorbs it for all but tiny angles."""

Components = Sequence[Any]
"""Floats, arrays of one shape, or symbols."""

Vector = tuple[Any, Any, Any]


class Functions(NamedTuple):
    """Elementary functions of the components."""

    sqrt: Callable[[Any], Any]
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    arctan: Callable[[Any], Any]
    sign: Callable[[Any], Any]


FLOATS = Functions(math.sqrt, math.sin, math.cos, math.atan, lambda x: (x > 0.0) - (x < 0.0))
"""Functions of floats of Python."""

ARRAYS = Functions(sqrt, sin, cos, arctan, sign)
"""Functions of arrays of any scalar, which round as NumPy does."""


def exponential(linear: Components, angular: Components, f: Functions) -> tuple[Vector, Components]:
    """Return the position [m] and the quaternion that a body reaches by a constant twist in unit time.

    `linear` [m] and `angular` [rad] are in the axes of the body, the result in those at the start (Murray, Li
    and Sastry, A Mathematical Introduction to Robotic Manipulation, eq. 2.36).
    """
    squared, half, sine, cosine = _half_angle(angular, f)
    ratio = sine / half
    x, y, z = linear
    ux, uy, uz = turned = _cross(angular, linear)
    tx, ty, tz = _cross(angular, turned)
    b, c = 0.5 * (ratio * ratio), (1.0 - ratio * cosine) / squared
    position = x + b * ux + c * tx, y + b * uy + c * ty, z + b * uz + c * tz
    x, y, z = angular
    ratio = 0.5 * ratio
    return position, (ratio * x, ratio * y, ratio * z, cosine)


def logarithm(position: Components, quat: Components, f: Functions) -> tuple[Vector, Components]:
    """Return the twist (linear, angular), of an angle of at most pi, whose `exponential` is this one."""
    angular = _rotation_vector(quat, f)
    squared, half, sine, cosine = _half_angle(angular, f)
    x, y, z = position
    ux, uy, uz = turned = _cross(angular, position)
    tx, ty, tz = _cross(angular, turned)
    c = (1.0 - half * cosine / sine) / squared
    return (x - 0.5 * ux + c * tx, y - 0.5 * uy + c * ty, z - 0.5 * uz + c * tz), angular


def moved(pose: Components, twist: Components, f: Functions) -> list[Any]:
    """Return the pose, position [m] and quaternion, after a constant body twist (6) for unit time."""
    step, turn = exponential(twist[:3], twist[3:], f)
    dx, dy, dz = _rotated(pose[3:], step)
    x, y, z, w = _product(pose[3:], turn)
    norm = f.sqrt(x * x + y * y + z * z + w * w)
    return [pose[0] + dx, pose[1] + dy, pose[2] + dz, x / norm, y / norm, z / norm, w / norm]


def twist_between(start: Components, end: Components, f: Functions) -> list[Any]:
    """Return the body twist (6) with which `moved` leads from one pose to another."""
    x, y, z, w = start[3:]
    back = -x, -y, -z, w
    step = _rotated(back, (end[0] - start[0], end[1] - start[1], end[2] - start[2]))
    linear, angular = logarithm(step, _product(back, end[3:]), f)
    return [*linear, *angular]


def quat_exp(rotation_vector: Array) -> Array:
    """Return the unit quaternion (..., 4) of a rotation vector [rad] (..., 3)."""
    angular = _components(rotation_vector)
    _, half, sine, cosine = _half_angle(angular, ARRAYS)
    ratio = 0.5 * (sine / half)
    return np.stack([*(ratio * w for w in angular), cosine], axis=-1)


def quat_log(quat_xyzw: Array) -> Array:
    """Return the rotation vector [rad] (..., 3), of norm at most pi, of a quaternion of any non-zero norm."""
    return np.stack(_rotation_vector(_components(quat_xyzw), ARRAYS), axis=-1)


def rotation_log(R: Array) -> Array:
    """Return the rotation vector [rad] (..., 3) of a rotation matrix (..., 3, 3)."""
    return quat_log(_scaled_quat(R))


def integrate(q: Array, v: Array) -> Array:
    """Return `Model.integrate` for a floating base: q (..., nq) moved by v (..., nv) for unit time."""
    base = moved(_components(q[..., :7]), _components(v[..., :6]), ARRAYS)
    return np.concatenate([np.stack(base, axis=-1), q[..., 7:] + v[..., 6:]], axis=-1)


def displace(q: Array, d: Array, *, floating: bool) -> Array:
    """Return q (+) d (..., nq), `Model.integrate` to first order in d (..., nv).

    Derivatives with respect to a configuration are taken with respect to d: with a floating base q has one
    entry more than a velocity. Value and first derivatives are exact at d = 0. The base translates by
    R d[:3] and rotates by the quaternion product of q with (d[3:6] / 2, 1).
    """
    if not floating:
        return np.asarray(q + d)
    x, y, z, w = (q[..., k] for k in range(3, 7))
    a, b, c = (d[..., k] for k in range(3, 6))
    change = [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
    position = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), d[..., :3])
    quat = q[..., 3:7] + np.stack(change, axis=-1) * 0.5
    return np.concatenate([position, quat, q[..., 7:] + d[..., 6:]], axis=-1)


def difference(q0: Array, q1: Array) -> Array:
    """Return `Model.difference` for a floating base: the v (..., nv) with integrate(q0, v) = q1."""
    base = twist_between(_components(q0[..., :7]), _components(q1[..., :7]), ARRAYS)
    return np.concatenate([np.stack(base, axis=-1), q1[..., 7:] - q0[..., 7:]], axis=-1)


def _components(array: Array) -> list[Any]:
    return [array[..., k] for k in range(array.shape[-1])]


def _half_angle(angular: Components, f: Functions) -> tuple[Any, Any, Any, Any]:
    """Return the square of the angle, kept above 0 by `TINY`, half of the angle, its sine and cosine."""
    x, y, z = angular
    squared = x * x + y * y + z * z + TINY
    half = 0.5 * f.sqrt(squared)
    return squared, half, f.sin(half), f.cos(half)


def _rotation_vector(quat: Components, f: Functions) -> Vector:
    x, y, z, w = quat
    squared = x * x + y * y + z * z + TINY
    norm = f.sqrt(squared)
    # The formula uses a quarter of the rotation angle, whose tangent is finite.
    angle = 4.0 * f.arctan(norm / (abs(w) + f.sqrt(squared + w * w)))
    # This is the sign of w, but 1 where w is 0.
    factor = f.sign(f.sign(w) + 0.5) * (angle / norm)
    return factor * x, factor * y, factor * z


def _cross(a: Components, b: Components) -> Vector:
    ax, ay, az = a
    bx, by, bz = b
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def _rotated(quat: Components, vector: Components) -> Vector:
    """Return a vector turned by a unit quaternion: v + 2 w (u x v) + 2 u x (u x v)."""
    x, y, z, w = quat
    a, b, c = vector
    # Twice u x v, with u the vector part.
    p, q, r = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p


def _product(a: Components, b: Components) -> Components:
    """Return the Hamilton product a b."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + bw * ax + ay * bz - az * by,
        aw * by + bw * ay + az * bx - ax * bz,
        aw * bz + bw * az + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _scaled_quat(R: Array) -> Array:
    """Return the quaternion of R times its largest component (Markley and Crassidis 2014, section 2.9.3)."""
    m: Any = [[R[..., i, j, None] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    differences = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    products = np.concatenate([*differences, 1.0 + trace], axis=-1)
    largest = products[..., 3:]
    for i in range(3):
        row = [m[i][j] + m[j][i] for j in range(3)]
        row[i] = 1.0 + 2.0 * m[i][i] - trace
        # `larger` is 1 where component i is larger than those before it, otherwise 0.
        larger = sign(row[i] - largest)
        larger = 0.5 * (larger + abs(larger))
        products_i = np.concatenate([*row, differences[i]], axis=-1)
        products = larger * products_i + (1.0 - larger) * products
        largest = larger * row[i] + (1.0 - larger) * largest
    return products
