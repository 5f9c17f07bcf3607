"""The refusal of ball joints by what takes robots whose joints have one coordinate each."""

from __future__ import annotations

from dynx.errors import EngineLimitError, UnsupportedFeatureError, shown
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
