"""Random scenes: bodies, robots, grounds, constraints and filters, valid by construction.

Parts stand in columns, each with its box (along the axes of the world) above that of the part below it, so
that nothing overlaps at the start.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar, get_args

import numpy as np
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, UnknownNameError, nearest, shown
from dynx.model import Limits, Model, Pose
from dynx.model.elements import Vector
from dynx.model.geometry import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Geometry,
    HeightField,
    LinkGeometry,
    Mesh,
    Plane,
    Shape,
    Sphere,
)
from dynx.model.tree import STANDARD_GRAVITY
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.configurations import configurations, velocities
from dynx.testing.strategies.geometry import Strategy, numbers, poses, vectors
from dynx.testing.strategies.models import models, optional
from dynx.world import Material, PointToPoint, Scene, SceneBody, SceneRobot, Weld
from dynx.world.boxes import Corners, shape_box
from dynx.world.scene.robots import LinkFrames

# Places of the parts of a scene: columns along x, in which each part stands above the one before it.


COLUMN_SPACING = 0.02
"""Distance [m] between the boxes of neighbouring columns."""


def in_columns(
    parts: Sequence[SceneRobot | SceneBody], gaps: Sequence[float], columns: int, ground: GroundHeight
) -> list[SceneRobot | SceneBody]:
    """Return the parts, in the order given, placed in columns along x: part k in column k mod `columns`.

    `gaps` holds for each part the gap [m] between its box and what is below it, the ground or the part
    before it in the column. Columns are `COLUMN_SPACING` apart.
    """
    boxes = [_box(part) for part in parts]
    placed = []
    left = 0.0
    for column in range(columns):
        chosen = range(column, len(parts), columns)
        if not chosen:
            break
        half = max(float(np.max(np.abs(corner[:2]))) for k in chosen for corner in boxes[k])
        x, left = left + half, left + 2.0 * half + COLUMN_SPACING
        top = ground.highest(x, half)
        for k in chosen:
            lower, upper = boxes[k]
            shift = np.array([x, 0.0, top + gaps[k] - lower[2]])
            placed.append((k, _shifted(parts[k], shift)))
            top += gaps[k] + float(upper[2] - lower[2])
    return [part for _, part in sorted(placed, key=lambda found: found[0])]


@dataclass(frozen=True)
class GroundHeight:
    """Height of the ground: that of a plane, or at most 0."""

    normal: Vector | None
    """Normal of a plane through the origin; None for no ground, or one that is nowhere above z = 0."""

    def highest(self, x: float, half: float) -> float:
        """Return the height of the highest point within `half` of (x, 0) on both axes."""
        if self.normal is None:
            return 0.0
        a, b, c = self.normal
        return (-a * x + (abs(a) + abs(b)) * half) / c


def ground_height(ground_bodies: tuple[SceneBody, ...]) -> GroundHeight:
    if ground_bodies and isinstance(ground_bodies[0].shapes[0].shape, Plane):
        x, y, z = ground_bodies[0].pose.matrix[:3, 2].tolist()
        return GroundHeight((x, y, z))
    return GroundHeight(None)


def _box(part: SceneRobot | SceneBody) -> Corners:
    """Return the corners of the box around a part at its pose; the world's origin if it has no shape."""
    if isinstance(part, SceneBody):
        placed = [(each.shape, part.pose.matrix @ each.origin.matrix) for each in part.shapes]
    else:
        frames, q = LinkFrames(part.model), np.array(part.q)
        placed = [
            (each.shape, frames.pose(q, link.name) @ each.origin.matrix)
            for link in part.model.links
            for each in part.model.geometry.collisions(link.name)
        ]
    if not placed:
        return np.zeros(3), np.zeros(3)
    corners = [shape_box(shape, T) for shape, T in placed]
    return np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)


def _shifted(part: SceneRobot | SceneBody, shift: Floats) -> SceneRobot | SceneBody:
    if isinstance(part, SceneBody):
        return replace(part, pose=_moved(part.pose, shift))
    if not part.model.floating:
        return replace(part, model=part.model.with_base_pose(_moved(part.model.base_pose, shift)))
    assert part.q is not None
    return replace(part, q=(*(np.array(part.q[:3]) + shift).tolist(), *part.q[3:]))


def _moved(pose: Pose, shift: Floats) -> Pose:
    x, y, z = (np.array(pose.xyz) + shift).tolist()
    return replace(pose, xyz=(x, y, z))


