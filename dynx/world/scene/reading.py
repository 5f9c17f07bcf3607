"""A scene from its document; every error names the place in it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, shown
from dynx.files.documents import convert_document
from dynx.model import Model, Pose
from dynx.model.elements import IDENTITY, ZERO
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.geometry.sizes import finite_numbers, finite_vector
from dynx.model.loading import load, read_model
from dynx.model.xacro_reading import split_arguments
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.steppers.material import DEFAULT_MATERIAL, Material
from dynx.world.motors import Motor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
from dynx.world.scene.bodies import SceneBody
from dynx.world.scene.constraints import Constraint, PointToPoint, Weld
from dynx.world.scene.document_types import (
    BodyDocument,
    ConstraintDocument,
    MaterialDocument,
    MotorDocument,
    RobotDocument,
    SceneDocument,
    ShapeDocument,
)
from dynx.world.scene.paths import ScenePaths
from dynx.world.scene.robots import SceneRobot
from dynx.world.scene.scene import Scene

SCHEMA = "dynx.scene/1"
"""Name and version of the layout of a scene's document."""

MOTORS: dict[str, type[Motor]] = {
    "position": PositionMotor,
    "velocity": VelocityMotor,
    "pd": PDMotor,
    "torque": TorqueMotor,
}
"""Classes of motors by their names in a document."""

QUATERNION_TOLERANCE = 1e-6
"""Largest deviation of the norm of a quaternion from 1."""


def scene_from_document(document: object, paths: ScenePaths | None = None) -> Scene:
    """Return the scene of a document.

    Files are looked for by `paths`; without them, robots are given as text only, so that a document from
    elsewhere names no file that is read as a robot. Raises ArgumentError, DescriptionError and their kinds,
    naming the place in the document.
    """
    if not isinstance(document, Mapping):
        raise ArgumentError(f"a scene's document is a table of keys; this is {shown(document)}")
    if document.get("schema") != SCHEMA:
        found = f"is {shown(document['schema'])}" if "schema" in document else "is absent"
        raise ArgumentError(f"schema {found}; wanted schema = {SCHEMA!r}")
    given = convert_document(document, SceneDocument)
    robots, bodies, constraints = [], [], []
    for k, robot in enumerate(given.robots):
        with _place(f"robots[{k}], {shown(robot.name)}"):
            robots.append(_robot(robot, paths))
    for k, body in enumerate(given.bodies):
        with _place(f"bodies[{k}], {shown(body.name)}"):
            bodies.append(_body(body, paths or ScenePaths(None)))
    for k, constraint in enumerate(given.constraints):
        with _place(f"constraints[{k}]"):
            constraints.append(_constraint(constraint))
    return Scene(
        given.name,
        tuple(robots),
        tuple(bodies),
        tuple(constraints),
        given.ignored,
        given.groups,
        given.gravity,
    )


@contextmanager
def _place(place: str) -> Iterator[None]:
    """Name the place in the document in an error."""
    try:
        yield
    except (ArgumentError, DescriptionError, RobotNotFoundError) as error:
        kind = DescriptionError if isinstance(error, DescriptionError) else type(error)
        raise kind(f"{place}: {error}") from error


# -- robots ---------------------------------------------------------------------------------------


def _robot(given: RobotDocument, paths: ScenePaths | None) -> SceneRobot:
    model, pose = _model(given, paths), _pose("pose", given.pose)
    if pose is not None and model.floating and isinstance(given.q, list):
        raise ArgumentError("q and pose are both given for a floating base; q begins with the pose")
    robot = SceneRobot(
        given.name,
        model,
        _coordinates("q", given.q, model, model.nq),
        _coordinates("v", given.v, model, model.nv),
        _material(given.material),
        {link: _material(each) for link, each in given.materials.items()},
        given.self_collision,
        tuple(_motor(k, each) for k, each in enumerate(given.motors)),
    )
    return robot if pose is None else robot.at(pose)


def _model(given: RobotDocument, paths: ScenePaths | None) -> Model:
    if (given.robot is None) == (given.urdf is None):
        raise ArgumentError("wanted either robot (a name or a file) or urdf (its text)")
    if given.urdf is not None:
        return read_model(
            given.urdf,
            "<string>",
            given.name,
            base=given.base,
            lock=given.lock or None,
            package_dirs=(paths or ScenePaths(None)).folders(given.mesh_folders),
        )
    assert given.robot is not None
    if paths is None:
        raise ArgumentError(
            "robot is a name or a file, which a document from elsewhere may not name; wanted urdf"
        )
    robot = given.robot
    file, _ = split_arguments(robot)
    if _is_file(file):
        robot = paths.find(file, "robot") + robot.removeprefix(file)
    return load(
        robot,
        base=given.base,
        lock=given.lock or None,
        package_dirs=paths.package_dirs,
    )


def _is_file(robot: str) -> bool:
    """Check whether the robot of a scene is a file rather than a name."""
    return "/" in robot or os.sep in robot or robot.endswith((".urdf", ".xacro", ".xml"))


