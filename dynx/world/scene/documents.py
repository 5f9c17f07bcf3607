"""A scene as a document of text and numbers, complete but for the files of its meshes, and back.

The classes declare the keys and types, from which the JSON Schema is generated. Lengths are in m, angles in
rad, masses in kg. A pose is x, y, z, alone or followed by roll, pitch, yaw or by the quaternion qx, qy, qz,
qw. Keys with a default may be left out. Every error of reading names the place in the document.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, shown
from dynx.files.documents import convert_document
from dynx.model import Model, Pose
from dynx.model.documents import pose_numbers, with_balls_for_hinges, with_hinges_for_balls
from dynx.model.elements import IDENTITY, ZERO
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    HeightField,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Visual,
)
from dynx.model.loading import load, read_model, split_arguments
from dynx.model.numbers import finite_numbers, finite_vector
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.steppers.material import DEFAULT_MATERIAL, Material
from dynx.world.motors import Motor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
from dynx.world.scene.bodies import Constraint, PointToPoint, SceneBody, Weld
from dynx.world.scene.paths import ScenePaths
from dynx.world.scene.robots import SceneRobot
from dynx.world.scene.scene import Scene

if TYPE_CHECKING:
    from dynx.world.sensors.sensor import Sensor

Vector = list[float]
Numbers = float | list[float]

SCHEMA: Literal["dynx.scene/1"] = "dynx.scene/1"
"""Name and version of the layout of a scene's document."""

SensorKind = Literal["force_torque", "imu", "joint_torque", "encoder", "contact", "ray"]

MotorKind = Literal["position", "velocity", "pd", "torque"]

MOTORS: dict[MotorKind, type[Motor]] = {
    "position": PositionMotor,
    "velocity": VelocityMotor,
    "pd": PDMotor,
    "torque": TorqueMotor,
}
"""Classes of motors by their names in a document."""

QUATERNION_TOLERANCE = 1e-6
"""Largest deviation of the norm of a quaternion from 1."""


# -- keys and types --------------------------------------------------------------------------------


@dataclass
class MaterialDocument:
    """A material; see `dynx.world.Material`."""

    friction: float = 0.5
    torsional_friction: float = 0.0
    rolling_friction: float = 0.0
    restitution: float = 0.0
    rgba: Vector = field(default_factory=lambda: [0.7, 0.7, 0.7, 1.0])


@dataclass
class ShapeDocument:
    """One shape; exactly one of the keys before `scale` is given.

    `box` has three edge lengths, `cylinder` and `capsule` radius and length, `ellipsoid` three half axes,
    `mesh` a file beside the scene, scaled by `scale`, `heights` the rows of a height field of the extent
    `size` along x and y. `vertices` are those of a mesh without a file; each of `faces` has the numbers of
    three of them, from 0, and without faces it is their hull. `rgba` is the colour of a visual; without it a
    visual has that of its body.
    """

    box: Vector | None = None
    sphere: float | None = None
    cylinder: Vector | None = None
    capsule: Vector | None = None
    ellipsoid: Vector | None = None
    plane: Literal[True] | None = None
    mesh: str | None = None
    heights: list[Vector] | None = None
    vertices: list[Vector] | None = None
    faces: list[list[int]] | None = None
    scale: Vector | None = None
    size: Vector | None = None
    pose: Vector | None = None
    rgba: Vector | None = None


@dataclass
class MotorDocument:
    """A motor on the joints named, or on all; see `dynx.world.PositionMotor` and its siblings."""

    kind: MotorKind
    target: Numbers | None = None
    velocity: Numbers | None = None
    torque: Numbers | None = None
    kp: Numbers | None = None
    kd: Numbers | None = None
    max_force: Numbers | None = None
    joints: list[str] | None = None


@dataclass
class RobotDocument:
    """A robot: `robot` is the name of one that dynx knows, a file beside the scene, or
    ``package://pybullet_data/FILE``; `urdf` is the text of its description,
    whose meshes are looked for in `mesh_folders`, with hinges in the place of `ball_joints`, which URDF does
    not have.

    `base` replaces that of the description. `q` is a list (nq) or the positions of joints by name; `pose` is
    that of the base, fixed or floating.
    """

    name: str
    robot: str | None = None
    urdf: str | None = None
    mesh_folders: list[str] = field(default_factory=list)
    ball_joints: list[str] = field(default_factory=list)
    base: Literal["fixed", "floating"] | None = None
    pose: Vector | None = None
    lock: dict[str, float] = field(default_factory=dict)
    q: list[float] | dict[str, float] | None = None
    v: list[float] | dict[str, float] | None = None
    self_collision: bool = False
    material: MaterialDocument | None = None
    materials: dict[str, MaterialDocument] = field(default_factory=dict)
    motors: list[MotorDocument] = field(default_factory=list)