T = TypeVar("T")
GroundChoice = Literal["plane", "slope", "hills", "none", "any"]
MAX_PARTS = 20
"""Largest number of bodies, and of robots."""

SLOPE = 0.35
"""Largest angle of a slope [rad]."""
HILL = 0.1
"""Largest height of hills [m]."""


def materials() -> Strategy[Material]:
    """Draw a material: friction up to 1.5, restitution from 0 to 1, one time in six torsional or rolling
    friction. Shrinks to dynx's default."""
    return _materials()


@lru_cache(maxsize=1)
def _materials() -> Strategy[Material]:
    friction = st.sampled_from((0.5, 0.0, 1.0)) | st.floats(0.0, 1.5).map(_rounded)
    restitution = st.sampled_from((0.0, 0.5, 1.0)) | st.floats(0.0, 1.0).map(_rounded)
    length = optional(st.sampled_from((0.005, 0.02))).map(lambda found: found or 0.0)
    return st.builds(Material, friction, length, length, restitution)


def shapes(meshes: Iterable[Mesh] = ()) -> Strategy[Shape]:
    """Draw a shape that moves, from 5 cm to 50 cm: a ball, box, capsule or cylinder, or one of `meshes`.

    Shrinks to a ball of 10 cm.
    """
    return _shapes(_checked_meshes(meshes))


@lru_cache(maxsize=8)
def _shapes(meshes: tuple[Mesh, ...]) -> Strategy[Shape]:
    size = st.sampled_from((0.2, 0.1, 0.3)) | st.floats(0.05, 0.5).map(_rounded)
    radius = size.map(lambda diameter: diameter / 2)
    kinds: list[Strategy[Shape]] = [
        st.builds(Sphere, radius),
        st.builds(lambda *edges: Box(edges), size, size, size),
        st.builds(Capsule, radius, size),
        st.builds(Cylinder, radius, size),
    ]
    if meshes:
        kinds.append(st.sampled_from(meshes))
    return st.one_of(kinds)


def scenes(
    *,
    max_bodies: int = 4,
    max_robots: int = 1,
    ground: GroundChoice = "any",
    moving: bool = True,
    constraints: bool = True,
    filters: bool = True,
    fixed_bodies: bool = True,
    meshes: Iterable[Mesh] = (),
) -> Strategy[Scene]:
    """Return a strategy of scenes that every engine can represent: 1 to `max_bodies` bodies, not counting the
    ground, and 0 to `max_robots` robots.

    Bodies of one shape or several, of any attitude, with their own centre of mass or that of their shapes,
    masses from 0.1 to 10 kg, and materials; fixed bodies; robots from `models` with shapes on their links, on
    fixed and floating bases, within their joint limits (joints that follow others have none); welds and ball
    joints that hold at the start; pairs and groups that do not collide; gravity of the earth, of another
    direction, or none. No two parts overlap at the start.

    - `ground`: ``"plane"``, ``"slope"``, ``"hills"`` (a height field), ``"none"`` or ``"any"`` of these
    - `moving`: whether parts have velocities at the start
    - `constraints`: whether parts may be welded or joined by a ball joint
    - `filters`: whether some pairs may ignore each other
    - `fixed_bodies`: whether bodies other than the ground may be fixed
    - `meshes`: meshes that bodies may have, besides primitive shapes

    Shrinks towards a plane (where `ground` allows it) and one ball at rest above it; a shorter search may
    stop at another small scene. Raises, at the call, DTypeError for a count that is no int or a flag that is
    no bool, ArgumentError for a count outside 1 to 20 (of robots, 0 to 20) or a mesh that is no Mesh, and
    UnknownNameError for another ground.
    """
    for name, value, least in (("max_bodies", max_bodies, 1), ("max_robots", max_robots, 0)):
        if isinstance(value, bool) or not isinstance(value, int):
            raise DTypeError(f"{name} is {shown(value)}; wanted a whole number")
        if not least <= value <= MAX_PARTS:
            raise ArgumentError(f"{name} is {value}; wanted {least} to {MAX_PARTS}")
    if ground not in get_args(GroundChoice):
        raise UnknownNameError(f"ground is {shown(ground)}{nearest(ground, get_args(GroundChoice))}")
    flags = {
        "moving": moving,
        "constraints": constraints,
        "filters": filters,
        "fixed_bodies": fixed_bodies,
    }
    for name, flag in flags.items():
        if not isinstance(flag, bool):
            raise DTypeError(f"{name} is {shown(flag)}; wanted True or False")
    options = _SceneOptions(max_bodies, max_robots, ground, meshes=_checked_meshes(meshes), **flags)
    return _scenes(options)


