"""Locking joints at a value: the joint becomes fixed and leaves q."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from dynx.errors import NotFiniteError, UnknownNameError, nearest, shown
from dynx.model.elements import Joint, Pose
from dynx.spatial.so3 import rotation_about, rpy_from_rotation


def lock_joints(joints: list[Joint], lock: Mapping[str, float]) -> list[Joint]:
    """`joints` with those named in `lock` fixed at the given values [rad or m].

    A joint that follows a locked one is fixed at the value it follows to. Raises UnknownNameError
    for a name that is no joint, or a joint that cannot move.
    """
    by_name = {joint.name: joint for joint in joints}
    for name, value in lock.items():
        if name not in by_name:
            raise UnknownNameError(f"cannot lock {shown(name)}: no such joint{nearest(name, by_name)}")
        if not by_name[name].moves:
            raise UnknownNameError(f"cannot lock {shown(name)}: it is a fixed joint already")
        if not math.isfinite(value):
            raise NotFiniteError(f"cannot lock {shown(name)} at {value}: wanted a finite number")
    return [_locked(joint, lock, by_name) for joint in joints]


def _locked(joint: Joint, lock: Mapping[str, float], by_name: Mapping[str, Joint]) -> Joint:
    if joint.name in lock:
        return fixed_at(joint, float(lock[joint.name]))
    # Follow the chain of mimics up to a locked joint; a cycle is refused elsewhere, by name.
    scale, offset, current, seen = 1.0, 0.0, joint, {joint.name}
    while current.mimic is not None:
        offset += scale * current.mimic.offset
        scale *= current.mimic.multiplier
        driver = current.mimic.joint
        if driver in lock:
            return fixed_at(joint, scale * float(lock[driver]) + offset)
        if driver in seen or driver not in by_name:
            break
        seen.add(driver)
        current = by_name[driver]
    return joint


def fixed_at(joint: Joint, value: float) -> Joint:
    """The moving joint welded at `value`: its origin takes the motion in."""
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
