"""A robot in a world that is rotated together with gravity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dynx.model import Joint, Link, Model, Pose
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, quat_product, rotate, rotation_from_quat, rpy_from_rotation

ROTATION_VECTOR = (0.7, -1.1, 0.4)
"""Rotation of the world [rad], about an oblique axis, so that exchanged axes show."""


def rotate_world(model: Model) -> tuple[Model, Callable[[Floats], Floats]]:
    """Return a model in the rotated world, and the map from configurations (..., nq) of `model` to its own.

    A floating base is rotated by its configuration; a fixed one is rigidly connected to a new root.
    """
    quat = quat_exp(np.array(ROTATION_VECTOR))
    R = rotation_from_quat(quat)
    x, y, z = rotate(R, np.array(model.gravity)).tolist()
    if model.floating:

        def rotate_base(q: Floats) -> Floats:
            attitude = quat_product(np.broadcast_to(quat, (*q.shape[:-1], 4)), q[..., 3:7])
            return np.concatenate([rotate(R, q[..., :3]), attitude, q[..., 7:]], axis=-1)

        return model.with_gravity((x, y, z)), rotate_base
    roll, pitch, yaw = rpy_from_rotation(R).tolist()
    link = Link(_free_name("rotated_world", {link.name for link in model.links}))
    joint = Joint(
        _free_name("rotated_mount", {joint.name for joint in model.joints}),
        "fixed",
        link.name,
        model.root,
        Pose(rpy=(roll, pitch, yaw)),
    )
    links, joints = (link, *model.links), (joint, *model.joints)
    return replace(model, links=links, joints=joints, gravity=(x, y, z)), lambda q: q


def _free_name(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name
