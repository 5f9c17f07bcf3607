"""Numbers that position limits of joints bound: the position, or the angle of rotation of a ball joint."""

from __future__ import annotations

import numpy as np

from dynx.model.tree import Tree
from dynx.spatial.scalar import Floats


def limited_positions(tree: Tree, q: Floats) -> Floats:
    """Return the position (..., n) [rad or m] of each joint of `joint_names` at q (..., nq): of a ball joint
    the angle of its rotation, from 0 to pi."""
    if not tree.ball_joints:
        return np.asarray(q[..., 7 if tree.floating else 0 :])
    columns = []
    for joint in tree.coordinate_joints:
        k = tree.position_index(joint.name)
        columns.append(rotation_angle(q[..., k : k + 4]) if joint.type == "ball" else q[..., k])
    return np.stack(columns, axis=-1)


def joint_ranges(tree: Tree) -> tuple[Floats, Floats]:
    """Return the lowest and the highest of `limited_positions` (n,) of each joint; infinite where it has no
    limit."""
    firsts = [tree.position_index(joint.name) for joint in tree.coordinate_joints]
    lower, upper = tree.lower[firsts], tree.upper[firsts]
    for k, joint in enumerate(tree.coordinate_joints):
        # The angle of a rotation is at most pi.
        if joint.type == "ball" and joint.limits.upper < np.pi:
            upper[k] = joint.limits.upper
    return lower, upper


def rotation_angle(quat_xyzw: Floats) -> Floats:
    """Return the angle (...,) [rad], from 0 to pi, of the rotation of a quaternion (..., 4)."""
    vector = np.linalg.norm(quat_xyzw[..., :3], axis=-1)
    return np.asarray(2.0 * np.arctan2(vector, np.abs(quat_xyzw[..., 3])))
