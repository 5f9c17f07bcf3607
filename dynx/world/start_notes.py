"""Notes on the start of a world: parts that overlap, constraints that are violated, and coefficients of
contact that the engine does not have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.errors import shown
from dynx.spatial.so3 import quat_from_rotation, quat_log
from dynx.world.engine import WorldEngine
from dynx.world.geometry.boxes import owner_pose
from dynx.world.layout import ConstraintLayout
from dynx.world.materials import inexact_materials
from dynx.world.overlaps import overlaps_of
from dynx.world.scene import Scene
from dynx.world.state import WorldState

MAX_OVERLAPS = 5
"""Largest number of overlaps that are noted one by one."""

GAP, ANGLE = 1e-4, 1e-3
"""Distance [m] and angle [rad] between the ends of a constraint from which it counts as violated."""


def notes_on_start(engine: WorldEngine, state: WorldState, scene: Scene) -> tuple[str, ...]:
    """Return one sentence for each overlap and each violated constraint of an engine at a state, and for each
    coefficient of contact that it does not have."""
    return (*_overlaps(engine), *_violations(engine, state, scene), *map(str, inexact_materials(engine)))


def _overlaps(engine: WorldEngine) -> Iterator[str]:
    found = overlaps_of(engine)
    for each in found[:MAX_OVERLAPS]:
        yield (
            f"{shown(each.a)} and {shown(each.b)} overlap by {1e3 * each.depth:.3g} mm at the start, so that "
            "they are pushed apart in the first steps"
        )
    if len(found) > MAX_OVERLAPS:
        yield f"{len(found) - MAX_OVERLAPS} more pairs of parts overlap at the start"


def _violations(engine: WorldEngine, state: WorldState, scene: Scene) -> Iterator[str]:
    for given, constraint in zip(scene.constraints, engine.layout.constraints, strict=True):
        gap, angle = _deviation(engine, constraint, state)
        turned = constraint.kind == "weld" and angle > ANGLE
        if gap > GAP or turned:
            more = f" and turned by {angle:.3g} rad" if turned else ""
            yield (
                f"the ends of the {type(given).__name__} of {shown(given.a)} and {shown(given.b)} are "
                f"{1e3 * gap:.3g} mm apart{more} at the start, so that they are pulled together in the first "
                "steps"
            )


def _deviation(engine: WorldEngine, constraint: ConstraintLayout, state: WorldState) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between the frames of the two ends."""
    a, b = (owner_pose(engine.layout, end.owner, state) @ end.T for end in (constraint.a, constraint.b))
    rotation = quat_log(quat_from_rotation(a[:3, :3].T @ b[:3, :3]))
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.linalg.norm(rotation))
