"""Notes on a world: overlaps at the start, violated constraints, joints beyond their limits, accelerations
without a bound; coefficients of contact that the engine does not have."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dynx.errors import shown
from dynx.spatial.so3 import quat_from_rotation, quat_log
from dynx.steppers.layout import ConstraintLayout, Layout
from dynx.steppers.materials import inexact_materials
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.geometry.owner_poses import owner_pose
from dynx.world.notes.overlaps import overlaps_of
from dynx.world.notes.unbounded_motions import unbounded_motions

MAX_OVERLAPS = 5
"""Largest number of overlaps that are noted one by one."""

LIMIT_EXCESS = 1e-3
"""Distance [rad or m] beyond a limit from which a joint is noted."""

CONSTRAINT_GAP, CONSTRAINT_ANGLE = 1e-4, 1e-3
"""Distance [m] and angle [rad] between the ends of a constraint from which it counts as violated."""

LONG_STEP = 0.1
"""Step of an engine [s] above which contacts are hardly noticed."""


def notes_on_start(engine: Stepper, state: WorldState) -> tuple[str, ...]:
    """Return one sentence for each overlap, violated constraint and joint beyond its limits of an engine at a
    state, and for each robot whose accelerations have no bound."""
    drawn = "so that they are pulled together in the first steps"
    moved = "so that it is pushed back in the first steps"
    return (
        *_overlaps(engine),
        *(f"{each} at the start, {drawn}" for each in violations(engine.layout, state)),
        *(f"{each} at the start, {moved}" for each in joints_beyond_limits(engine.layout, state)),
        *unbounded_motions(engine.layout, state),
    )


def notes_on_engine(engine: Stepper) -> Iterator[str]:
    """Yield one sentence for each coefficient of contact that the engine does not have, for a long step, and
    for each robot without collision shapes: they hold at every state."""
    yield from map(str, inexact_materials(engine))
    if engine.dt > LONG_STEP:
        yield f"a step of {engine.dt:g} s is longer than {LONG_STEP:g} s: bodies may pass through one another"
    yield from _robots_without_shapes(engine.layout)


def _robots_without_shapes(layout: Layout) -> Iterator[str]:
    """Yield each robot that passes through what others have in its way, because it has no collision shape."""
    shaped = {collider.owner.robot for collider in layout.colliders}
    for k, robot in enumerate(layout.robots):
        if shaped and k not in shaped:
            yield f"no link of {shown(robot.name)} has a collision shape: it passes through everything"


def _overlaps(engine: Stepper) -> Iterator[str]:
    found = overlaps_of(engine)
    for each in found[:MAX_OVERLAPS]:
        yield (
            f"{shown(each.a)} and {shown(each.b)} overlap by {1e3 * each.depth:.3g} mm at the start, so that "
            "they are pushed apart in the first steps"
        )
    if len(found) > MAX_OVERLAPS:
        yield f"{len(found) - MAX_OVERLAPS} more pairs of parts overlap at the start"


def violations(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield each constraint whose ends are apart, and by how much."""
    for constraint in layout.constraints:
        gap, angle = _deviation(layout, constraint, state)
        turned = constraint.kind == "weld" and angle > CONSTRAINT_ANGLE
        if gap > CONSTRAINT_GAP or turned:
            kind = "weld" if constraint.kind == "weld" else "point-to-point constraint"
            ends = " and ".join(map(shown, constraint.names))
            more = f" and turned by {angle:.3g} rad" if turned else ""
            yield f"the ends of the {kind} of {ends} are {1e3 * gap:.3g} mm apart{more}"


def joints_beyond_limits(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield each joint that is beyond a limit, with both."""
    for robot in layout.robots:
        model, q = robot.model, state.robots[robot.name].q
        positions = model.mechanism.tree_q(q)[7 if model.floating else 0 :]
        names = (joint.name for joint in model.joints if joint.moves)
        for name, x, lower, upper in zip(names, positions, robot.lower, robot.upper, strict=True):
            if not lower - LIMIT_EXCESS <= x <= upper + LIMIT_EXCESS:
                joint = shown(f"{robot.name}/{name}")
                yield f"{joint} is at {x:.4g}, beyond its limits {lower:.4g} to {upper:.4g},"


def _deviation(layout: Layout, constraint: ConstraintLayout, state: WorldState) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between the frames of the two ends."""
    a, b = (owner_pose(layout, end.owner, state) @ end.T for end in (constraint.a, constraint.b))
    rotation = quat_log(quat_from_rotation(a[:3, :3].T @ b[:3, :3]))
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.linalg.norm(rotation))
