"""Rollouts of ``dynx view``: read from files, which have no shapes, and drawn with those of a robot."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np

from dynx.errors import ArgumentError, DynxError, RobotNotFoundError, shown
from dynx.files.reading import irregularity
from dynx.model import Model
from dynx.model.elements import Joint
from dynx.model.geometry import Geometry
from dynx.model.library import robots
from dynx.model.loading import load
from dynx.sim import Rollout

_SAME = 1e-9
"""Largest difference of joint origins [m, and entries of a rotation] of a robot that is the same."""


def read_rollout(path: str, shapes: str | None) -> Rollout:
    """Return the rollout of a file, drawn with the shapes of the robot named `shapes`.

    Without one it has the shapes of the robot of the library that has its name and its joints, if there is
    one: the file came from anyone, so it does not choose which files are read.
    """
    if not os.path.isfile(path):
        other = irregularity(path)
        raise RobotNotFoundError(f"no file {shown(path, 300)}{f': {other}' if other else ''}")
    rollout = Rollout.load(path)
    model = rollout.model
    if shapes is None:
        robot = _of_library(model)
        return rollout if robot is None else replace(rollout, model=_with_shapes(model, robot))
    robot = load(shapes)
    missing = [link.name for link in model.links if link.name not in robot.geometry.links]
    if missing:
        raise ArgumentError(
            f"{shown(shapes, 300)} has no link {shown(missing[0])}, which {model.name} has; --shapes "
            "names the robot of the rollout"
        )
    return replace(rollout, model=_with_shapes(model, robot))


def _with_shapes(model: Model, robot: Model) -> Model:
    geometry = Geometry({link.name: robot.geometry.links[link.name] for link in model.links})
    return replace(model, geometry=geometry)


def has_shapes(rollout: Rollout) -> bool:
    """Check whether the robot of a rollout has visual or collision shapes."""
    return any(link.visuals or link.collisions for link in rollout.model.geometry.links.values())


def _of_library(model: Model) -> Model | None:
    """Return the robot of the library with the name, links and joints of a model; None without one.

    The name of a robot in its description, which a rollout has, is often another than that of its entry, so
    all of them are compared (0.3 s) unless an entry with the name has these joints.
    """
    entries = sorted(robots(), key=lambda entry: model.name not in (entry.name, *entry.aliases))
    for entry in entries:
        try:
            robot = load(entry.name)
        except DynxError:
            continue
        if model.name in (robot.name, entry.name, *entry.aliases) and _has_parts_of(robot, model):
            return robot
    return None


def _has_parts_of(robot: Model, model: Model) -> bool:
    there = {joint.name: joint for joint in robot.joints}
    return all(link.name in robot.geometry.links for link in model.links) and all(
        _same(joint, there.get(joint.name)) for joint in model.joints
    )


def _same(joint: Joint, other: Joint | None) -> bool:
    return (
        other is not None
        and (joint.parent, joint.child) == (other.parent, other.child)
        and bool(np.abs(joint.origin.matrix - other.origin.matrix).max() < _SAME)
    )
