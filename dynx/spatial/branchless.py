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


def moved(pose: Components, twist: Components, f: Functions) -> list[Any]:
    """Return the pose, position [m] and quaternion, after a constant body twist (6) for unit time.

    Linear velocity [m] comes first, angular velocity [rad] second, both in the axes of the body (Murray, Li
    and Sastry, A Mathematical Introduction to Robotic Manipulation, eq. 2.36).
    """
    # Written out, since a call of a function takes as long as ten products of floats.
    lx, ly, lz, wx, wy, wz = twist
    px, py, pz, x, y, z, w = pose
    squared = wx * wx + wy * wy + wz * wz + TINY
    half = 0.5 * f.sqrt(squared)
    sine, cosine = f.sin(half), f.cos(half)
    ratio = sine / half
    # The displacement d in the axes of the start: linear + b (angular x linear) + c angular x (...).
    ux, uy, uz = wy * lz - wz * ly, wz * lx - wx * lz, wx * ly - wy * lx
    b, c = 0.5 * (ratio * ratio), (1.0 - ratio * cosine) / squared
    dx = lx + b * ux + c * (wy * uz - wz * uy)
    dy = ly + b * uy + c * (wz * ux - wx * uz)
    dz = lz + b * uz + c * (wx * uy - wy * ux)
    # The displacement in the axes of the world: d + 2 w (u x d) + 2 u x (u x d), with u the vector part.
    tx, ty, tz = 2.0 * (y * dz - z * dy), 2.0 * (z * dx - x * dz), 2.0 * (x * dy - y * dx)
    # The Hamilton product with the rotation of the step.
    ratio = 0.5 * ratio
    rx, ry, rz = ratio * wx, ratio * wy, ratio * wz
    qx = w * rx + cosine * x + y * rz - z * ry
    qy = w * ry + cosine * y + z * rx - x * rz
    qz = w * rz + cosine * z + x * ry - y * rx
    qw = w * cosine - x * rx - y * ry - z * rz
    norm = f.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    return [
        px + (dx + w * tx + y * tz - z * ty),
        py + (dy + w * ty + z * tx - x * tz),
        pz + (dz + w * tz + x * ty - y * tx),
        qx / norm,
        qy / norm,
        qz / norm,
        qw / norm,
    ]


def twist_between(start: Components, end: Components, f: Functions) -> list[Any]:
    """Return the body twist (6), of an angle of at most pi, with which `moved` leads from one pose to
    another."""
    # Written out like `moved`. The conjugate of the first quaternion leads back.
    px, py, pz, x, y, z, w = start
    ex, ey, ez, qx, qy, qz, qw = end
    x, y, z = -x, -y, -z
    # The displacement in the axes of the start.
    ax, ay, az = ex - px, ey - py, ez - pz
    tx, ty, tz = 2.0 * (y * az - z * ay), 2.0 * (z * ax - x * az), 2.0 * (x * ay - y * ax)
    dx = ax + w * tx + y * tz - z * ty
    dy = ay + w * ty + z * tx - x * tz
    dz = az + w * tz + x * ty - y * tx
    wx, wy, wz = _rotation_vector(
        (
            w * qx + qw * x + y * qz - z * qy,
            w * qy + qw * y + z * qx - x * qz,
            w * qz + qw * z + x * qy - y * qx,
            w * qw - x * qx - y * qy - z * qz,
        ),
        f,
    )
    squared = wx * wx + wy * wy + wz * wz + TINY
    half = 0.5 * f.sqrt(squared)
    c = (1.0 - half * f.cos(half) / f.sin(half)) / squared
    ux, uy, uz = wy * dz - wz * dy, wz * dx - wx * dz, wx * dy - wy * dx
    return [
        dx - 0.5 * ux + c * (wy * uz - wz * uy),
        dy - 0.5 * uy + c * (wz * ux - wx * uz),
        dz - 0.5 * uz + c * (wx * uy - wy * ux),
        wx,
        wy,
        wz,
    ]


def quat_exp(rotation_vector: Array) -> Array:
    """Return the unit quaternion (..., 4) of a rotation vector [rad] (..., 3)."""
    x, y, z = components(rotation_vector)
    half = 0.5 * sqrt(x * x + y * y + z * z + TINY)
    ratio = 0.5 * (sin(half) / half)
    return np.stack([ratio * x, ratio * y, ratio * z, cos(half)], axis=-1)


def quat_log(quat_xyzw: Array) -> Array:
    """Return the rotation vector [rad] (..., 3), of norm at most pi, of a quaternion of any non-zero norm."""
    return np.stack(_rotation_vector(components(quat_xyzw), ARRAYS), axis=-1)


def rotation_log(R: Array) -> Array:
    """Return the rotation vector [rad] (..., 3) of a rotation matrix (..., 3, 3)."""
    return quat_log(_scaled_quat(R))


def components(array: Array) -> list[Any]:
    """Return the entries (...,) of an array (..., n)."""
    return [array[..., k] for k in range(array.shape[-1])]


def _rotation_vector(quat: Components, f: Functions) -> Vector:
    x, y, z, w = quat
    squared = x * x + y * y + z * z + TINY
    norm = f.sqrt(squared)
    # The formula uses a quarter of the rotation angle, whose tangent is finite.
    angle = 4.0 * f.arctan(norm / (abs(w) + f.sqrt(squared + w * w)))
    # This is the sign of w, but 1 where w is 0.
    factor = f.sign(f.sign(w) + 0.5) * (angle / norm)
    return factor * x, factor * y, factor * z


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
