"""Parts of a world that move, turn or slide too fast for its step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dynx.errors import shown
from dynx.model.geometry import Box, Cylinder
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, rotation_from_quat
from dynx.steppers.layout import Collider, Layout, Owner
from dynx.steppers.material import contact_material
from dynx.steppers.state import BodyState, PartStates, RobotState, WorldState
from dynx.steppers.stepper import SlidingFace, Stepper
from dynx.world.boxes import OwnerPoses, shape_box
from dynx.world.queries import Distances

MAX_TRAVEL = 0.5
"""Way of a part in a step, relative to its own extent along it, from which it may pass through others.

Balls and boxes of 0.1 m that met a wall of that thickness in steps of 1 ms stopped below a way of 0.5 on
every engine, at whatever moment of a step they touched. At 0.5 boxes began to pass in Drake, above 1 all did.
"""

MAX_TURN = 0.1
"""Angle [rad] by which a body may turn in a step: free boxes that turned by 0.1 in every step gained 4 to 6 %
of their energy in two turns on every engine, by 0.2 they gained 11 to 13 %."""

SYMMETRY = 0.01
"""Relative difference of moments of inertia below which a body counts as one of revolution."""

CLOSE = 1e-3
"""Distance [m] from a surface at which a body counts as lying on it."""

MIN_SLIP = 0.1
"""Speed [m/s] from which a body counts as one that slides."""

REMEDY = "; try a smaller dt or more substeps"


def fast_parts(engine: Stepper, state: WorldState) -> Iterator[str]:
    """Yield one sentence for each part that is too fast for the step of an engine at a state."""
    layout, h = engine.layout, engine.dt
    before, then = OwnerPoses(layout, state), OwnerPoses(layout, _after(layout, state, h))
    in_step = f"in a step of {h:g} s"
    for collider in layout.colliders:
        if layout.is_fixed(collider.owner):
            continue
        travel = _travel(collider, before[collider.owner], then[collider.owner])
        if travel > MAX_TRAVEL:
            yield (
                f"{shown(collider.name)} moves by {travel:.2g} of its own length {in_step}, so that it may "
                f"pass through others{REMEDY}"
            )
    for body in layout.bodies:
        if not body.fixed:
            R, spin = state.bodies[body.name].T_world_body[:3, :3], state.bodies[body.name].twist[3:]
            turn = h * float(np.linalg.norm(spin))
            if turn > MAX_TURN and not _spins_evenly(R @ body.inertia @ R.T, spin):
                yield f"{shown(body.name)} turns by {turn:.2g} rad {in_step}, so that it gains energy{REMEDY}"
    for number, collider in enumerate(layout.colliders):
        if not layout.is_fixed(collider.owner):
            fault = _sliding_fault(engine, state, number, before, then)
            if fault is not None:
                yield f"{shown(collider.name)} slides too fast for a step of {h:g} s: it {fault}{REMEDY}"


def _after(layout: Layout, state: WorldState, h: float) -> WorldState:
    """Return where the velocities of a state lead in `h` [s]."""
    robots, bodies = {}, {}
    for robot in layout.robots:
        q, v = state.robots[robot.name]
        robots[robot.name] = RobotState(robot.model.integrate(q, h * v), v)
    for body in layout.bodies:
        T, twist = state.bodies[body.name]
        T_after = T.copy()
        T_after[:3, :3] = rotation_from_quat(quat_exp(h * twist[3:])) @ T[:3, :3]
        T_after[:3, 3] += h * twist[:3]
        bodies[body.name] = BodyState(T_after, twist)
    return replace(state, robots=PartStates(robots), bodies=PartStates(bodies))


def _extent(collider: Collider, T: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Return the least and the largest coordinate (3,) of a collider at T (4, 4) along unit axes (3, 3),
    which are rows."""
    turned = T.copy()
    turned[:3] = axes @ T[:3]
    corners = [shape_box(each.shape, turned @ each.T) for each in collider.shapes]
    return np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)