@dataclass(frozen=True)
class _SceneOptions:
    max_bodies: int
    max_robots: int
    ground: GroundChoice
    moving: bool
    constraints: bool
    filters: bool
    fixed_bodies: bool
    meshes: tuple[Mesh, ...]


@lru_cache(maxsize=32)
def _scenes(options: _SceneOptions) -> Strategy[Scene]:
    body = _bodies(options)
    robot = _robots(options.moving)
    grounds = _grounds(options.ground)

    @st.composite
    def scene(draw: st.DrawFn) -> Scene:
        ground_bodies = draw(grounds)
        bodies = draw(st.lists(body, min_size=1, max_size=options.max_bodies))
        robots = draw(st.lists(robot, max_size=options.max_robots))
        columns = draw(st.integers(1, 3))
        gaps = [draw(st.sampled_from((0.01, 0.0, 0.1))) for _ in range(len(bodies) + len(robots))]
        named_robots = [replace(each, name=f"robot{k}") for k, each in enumerate(robots)]
        named_bodies = [replace(each, name=f"body{k}") for k, each in enumerate(bodies)]
        placed = in_columns([*named_robots, *named_bodies], gaps, columns, ground_height(ground_bodies))
        moved_robots = tuple(each for each in placed if isinstance(each, SceneRobot))
        moved_bodies = tuple(each for each in placed if isinstance(each, SceneBody))
        found = Scene(
            "random_scene",
            robots=moved_robots,
            bodies=(*ground_bodies, *moved_bodies),
            gravity=draw(_gravities(bool(ground_bodies))),
        )
        if options.filters:
            found = _with_filters(draw, found)
        if options.constraints:
            found = _with_constraints(draw, found)
        return found

    return scene()


# -- parts ----------------------------------------------------------------------------------------


def _bodies(options: _SceneOptions) -> Strategy[SceneBody]:
    shape = _shapes(options.meshes)
    more = st.lists(st.tuples(shape, poses(0.2).map(Pose.from_matrix)), max_size=2)
    mass = st.sampled_from((1.0, 0.1, 10.0)) | st.floats(-1.0, 1.0).map(lambda x: _rounded(10.0**x))
    attitude = poses(1.0).map(lambda T: Pose.from_matrix(_at_origin(T)))

    @st.composite
    def body(draw: st.DrawFn) -> SceneBody:
        placed = (Collision(draw(shape)), *(Collision(each, at) for each, at in draw(more)))
        pose, material = draw(attitude), draw(materials())
        if options.fixed_bodies and draw(_sometimes(st.just(True))):
            return SceneBody("body", placed, pose, material=material)
        center = draw(_sometimes(vectors(0.05)))
        twist = (0.0,) * 6
        if options.moving:
            twist = (*draw(vectors(2.0)), *draw(vectors(5.0)))
        return SceneBody(
            "body",
            placed,
            pose,
            mass=draw(mass),
            center_of_mass=center,
            twist=twist,
            material=material,
        )

    return body()


@lru_cache(maxsize=2)
def _robots(moving: bool) -> Strategy[SceneRobot]:
    tree = models(max_links=4, solvable=True)
    shape = _shapes(())

    @st.composite
    def robot(draw: st.DrawFn) -> SceneRobot:
        model = _without_limits_of_followers(draw(tree))
        links = {
            link.name: LinkGeometry(collisions=(Collision(draw(shape)),))
            for link in model.links
            if draw(st.booleans())
        }
        model = replace(model, geometry=Geometry(links).for_links(link.name for link in model.links))
        q = draw(configurations(model, within_limits=True))
        v = draw(velocities(model, 2.0)) if moving else np.zeros(model.nv)
        return SceneRobot("robot", model, q=tuple(q), v=tuple(v), material=draw(materials()))

    return robot()


