"""A model as a JSON document: URDF text, and what URDF cannot express of the robot and its world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dynx.model.elements import IDENTITY, Pose
from dynx.model.loading import read_model
from dynx.model.model import Model
from dynx.model.numbers import checked_array
from dynx.model.tree import STANDARD_GRAVITY


def bare_urdf(model: Model) -> str:
    """Return the robot as URDF text that says nothing of its base, the pose of that, and gravity, for those
    that state these apart."""
    return replace(model, base="fixed", base_pose=IDENTITY, gravity=STANDARD_GRAVITY).to_urdf()


def robot_document(model: Model) -> dict[str, Any]:
    """Return the entries ``urdf``, ``base``, ``gravity`` and, if the base is not at the world frame,
    ``base_pose``: x, y, z [m], roll, pitch, yaw [rad]."""
    entries = {"urdf": bare_urdf(model), "base": model.base, "gravity": [float(x) for x in model.gravity]}
    return entries if model.base_pose == IDENTITY else {**entries, "base_pose": pose_numbers(model.base_pose)}


def robot_from_document(document: Mapping[str, Any]) -> Model:
    """Return the model of a `robot_document`.

    Raises KeyError, TypeError or ValueError for another document, which include the errors of `load`.
    """
    numbers = document["base_pose"] if "base_pose" in document else pose_numbers(IDENTITY)
    x, y, z, roll, pitch, yaw = checked_array("base_pose", numbers, 6).tolist()
    # A path or a name would make dynx read another file, which whoever wrote the document chose.
    if not isinstance(document["urdf"], str):
        raise TypeError(f"the URDF of a model is of type {type(document['urdf']).__name__}; wanted text")
    return read_model(
        document["urdf"],
        "<string>",
        base=document["base"],
        gravity=document["gravity"],
        base_pose=Pose((x, y, z), (roll, pitch, yaw)),
    )


def pose_numbers(pose: Pose) -> list[float]:
    """Return a pose as x, y, z [m], roll, pitch, yaw [rad]."""
    return [float(x) for x in (*pose.xyz, *pose.rpy)]
