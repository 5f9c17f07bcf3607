"""Poses and total inertia of links, computed joint by joint from the definitions.

Only the parts of a model are used, none of its `Mechanism`, so that lumping can be tested by it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dynx.model import Model
from dynx.spatial.inertia import RigidInertia, inertia_about_origin

Floats = NDArray[np.float64]


def link_poses(model: Model, q: Floats) -> dict[str, Floats]:
    """Return T_world_link of every link."""
    T = model.base_pose.matrix
    base = 0
    if model.floating:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = Rotation.from_quat(q[3:7]).as_matrix(), q[:3]
        base = 7
    value = dict(zip(model.joint_names, q[base:].tolist(), strict=True))
    poses = {model.root: T}
    for joint in model.joints:
        moved = np.eye(4)
        if joint.moves:
            mimic = joint.mimic
            x = value[joint.name] if mimic is None else mimic.multiplier * value[mimic.joint] + mimic.offset
            if joint.type == "prismatic":
                moved[:3, 3] = np.array(joint.axis) * x
            else:
                moved[:3, :3] = Rotation.from_rotvec(np.array(joint.axis) * x).as_matrix()
        poses[joint.child] = poses[joint.parent] @ joint.origin.matrix @ moved
    return poses


def frame_poses(model: Model, q: Floats) -> list[Floats]:
    """Return T_world_frame of every frame, in the order of `model.frame_names`."""
    poses = link_poses(model, q)
    return [poses[frame.link] @ frame.placement.matrix for frame in model.frames]


def total_inertia(model: Model, q: Floats) -> RigidInertia:
    """Return the inertia of all links about the origin of the world."""
    total = RigidInertia(np.zeros(()), np.zeros(3), np.zeros((3, 3)))
    for name, T in link_poses(model, q).items():
        inertial = model.inertial(name)
        own = inertial.origin.matrix
        about = inertia_about_origin(np.array(inertial.mass), own[:3, 3], own[:3, :3], inertial.tensor)
        total = total + about.transform(T[:3, :3], T[:3, 3])
    return total
