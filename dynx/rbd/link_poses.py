"""Poses of the links of a robot, for whoever draws them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.model import Model
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous


def link_poses(model: Model, q: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield every link with its pose in the world (..., 4, 4) at the configuration q (..., nq)."""
    links = {link.name for link in model.links}
    return (each for each in frame_poses(model, q) if each[0] in links)


def frame_poses(model: Model, q: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield every frame with its pose in the world (..., 4, 4) at the configuration q (..., nq)."""
    mechanism = model.mechanism
    poses = body_poses(mechanism, mechanism.tree_q(q))
    for frame in mechanism.frames:
        T = homogeneous(*poses[frame.body]) @ homogeneous(frame.R, frame.p)
        yield frame.name, np.asarray(T, dtype=np.float64)
