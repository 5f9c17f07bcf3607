"""A model as a JSON document: URDF text, and what URDF cannot express of the robot and its world."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.model.elements import IDENTITY, Pose
from dynx.model.loading import load
from dynx.model.model import Model


def robot_document(model: Model) -> dict[str, Any]:
    """Return the entries ``urdf``, ``base``, ``gravity`` and, if the base is not at the world frame,
    ``base_pose``: x, y, z [m], roll, pitch, yaw [rad]."""
    entries = {"urdf": model.to_urdf(), "base": model.base, "gravity": [float(x) for x in model.gravity]}
    return entries if model.base_pose == IDENTITY else {**entries, "base_pose": pose_numbers(model.base_pose)}


def robot_from_document(document: Mapping[str, Any]) -> Model:
    """Return the model of a `robot_document`.

    Raises KeyError or TypeError for another document, and the errors of `load`.
    """
    numbers = document["base_pose"] if "base_pose" in document else pose_numbers(IDENTITY)
    base_pose = Pose(tuple(numbers[:3]), tuple(numbers[3:]))
    return load(document["urdf"], base=document["base"], gravity=document["gravity"], base_pose=base_pose)


def pose_numbers(pose: Pose) -> list[float]:
    """Return a pose as x, y, z [m], roll, pitch, yaw [rad]."""
    return [float(x) for x in (*pose.xyz, *pose.rpy)]
