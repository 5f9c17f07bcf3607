"""Frames of the links of a robot in the bodies of its mechanism, and in the world."""

from __future__ import annotations

import numpy as np

from dynx.model import Model
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous


class LinkFrames:
    """The frames of a robot's links: the body of the mechanism that each is fixed to, and its pose there."""

    def __init__(self, model: Model) -> None:
        self._mechanism = model.mechanism
        frames = model.mechanism.frames
        self._at = {frame.name: (frame.body, homogeneous(frame.R, frame.p)) for frame in frames}

    def __getitem__(self, link: str) -> tuple[int, Floats]:
        body, T = self._at[link]
        return body, np.asarray(T, dtype=np.float64)

    def pose(self, q: Floats, link: str) -> Floats:
        """Return T_world_link (4, 4) at the configuration `q` (nq,) of the model."""
        poses = body_poses(self._mechanism, self._mechanism.tree_q(q))
        body, T = self[link]
        return np.asarray(homogeneous(*poses[body]) @ T)
