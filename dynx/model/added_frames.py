"""Frames that a program adds to a robot."""

from __future__ import annotations

from dataclasses import replace

from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.model.elements import IDENTITY, Frame, Pose, checked_pose
from dynx.model.model import Model


@checks_types
def with_frame(model: Model, name: str, link: str, placement: Pose | ArrayLike = IDENTITY) -> Model:
    """Return a robot with one more named frame; see `Model.with_frame`."""
    model.link(link)
    if not isinstance(name, str) or not name:
        raise ArgumentError(f"a frame's name is {shown(name)}; wanted a str that is not empty")
    placement = checked_pose("placement", placement)
    if name in model.frame_names:
        raise ArgumentError(f"frame {shown(name)} exists already in {model.name}")
    return replace(model, extra_frames=(*model.extra_frames, Frame(name, link, placement)))