@lru_cache(maxsize=5)
def _grounds(choice: GroundChoice) -> Strategy[tuple[SceneBody, ...]]:
    """Draw the fixed body below all others, or none; the highest point of it near the origin is z = 0."""
    material = materials()
    plane = st.builds(lambda made: (SceneBody("ground", _one(Plane()), material=made),), material)
    tilt = st.tuples(numbers(SLOPE), numbers(SLOPE), st.just(0.0))
    slope = st.builds(
        lambda made, rpy: (SceneBody("ground", _one(Plane()), Pose((0.0, 0.0, 0.0), rpy), material=made),),
        material,
        tilt,
    )
    height = st.floats(-HILL, 0.0).map(_rounded)
    rows = st.lists(st.tuples(*[height] * 5), min_size=5, max_size=5)
    hills = st.builds(
        lambda made, found: (
            SceneBody("ground", _one(HeightField(tuple(found), (40.0, 40.0))), material=made),
        ),
        material,
        rows,
    )
    kinds = {"plane": plane, "slope": slope, "hills": hills, "none": st.just(())}
    return st.one_of(list(kinds.values())) if choice == "any" else kinds[choice]


def _gravities(grounded: bool) -> Strategy[Vector]:
    if grounded:
        return st.just(STANDARD_GRAVITY)
    return st.sampled_from((STANDARD_GRAVITY, (0.0, 0.0, 0.0))) | vectors(10.0)


def _without_limits_of_followers(model: Model) -> Model:
    """Return the robot whose joints that follow others are unlimited, because a driver within its limits may
    move them beyond theirs."""
    joints = (each if each.mimic is None else replace(each, limits=Limits()) for each in model.joints)
    return replace(model, joints=tuple(joints))


# -- filters and constraints ----------------------------------------------------------------------


def _with_filters(draw: st.DrawFn, scene: Scene) -> Scene:
    """Let up to two pairs ignore each other, one of them by the name of a group."""
    names = [*(robot.name for robot in scene.robots), *(body.name for body in scene.bodies)]
    pairs = draw(_sometimes(st.lists(st.tuples(st.sampled_from(names), st.sampled_from(names)), max_size=2)))
    if not pairs:
        return scene
    groups = (("group", (pairs[0][0],)),)
    return replace(scene, groups=groups, ignored=(("group", pairs[0][1]), *pairs[1:]))


def _with_constraints(draw: st.DrawFn, scene: Scene) -> Scene:
    """Connect up to two pairs of parts as they are at the start, so that no constraint is violated."""
    ends = {"world": np.eye(4)}
    for robot in scene.robots:
        frames = LinkFrames(robot.model)
        for link in robot.model.links:
            ends[f"{robot.name}/{link.name}"] = frames.pose(np.array(robot.q), link.name)
    ends.update({body.name: body.pose.matrix for body in scene.bodies})
    free = [body.name for body in scene.bodies if not body.fixed]
    if not free:
        return scene
    made: list[Weld | PointToPoint] = []
    for a in draw(optional(st.lists(st.sampled_from(free), min_size=1, max_size=2, unique=True))) or []:
        others = [end for end in ends if end != a and end not in {c.a for c in made}]
        links = [end for end in others if "/" in end]
        # Few scenes have both robots and constraints: half of the constraints of these are to a link.
        linked: bool = bool(links) and draw(st.booleans())
        b: str = draw(st.sampled_from(links if linked else others))
        if draw(st.booleans()):
            made.append(Weld(a, b))
            continue
        point = np.append(ends[a][:3, 3] + np.array(draw(vectors(0.3))), 1.0)
        on_a, on_b = (np.linalg.solve(ends[end], point)[:3] for end in (a, b))
        made.append(PointToPoint(a, b, tuple(on_a.tolist()), tuple(on_b.tolist())))
    return replace(scene, constraints=tuple(made))


# -- small things ---------------------------------------------------------------------------------


def _checked_meshes(meshes: Iterable[Mesh]) -> tuple[Mesh, ...]:
    found = tuple(meshes)
    for each in found:
        if not isinstance(each, Mesh):
            raise ArgumentError(f"meshes holds {shown(each)}; wanted Mesh")
    return found


def _sometimes(strategy: Strategy[T]) -> Strategy[T | None]:
    """Draw from the strategy one time in three, otherwise None."""
    return st.integers(0, 2).flatmap(lambda n: strategy if n == 2 else st.none())


def _one(shape: Shape) -> tuple[Collision, ...]:
    return (Collision(shape),)


def _at_origin(T: Floats) -> Floats:
    turned = np.array(T)
    turned[:3, 3] = 0.0
    return turned


def _rounded(x: float) -> float:
    return round(x, 3)
