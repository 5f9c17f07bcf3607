"""Errors for arrays that are no pose, or no part of one, because of their shapes."""

from __future__ import annotations

from typing import NoReturn

import numpy as np

from dynx.errors import ShapeError, shown
from dynx.spatial.scalar import Floats


def refuse_matrix(name: str, array: Floats) -> NoReturn:
    """Raise ShapeError for an array that is no matrix (4, 4)."""
    position = ", ".join(f"{x:g}" for x in array.tolist()) if array.shape == (3,) else None
    hint = f", such as Pose(({position}))" if position is not None else ""
    raise ShapeError(
        f"{name} has shape {array.shape}; wanted a Pose or a matrix (4, 4){hint}, or a pair of position "
        "and quaternion (x, y, z, w)"
    )


def refuse_pair(name: str, position: Floats, quat_xyzw: Floats) -> NoReturn:
    """Raise ShapeError for positions and quaternions whose leading axes do not broadcast."""
    raise ShapeError(
        f"{name} has positions of shape {position.shape} and quaternions of shape {quat_xyzw.shape}, "
        "whose leading axes do not broadcast"
    ) from None


def refuse_part(name: str, part: object) -> None:
    """Raise ShapeError for xyz or rpy of a pose that has not three entries."""
    shape = np.shape(np.array(part, dtype=object))
    if shape == (3,):
        return
    hint = "; Pose.from_matrix(((x, y, z), (qx, qy, qz, qw))) makes a pose of a quaternion"
    raise ShapeError(
        f"{name} of a pose is {shown(part)}, of shape {shape}; wanted 3 numbers, "
        f"{'x, y, z [m]' if name == 'xyz' else 'roll, pitch, yaw [rad]'}{hint if shape == (4,) else ''}"
    )
