"""What a robot of a scene is to keep away from: obstacles, what other robots are, and its own links."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from dynx.distance.avoidance import Avoidance, AvoidingPart, same_kinematics
from dynx.errors import ArgumentError, DescriptionError, shown
from dynx.model import Link, Model
from dynx.model.geometry import Collision
from dynx.spatial.scalar import Floats
from dynx.world.scene.bodies import Constraint, SceneBody, Weld
from dynx.world.scene.filters import CollisionFilter, merged_links
from dynx.world.scene.robots import LinkFrames, SceneRobot

_IDENTITY: Floats = np.eye(4)

Ignored = Iterable[tuple[frozenset[str], ...]]


def robot_like(robots: Iterable[SceneRobot], model: Model) -> SceneRobot:
    """Return the robot of a scene that is `model`; a scene without robots has it as its only one.

    Raises ArgumentError if no robot is like it, or several are.
    """
    known = list(robots)
    if not known:
        return SceneRobot("robot", model)
    found = [robot for robot in known if robot.model is model or same_kinematics(robot.model, model)]
    if len(found) == 1:
        return found[0]
    names = ", ".join(shown(robot.name) for robot in (found or known))
    if found:
        raise ArgumentError(
            f"robots {names} of the scene are like the backend's; choose one by Scene.avoidance(robot)"
        )
    where = [robot.name for robot in known if _is_elsewhere(robot.model, model)]
    if where:
        raise ArgumentError(
            f"robot {shown(where[0])} of the scene is at another base pose than the model of the backend; "
            "make the backend from the model of the scene's robot"
        )
    raise ArgumentError(
        f"the scene has {names}, none with the joints and links of the backend's {shown(model.name)}; make "
        "the backend from the model of the scene's robot"
    )


def robot_avoidance(
    robot: SceneRobot,
    robots: Iterable[SceneRobot],
    bodies: Iterable[SceneBody],
    constraints: Iterable[Constraint],
    ignored: Ignored,
    margin: float,
    self_margin: float,
) -> Avoidance:
    """Return what one robot of a scene keeps away from; bodies and other robots are where they start.

    Bodies with mass that a `Weld` connects to the robot move with it. Pairs that the scene ignores, and links
    that a joint connects, are not kept apart. Raises ArgumentError for a robot none of whose moving links has
    a shape, because such an avoidance would be kept by every configuration.
    """
    all_robots = [replace(robot, self_collision=True), *(each for each in robots if each.name != robot.name)]
    movable = list(bodies)
    may_collide = CollisionFilter(all_robots, movable, ignored).may_collide
    starts = _StartPoses(all_robots, movable)
    carried = _carried(robot, movable, constraints, starts)
    heads = merged_links(robot.model)
    own: list[AvoidingPart] = []
    others: list[AvoidingPart] = []
    for link in robot.model.links:
        shapes = robot.model.geometry.collisions(link.name)
        if shapes:
            own.append(_part(f"{robot.name}/{link.name}", link.name, _IDENTITY, shapes))
    for other in all_robots[1:]:
        for link in other.model.links:
            name, shapes = f"{other.name}/{link.name}", other.model.geometry.collisions(link.name)
            if shapes:
                others.append(_part(name, None, starts(name), shapes))
    for body in movable:
        if body.name in carried:
            frame, T = carried[body.name]
            own.append(_part(body.name, frame, T, body.shapes))
        else:
            others.append(_part(body.name, None, body.pose.matrix, body.shapes))
    without = _links_without_shapes(robot.model, heads, own)
    parts = [*own, *others]
    number = {part.name: k for k, part in enumerate(parts)}
    pairs: list[tuple[int, int, float]] = []
    for a, b in combinations(own, 2):
        assert a.frame is not None
        assert b.frame is not None
        if heads[a.frame] != heads[b.frame] and may_collide(a.name, b.name):
            pairs.append((number[a.name], number[b.name], self_margin))
    for a in own:
        for b in others:
            # A base that is fixed in the world cannot move away from anything.
            if not (may_collide(a.name, b.name) and _moves(robot.model, heads, a)):
                continue
            pairs.append((number[a.name], number[b.name], margin))
    return Avoidance(robot.model, parts, pairs, without)


def _part(name: str, frame: str | None, T: Floats, shapes: Iterable[Collision]) -> AvoidingPart:
    return AvoidingPart(name, frame, tuple((each.shape, T @ each.origin.matrix) for each in shapes))


def _moves(model: Model, heads: Mapping[str, str], part: AvoidingPart) -> bool:
    return part.frame is not None and _link_moves(model, heads, part.frame)


def _link_moves(model: Model, heads: Mapping[str, str], link: str) -> bool:
    return model.floating or heads[link] != heads[model.root]


def _links_without_shapes(model: Model, heads: Mapping[str, str], own: Iterable[AvoidingPart]) -> list[str]:
    """Return the moving links that have a mass or a visual shape, but no collision shape.

    Raises ArgumentError if no body that moves with the robot has a collision shape.
    """
    moving = [link for link in model.links if _link_moves(model, heads, link.name)]
    parts = [part for part in own if _moves(model, heads, part)]
    if moving and not parts:
        raise ArgumentError(
            f"no link of robot {shown(model.name)} that can move has a collision shape, so that there is "
            "nothing to keep apart; add <collision> elements to its description"
        )
    return [
        link.name for link in moving if not model.geometry.collisions(link.name) and _is_solid(model, link)
    ]


def _is_solid(model: Model, link: Link) -> bool:
    """Return whether a link is more than a frame: it has a mass or a visual shape."""
    if link.inertial is not None and link.inertial.mass > 0.0:
        return True
    try:
        return bool(model.geometry.visuals(link.name))
    except DescriptionError:
        # A visual shape with a fault is one.
        return True


def _is_elsewhere(one: Model, other: Model) -> bool:
    if one.floating or other.floating:
        return False
    return same_kinematics(one, other.with_base_pose(one.base_pose))


class _StartPoses:
    """Poses in the world (4, 4) of bodies and links at the start of a scene, by name."""

    def __init__(self, robots: Iterable[SceneRobot], bodies: Iterable[SceneBody]) -> None:
        self._robots = {robot.name: (robot, LinkFrames(robot.model)) for robot in robots}
        self._bodies = {body.name: body for body in bodies}

    def __call__(self, name: str) -> Floats:
        owner, _, link = name.partition("/")
        if owner in self._robots:
            robot, frames = self._robots[owner]
            return frames.pose(np.array(robot.q), link)
        return self._bodies[owner].pose.matrix if owner in self._bodies else _IDENTITY


def _carried(
    robot: SceneRobot,
    bodies: Iterable[SceneBody],
    constraints: Iterable[Constraint],
    starts: Callable[[str], Floats],
) -> dict[str, tuple[str, Floats]]:
    """Return, for each body that welds connect to the robot, a link and the body's pose (4, 4) in it."""
    movable = {body.name for body in bodies if not body.fixed}
    known: dict[str, tuple[str, Floats]] = {
        f"{robot.name}/{link.name}": (link.name, _IDENTITY) for link in robot.model.links
    }
    found: dict[str, tuple[str, Floats]] = {}
    welds = [each for each in constraints if isinstance(each, Weld) and each.active]
    while True:
        before = len(found)
        for weld in welds:
            given = None if weld.T_a_b is None else weld.T_a_b.matrix
            T_a_b = np.linalg.inv(starts(weld.a)) @ starts(weld.b) if given is None else given
            for one, other, T in ((weld.a, weld.b, T_a_b), (weld.b, weld.a, np.linalg.inv(T_a_b))):
                if one in known and other in movable and other not in known:
                    frame, T_frame_one = known[one]
                    known[other] = found[other] = frame, T_frame_one @ T
        if len(found) == before:
            return found
