"""Notes on a world: overlaps at the start, violated constraints, joints beyond their limits, accelerations
without a bound; coefficients of contact that the engine does not have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dynx.backends.solvability import main_joints, singular_direction
from dynx.errors import shown
from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.so3 import quat_from_rotation, quat_log
from dynx.steppers.layout import Collider, ConstraintLayout, Layout
from dynx.steppers.materials import inexact_materials
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.boxes import owner_pose, shape_box

MIN_DEPTH = 1e-3
"""Depth [m] from which two parts count as overlapping: at rest, parts sink into one another by less."""

MIN_DEPTH_SHARE = 0.05
"""Depth from which two smaller parts do, relative to the shortest edge of the smaller one's box."""


class Overlap(NamedTuple):
    """Two parts that overlap, and by how much at their deepest contact [m]."""

    a: str
    b: str
    depth: float


def overlaps_of(engine: Stepper) -> tuple[Overlap, ...]:
    """Return the parts that may touch and overlap at the present state, the deepest first."""
    deepest: dict[tuple[int, int], float] = {}
    for point in engine.contacts():
        pair = min(point.a, point.b), max(point.a, point.b)
        deepest[pair] = max(deepest.get(pair, 0.0), -point.distance)
    colliders = engine.layout.colliders
    found = [
        Overlap(colliders[a].name, colliders[b].name, depth)
        for (a, b), depth in deepest.items()
        if depth > min(MIN_DEPTH, MIN_DEPTH_SHARE * min(_shortest_edge(colliders[k]) for k in (a, b)))
    ]
    return tuple(sorted(found, key=lambda overlap: -overlap.depth))


def _shortest_edge(collider: Collider) -> float:
    """Return the shortest edge of the boxes around the shapes [m]."""
    boxes = (shape_box(each.shape, each.T) for each in collider.shapes)
    return min(float(np.min(upper - lower)) for lower, upper in boxes)


def unbounded_motions(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield, for each robot, why its acceleration has no bound at a state or where two of its axes align."""
    for robot in layout.robots:
        model = robot.model
        if not model.mechanism.bodies:
            continue
        found = singular_direction(model, state.robots[robot.name].q)
        if found is not None:
            joints = [shown(f"{robot.name}/{name}") for name in main_joints(model, found.direction)]
            yield (
                f"the mass matrix of {shown(robot.name)} is singular to rounding, because its links have "
                f"almost no inertia about {' and '.join(joints) or 'its base'}"
            )
        elif (axes := _massless_gimbal(model.mechanism)) is not None:
            moving = [joint.name for joint in model.joints if joint.moves]
            first, last = (shown(f"{robot.name}/{moving[k]}") for k in axes)
            yield (
                f"the links between {first} and {last} have no mass, so that the motion has no bound where "
                "the axes of these two joints align"
            )


def _massless_gimbal(mechanism: Mechanism) -> tuple[int, int] | None:
    """Return the first and the last of three revolute joints in series without mass between them."""
    children = Counter(body.parent for body in mechanism.bodies)
    for last, body in enumerate(mechanism.bodies):
        chain = [last]
        while len(chain) < 3 and (parent := mechanism.bodies[chain[-1]].parent) != ROOT:
            inertia = mechanism.bodies[parent].inertia
            if float(inertia.mass) != 0.0 or np.any(inertia.rotational_inertia != 0.0):
                break
            if children[parent] > 1:
                break
            chain.append(parent)
        if len(chain) == 3 and body.revolute and all(mechanism.bodies[k].revolute for k in chain):
            return chain[-1], last
    return None


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
