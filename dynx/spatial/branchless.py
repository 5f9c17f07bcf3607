"""Exponentials and logarithms of rotations and poses for any scalar, without a branch.

`dynx.spatial.so3` and `se3` choose between formulas by the size of an angle, which symbols of a trace do
not tell. The formulas here are good for every angle: what is divided by vanishes only where all that it is
multiplied with does, and `TINY` keeps the quotient finite there. Where they cancel digits, as 1 - sin(x) / x
does, the result is multiplied with squares of the angle: errors are some roundings of the entries around it.

Arrays (..., n), quaternions (x, y, z, w). For floats the functions of the other modules are the better ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.spatial.scalar import Array, arctan, cos, sign, sin, sqrt
from dynx.spatial.so3 import quat_product, rotate, rotate_back, rotation_from_quat, skew

TINY = 1e-300
"""Added to squares of angles: lost beside all that are not 0 to rounding."""


def quat_exp(rotation_vector: Array) -> Array:
    """Unit quaternion (..., 4) of a rotation vector [rad] (..., 3)."""
    half = 0.5 * _length(rotation_vector)
    return np.concatenate([0.5 * rotation_vector * (sin(half) / half), cos(half)], axis=-1)


def quat_log(quat_xyzw: Array) -> Array:
    """Rotation vector [rad] (..., 3), of length at most pi, of a quaternion of any length but 0."""
    vector, w = quat_xyzw[..., :3], quat_xyzw[..., 3:]
    size = _length(vector)
    # The half of an angle between 0 and pi, whose tangent is finite.
    angle = 4.0 * arctan(size / (abs(w) + sqrt(size * size + w * w)))
    # 1 where w is 0 as well.
    same_way = sign(sign(w) + 0.5)
    return np.asarray(same_way * (angle / size) * vector)


def rotation_log(R: Array) -> Array:
    """Rotation vector [rad] (..., 3) of a rotation matrix (..., 3, 3)."""
    return quat_log(_quat_multiple(R))


def se3_exp(linear: Array, angular: Array) -> tuple[Array, Array]:
    """`dynx.spatial.se3.se3_exp`: position (..., 3) and quaternion (..., 4) that a body twist leads to."""
    angle = _length(angular)[..., None]
    half = 0.5 * angle
    shape = sin(half) / half
    W = skew(angular)
    bent = 0.5 * (shape * shape) * W + ((1.0 - sin(angle) / angle) / (angle * angle)) * (W @ W)
    return linear + rotate(bent, linear), quat_exp(angular)


def se3_log(position: Array, quat_xyzw: Array) -> tuple[Array, Array]:
    """The body twist (linear, angular) that `se3_exp` maps to this displacement."""
    angular = quat_log(quat_xyzw)
    angle = _length(angular)[..., None]
    half = 0.5 * angle
    W = skew(angular)
    bent = -0.5 * W + ((1.0 - half * cos(half) / sin(half)) / (angle * angle)) * (W @ W)
    return position + rotate(bent, position), angular


def integrate(q: Array, v: Array) -> Array:
    """`Model.integrate` of a floating base and its joints: q (..., nq) plus v (..., nv) for unit time."""
    position, quat = se3_exp(v[..., :3], v[..., 3:6])
    moved = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), position)
    turned = quat_product(q[..., 3:7], quat)
    turned = turned / sqrt(np.sum(turned * turned, axis=-1, keepdims=True))
    return np.concatenate([moved, turned, q[..., 7:] + v[..., 6:]], axis=-1)


def difference(q0: Array, q1: Array) -> Array:
    """`Model.difference` of a floating base and its joints: the v (..., nv) with integrate(q0, v) = q1."""
    conjugate = q0[..., 3:7] * np.array([-1.0, -1.0, -1.0, 1.0])
    moved = rotate_back(rotation_from_quat(q0[..., 3:7]), q1[..., :3] - q0[..., :3])
    linear, angular = se3_log(moved, quat_product(conjugate, q1[..., 3:7]))
    return np.concatenate([linear, angular, q1[..., 7:] - q0[..., 7:]], axis=-1)


def _length(a: Array) -> Array:
    """(..., 1), never 0."""
    return sqrt(np.sum(a * a, axis=-1, keepdims=True) + TINY)


def _quat_multiple(R: Array) -> Array:
    """A quaternion of R times its largest component (Markley and Crassidis 2014, section 2.9.3)."""
    m: Any = [[R[..., i, j, None] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    skewed = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    products = np.concatenate([*skewed, 1.0 + trace], axis=-1)
    largest = products[..., 3:]
    for i in range(3):
        row = [m[i][j] + m[j][i] for j in range(3)]
        row[i] = 1.0 + 2.0 * m[i][i] - trace
        # 1 where this one is larger, otherwise 0.
        larger = sign(row[i] - largest)
        larger = 0.5 * (larger + abs(larger))
        others = np.concatenate([*row, skewed[i]], axis=-1)
        products = larger * others + (1.0 - larger) * products
        largest = larger * row[i] + (1.0 - larger) * largest
    return products