def _coordinates(
    name: str, given: list[float] | dict[str, float] | None, model: Model, size: int
) -> tuple[float, ...] | None:
    """Return all coordinates of a list, or of positions or velocities by joint."""
    if given is None:
        return None
    if isinstance(given, list):
        return tuple(given)
    numbers = model.neutral() if name == "q" else np.zeros(size)
    for joint, value in given.items():
        numbers[model.coordinate_index(joint) + size - model.nv] = value
    return tuple(numbers.tolist())


def _motor(k: int, given: MotorDocument) -> Motor:
    kind = MOTORS[given.kind]
    values = {each.name: getattr(given, each.name) for each in fields(given) if each.name != "kind"}
    values = {name: value for name, value in values.items() if value is not None}
    wanted = {each.name: each for each in fields(kind)}
    for name in values:
        if name not in wanted:
            raise ArgumentError(
                f"motors[{k}] of kind {given.kind!r} has no {name}; it has {', '.join(wanted)}"
            )
    for name, each in wanted.items():
        if each.default is MISSING and name not in values:
            raise ArgumentError(f"motors[{k}] of kind {given.kind!r} lacks {name}")
    return kind(**values)


# -- bodies ---------------------------------------------------------------------------------------


def _body(given: BodyDocument, paths: ScenePaths) -> SceneBody:
    if (given.shape is None) == (not given.shapes):
        raise ArgumentError("wanted either shape or shapes")
    shapes = given.shapes if given.shape is None else [given.shape]
    return SceneBody(
        given.name,
        tuple(_shape(each, paths) for each in shapes),
        _pose("pose", given.pose) or IDENTITY,
        given.mass,
        given.inertia,
        given.center_of_mass,
        (0.0,) * 6 if given.twist is None else given.twist,
        _material(given.material),
    )


def _shape(given: ShapeDocument, paths: ScenePaths) -> Collision:
    kinds = ("box", "sphere", "cylinder", "capsule", "plane", "mesh", "heights")
    present = [name for name in kinds if getattr(given, name) is not None]
    if len(present) != 1:
        found = f"it has {' and '.join(present)}" if present else "it has none"
        raise ArgumentError(f"a shape has one of {', '.join(kinds)}; {found}")
    for name, owner in (("scale", "mesh"), ("size", "heights")):
        if getattr(given, name) is not None and present != [owner]:
            raise ArgumentError(f"{name} belongs to {owner}, not to {present[0]}")
    return Collision(_solid(given, paths), _pose("pose of a shape", given.pose) or IDENTITY)


def _solid(given: ShapeDocument, paths: ScenePaths) -> Shape:
    if given.box is not None:
        return Box(finite_vector("size of a box", given.box))
    if given.sphere is not None:
        return Sphere(given.sphere)
    for name, kind in (("cylinder", Cylinder), ("capsule", Capsule)):
        numbers = getattr(given, name)
        if numbers is not None:
            if len(numbers) != 2:
                raise ArgumentError(f"{name} is {shown(numbers)}; wanted radius and length")
            return kind(*numbers)
    if given.heights is not None:
        if given.size is None:
            raise ArgumentError("heights has no size; wanted the extent of the grid along x and y")
        x, y = finite_numbers("size of a height field", given.size, 2)
        return HeightField(tuple(map(tuple, given.heights)), (x, y))
    if given.mesh is not None:
        scale = (1.0, 1.0, 1.0) if given.scale is None else finite_vector("scale of a mesh", given.scale)
        return Mesh(paths.find(given.mesh, "mesh"), scale)
    return Plane()


# -- parts ----------------------------------------------------------------------------------------


def _constraint(given: ConstraintDocument) -> Constraint:
    points = {name: getattr(given, name) for name in ("point_a", "point_b")}
    if given.kind == "weld":
        for name, point in points.items():
            if point is not None:
                raise ArgumentError(f"a weld has no {name}; wanted pose, that of the frame of b in that of a")
        return Weld(given.a, given.b, _pose("pose", given.pose))
    if given.pose is not None:
        raise ArgumentError("a point-to-point constraint has no pose; wanted point_a and point_b")
    return PointToPoint(given.a, given.b, **{name: point or ZERO for name, point in points.items()})


def _material(given: MaterialDocument | None) -> Material:
    if given is None:
        return DEFAULT_MATERIAL
    return Material(**{each.name: getattr(given, each.name) for each in fields(given)})


def _pose(name: str, numbers: list[float] | None) -> Pose | None:
    """Return the pose of 3, 6 or 7 numbers; see `document_types`."""
    if numbers is None:
        return None
    entries = finite_numbers(name, numbers, len(numbers))
    if len(entries) == 7:
        quat = np.array(entries[3:])
        if abs(float(np.linalg.norm(quat)) - 1.0) > QUATERNION_TOLERANCE:
            raise ArgumentError(f"{name} has the quaternion {list(entries[3:])}; wanted one of norm 1")
        R = rotation_from_quat(quat / np.linalg.norm(quat))
        return Pose.from_matrix(homogeneous(R, np.array(entries[:3])), name)
    if len(entries) not in (3, 6):
        raise ArgumentError(f"{name} has {len(entries)} numbers; wanted 3, 6 or 7")
    return Pose(finite_vector(name, entries[:3]), finite_vector(name, entries[3:] or ZERO))
