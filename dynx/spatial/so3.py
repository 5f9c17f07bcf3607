"""Rotations: matrices, roll-pitch-yaw, axis and angle, unit quaternions ordered (x, y, z, w).

Every function takes leading batch axes. Those used by `dynx.rbd` (`cross`, `skew`, `rotation_about`,
`rotation_from_rpy`, `rotation_from_quat`) branch on no value and work on any scalar type; the others are for
float64.
"""

from __future__ import annotations

import math

import numpy as np

from dynx.spatial.scalar import Array, Floats, cos, sin

# The two axes that follow each axis in cyclic order.
NEXT_AXIS, SECOND_NEXT_AXIS = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Array, b: Array) -> Array:
    """Return a x b, for arrays (..., 3)."""
    # Two products of whole vectors take a third of the time of three stacked components.
    a1, a2 = a.take(NEXT_AXIS, axis=-1), a.take(SECOND_NEXT_AXIS, axis=-1)
    b1, b2 = b.take(NEXT_AXIS, axis=-1), b.take(SECOND_NEXT_AXIS, axis=-1)
    return np.asarray(a1 * b2 - a2 * b1)


def skew(a: Array) -> Array:
    """Return the matrix [a] (..., 3, 3) with [a] b = a x b, for a (..., 3)."""
    x, y, z = a[..., 0:1], a[..., 1:2], a[..., 2:3]
    zero = x * 0
    return _stack_matrix([[zero, -z, y], [z, zero, -x], [-y, x, zero]])


def rotate(R: Array, a: Array) -> Array:
    """Return R a, for R (..., 3, 3) and a (..., 3)."""
    return np.asarray((R @ a[..., None])[..., 0])


def rotate_back(R: Array, a: Array) -> Array:
    """Return R^T a, for R (..., 3, 3) and a (..., 3)."""
    return np.asarray((np.swapaxes(R, -1, -2) @ a[..., None])[..., 0])


def rotation_about(axis: Array, angle: Array) -> Array:
    """Return the rotation matrix (..., 3, 3) by `angle` [rad] about the unit vector `axis` (Rodrigues)."""
    angle = np.asarray(angle)
    c, s = cos(angle)[..., None, None], sin(angle)[..., None, None]
    along = axis[..., :, None] * axis[..., None, :]
    eye = np.eye(3, dtype=int)
    return np.asarray(along + (eye - along) * c + skew(axis) * s)


def rotation_of_z(direction: Floats) -> Floats:
    """Return the smallest rotation (3, 3) that turns z into a unit vector; half a turn is about x."""
    axis = np.array([-direction[1], direction[0], 0.0])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-10:
        return np.diag([1.0, 1.0, 1.0] if direction[2] > 0.0 else [1.0, -1.0, -1.0])
    return np.asarray(rotation_about(axis / sine, np.arctan2(sine, direction[2])))


def rotation_from_rpy(rpy: Array) -> Array:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll) (..., 3, 3) of URDF's roll, pitch, yaw [rad] (..., 3)."""
    c, s = cos(rpy), sin(rpy)
    cr, cp, cy = c[..., 0:1], c[..., 1:2], c[..., 2:3]
    sr, sp, sy = s[..., 0:1], s[..., 1:2], s[..., 2:3]
    rows = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return _stack_matrix(rows)


def rpy_from_rotation(R: Array) -> Array:
    """Return roll, pitch, yaw [rad] (..., 3) of R (..., 3, 3); yaw is 0 at pitch = +-90 degrees.

    Roll is computed from Rz(-yaw) R, so that it compensates for a yaw that is ill-determined near
    pitch = +-90 degrees: the three angles reproduce R to rounding, also in long double.
    """
    locked = np.hypot(R[..., 0, 0], R[..., 1, 0]) < 4.0 * np.finfo(float).eps
    yaw = np.where(locked, 0.0, np.arctan2(R[..., 1, 0], R[..., 0, 0]))
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[..., 2, 0], c * R[..., 0, 0] + s * R[..., 1, 0])
    roll = np.arctan2(s * R[..., 0, 2] - c * R[..., 1, 2], c * R[..., 1, 1] - s * R[..., 0, 1])
    return np.stack([roll, pitch, yaw], axis=-1)


