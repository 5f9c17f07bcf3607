"""Conversions between the forms of a rotation, for programs that use dynx; every argument is checked.

- *Roll, pitch, yaw* [rad] are the Euler angles of URDF: R = Rz(yaw) Ry(pitch) Rx(roll). The frame is rotated
  by roll about x, then by pitch about y, then by yaw about z of the fixed axes; or, which is the same, by yaw
  about z, then by pitch about its new y axis, then by roll about its new x axis (SciPy's ``"xyz"`` and
  ``"ZYX"``).
- A *quaternion* is a unit quaternion (x, y, z, w), the scalar last, as in ``q[3:7]`` of a floating base.
- A *rotation matrix* R (3, 3) maps coordinates in the rotated frame to coordinates in the fixed one.

Every function takes leading batch axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError
from dynx.model.elements import RIGIDITY_TOLERANCE
from dynx.model.numbers import checked_array, checked_quaternion
from dynx.spatial import so3
from dynx.spatial.scalar import Floats


def quat_from_rpy(rpy: ArrayLike) -> Floats:
    """Return the unit quaternion (x, y, z, w) (..., 4), w >= 0, of roll, pitch, yaw [rad] (..., 3)."""
    return so3.quat_from_rotation(rotation_from_rpy(rpy))


def rpy_from_quat(quat_xyzw: ArrayLike) -> Floats:
    """Return roll, pitch, yaw [rad] (..., 3) of a unit quaternion (x, y, z, w) (..., 4).

    Pitch is in [-pi/2, pi/2]; where it is +-pi/2, only roll and yaw together are determined, and yaw is 0.
    """
    return np.asarray(so3.rpy_from_rotation(rotation_from_quat(quat_xyzw)))


def rotation_from_rpy(rpy: ArrayLike) -> Floats:
    """Return the matrix Rz(yaw) Ry(pitch) Rx(roll) (..., 3, 3) of roll, pitch, yaw [rad] (..., 3)."""
    return np.asarray(so3.rotation_from_rpy(checked_array("rpy", rpy, 3)))


def rpy_from_rotation(R: ArrayLike) -> Floats:
    """Return roll, pitch, yaw [rad] (..., 3) of a rotation matrix (..., 3, 3), like `rpy_from_quat`."""
    return np.asarray(so3.rpy_from_rotation(_checked_rotation(R)))


def rotation_from_quat(quat_xyzw: ArrayLike) -> Floats:
    """Return the rotation matrix (..., 3, 3) of a unit quaternion (x, y, z, w) (..., 4)."""
    quat = checked_quaternion("quat_xyzw", checked_array("quat_xyzw", quat_xyzw, 4))
    return np.asarray(so3.rotation_from_quat(quat))


def quat_from_rotation(R: ArrayLike) -> Floats:
    """Return the unit quaternion (x, y, z, w) (..., 4), w >= 0, of a rotation matrix (..., 3, 3)."""
    return so3.quat_from_rotation(_checked_rotation(R))


def _checked_rotation(R: ArrayLike) -> Floats:
    if isinstance(R, np.ndarray) and R.shape[-2:] == (4, 4):
        raise ShapeError(f"R has shape {R.shape}; wanted (..., 3, 3): of a pose T, T[..., :3, :3]")
    array = checked_array("R", R, 3)
    if array.ndim < 2 or array.shape[-2] != 3:
        raise ShapeError(f"R has shape {array.shape}; wanted (..., 3, 3)")
    off = np.max(np.abs(np.swapaxes(array, -1, -2) @ array - np.eye(3)), initial=0.0)
    if not off < RIGIDITY_TOLERANCE or (np.linalg.det(array) < 0.0).any():
        raise ArgumentError("R is not a rotation matrix: wanted orthonormal columns and determinant 1")
    return array
