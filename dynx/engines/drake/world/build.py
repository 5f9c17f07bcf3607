"""A scene as one discrete plant with a scene graph: robots, bodies, shapes, filters and constraints.

Names in Drake are made of numbers. Drake's frame of a floating base, and of a body of the scene that moves,
is at the centre of mass; other bodies have theirs where `Layout` has it, and what is fixed is part of Drake's
world body.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.backends.solvability import Solvability
from dynx.engines.drake.library import (
    AddMultibodyPlantSceneGraph,
    DiagramBuilder,
    FixedOffsetFrame,
    MultibodyPlant,
    PrismaticJoint,
    QuaternionFloatingJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
    geometry,
)
from dynx.engines.drake.multibody_plant import drake_pose, inertia_parts
from dynx.engines.drake.world.coordinates import BodyCoordinates, RobotCoordinates, root_center
from dynx.engines.drake.world.materials import Copies, copies_of
from dynx.engines.drake.world.options import APPROXIMATIONS, MODELS, proximity_properties
from dynx.engines.drake.world.shapes import drake_shapes
from dynx.errors import EngineLimitError, UnsupportedFeatureError, shown
from dynx.model.mechanism import ROOT
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.layout import WORLD, BodyLayout, Layout, Owner, RobotLayout


class Carrier(NamedTuple):
    """Drake's body of an owner, and the pose (4, 4) of the owner's frame in Drake's."""

    body: Any
    T: Floats

    def pose(self, T: Floats) -> Any:
        """Return Drake's transform for a pose (4, 4) in the owner's frame."""
        placed = self.T @ T
        return drake_pose(placed[:3, :3], placed[:3, 3])


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """A finalized scene and where to find its parts in it: coordinates of robots and moving bodies, Drake's
    geometries of each collider (its first copy) and the collider of every geometry, by its number."""

    diagram: Any
    plant: Any
    scene_graph: Any
    robots: tuple[RobotCoordinates, ...]
    bodies: Mapping[int, BodyCoordinates]
    geometries: tuple[tuple[Any, ...], ...]
    collider_of: Mapping[int, int]
    quaternions: Array
    """Indices (n, 4) in the plant's q of the quaternions of floating bases and moving bodies."""


