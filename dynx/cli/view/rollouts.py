"""Rollouts of ``dynx view``: read from files, with the shapes of a robot."""

from __future__ import annotations

import os
from dataclasses import replace

from dynx.errors import ArgumentError, RobotNotFoundError, shown
from dynx.model.geometry import Geometry
from dynx.model.loading import load
from dynx.sim import Rollout


def read_rollout(path: str, shapes: str | None) -> Rollout:
    """Return the rollout of a file, drawn with the shapes of the robot named `shapes`, if one is named."""
    if not os.path.isfile(path):
        what = "it is a folder" if os.path.isdir(path) else "there is none"
        raise RobotNotFoundError(f"no file {shown(path, 300)}: {what}")
    rollout = Rollout.load(path)
    if shapes is None:
        return rollout
    links = [link.name for link in rollout.model.links]
    robot = load(shapes)
    missing = [name for name in links if name not in robot.geometry.links]
    if missing:
        raise ArgumentError(
            f"{shown(shapes, 300)} has no link {shown(missing[0])}, which {rollout.model.name} has; --shapes "
            "names the robot of the rollout"
        )
    geometry = Geometry({name: robot.geometry.links[name] for name in links})
    return replace(rollout, model=replace(rollout.model, geometry=geometry))
