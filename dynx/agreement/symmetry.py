"""A robot in a world that is rotated together with gravity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_exp, quat_product, rotate, rotation_from_quat

ROTATION_VECTOR = (0.7, -1.1, 0.4)
"""Rotation of the world [rad], about an oblique axis, so that exchanged axes show."""


def rotate_world(model: Model) -> tuple[Model, Callable[[Floats], Floats]]:
    """Return a model in the rotated world, and the map from configurations (..., nq) of `model` to its own.

    A floating base is rotated by its configuration, a fixed one by its pose in the world.
    """
    quat = quat_exp(np.array(ROTATION_VECTOR))
    R = rotation_from_quat(quat)
    x, y, z = rotate(R, np.array(model.gravity)).tolist()
    if model.floating:

        def rotate_base(q: Floats) -> Floats:
            attitude = quat_product(np.broadcast_to(quat, (*q.shape[:-1], 4)), q[..., 3:7])
            return np.concatenate([rotate(R, q[..., :3]), attitude, q[..., 7:]], axis=-1)

        return model.with_gravity((x, y, z)), rotate_base
    T = homogeneous(R, np.zeros(3)) @ model.base_pose.matrix
    return model.with_base_pose(T).with_gravity((x, y, z)), lambda q: q
