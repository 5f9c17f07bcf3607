"""Places of frames of two robots: the merged body that has a frame, and its pose there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.model import Model
from dynx.model.mechanism import ROOT, BodyFrame
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.same.decimals import decimals
from dynx.same.fit import Fit
from dynx.same.skeleton import Skeleton
from dynx.spatial.scalar import Array
from dynx.spatial.se3 import homogeneous, inverse

WORLD_BODY = ROOT - 1
"""Number that stands for the world around a robot with a floating base."""


class PlaceInBody(NamedTuple):
    """A pose T (4, 4) in a body of the first robot, of that number."""

    body: int
    T: Array


class Places:
    """Places of frames and links in both robots, in the bodies of the first one; call it inside
    `fifty_digits`."""

    def __init__(self, ours: Model, theirs: Model, found: Fit) -> None:
        self._models = ours, theirs
        self._fits = {each.theirs: each for each in found.bodies}
        self._frames = [_frames(each) for each in (found.ours, found.theirs)]

    def ours(self, name: str) -> PlaceInBody | None:
        """Return the place of a frame of the first robot; None for a frame that it has not."""
        frame = self._frames[0].get(name)
        if frame is not None:
            return PlaceInBody(frame.body, homogeneous(frame.R, frame.p))
        return _world(self._models[0]) if name == WORLD else None

    def theirs(self, name: str) -> PlaceInBody | None:
        """Return the place of a frame of the second robot; None for one in a body without counterpart."""
        frame = self._frames[1].get(name)
        if frame is None:
            place = _world(self._models[1]) if name == WORLD else None
        else:
            place = PlaceInBody(frame.body, homogeneous(frame.R, frame.p))
        if place is None or place.body == WORLD_BODY:
            return place
        each = self._fits.get(place.body)
        return None if each is None else PlaceInBody(each.ours, each.D @ place.T)


def _world(model: Model) -> PlaceInBody:
    """Return the place of the world, which stands apart from a floating base."""
    if model.floating:
        return PlaceInBody(WORLD_BODY, decimals(np.eye(4)))
    return PlaceInBody(ROOT, inverse(decimals(model.base_pose.matrix)))


def _frames(skeleton: Skeleton) -> dict[str, BodyFrame]:
    return {frame.name: frame for frame in skeleton.frames}
