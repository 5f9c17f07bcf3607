"""How far a robot was from what it was to follow: its joints, its floating base, a frame of it.

Joints, and the base and a frame, are told apart: the largest of metres and radians together means nothing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.backends import backend
from dynx.sim import Rollout
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error

Entry = dict[str, Any]


def joint_error(rollout: Rollout) -> Entry:
    """Over all joints and times; None where there was nothing to follow, or where there are no joints."""
    base = 6 if rollout.model.floating else 0
    error = np.abs(rollout.error[:, base:])
    if rollout.reference is None or error.size == 0:
        names = ("max_error", "max_error_joint", "max_error_time", "rms_error", "final_error")
        return dict.fromkeys(names)
    row, column = np.unravel_index(int(np.argmax(error)), error.shape)
    return {
        "max_error": float(error[row, column]),
        "max_error_joint": rollout.model.joint_names[column],
        "max_error_time": float(rollout.t[row]),
        "rms_error": float(np.sqrt(np.mean(error**2))),
        "final_error": float(error[-1].max()),
    }


def base_error(rollout: Rollout) -> Entry | None:
    """Of a floating base; None for a fixed one, or where there was nothing to follow."""
    if rollout.reference is None or not rollout.model.floating:
        return None
    return _of_body(rollout.t, rollout.error[:, :3], rollout.error[:, 3:6])


def frame_error(rollout: Rollout, frame: str | None) -> Entry | None:
    """Of a frame of the robot as it moved; None without a frame, or where there was nothing to follow."""
    if rollout.reference is None or frame is None:
        return None
    with backend("reference", rollout.model) as bodies:
        wanted = bodies.forward_kinematics(rollout.reference.q, frame)
        found = bodies.forward_kinematics(rollout.q, frame)
    return _of_body(rollout.t, *pose_error(wanted, found))


def _of_body(t: Floats, position: Floats, rotation: Floats) -> Entry:
    """The lengths of both errors (n + 1, 3): [m], and [rad] as the angle of the rotation that is left."""
    return {
        name: {
            "max": float(length.max()),
            "max_time": float(t[int(np.argmax(length))]),
            "final": float(length[-1]),
        }
        for name, length in (
            ("position", np.linalg.norm(position, axis=1)),
            ("rotation", np.linalg.norm(rotation, axis=1)),
        )
    }
