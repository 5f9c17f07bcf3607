"""Locking of joints at a position: the joint becomes fixed and is removed from q."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import SupportsFloat

import numpy as np

from dynx.errors import DTypeError, NotFiniteError, UnknownNameError, nearest, shown
from dynx.model.elements import Joint, Pose
from dynx.spatial.so3 import rotation_about, rpy_from_rotation


def lock_joints(joints: list[Joint], lock: Mapping[str, float]) -> list[Joint]:
    """Return `joints` with those named in `lock` fixed at the given positions [rad or m].

    Joints that follow a locked one are fixed by `topology.resolve_mimics`. Raises UnknownNameError for an
    unknown or fixed joint; DTypeError or NotFiniteError for a position that is not a finite number.
    """
    by_name = {joint.name: joint for joint in joints}
    for name, value in lock.items():
        if name not in by_name:
            raise UnknownNameError(f"cannot lock {shown(name)}: no such joint{nearest(str(name), by_name)}")
        if not by_name[name].moves:
            raise UnknownNameError(f"cannot lock {shown(name)}: it is a fixed joint already")
        if isinstance(value, bool | str) or not isinstance(value, SupportsFloat):
            raise DTypeError(f"cannot lock {shown(name)} at {shown(value)}; wanted a number")
        if not math.isfinite(value):
            raise NotFiniteError(f"cannot lock {shown(name)} at {value}: wanted a finite number")
    return [lock_joint(joint, float(lock[joint.name])) if joint.name in lock else joint for joint in joints]


def lock_joint(joint: Joint, value: float) -> Joint:
    """Return the joint fixed at position `value`, which is included in its origin."""
    axis, T = np.array(joint.axis), joint.origin.matrix
    if joint.type == "prismatic":
        x, y, z = (T[:3, 3] + T[:3, :3] @ (axis * value)).tolist()
        origin = Pose((x, y, z), joint.origin.rpy)
    elif value == 0.0:
        origin = joint.origin
    else:
        R = T[:3, :3] @ rotation_about(axis, np.array(value))
        roll, pitch, yaw = rpy_from_rotation(R).tolist()
        origin = Pose(joint.origin.xyz, (roll, pitch, yaw))
    return replace(joint, type="fixed", origin=origin, mimic=None, locked_at=value)
