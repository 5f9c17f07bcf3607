"""Rigid transforms: ``T_AB`` maps coordinates in B to coordinates in A and is the pose of B in A.

Public interfaces use homogeneous matrices (..., 4, 4); `dynx.rbd` uses pairs (R, p).
"""

from __future__ import annotations

import numpy as np

from dynx.spatial.branchless import rotation_log
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import quat_from_rotation, quat_log, rotate


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
