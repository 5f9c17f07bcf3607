"""Plants of Drake: the moving bodies of one robot for the backend, and a scene for the stepper.

**A robot** is a mechanism with the map of its frames and coordinates. Drake's `SpatialInertia` is mass,
centre of mass and inertia per unit of mass; without its check it may be unphysical. It cannot represent
inertia without mass: such a body is made of two rigidly connected parts of mass s and -s, whose sum is the
inertia. Drake's inverse dynamics, energies and articulated-body algorithm add forces and 6 x 6 matrices, so
the parts cancel to rounding; its composite-body mass matrix divides by the mass of the sum and must not be
used.

**A scene** is one discrete plant with a scene graph: robots, bodies, shapes, filters and constraints. Names
in Drake are made of numbers. Drake's frame of a floating base, and of a body of the scene that moves, is at
the centre of mass; other bodies have theirs where `Layout` has it, and what is fixed is part of Drake's world
body.

A height field becomes a prism below each of its triangles, because Drake takes a mesh in contact as its
convex hull.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.backends.solvability import Solvability
from dynx.engines.drake.coordinates import BodyCoordinates, DrakeCoordinates, RobotCoordinates
from dynx.engines.drake.library import (
    AddMultibodyPlantSceneGraph,
    DiagramBuilder,
    FixedOffsetFrame,
    MultibodyPlant,
    PrismaticJoint,
    PrismaticSpring,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RevoluteSpring,
    RigidTransform,
    RotationMatrix,
    SpatialInertia,
    UnitInertia,
    geometry,
)
from dynx.engines.drake.materials import APPROXIMATIONS, MODELS, Copies, copies_of, proximity_properties
from dynx.errors import EngineLimitError, UnsupportedFeatureError, shown
from dynx.model import Mechanism
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.mechanism import ROOT, Body
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, skew
from dynx.steppers.layout import WORLD, BodyLayout, Layout, Owner, RobotLayout

_ORIGIN: Floats = np.zeros(3)

MAX_RATIO = 1e150
"""Bound on a length [m] and on a squared radius of gyration [m^2], above which products may overflow."""


@dataclass(frozen=True, eq=False)
class BuiltPlant:
    """A finalized plant.

    `bodies` are the engine's bodies, the root first; `frames` the engine's frames by the number of
    the dynx frame; `body_of_frame` (n_frames,) and `T_body_frame` (n_frames, 4, 4) place each frame in
    `bodies`. `counterweighted`: some body is made of parts of opposite mass.
    """

    plant: Any
    coordinates: DrakeCoordinates
    bodies: list[Any]
    frames: list[Any]
    body_of_frame: Array
    T_body_frame: Floats
    counterweighted: bool


def build_plant(mechanism: Mechanism) -> BuiltPlant:
    """Return the plant of a mechanism, with one numbered body for each of its bodies."""
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.array(mechanism.gravity))
    bodies: list[Any] = []
    counterweighted = False
    for index, inertia in enumerate([mechanism.root, *(body.inertia for body in mechanism.bodies)]):
        first, *others = inertia_parts(inertia)
        bodies.append(plant.AddRigidBody(f"{index}", first))
        for number, part in enumerate(others):
            counterweight = plant.AddRigidBody(f"{index}:{number}", part)
            plant.WeldFrames(bodies[-1].body_frame(), counterweight.body_frame())
            counterweighted = True

    base: Any = None
    if mechanism.floating:
        base = plant.AddJoint(QuaternionFloatingJoint("base", plant.world_frame(), bodies[0].body_frame()))
    else:
        plant.WeldFrames(plant.world_frame(), bodies[0].body_frame())
    joints: list[Any] = []
    for index, body in enumerate(mechanism.bodies):
        carrier = bodies[body.parent - ROOT].body_frame()
        before, after, axis = joint_frames(plant, f"{index}", carrier, bodies[index + 1].body_frame(), body)
        kind = RevoluteJoint if body.revolute else PrismaticJoint
        joints.append(plant.AddJoint(kind(f"{index}", before, after, axis)))
    frames = []
    for index, frame in enumerate(mechanism.frames):
        carrier = bodies[frame.body - ROOT].body_frame()
        placed = FixedOffsetFrame(f"frame:{index}", carrier, drake_pose(frame.R, frame.p))
        frames.append(plant.AddFrame(placed))
    plant.Finalize()

    coordinates = DrakeCoordinates(
        [joint.position_start() for joint in joints],
        [joint.velocity_start() for joint in joints],
        plant.num_positions(),
        plant.num_velocities(),
        None if base is None else (base.position_start(), base.velocity_start()),
    )
    placements = [homogeneous(np.asarray(frame.R), np.asarray(frame.p)) for frame in mechanism.frames]
    return BuiltPlant(
        plant,
        coordinates,
        bodies,
        frames,
        np.array([frame.body - ROOT for frame in mechanism.frames], dtype=int),
        np.array(placements, dtype=float),
        counterweighted,
    )


def joint_frames(
    plant: Any, name: str, carrier: Any, moved: Any, body: Body, shift: Floats = _ORIGIN
) -> tuple[Any, Any, Floats]:
    """Add the two frames of a joint; return them with the axis (3,) in both.

    Drake 1.51 takes an axis within 1.8e-8 rad of x, y or z for that one. Such an axis becomes x, y or z of
    frames that are turned by the deviation.
    """
    axis, R = np.asarray(body.axis, dtype=float), np.eye(3)
    nearest = np.eye(3)[np.argmax(axis)]
    deviation = cross(nearest, axis)
    if np.max(axis) > 0.0 and 0.0 < np.max(np.abs(deviation)) < NEAR_AXIS:
        # Of this rotation, terms of second order are below rounding.
        axis, R = nearest, np.eye(3) + skew(deviation)
    R_before = np.asarray(body.R, dtype=float) @ R
    before = FixedOffsetFrame(f"before:{name}", carrier, drake_pose(R_before, body.p + shift))
    after = moved
    if axis is nearest:
        after = plant.AddFrame(FixedOffsetFrame(f"after:{name}", moved, drake_pose(R, _ORIGIN)))
    return plant.AddFrame(before), after, axis


NEAR_AXIS = 2e-8
"""Component of an axis across a coordinate axis below which the frames of the joint are turned."""


def inertia_parts(inertia: RigidInertia) -> list[Any]:
    """Return Drake's inertia, or several that add up to it if it cannot be divided by its mass."""
    mass = float(inertia.mass)
    if not (inertia.first_moment.any() or inertia.rotational_inertia.any()):
        return [_part_inertia(mass, inertia)]
    largest = float(max(np.max(np.abs(inertia.first_moment)), np.max(np.abs(inertia.rotational_inertia))))
    if mass and largest < MAX_RATIO * abs(mass):
        return [_part_inertia(mass, inertia)]
    point = RigidInertia(inertia.mass, np.zeros(3), np.zeros((3, 3)))
    parts = [_part_inertia(largest, inertia), _part_inertia(-largest, point)]
    return [*parts, _part_inertia(mass, point)] if mass else parts


