"""Tracking errors of a rollout: of its joints, of its floating base, and of a frame.

Errors of joints, of positions and of rotations are summarised separately, because a maximum over metres and
radians has no meaning.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.backends import backend
from dynx.sim.record.rollout import Rollout
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.trajectory.base import Setpoint

Entry = dict[str, Any]


def joint_error(rollout: Rollout) -> Entry:
    """Summarise the error over all joints and times; numbers are None without a reference or joints."""
    base = 6 if rollout.model.floating else 0
    error = np.abs(rollout.error[:, base:])
    if rollout.reference is None or error.size == 0:
        names = ("max_error", "max_error_joint", "max_error_time", "rms_error", "final_error")
        return dict.fromkeys(names)
    row, column = np.unravel_index(int(np.argmax(error)), error.shape)
    return {
        "max_error": float(error[row, column]),
        "max_error_joint": rollout.model.coordinate_names[column],
        "max_error_time": float(rollout.t[row]),
        "rms_error": float(np.sqrt(np.mean(error**2))),
        "final_error": float(error[-1].max()),
    }


def base_error(rollout: Rollout) -> Entry | None:
    """Summarise the error of a floating base; None for a fixed base, or without a reference."""
    if rollout.reference is None or not rollout.model.floating:
        return None
    return _body_error(rollout.t, rollout.error[:, :3], rollout.error[:, 3:6])


def frame_error(rollout: Rollout, frame: str | None) -> Entry | None:
    """Summarise the error of a frame of the robot; None without a frame or a reference."""
    if rollout.reference is None or frame is None:
        return None
    return _body_error(rollout.t, *frame_pose_errors(rollout, rollout.reference, frame))


def frame_pose_errors(rollout: Rollout, reference: Setpoint, frame: str) -> tuple[Floats, Floats]:
    """Return position errors [m] and rotation vectors [rad] of a frame, each (n + 1, 3), in world axes."""
    with backend("reference", rollout.model) as engine:
        wanted = engine.forward_kinematics(reference.q, frame)
        actual = engine.forward_kinematics(rollout.q, frame)
    position, rotation = pose_error(wanted, actual)
    return position, rotation


def _body_error(t: Floats, position: Floats, rotation: Floats) -> Entry:
    """Summarise the norms of position errors (n + 1, 3) [m] and of rotation vectors (n + 1, 3) [rad]."""
    return {
        name: {
            "max": float(norm.max()),
            "max_time": float(t[int(np.argmax(norm))]),
            "final": float(norm[-1]),
        }
        for name, norm in (
            ("position", np.linalg.norm(position, axis=1)),
            ("rotation", np.linalg.norm(rotation, axis=1)),
        )
    }
