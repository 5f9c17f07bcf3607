"""Rigid transforms: ``T_AB`` maps coordinates in B to coordinates in A and is the pose of B in A.

Public interfaces use homogeneous matrices (..., 4, 4); `dynx.rbd` uses pairs (R, p).
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.branchless import rotation_log
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import quat_exp, quat_from_rotation, quat_log, rotate, skew


def homogeneous(R: Array, p: Array) -> Array:
    """Return the matrix [[R, p], [0, 1]] (..., 4, 4) from R (..., 3, 3) and p (..., 3)."""
    if R.ndim == 2 and p.ndim == 1 and R.dtype == p.dtype == np.float64:
        # Views and concatenations take ten times as long as one small matrix.
        T = np.zeros((4, 4))
        T[:3, :3], T[:3, 3], T[3, 3] = R, p, 1.0
        return T
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    R = np.broadcast_to(R, (*shape, 3, 3))
    p = np.broadcast_to(p, (*shape, 3))
    bottom = np.broadcast_to(np.array([[0, 0, 0, 1]], dtype=R.dtype), (*shape, 1, 4))
    return np.concatenate([np.concatenate([R, p[..., None]], axis=-1), bottom], axis=-2)


def inverse(T: Array) -> Array:
    """Return the inverse of a rigid transform T (..., 4, 4), by transposing its rotation."""
    R_T = np.swapaxes(T[..., :3, :3], -1, -2)
    return homogeneous(R_T, -rotate(R_T, T[..., :3, 3]))


def se3_exp(linear: Floats, angular: Floats) -> tuple[Floats, Floats]:
    """Return the displacement reached by a constant body twist in unit time.

    `linear` [m] and `angular` [rad] are (..., 3). Returns (position (..., 3), quat_xyzw (..., 4)) in the
    initial frame (Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, eq. 2.36).
    """
    theta2 = np.sum(angular * angular, axis=-1)[..., None, None]
    theta = np.sqrt(theta2)
    small = theta < 1e-2
    safe = np.where(small, 1.0, theta)
    b = 0.5 * np.sinc(0.5 * theta / np.pi) ** 2
    series = 1.0 / 6.0 - theta2 / 120.0 + theta2**2 / 5040.0
    c = np.where(small, series, (safe - np.sin(safe)) / safe**3)
    W = skew(angular)
    V = np.eye(3) + b * W + c * (W @ W)
    return rotate(V, linear), quat_exp(angular)


def se3_log(position: Floats, quat_xyzw: Floats) -> tuple[Floats, Floats]:
    """Return the body twist (linear (..., 3), angular (..., 3)) that `se3_exp` maps to this displacement."""
    angular = quat_log(quat_xyzw)
    theta2 = np.sum(angular * angular, axis=-1)[..., None, None]
    theta = np.sqrt(theta2)
    small = theta < 1e-2
    half = np.where(small, 1.0, 0.5 * theta)
    series = 1.0 / 12.0 + theta2 / 720.0 + theta2**2 / 30240.0
    d = np.where(small, series, (1.0 - half / np.tan(half)) / (2.0 * half) ** 2)
    W = skew(angular)
    V_inverse = np.eye(3) - 0.5 * W + d * (W @ W)
    return rotate(V_inverse, position), angular


def pose_error(T_world_target: Array, T_world_frame: Array) -> tuple[Array, Array]:
    """Return position error [m] and rotation vector [rad], each (..., 3), from `frame` to `target`.

    Both are in world axes. The poses are (..., 4, 4), of floats or of traced symbols.
    """
    position = T_world_target[..., :3, 3] - T_world_frame[..., :3, 3]
    R = T_world_target[..., :3, :3] @ np.swapaxes(T_world_frame[..., :3, :3], -1, -2)
    if R.dtype == object and all(isinstance(entry, float) for entry in R.flat):
        # In a trace, a frame that never rotates has constant entries.
        R = R.astype(np.float64)
    return position, rotation_log(R) if R.dtype == object else quat_log(quat_from_rotation(R))