@dataclass
class BodyDocument:
    """A body of one shape or several; without `mass` it is fixed in the world.

    It is drawn by its `visuals` where it has some, and otherwise by its shapes.
    """

    name: str
    shape: ShapeDocument | None = None
    shapes: list[ShapeDocument] = field(default_factory=list)
    pose: Vector | None = None
    mass: float | None = None
    inertia: list[Vector] | None = None
    center_of_mass: Vector | None = None
    twist: Vector | None = None
    material: MaterialDocument | None = None
    visuals: list[ShapeDocument] = field(default_factory=list)


@dataclass
class ConstraintDocument:
    """A weld, with the pose of the frame of `b` in that of `a`, or a point-to-point constraint; see
    `dynx.world.Weld`."""

    kind: Literal["weld", "point"]
    a: str
    b: str
    pose: Vector | None = None
    point_a: Vector | None = None
    point_b: Vector | None = None
    name: str = ""
    active: bool = True
    collides: bool = True


@dataclass
class SensorErrorsDocument:
    """Errors of one measured vector; see `dynx.world.SensorErrors`."""

    noise: Numbers = 0.0
    noise_density: Numbers = 0.0
    bias: Numbers = 0.0
    random_walk: Numbers = 0.0
    scale: Numbers = 0.0
    cross_axis: float | list[Vector] = 0.0
    resolution: Numbers = 0.0
    saturation: Numbers | None = None


@dataclass
class SensorDocument:
    """A sensor `on` a part; see `dynx.world.Imu` and its siblings.

    `force`, `torque`, `accelerometer`, `gyroscope`, `position`, `velocity` and `distance` are the errors of
    what it measures.
    """

    kind: SensorKind
    name: str
    on: str
    rate: float | None = None
    delay: float | None = None
    seed: int | None = None
    pose: Vector | None = None
    weight: bool | None = None
    length: float | None = None
    force: SensorErrorsDocument | None = None
    torque: SensorErrorsDocument | None = None
    accelerometer: SensorErrorsDocument | None = None
    gyroscope: SensorErrorsDocument | None = None
    position: SensorErrorsDocument | None = None
    velocity: SensorErrorsDocument | None = None
    distance: SensorErrorsDocument | None = None


@dataclass
class SceneDocument:
    """A scene; see `dynx.world.Scene`."""

    schema: Literal["dynx.scene/1"]
    name: str = "scene"
    gravity: Vector = field(default_factory=lambda: [0.0, 0.0, -9.81])
    robots: list[RobotDocument] = field(default_factory=list)
    bodies: list[BodyDocument] = field(default_factory=list)
    constraints: list[ConstraintDocument] = field(default_factory=list)
    ignored: list[list[str]] = field(default_factory=list)
    groups: dict[str, list[str]] = field(default_factory=dict)
    sensors: list[SensorDocument] = field(default_factory=list)


# -- reading --------------------------------------------------------------------------------------


