"""Exponentials and logarithms of rotations and poses for any scalar type, without branches.

`dynx.spatial.so3` and `se3` choose a formula by the magnitude of the angle, which a traced symbol does not
have. The formulas here hold for every angle. A divisor vanishes only where its numerator does, and
`TINY` keeps the quotient finite there. Where a formula cancels digits, as 1 - sin(x) / x does, its result is
multiplied by squares of the angle, so that the error stays at a few roundings of the neighbouring entries.

Arrays are (..., n), quaternions (x, y, z, w). For floats, `so3` and `se3` are faster and more accurate.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.spatial.scalar import Array, arctan, cos, sign, sin, sqrt
from dynx.spatial.so3 import quat_product, rotate, rotate_back, rotation_from_quat, skew

TINY = 1e-300
"""Term added to squared angles [rad^2] before division; rounding absorbs it for all but tiny angles."""


def quat_exp(rotation_vector: Array) -> Array:
    """Return the unit quaternion (..., 4) of a rotation vector [rad] (..., 3)."""
    half = 0.5 * _positive_norm(rotation_vector)
    return np.concatenate([0.5 * rotation_vector * (sin(half) / half), cos(half)], axis=-1)


def quat_log(quat_xyzw: Array) -> Array:
    """Return the rotation vector [rad] (..., 3), of norm at most pi, of a quaternion of any non-zero norm."""
    vector, w = quat_xyzw[..., :3], quat_xyzw[..., 3:]
    norm = _positive_norm(vector)
    # The formula uses a quarter of the rotation angle, whose tangent is finite.
    angle = 4.0 * arctan(norm / (abs(w) + sqrt(norm * norm + w * w)))
    # This is the sign of w, but 1 where w is 0.
    sign_of_w = sign(sign(w) + 0.5)
    return np.asarray(sign_of_w * (angle / norm) * vector)


def rotation_log(R: Array) -> Array:
    """Return the rotation vector [rad] (..., 3) of a rotation matrix (..., 3, 3)."""
    return quat_log(_scaled_quat(R))


def se3_exp(linear: Array, angular: Array) -> tuple[Array, Array]:
    """Return position [m] (..., 3) and quaternion (..., 4) reached by a body twist, as `se3.se3_exp` does."""
    angle = _positive_norm(angular)[..., None]
    half = 0.5 * angle
    sinc = sin(half) / half
    W = skew(angular)
    V_minus_1 = 0.5 * (sinc * sinc) * W + ((1.0 - sin(angle) / angle) / (angle * angle)) * (W @ W)
    return linear + rotate(V_minus_1, linear), quat_exp(angular)


def se3_log(position: Array, quat_xyzw: Array) -> tuple[Array, Array]:
    """Return the body twist (linear, angular) that `se3_exp` maps to this displacement."""
    angular = quat_log(quat_xyzw)
    angle = _positive_norm(angular)[..., None]
    half = 0.5 * angle
    W = skew(angular)
    V_inverse_minus_1 = -0.5 * W + ((1.0 - half * cos(half) / sin(half)) / (angle * angle)) * (W @ W)
    return position + rotate(V_inverse_minus_1, position), angular


def integrate(q: Array, v: Array) -> Array:
    """Return `Model.integrate` for a floating base: q (..., nq) moved by v (..., nv) for unit time."""
    step, quat_step = se3_exp(v[..., :3], v[..., 3:6])
    position = q[..., :3] + rotate(rotation_from_quat(q[..., 3:7]), step)
    quat = quat_product(q[..., 3:7], quat_step)
    quat = quat / sqrt(np.sum(quat * quat, axis=-1, keepdims=True))
    return np.concatenate([position, quat, q[..., 7:] + v[..., 6:]], axis=-1)


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
    conjugate = q0[..., 3:7] * np.array([-1.0, -1.0, -1.0, 1.0])
    step = rotate_back(rotation_from_quat(q0[..., 3:7]), q1[..., :3] - q0[..., :3])
    linear, angular = se3_log(step, quat_product(conjugate, q1[..., 3:7]))
    return np.concatenate([linear, angular, q1[..., 7:] - q0[..., 7:]], axis=-1)


def _positive_norm(a: Array) -> Array:
    """Return the Euclidean norm (..., 1), kept above 0 by `TINY`."""
    return sqrt(np.sum(a * a, axis=-1, keepdims=True) + TINY)


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