def build_scene(layout: Layout, dt: float, settings: Mapping[str, Any]) -> BuiltScene:
    """Build and finalize a scene.

    Raises UnsupportedFeatureError for what Drake does not have, EngineLimitError for what it cannot
    represent, SingularMassMatrixError for a robot without a unique acceleration.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, MultibodyPlant(time_step=dt))
    # Without sampled ports the state is q and v alone, and contacts are computed when they are asked for.
    plant.SetUseSampledOutputPorts(False)
    plant.set_contact_model(MODELS[settings["contact_model"]])
    plant.set_discrete_contact_approximation(APPROXIMATIONS[settings["contact_approximation"]])
    plant.set_stiction_tolerance(settings["stiction_tolerance"])
    plant.set_adjacent_bodies_collision_filters(False)
    plant.mutable_gravity_field().set_gravity_vector(layout.gravity)
    carriers = {Owner(None, WORLD): Carrier(plant.world_body(), np.eye(4))}
    joints = [_add_robot(plant, number, robot, carriers) for number, robot in enumerate(layout.robots)]
    free = {
        number: _add_body(plant, number, body, carriers)
        for number, body in enumerate(layout.bodies)
        if not body.fixed
    }
    for number, body in enumerate(layout.bodies):
        if body.fixed:
            carriers[Owner(None, number)] = Carrier(plant.world_body(), body.T)
    copies = copies_of(layout)
    geometries = _add_shapes(plant, layout, carriers, copies, settings)
    _add_constraints(plant, layout, carriers)
    plant.Finalize()
    _filter(scene_graph, copies.touch, geometries)
    return BuiltScene(
        builder.Build(),
        plant,
        scene_graph,
        tuple(
            RobotCoordinates(
                robot.model,
                [joint.position_start() for joint in moving],
                [joint.velocity_start() for joint in moving],
                None if base is None else (base.position_start(), base.velocity_start()),
            )
            for robot, (base, moving) in zip(layout.robots, joints, strict=True)
        ),
        {
            number: BodyCoordinates(
                layout.bodies[number].center, joint.position_start(), joint.velocity_start()
            )
            for number, joint in free.items()
        },
        geometries[: len(layout.colliders)],
        {
            each.get_value(): number
            for number, found in zip(copies.collider.tolist(), geometries, strict=True)
            for each in found
        },
        np.array(
            [
                np.arange(4) + joint.position_start()
                for joint in [base for base, _ in joints if base is not None] + list(free.values())
            ],
            dtype=np.intp,
        ).reshape(-1, 4),
    )


def _add_robot(
    plant: Any, number: int, robot: RobotLayout, carriers: dict[Owner, Carrier]
) -> tuple[Any, list[Any]]:
    """Add the bodies and joints of a robot; return the joint of a floating base, or None, and the others."""
    Solvability(robot.model).refuse_singular(joint_dynamics=False)
    if robot.friction.any():
        raise UnsupportedFeatureError(
            f"{shown(robot.name)} has joints with dry friction, which 'drake' does not have"
        )
    mechanism = robot.model.mechanism
    center, base = root_center(mechanism), None
    carriers[Owner(number, ROOT)] = Carrier(plant.world_body(), np.eye(4))
    if mechanism.floating:
        shifted = mechanism.root.transform(np.eye(3), -center)
        root = plant.AddRigidBody(f"r{number}.{ROOT}", _inertia(shifted, robot))
        base = plant.AddJoint(
            QuaternionFloatingJoint(f"r{number}.{ROOT}", plant.world_frame(), root.body_frame())
        )
        T = np.eye(4)
        T[:3, 3] = -center
        carriers[Owner(number, ROOT)] = Carrier(root, T)
    joints = []
    for index, moving in enumerate(mechanism.bodies):
        name = f"r{number}.{index}"
        parent = carriers[Owner(number, moving.parent)]
        p = moving.p + parent.T[:3, 3]
        before = plant.AddFrame(
            FixedOffsetFrame(f"before:{name}", parent.body.body_frame(), drake_pose(moving.R, p))
        )
        body = plant.AddRigidBody(name, _inertia(moving.inertia, robot))
        kind = RevoluteJoint if moving.revolute else PrismaticJoint
        limits = robot.lower[index], robot.upper[index], robot.damping[index]
        joints.append(plant.AddJoint(kind(name, before, body.body_frame(), np.array(moving.axis), *limits)))
        carriers[Owner(number, index)] = Carrier(body, np.eye(4))
    _couple_mimics(plant, robot, joints)
    return base, joints


def _inertia(inertia: RigidInertia, robot: RobotLayout) -> Any:
    parts = inertia_parts(inertia)
    if len(parts) > 1:
        raise EngineLimitError(
            f"a body of {shown(robot.name)} has moments and no mass, which the discrete plants of 'drake' "
            "cannot represent"
        )
    return parts[0]


def _couple_mimics(plant: Any, robot: RobotLayout, joints: list[Any]) -> None:
    coupling = robot.model.mechanism.coupling
    if coupling is None:
        return
    moving = [joint for joint in robot.model.joints if joint.moves]
    owners = [k for k, joint in enumerate(moving) if joint.mimic is None]
    for k, joint in enumerate(moving):
        if joint.mimic is not None:
            driver = joints[owners[coupling.index[k]]]
            plant.AddCouplerConstraint(joints[k], driver, coupling.scale[k], coupling.offset[k])


def _add_body(plant: Any, number: int, body: BodyLayout, carriers: dict[Owner, Carrier]) -> Any:
    """Add a moving body of the scene; return its joint."""
    G = body.inertia / body.mass
    unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
    inertia = SpatialInertia(body.mass, np.zeros(3), unit, skip_validity_check=True)
    added = plant.AddRigidBody(f"b{number}", inertia)
    T = np.eye(4)
    T[:3, 3] = -body.center
    carriers[Owner(None, number)] = Carrier(added, T)
    return plant.AddJoint(QuaternionFloatingJoint(f"b{number}", plant.world_frame(), added.body_frame()))


def _add_shapes(
    plant: Any, layout: Layout, carriers: Mapping[Owner, Carrier], copies: Copies, settings: Mapping[str, Any]
) -> tuple[tuple[Any, ...], ...]:
    """Add the shapes of all copies of colliders; return Drake's numbers of them."""
    found = []
    for copy, number in enumerate(copies.collider.tolist()):
        collider = layout.colliders[number]
        fixed = layout.is_fixed(collider.owner)
        carrier = carriers[collider.owner]
        friction = float(copies.friction[copy])
        added: list[Any] = []
        for placed in collider.shapes:
            properties = proximity_properties(placed.shape, friction, settings, fixed)
            for shape in drake_shapes(placed.shape):
                name = f"{copy}.{len(added)}"
                pose = carrier.pose(placed.T)
                added.append(plant.RegisterCollisionGeometry(carrier.body, pose, shape, name, properties))
        found.append(tuple(added))
    return tuple(found)


def _add_constraints(plant: Any, layout: Layout, carriers: Mapping[Owner, Carrier]) -> None:
    """Add welds and point-to-point constraints.

    A constraint on Drake's world body ends the process in its step (1.51); one on a body that is welded to
    the world does not.
    """
    if not layout.constraints:
        return
    anchor = plant.AddRigidBody("anchor", SpatialInertia(1.0, np.zeros(3), UnitInertia.SolidSphere(1.0)))
    plant.WeldFrames(plant.world_frame(), anchor.body_frame())
    for constraint in layout.constraints:
        ends = []
        for end in (constraint.a, constraint.b):
            carrier = carriers[end.owner]
            body = anchor if layout.is_fixed(end.owner) else carrier.body
            ends.append((body, carrier.pose(end.T)))
        (body_a, at_a), (body_b, at_b) = ends
        if constraint.kind == "weld":
            plant.AddWeldConstraint(body_a, at_a, body_b, at_b)
        else:
            plant.AddBallConstraint(body_a, at_a.translation(), body_b, at_b.translation())


def _filter(scene_graph: Any, touch: NDArray[np.bool_], geometries: tuple[tuple[Any, ...], ...]) -> None:
    """Let exactly those copies of colliders collide that touch."""
    manager = scene_graph.collision_filter_manager()
    for number, found in enumerate(geometries):
        own = geometry.GeometrySet()
        own.Add(list(found))
        others = [
            each
            for other in np.flatnonzero(~touch[number]).tolist()
            if other > number
            for each in geometries[other]
        ]
        declaration = geometry.CollisionFilterDeclaration().ExcludeWithin(own)
        if others:
            rest = geometry.GeometrySet()
            rest.Add(others)
            declaration = declaration.ExcludeBetween(own, rest)
        manager.Apply(declaration)