def rotation_from_quat(quat_xyzw: Array) -> Array:
    """Return the rotation matrix (..., 3, 3) of a unit quaternion (..., 4); the norm is not checked."""
    x, y, z, w = (quat_xyzw[..., i : i + 1] for i in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return _stack_matrix(rows)


def quat_from_rotation(R: Floats) -> Floats:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation matrix (..., 3, 3).

    The products of one component with all four are sums of entries of R. Those of the largest component,
    normalised, are the quaternion (Shepperd 1978; Markley and Crassidis 2014, section 2.9.3).
    """
    R = np.asarray(R, dtype=float)
    if R.ndim == 2:
        return _quat_of_one(R.tolist())
    m = [[R[..., i, j] for j in range(3)] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    differences = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    rows = []
    for i in range(3):
        row = [m[i][j] + m[j][i] for j in range(3)]
        row[i] = 1.0 + 2.0 * m[i][i] - trace
        rows.append(np.stack([*row, differences[i]], axis=-1))
    rows.append(np.stack([*differences, 1.0 + trace], axis=-1))
    products = np.stack(rows, axis=-2)
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    quat = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    quat = quat / np.linalg.norm(quat, axis=-1, keepdims=True)
    return np.asarray(np.where(quat[..., 3:] < 0, -quat, quat))


def _quat_of_one(m: list[list[float]]) -> Floats:
    """Return the quaternion of one rotation matrix, bit for bit that of `quat_from_rotation` in a batch, in a
    tenth of its time."""
    trace = m[0][0] + m[1][1] + m[2][2]
    differences = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    squares = [*(1.0 + 2.0 * m[i][i] - trace for i in range(3)), 1.0 + trace]
    # NaN is the largest number of NumPy's argmax.
    largest = next((i for i, x in enumerate(squares) if x != x), squares.index(max(squares)))
    if largest == 3:
        products = [*differences, squares[3]]
    else:
        products = [m[largest][j] + m[j][largest] for j in range(3)]
        products[largest] = squares[largest]
        products.append(differences[largest])
    x, y, z, w = products
    norm = math.sqrt(x * x + y * y + z * z + w * w)
    if norm == 0.0:
        return np.full(4, np.nan)
    sign = -norm if w < 0.0 else norm
    return np.array([x / sign, y / sign, z / sign, w / sign])


def quat_product(a_xyzw: Floats, b_xyzw: Floats) -> Floats:
    """Return the Hamilton product a b (..., 4), so that R(a b) = R(a) R(b)."""
    av, aw = a_xyzw[..., :3], a_xyzw[..., 3:]
    bv, bw = b_xyzw[..., :3], b_xyzw[..., 3:]
    vector = aw * bv + bw * av + cross(av, bv)
    scalar = aw * bw - np.sum(av * bv, axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)


def quat_exp(rotation_vector: Floats) -> Floats:
    """Return the unit quaternion (x, y, z, w) of a rotation vector [rad] (..., 3)."""
    half = 0.5 * np.linalg.norm(rotation_vector, axis=-1, keepdims=True)
    vector = 0.5 * rotation_vector * np.sinc(half / np.pi)
    return np.concatenate([vector, np.cos(half)], axis=-1)


def quat_log(quat_xyzw: Floats) -> Floats:
    """Return the rotation vector [rad] (..., 3), of norm at most pi, of a unit quaternion."""
    vector, w = quat_xyzw[..., :3], quat_xyzw[..., 3:]
    sign = np.where(w < 0, -1.0, 1.0)
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(length, sign * w)
    # Near the identity 2 atan2(n, w) / n tends to 2 / w; division by n = 0 is avoided.
    scale = np.where(
        length > 1e-12, angle / np.where(length > 0, length, 1.0), 2.0 / np.abs(np.where(w == 0, 1.0, w))
    )
    return np.asarray(sign * scale * vector)


def _stack_matrix(rows: list[list[Array]]) -> Array:
    """Return the matrix (..., m, n) of entries (..., 1); stacking twice would take three times as long."""
    entries = [entry for row in rows for entry in row]
    shape = (*entries[0].shape[:-1], len(rows), len(rows[0]))
    return np.concatenate(entries, axis=-1).reshape(shape)
