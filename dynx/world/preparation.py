"""Preparation of a scene for an engine: shapes by owner, limits and dynamics by joint, anchors, filters."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, EngineLimitError, UnsupportedFeatureError, shown
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.elements import Pose
from dynx.model.geometry import Collision, Mesh
from dynx.model.numbers import positive_seconds, whole_number
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import (
    WORLD,
    Anchor,
    BodyLayout,
    Collider,
    ConstraintLayout,
    Layout,
    Owner,
    PlacedShape,
    RobotLayout,
)
from dynx.steppers.material import Material
from dynx.steppers.settings import checked_switches
from dynx.steppers.stepper import Feature, Stepper
from dynx.world.scene.bodies import PointToPoint, SceneBody, Weld
from dynx.world.scene.robots import LinkFrames, SceneRobot
from dynx.world.scene.scene import Scene

MAX_COLLIDERS = 10_000
"""Largest number of links and bodies with shapes; the filter has an entry for each pair."""

_IDENTITY = np.eye(4)


SHORTEST_STEP = 1e-9
"""Shortest step of an engine [s]."""


JointDynamics = bool
"""True if joints have the damping, friction, armature or springs of the robot description; a world takes no
other values. The refusal of a number knows the name (`dynx.argument_types`)."""


def checked_options(dt: float, substeps: int, **switches: bool) -> dict[str, Any]:
    """Return the options of a world by name; ArgumentError for an invalid one."""
    seconds, steps = positive_seconds("dt", dt), whole_number("substeps", substeps, 1)
    if seconds / steps < SHORTEST_STEP:
        raise ArgumentError(
            f"dt is {dt} in {substeps} substeps; wanted steps of at least {SHORTEST_STEP:g} s"
        )
    return {"dt": seconds, "substeps": steps, **checked_switches(**switches)}


def prepare(
    scene: Scene,
    *,
    collisions: bool,
    joint_limits: bool,
    joint_damping: bool,
    joint_friction: bool,
    joint_armature: bool,
    joint_springs: bool,
) -> Layout:
    """Return the layout of a scene.

    Raises DescriptionError for a fault in a collision shape or its mesh, EngineLimitError for more than
    `MAX_COLLIDERS` colliders.
    """
    switches = joint_limits, joint_damping, joint_friction, joint_armature, joint_springs
    robots = tuple(_robot(robot, scene.gravity, *switches) for robot in scene.robots)
    parts = _PartLookup(scene, robots)
    colliders = parts.colliders() if collisions else ()
    return Layout(
        name=scene.name,
        gravity=np.array(scene.gravity),
        robots=robots,
        bodies=tuple(map(_body, scene.bodies)),
        colliders=colliders,
        collides=_pairs(scene, colliders),
        constraints=tuple(map(parts.constraint, scene.constraints)),
        sensors=tuple(each.layout(scene.sensed_parts) for each in scene.sensors),
    )


def _robot(
    robot: SceneRobot,
    gravity: tuple[float, float, float],
    limits: bool,
    damping: bool,
    friction: bool,
    armature: bool,
    springs: bool,
) -> RobotLayout:
    model = robot.model if robot.model.gravity == gravity else replace(robot.model, gravity=gravity)
    moving = [joint for joint in model.joints if joint.moves for _ in range(joint.n_rates)]
    n = len(moving)
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    angles = [np.inf] * len(model.ball_joints)
    if limits:
        for k, joint in enumerate(moving):
            if joint.type != "ball":
                lower[k], upper[k] = sorted((joint.limits.lower, joint.limits.upper))
        # The angle of a rotation is at most pi.
        found = (joint.limits.upper for joint in model.ball_joints)
        angles = [angle if angle < np.pi else np.inf for angle in found]
    switches = {"damping": damping, "friction": friction, "armature": armature}
    switches |= {"stiffness": springs, "spring_reference": springs}
    dynamics = {
        name: np.array([getattr(joint.dynamics, name) if acts else 0.0 for joint in moving])
        for name, acts in switches.items()
    }
    q, v = np.array(robot.q), np.array(robot.v)
    return RobotLayout(robot.name, model, q, v, lower, upper, **dynamics, largest_angles=tuple(angles))


def _body(body: SceneBody) -> BodyLayout:
    inertial = body.inertial
    return BodyLayout(
        body.name,
        inertial.mass,
        np.array(inertial.origin.xyz),
        inertial.tensor,
        body.pose.matrix.copy(),
        np.array(body.twist),
    )


def _first_pair(layout: Layout) -> str:
    """Name two parts that may touch, and what lets them pass."""
    a, b = (shown(layout.colliders[k].name) for k in np.argwhere(layout.collides)[0])
    return f": {a} and {b} may touch; with collisions=False everything passes through everything"


def layout_for(kind: type[Stepper], layout: Layout) -> Layout:
    """Return the layout that an engine gets: that of the scene, without joint dynamics that are computed
    outside of it: those which it does not have, and of robots that nothing can reach those which it has with
    an error (`Stepper.inexact`).

    Raises UnsupportedFeatureError, naming the engine, for another feature that the scene needs and the engine
    does not have.
    """
    provided = kind.provides(layout)
    for robot in layout.robots:
        if robot.model.ball_joints and not kind.takes_ball_joints:
            instead = "the world engines 'mujoco' and 'dynx' do"
            refuse_ball_joints(robot.model, f"a world on {shown(kind.name)}", instead)
    limited = any(robot.limited for robot in layout.robots)
    needed = {
        Feature.CONTACTS: layout.collides.any(),
        Feature.LIMITS: limited,
        Feature.MIMICS: any(robot.model.mechanism.coupling is not None for robot in layout.robots),
        Feature.CONSTRAINTS: bool(layout.constraints),
    }
    for feature, is_needed in needed.items():
        if is_needed and feature not in provided:
            raise UnsupportedFeatureError(
                f"the scene {shown(layout.name)} has {feature.value}, which {kind.name!r} does not have"
                + (_first_pair(layout) if feature is Feature.CONTACTS else "")
            )
    robots = []
    for k, robot in enumerate(layout.robots):
        exact = provided if may_be_reached(layout, k) else provided - kind.inexact.keys()
        robots.append(_with_provided_joints(robot, exact))
    return replace(layout, robots=tuple(robots))


def _with_provided_joints(robot: RobotLayout, provided: frozenset[Feature]) -> RobotLayout:
    """Return a robot without the joint dynamics that are computed outside; the same object if none are."""
    present = {
        Feature.DAMPING: robot.damping,
        Feature.DRY_FRICTION: robot.friction,
        Feature.ARMATURE: robot.armature,
        Feature.SPRINGS: robot.stiffness,
    }
    missing = {feature for feature, values in present.items() if values.any()} - provided
    if not missing:
        return robot
    nothing = np.zeros(len(robot.damping))
    # Springs are outside with anything else, whose torque depends on all other torques.
    elastic = replace(robot, stiffness=nothing, spring_reference=nothing)
    if missing & {Feature.DAMPING, Feature.ARMATURE}:
        # Both change the acceleration for which an engine computes the others.
        return replace(elastic, damping=nothing, friction=nothing, armature=nothing)
    return replace(elastic, friction=nothing) if Feature.DRY_FRICTION in missing else elastic


def acting_layout(layout: Layout) -> Layout:
    """Return the layout with the active constraints alone, whose ends collide as they let them."""
    active = tuple(each for each in layout.constraints if each.active)
    collides = layout.collides
    for constraint in active:
        if not constraint.collides:
            ends = [
                [k for k, each in enumerate(layout.colliders) if each.name == name]
                for name in constraint.names
            ]
            if all(ends):
                collides = collides.copy()
                collides[np.ix_(ends[0], ends[1])] = collides[np.ix_(ends[1], ends[0])] = False
    if len(active) == len(layout.constraints) and collides is layout.collides:
        return layout
    return replace(layout, constraints=active, collides=collides)


def may_be_reached(layout: Layout, robot: int) -> bool:
    """Check whether contacts or constraints may act on a robot."""
    own = [k for k, collider in enumerate(layout.colliders) if collider.owner.robot == robot]
    tied = any(robot in (each.a.owner.robot, each.b.owner.robot) for each in layout.constraints)
    return tied or bool(layout.collides[own].any())


class _PartLookup:
    """Colliders and anchors of a scene, from the names of its parts."""

    def __init__(self, scene: Scene, robots: tuple[RobotLayout, ...]) -> None:
        self._scene = scene
        self._robots = robots
        self._number = {robot.name: k for k, robot in enumerate(robots)}
        self._body_number = {body.name: k for k, body in enumerate(scene.bodies)}

    @cached_property
    def _frames(self) -> list[LinkFrames]:
        return [LinkFrames(robot.model) for robot in self._robots]

    def colliders(self) -> tuple[Collider, ...]:
        """Return every link and body with collision shapes, in the order of the scene."""
        found = []
        for k, (robot, frames) in enumerate(zip(self._scene.robots, self._frames, strict=True)):
            for link in robot.model.links:
                shapes = robot.model.geometry.collisions(link.name)
                if shapes:
                    body, T = frames[link.name]
                    material = robot.material_of(link.name)
                    found.append(_collider(f"{robot.name}/{link.name}", Owner(k, body), T, shapes, material))
        for k, each in enumerate(self._scene.bodies):
            found.append(_collider(each.name, Owner(None, k), _IDENTITY, each.shapes, each.material))
        if len(found) > MAX_COLLIDERS:
            raise EngineLimitError(
                f"{self._scene.name} has {len(found)} links and bodies with shapes; "
                f"at most {MAX_COLLIDERS} are supported"
            )
        return tuple(found)

    def constraint(self, constraint: Weld | PointToPoint) -> ConstraintLayout:
        """Return a constraint with its ends as frames in their owners."""
        return replace(
            self._at_anchors(constraint),
            active=constraint.active,
            collides=constraint.collides,
            held=isinstance(constraint, Weld) and constraint.T_a_b is None,
            name=constraint.name,
        )

    def _at_anchors(self, constraint: Weld | PointToPoint) -> ConstraintLayout:
        names = constraint.a, constraint.b
        (owner_a, T_a), (owner_b, T_b) = self._part(constraint.a), self._part(constraint.b)
        if isinstance(constraint, PointToPoint):
            at_a, at_b = Pose(constraint.point_a).matrix, Pose(constraint.point_b).matrix
            return ConstraintLayout("point", Anchor(owner_a, T_a @ at_a), Anchor(owner_b, T_b @ at_b), names)
        if constraint.T_a_b is not None:
            T_a_b = constraint.T_a_b.matrix
        else:
            T_a_b = np.linalg.inv(self._start(constraint.a)) @ self._start(constraint.b)
        return ConstraintLayout("weld", Anchor(owner_a, T_a @ T_a_b), Anchor(owner_b, T_b), names)

    def _part(self, name: str) -> tuple[Owner, Floats]:
        """Return the owner of a part, and the pose of the part's frame in it."""
        owner, _, link = name.partition("/")
        if owner in self._number:
            robot = self._number[owner]
            body, T = self._frames[robot][link]
            return Owner(robot, body), T
        return Owner(None, self._body_number.get(owner, WORLD)), _IDENTITY

    def _start(self, name: str) -> Floats:
        """Return the pose of a part in the world at the start."""
        owner, _, link = name.partition("/")
        if owner in self._number:
            robot = self._number[owner]
            return self._frames[robot].pose(self._robots[robot].q, link)
        if owner in self._body_number:
            return self._scene.bodies[self._body_number[owner]].pose.matrix
        return _IDENTITY


def _collider(
    name: str, owner: Owner, T: Floats, shapes: tuple[Collision, ...], material: Material
) -> Collider:
    placed = []
    for each in shapes:
        if isinstance(each.shape, Mesh):
            # Read here, so that a fault is raised before any engine is started.
            _ = each.shape.hull
        placed.append(PlacedShape(each.shape, T @ each.origin.matrix))
    return Collider(name, owner, tuple(placed), material)


def _pairs(scene: Scene, colliders: tuple[Collider, ...]) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    pairs = scene.collision_filter.pairs([each.name for each in colliders])
    parts_of: dict[Owner, list[int]] = {}
    for k, each in enumerate(colliders):
        parts_of.setdefault(each.owner, []).append(k)
    for parts in parts_of.values():
        pairs[np.ix_(parts, parts)] = False
    return pairs