def _part_inertia(mass: float, moments: RigidInertia) -> Any:
    """Return Drake's inertia with this mass and the first and second moment of `moments`."""
    divisor = mass or 1.0
    G = moments.rotational_inertia / divisor
    unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
    return SpatialInertia(mass, moments.first_moment / divisor, unit, skip_validity_check=True)


def drake_pose(R: Array, p: Array) -> Any:
    """Return Drake's rigid transform for a rotation (3, 3) and a translation (3,)."""
    # Release builds of Drake, such as the wheels, do not check the matrix.
    return RigidTransform(RotationMatrix(np.asarray(R, dtype=float)), np.asarray(p, dtype=float))


MAX_TRIANGLES = 20_000
"""Largest number of triangles of a height field, each of which is a shape of its own."""


def drake_shapes(shape: Shape) -> list[object]:
    """Return Drake's shape, or several with one frame. Raises EngineLimitError for too fine a height
    field."""
    if isinstance(shape, Box):
        return [geometry.Box(*shape.size)]
    if isinstance(shape, Sphere):
        return [geometry.Sphere(shape.radius)]
    if isinstance(shape, Cylinder):
        return [geometry.Cylinder(shape.radius, shape.length)]
    if isinstance(shape, Capsule):
        return [geometry.Capsule(shape.radius, shape.length)]
    if isinstance(shape, Ellipsoid):
        return [geometry.Ellipsoid(*shape.radii)]
    if isinstance(shape, Plane):
        return [geometry.HalfSpace()]
    if isinstance(shape, Mesh):
        return [_convex(shape.hull[0], shape.name)]
    assert isinstance(shape, HeightField)
    return _prisms(shape)


def _prisms(shape: HeightField) -> list[object]:
    vertices, faces = shape.triangles()
    if len(faces) > MAX_TRIANGLES:
        raise EngineLimitError(
            f"a height field has {len(faces)} triangles; 'drake' takes at most {MAX_TRIANGLES}"
        )
    tops = vertices[faces]
    bottoms = tops.copy()
    bottoms[:, :, 2] = vertices[:, 2].min() - shape.DEPTH
    prisms = np.concatenate([tops, bottoms], axis=1)
    return [_convex(points, "height field") for points in prisms]


def _convex(points: Floats, label: str) -> object:
    shape: object = geometry.Convex(np.ascontiguousarray(points.T), label.replace("\n", " "))
    return shape


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
    Solvability(robot.model).refuse_singular(joint_dynamics=bool(robot.armature.any()))
    if robot.friction.any():
        raise UnsupportedFeatureError(
            f"{shown(robot.name)} has joints with dry friction, which 'drake' does not have"
        )
    mechanism = robot.model.mechanism
    center, base = np.asarray(mechanism.root_center, dtype=float), None
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
        body = plant.AddRigidBody(name, _inertia(moving.inertia, robot))
        carrier, shift = parent.body.body_frame(), parent.T[:3, 3]
        before, after, axis = joint_frames(plant, name, carrier, body.body_frame(), moving, shift)
        kind = RevoluteJoint if moving.revolute else PrismaticJoint
        limits = robot.lower[index], robot.upper[index], robot.damping[index]
        joints.append(plant.AddJoint(kind(name, before, after, axis, *limits)))
        if robot.stiffness[index]:
            spring = RevoluteSpring if moving.revolute else PrismaticSpring
            plant.AddForceElement(spring(joints[-1], robot.spring_reference[index], robot.stiffness[index]))
        if robot.armature[index]:
            actuator = plant.AddJointActuator(name, joints[-1])
            actuator.set_default_rotor_inertia(robot.armature[index])
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
