"""Refusals of ball joints: by what takes robots whose joints have one coordinate each, and for numbers that
no ball joint has."""

from __future__ import annotations

from typing import NoReturn

from dynx.errors import DescriptionError, EngineLimitError, UnsupportedFeatureError, shown
from dynx.model.elements import Joint
from dynx.model.tree import Tree

BACKENDS_WITH_BALL_JOINTS = "the backends 'reference', 'compiled', 'pinocchio' and 'mujoco' do"


def refuse_ball_joints(tree: Tree, what: str, instead: str = "") -> None:
    """Raise UnsupportedFeatureError, which names the joint, if the robot has a ball joint.

    `what` takes none: "URDF", "same_robot". `instead` is a clause on what does, such as "MJCF and SDF do".
    """
    if tree.ball_joints:
        joint = tree.ball_joints[0]
        raise UnsupportedFeatureError(_refusal(tree, what, instead), source=_source(tree), line=joint.line)


def refuse_ball_joints_of_backend(tree: Tree, backend: str) -> None:
    """Raise EngineLimitError, which names the joint, if the robot has a ball joint."""
    if tree.ball_joints:
        raise EngineLimitError(_refusal(tree, f"the backend {shown(backend)}", BACKENDS_WITH_BALL_JOINTS))


def refuse_ball_joints_of_urdf(tree: Tree) -> None:
    """Raise EngineLimitError, which names the joint, if a robot of URDF, where such joints are an extension,
    has a ball joint."""
    if tree.ball_joints:
        raise EngineLimitError(
            f"{shown(tree.ball_joints[0].name)} of {tree.name} is a ball joint, with which most engines do "
            "not load URDF"
        )


def _refusal(tree: Tree, what: str, instead: str) -> str:
    joint = tree.ball_joints[0].name
    clause = f"; {instead}" if instead else ""
    return f"{shown(joint)} of {tree.name} is a ball joint, which {what} does not take{clause}"


def _source(tree: Tree) -> str | None:
    return None if tree.source == "<memory>" else tree.source


def refuse_numbers(joint: Joint, source: str) -> NoReturn:
    """Raise DescriptionError for a largest angle below 0, or else UnsupportedFeatureError for a spring."""
    if not joint.limits.upper >= 0.0:
        raise DescriptionError(
            f"the largest angle of ball joint {shown(joint.name)} is {joint.limits.upper}; wanted at least 0",
            source=source,
            line=joint.line,
        )
    raise UnsupportedFeatureError(
        f"ball joint {shown(joint.name)} has a spring of {joint.dynamics.stiffness:g} N m/rad; ball joints "
        "have none in dynx",
        source=source,
        line=joint.line,
    )
