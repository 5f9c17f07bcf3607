"""A model as a JSON document: URDF text, and what URDF cannot express of the robot and its world."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from dynx.errors import shown
from dynx.model.elements import IDENTITY, INFINITY, Pose
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
    ``base_pose``: x, y, z [m], roll, pitch, yaw [rad].

    URDF has no ball joints: the text has hinges in their place, and ``ball_joints`` has their names.
    """
    hinged = with_hinges_for_balls(model)
    entries = {"urdf": bare_urdf(hinged), "base": model.base, "gravity": [float(x) for x in model.gravity]}
    if model.ball_joints:
        entries["ball_joints"] = [joint.name for joint in model.ball_joints]
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
    model = read_model(
        document["urdf"],
        "<string>",
        base=document["base"],
        gravity=document["gravity"],
        base_pose=Pose((x, y, z), (roll, pitch, yaw)),
    )
    return with_balls_for_hinges(model, document.get("ball_joints", ()))


def with_hinges_for_balls(model: Model) -> Model:
    """Return the robot with a hinge of the same numbers for each ball joint, which URDF can state."""
    if not model.ball_joints:
        return model
    joints = [
        replace(joint, type="revolute" if joint.limits.upper < INFINITY else "continuous")
        if joint.type == "ball"
        else joint
        for joint in model.joints
    ]
    return replace(model, joints=tuple(joints))


def with_balls_for_hinges(model: Model, names: Sequence[str]) -> Model:
    """Return the robot whose hinges of these names are ball joints, as before `with_hinges_for_balls`.

    Raises UnknownNameError for a name of no joint, ValueError for one of a joint that does not turn.
    """
    if not names:
        return model
    for name in names:
        if model.joint(name).type not in ("revolute", "continuous"):
            raise ValueError(f"ball_joints names {shown(name)}, which is {model.joint(name).type}")
    joints = [
        replace(joint, type="ball", limits=replace(joint.limits, lower=0.0)) if joint.name in names else joint
        for joint in model.joints
    ]
    return replace(model, joints=tuple(joints))


def pose_numbers(pose: Pose) -> list[float]:
    """Return a pose as x, y, z [m], roll, pitch, yaw [rad]."""
    return [float(x) for x in (*pose.xyz, *pose.rpy)]
