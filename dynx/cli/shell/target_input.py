"""Where a frame is to be brought: a position or a pose, from the numbers of an option."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dynx.cli.shell.configuration_input import Numbers
    from dynx.spatial.scalar import Floats

POSE_HELP = (
    "x,y,z [m], then nothing (any rotation), roll,pitch,yaw [rad], or qx,qy,qz,qw; "
    "or the 16 numbers of T_world_target, row by row."
)


def target_pose(given: Numbers, option: str) -> Floats:
    """A position (3,) or a pose (4, 4), from the numbers of `option`."""
    import numpy as np

    from dynx.errors import ArgumentError
    from dynx.spatial.se3 import homogeneous
    from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy

    if not isinstance(given, list):
        raise ArgumentError(f"{option} takes numbers without names")
    numbers = np.array(given)
    if len(numbers) == 3:
        return numbers
    if len(numbers) == 6:
        return homogeneous(rotation_from_rpy(numbers[3:]), numbers[:3])
    if len(numbers) == 7:
        norm = float(np.linalg.norm(numbers[3:]))
        if abs(norm - 1.0) > 1e-3:
            raise ArgumentError(f"{option}: the quaternion has length {norm:.6g}; wanted 1")
        return homogeneous(rotation_from_quat(numbers[3:] / norm), numbers[:3])
    if len(numbers) == 16:
        return numbers.reshape(4, 4)
    raise ArgumentError(
        f"{option}: wanted 3 numbers (position), 6 (and roll, pitch, yaw), 7 (and a quaternion xyzw) "
        f"or 16 (a matrix); got {len(numbers)}"
    )
