"""Errors for parts of a pose that have not three entries."""

from __future__ import annotations

import numpy as np

from dynx.errors import ShapeError, shown


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