def scene_from_document(document: object, paths: ScenePaths | None = None) -> Scene:
    """Return the scene of a document.

    Files are looked for by `paths`; without them, robots are given as text only, so that a document from
    elsewhere names no file that is read as a robot. With them a ``.xacro`` file is expanded, which evaluates
    expressions of it as Python code: give them only for a document that you trust. Raises ArgumentError,
    DescriptionError and their kinds, naming the place in the document.
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
    sensors = []
    for k, sensor in enumerate(given.sensors):
        with _place(f"sensors[{k}], {shown(sensor.name)}"):
            sensors.append(_sensor(sensor))
    return Scene(
        given.name,
        tuple(robots),
        tuple(bodies),
        tuple(constraints),
        given.ignored,
        given.groups,
        given.gravity,
        tuple(sensors),
    )


@contextmanager
def _place(place: str) -> Iterator[None]:
    """Name the place in the document in an error."""
    try:
        yield
    except (ArgumentError, DescriptionError, RobotNotFoundError) as error:
        kind = DescriptionError if isinstance(error, DescriptionError) else type(error)
        raise kind(f"{place}: {error}") from error


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
        model = read_model(
            given.urdf,
            "<string>",
            given.name,
            base=given.base,
            lock=given.lock or None,
            package_dirs=(paths or ScenePaths(None)).folders(given.mesh_folders),
        )
        return with_balls_for_hinges(model, given.ball_joints)
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
    return kind(**_arguments(f"motors[{k}]", kind, given))


def _arguments(what: str, kind: type[Any], given: MotorDocument | SensorDocument) -> dict[str, Any]:
    """Return the fields of a document as the arguments of its class, all of which it must have."""
    values = {each.name: getattr(given, each.name) for each in fields(given) if each.name != "kind"}
    values = {name: value for name, value in values.items() if value is not None}
    wanted = {each.name: each for each in fields(kind)}
    for name in values:
        if name not in wanted:
            raise ArgumentError(f"{what} of kind {given.kind!r} has no {name}; it has {', '.join(wanted)}")
    for name, each in wanted.items():
        if each.default is MISSING and name not in values:
            raise ArgumentError(f"{what} of kind {given.kind!r} lacks {name}")
    return values


def sensor_of_document(document: object) -> Sensor:
    """Return the sensor of a document that `document_of_sensor` made; ArgumentError for any other."""
    return _sensor(convert_document(document, SensorDocument))


def _sensor(given: SensorDocument) -> Sensor:
    # Imported here, because most scenes have none.
    from dynx.world.sensors.errors import SensorErrors
    from dynx.world.sensors.kinds import KINDS

    values = _arguments("a sensor", KINDS[given.kind], given)
    for name, value in values.items():
        if isinstance(value, SensorErrorsDocument):
            errors = {each.name: getattr(value, each.name) for each in fields(value)}
            values[name] = SensorErrors(**{key: each for key, each in errors.items() if each is not None})
    if "pose" in values:
        values["pose"] = _pose("pose", values["pose"])
    found: Sensor = KINDS[given.kind](**values)
    return found


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
        tuple(_visual(each, paths) for each in given.visuals),
    )


def _visual(given: ShapeDocument, paths: ScenePaths) -> Visual:
    placed = _shape(replace(given, rgba=None), paths)
    colour = None if given.rgba is None else Appearance(rgba=given.rgba)  # type: ignore[arg-type]
    return Visual(placed.shape, placed.origin, colour)


def _shape(given: ShapeDocument, paths: ScenePaths) -> Collision:
    if given.rgba is not None:
        raise ArgumentError("rgba belongs to visuals; the colour of shapes is that of the material")
    kinds = ("box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "heights", "vertices")
    present = [name for name in kinds if getattr(given, name) is not None]
    if len(present) != 1:
        found = f"it has {' and '.join(present)}" if present else "it has none"
        raise ArgumentError(f"a shape has one of {', '.join(kinds)}; {found}")
    for name, owners in (
        ("scale", ("mesh", "vertices")),
        ("size", ("heights",)),
        ("faces", ("vertices",)),
    ):
        if getattr(given, name) is not None and present[0] not in owners:
            raise ArgumentError(f"{name} belongs to {' and '.join(owners)}, not to {present[0]}")
    return Collision(_solid(given, paths), _pose("pose of a shape", given.pose) or IDENTITY)


def _solid(given: ShapeDocument, paths: ScenePaths) -> Shape:
    if given.box is not None:
        return Box(finite_vector("size of a box", given.box))
    if given.sphere is not None:
        return Sphere(given.sphere)
    if given.ellipsoid is not None:
        return Ellipsoid(finite_vector("radii of an ellipsoid", given.ellipsoid))
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
    scale = (1.0, 1.0, 1.0) if given.scale is None else finite_vector("scale of a mesh", given.scale)
    if given.vertices is not None:
        points = tuple(finite_vector("a vertex of a mesh", each) for each in given.vertices)
        if any(len(each) != 3 for each in given.faces or ()):
            raise ArgumentError("a face of a mesh has not three vertices")
        corners = tuple((a, b, c) for a, b, c in given.faces or ())
        from dynx.model.geometry.stated_mesh import StatedMesh

        return StatedMesh(scale=scale, points=points, corners=corners)
    if given.mesh is not None:
        return Mesh(paths.find(given.mesh, "mesh"), scale)
    return Plane()


def _constraint(given: ConstraintDocument) -> Constraint:
    points = {name: getattr(given, name) for name in ("point_a", "point_b")}
    switches: dict[str, Any] = {name: getattr(given, name) for name in ("name", "active", "collides")}
    if given.kind == "weld":
        for name, point in points.items():
            if point is not None:
                raise ArgumentError(f"a weld has no {name}; wanted pose, that of the frame of b in that of a")
        return Weld(given.a, given.b, _pose("pose", given.pose), **switches)
    if given.pose is not None:
        raise ArgumentError("a point-to-point constraint has no pose; wanted point_a and point_b")
    at_a, at_b = (point or ZERO for point in points.values())
    return PointToPoint(given.a, given.b, at_a, at_b, **switches)


def _material(given: MaterialDocument | None) -> Material:
    if given is None:
        return DEFAULT_MATERIAL
    return Material(**{each.name: getattr(given, each.name) for each in fields(given)})


def _pose(name: str, numbers: list[float] | None) -> Pose | None:
    """Return the pose of 3, 6 or 7 numbers; see the top of this module."""
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


# -- writing --------------------------------------------------------------------------------------

_MOTOR_KINDS = {kind: name for name, kind in MOTORS.items()}


def scene_document(scene: Scene, paths: ScenePaths | None = None) -> dict[str, Any]:
    """Return the document of a scene, from which `scene_from_document` makes an equal one.

    Robots are written as URDF text, with the full paths of their meshes; meshes of bodies as `paths` writes
    them. Raises DescriptionError for a collision shape with a fault in the description of a robot.
    """
    written: dict[str, Any] = _without_defaults(
        SceneDocument(
            SCHEMA,
            scene.name,
            list(scene.gravity),
            [_robot_document(each) for each in scene.robots],
            [_body_document(each, paths or ScenePaths(None)) for each in scene.bodies],
            [_constraint_document(each) for each in scene.constraints],
            [list(pair) for pair in scene.ignored],
            {name: list(members) for name, members in scene.groups},
            [_sensor_document(each) for each in scene.sensors],
        )
    )
    return written


def _without_defaults(part: Any) -> Any:
    """Return a document as dicts and lists, without the keys that have their default."""
    if isinstance(part, list | tuple):
        return [_without_defaults(each) for each in part]
    if isinstance(part, dict):
        return {name: _without_defaults(each) for name, each in part.items()}
    if not is_dataclass(part):
        return part
    found = {each.name: (each, getattr(part, each.name)) for each in fields(part)}
    return {
        name: _without_defaults(value)
        for name, (each, value) in found.items()
        if value != (each.default if each.default_factory is MISSING else each.default_factory())
    }


def _robot_document(robot: SceneRobot) -> RobotDocument:
    model = robot.model
    return RobotDocument(
        robot.name,
        # Base and pose have keys of their own; gravity is stated by the text.
        urdf=replace(with_hinges_for_balls(model), base="fixed", base_pose=IDENTITY).to_urdf(geometry=True),
        ball_joints=[joint.name for joint in model.ball_joints],
        mesh_folders=_mesh_folders(model),
        base="floating" if model.floating else None,
        pose=_pose_document(model.base_pose),
        q=list(robot.q or ()),
        v=list(robot.v or ()),
        self_collision=robot.self_collision,
        material=_material_document(robot.material),
        materials={link: _all_of_material(each) for link, each in robot.materials},
        motors=[_motor_document(each) for each in robot.motors],
    )


def _mesh_folders(model: Model) -> list[str]:
    """Return the folders of the meshes that were found."""
    placed: list[Visual | Collision] = []
    for link in model.geometry.links.values():
        placed += [*link.visuals, *link.collisions]
    meshes = [each.shape for each in placed if isinstance(each.shape, Mesh) and each.shape.file]
    return sorted({os.path.dirname(mesh.file) for mesh in meshes if mesh.fault is None})


def _motor_document(motor: Motor) -> MotorDocument:
    if type(motor) not in _MOTOR_KINDS:
        raise ArgumentError(f"a {type(motor).__name__} cannot be written to a file of a scene")
    given: dict[str, Any] = {each.name: getattr(motor, each.name) for each in fields(motor)}
    return MotorDocument(_MOTOR_KINDS[type(motor)], **given)


def document_of_sensor(sensor: Sensor) -> dict[str, Any]:
    """Return the document of a sensor, from which `sensor_of_document` makes an equal one."""
    written: dict[str, Any] = _without_defaults(_sensor_document(sensor))
    return written


def _sensor_document(sensor: Sensor) -> SensorDocument:
    given: dict[str, Any] = {}
    for each in fields(sensor):
        value = getattr(sensor, each.name)
        if value == each.default:
            continue
        given[each.name] = _pose_document(value) if isinstance(value, Pose) else value
        if each.name in {channel.errors for channel in sensor.channels}:
            errors = {part.name: getattr(value, part.name) for part in fields(value)}
            given[each.name] = SensorErrorsDocument(
                **{
                    name: number
                    for name, number in errors.items()
                    if not (name == "saturation" and np.all(np.isinf(number)))
                }
            )
    return SensorDocument(cast(SensorKind, sensor.kind), **given)


def _body_document(body: SceneBody, paths: ScenePaths) -> BodyDocument:
    shapes = [_shape_document(each, paths) for each in body.shapes]
    single = len(shapes) == 1
    return BodyDocument(
        body.name,
        shapes[0] if single else None,
        [] if single else shapes,
        _pose_document(body.pose),
        body.mass,
        None if body.inertia is None else [list(row) for row in body.inertia],
        None if body.center_of_mass is None else list(body.center_of_mass),
        list(body.twist) if any(body.twist) else None,
        _material_document(body.material),
        [_visual_document(each, paths) for each in body.visuals],
    )


def _visual_document(visual: Visual, paths: ScenePaths) -> ShapeDocument:
    rgba = None if visual.material is None else visual.material.rgba
    document = _shape_document(Collision(visual.shape, visual.origin), paths)
    return replace(document, rgba=None if rgba is None else list(rgba))


def _shape_document(placed: Collision, paths: ScenePaths) -> ShapeDocument:
    shape, pose = placed.shape, _pose_document(placed.origin)
    if isinstance(shape, Box):
        return ShapeDocument(box=list(shape.size), pose=pose)
    if isinstance(shape, Sphere):
        return ShapeDocument(sphere=shape.radius, pose=pose)
    if isinstance(shape, Cylinder):
        return ShapeDocument(cylinder=[shape.radius, shape.length], pose=pose)
    if isinstance(shape, Capsule):
        return ShapeDocument(capsule=[shape.radius, shape.length], pose=pose)
    if isinstance(shape, Ellipsoid):
        return ShapeDocument(ellipsoid=list(shape.radii), pose=pose)
    if isinstance(shape, HeightField):
        heights = [list(row) for row in shape.heights]
        return ShapeDocument(heights=heights, size=list(shape.size), pose=pose)
    if isinstance(shape, Mesh) and not shape.file:
        from dynx.model.geometry.stated_mesh import StatedMesh

        assert isinstance(shape, StatedMesh)
        return ShapeDocument(
            vertices=[list(each) for each in shape.points],
            faces=[list(each) for each in shape.corners] or None,
            scale=list(shape.scale),
            pose=pose,
        )
    if isinstance(shape, Mesh):
        return ShapeDocument(mesh=paths.write(shape.file), scale=list(shape.scale), pose=pose)
    assert isinstance(shape, Plane)
    return ShapeDocument(plane=True, pose=pose)


def _constraint_document(constraint: Constraint) -> ConstraintDocument:
    found = ConstraintDocument("weld", constraint.a, constraint.b)
    for name in ("name", "active", "collides"):
        setattr(found, name, getattr(constraint, name))
    if isinstance(constraint, Weld):
        found.pose = None if constraint.T_a_b is None else pose_numbers(constraint.T_a_b)
        return found
    found.kind = "point"
    found.point_a, found.point_b = list(constraint.point_a), list(constraint.point_b)
    return found


def _material_document(material: Material) -> MaterialDocument | None:
    return None if material == DEFAULT_MATERIAL else _all_of_material(material)


def _all_of_material(material: Material) -> MaterialDocument:
    given: dict[str, Any] = {each.name: getattr(material, each.name) for each in fields(material)}
    return MaterialDocument(**given)


def _pose_document(pose: Pose) -> list[float] | None:
    return None if pose == IDENTITY else pose_numbers(pose)