def _travel(collider: Collider, before: Floats, then: Floats) -> float:
    """Return the way of the middle of a collider, relative to its extent along that."""
    low, high = _extent(collider, np.eye(4), np.eye(3))
    middle = np.append(0.5 * (low + high), 1.0)
    way = ((then - before) @ middle)[:3]
    length = float(np.linalg.norm(way))
    if length == 0.0:
        return 0.0
    low, high = _extent(collider, before, axes_along(way))
    return length / float(high[0] - low[0])


def axes_along(direction: Floats) -> Floats:
    """Return three orthogonal unit axes as rows (3, 3), of which the first is along a direction (3,)."""
    first = direction / np.linalg.norm(direction)
    second = np.cross(first, np.eye(3)[int(np.argmin(np.abs(first)))])
    second /= np.linalg.norm(second)
    return np.array([first, second, np.cross(first, second)])


def _spins_evenly(inertia: Floats, spin: Floats) -> bool:
    """Check whether a body turns about an axis of symmetry of its inertia (3, 3), as balls and wheels do."""
    axes = axes_along(spin)
    turned = axes @ inertia @ axes.T
    across = np.abs(turned[0, 1:]).max() + np.abs(turned[1, 2]) + np.abs(turned[1, 1] - turned[2, 2])
    return bool(across <= SYMMETRY * np.trace(turned))


def _sliding_fault(
    engine: Stepper, state: WorldState, number: int, before: OwnerPoses, then: OwnerPoses
) -> str | None:
    """Return what an engine does wrong with the slide of a body on what carries it, or None."""
    layout, h = engine.layout, engine.dt
    collider = layout.colliders[number]
    body = _rigid_body(layout, state, collider.owner)
    if body is None or not body.moves:
        return None
    partners = np.flatnonzero(layout.collides[number]).tolist()
    for _, other, near in Distances(layout).closest(state, [number], partners, CLOSE):
        owner = layout.colliders[other].owner
        carried = then[owner] @ np.linalg.inv(before[owner])
        moved = then[collider.owner] @ np.linalg.inv(before[collider.owner])
        point, normal = np.append(near.point_a, 1.0), near.normal
        slip = ((moved - carried) @ point)[:3] / h
        slip = slip - float(slip @ normal) * normal
        gravity = -float(layout.gravity @ normal)
        if gravity <= 0.0 or np.linalg.norm(slip) < MIN_SLIP:
            continue
        friction = contact_material(collider.material, layout.colliders[other].material).friction
        fault = engine.sliding_fault(
            _face(collider, body, before[collider.owner], slip, normal, friction, gravity)
        )
        if fault is not None:
            return fault
    return None


class RigidPart(NamedTuple):
    """A body of the scene, or a robot without joints that move: its mass [kg] and the centre (3,) of that."""

    mass: float
    center: Floats
    moves: bool


def _rigid_body(layout: Layout, state: WorldState, owner: Owner) -> RigidPart | None:
    """Return what an owner is; None for a link of a robot whose joints move, because they share its load."""
    if owner.robot is None:
        body = layout.bodies[owner.body]
        return RigidPart(body.mass, body.center, bool(state.bodies[body.name].twist.any()))
    robot = layout.robots[owner.robot]
    if robot.model.joint_names:
        return None
    center = np.asarray(robot.model.mechanism.root_center, dtype=float)
    return RigidPart(robot.model.total_mass, center, bool(state.robots[robot.name].v.any()))


def _face(
    collider: Collider,
    body: RigidPart,
    T: Floats,
    slip: Floats,
    normal: Floats,
    friction: float,
    gravity: float,
) -> SlidingFace:
    """Return the slide of a body at T (4, 4) with a slip (3,) on a surface with a normal (3,) towards it."""
    along = slip / np.linalg.norm(slip)
    axes = np.array([along, np.cross(normal, along), normal])
    low, high = _extent(collider, T, axes)
    center = axes @ (T[:3, :3] @ body.center + T[:3, 3])
    # Friction shifts the load ahead until its moment balances that of the friction.
    load = friction * float(center[2] - low[2]) / max(float(high[0] - center[0]), 1e-9)
    flat = all(isinstance(each.shape, Box | Cylinder) for each in collider.shapes)
    size = (float(high[0] - low[0]), float(high[1] - low[1]), float(high[2] - low[2]))
    return SlidingFace(body.mass, gravity, friction, float(np.linalg.norm(slip)), size, load, flat)
