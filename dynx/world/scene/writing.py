"""A scene as a document of text and numbers, complete but for the files of its meshes."""

from __future__ import annotations

import os
from dataclasses import fields
from typing import Any

from dynx.errors import ArgumentError
from dynx.model import Model, Pose
from dynx.model.documents import pose_numbers
from dynx.model.elements import IDENTITY
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, HeightField, Mesh, Plane, Sphere, Visual
from dynx.steppers.material import DEFAULT_MATERIAL, Material
from dynx.world.motors import Motor
from dynx.world.scene.bodies import SceneBody
from dynx.world.scene.constraints import Constraint, Weld
from dynx.world.scene.paths import ScenePaths
from dynx.world.scene.reading import MOTORS, SCHEMA
from dynx.world.scene.robots import SceneRobot
from dynx.world.scene.scene import Scene

_MOTOR_KINDS = {kind: name for name, kind in MOTORS.items()}


def scene_document(scene: Scene, paths: ScenePaths | None = None) -> dict[str, Any]:
    """Return the document of a scene, from which `scene_from_document` makes an equal one.

    Robots are written as URDF text, with the full paths of their meshes; meshes of bodies as `paths` writes
    them. Raises DescriptionError for a
    collision shape with a fault in the description of a robot.
    """
    parts = {
        "robots": [_robot(each) for each in scene.robots],
        "bodies": [_body(each, paths or ScenePaths(None)) for each in scene.bodies],
        "constraints": [_constraint(each) for each in scene.constraints],
        "ignored": [list(pair) for pair in scene.ignored],
        "groups": {name: list(members) for name, members in scene.groups},
    }
    head = {"schema": SCHEMA, "name": scene.name, "gravity": list(scene.gravity)}
    return {**head, **{name: part for name, part in parts.items() if part}}


def _robot(robot: SceneRobot) -> dict[str, Any]:
    model = robot.model
    document: dict[str, Any] = {
        "name": robot.name,
        "urdf": model.to_urdf(geometry=True),
        "base": model.base,
        "q": list(robot.q or ()),
        "v": list(robot.v or ()),
    }
    folders = _mesh_folders(model)
    if folders:
        document["mesh_folders"] = folders
    if model.base_pose != IDENTITY:
        document["pose"] = pose_numbers(model.base_pose)
    if robot.self_collision:
        document["self_collision"] = True
    if robot.material != DEFAULT_MATERIAL:
        document["material"] = _material(robot.material)
    if robot.materials:
        document["materials"] = {link: _material(each) for link, each in robot.materials}
    if robot.motors:
        document["motors"] = [_motor(each) for each in robot.motors]
    return document


def _mesh_folders(model: Model) -> list[str]:
    """Return the folders of the meshes that were found."""
    placed: list[Visual | Collision] = []
    for link in model.geometry.links.values():
        placed += [*link.visuals, *link.collisions]
    meshes = [each.shape for each in placed if isinstance(each.shape, Mesh)]
    return sorted({os.path.dirname(mesh.file) for mesh in meshes if mesh.fault is None})


def _motor(motor: Motor) -> dict[str, Any]:
    if type(motor) not in _MOTOR_KINDS:
        raise ArgumentError(f"a {type(motor).__name__} cannot be written to a file of a scene")
    given = {each.name: getattr(motor, each.name) for each in fields(motor)}
    listed = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in given.items()
        if value is not None
    }
    return {"kind": _MOTOR_KINDS[type(motor)], **listed}


def _body(body: SceneBody, paths: ScenePaths) -> dict[str, Any]:
    document: dict[str, Any] = {"name": body.name}
    if len(body.shapes) == 1:
        document["shape"] = _shape(body.shapes[0], paths)
    else:
        document["shapes"] = [_shape(each, paths) for each in body.shapes]
    if body.pose != IDENTITY:
        document["pose"] = pose_numbers(body.pose)
    for name in ("mass", "center_of_mass"):
        value = getattr(body, name)
        if value is not None:
            document[name] = list(value) if isinstance(value, tuple) else value
    if body.inertia is not None:
        document["inertia"] = [list(row) for row in body.inertia]
    if any(body.twist):
        document["twist"] = list(body.twist)
    if body.material != DEFAULT_MATERIAL:
        document["material"] = _material(body.material)
    return document


def _shape(placed: Collision, paths: ScenePaths) -> dict[str, Any]:
    document = _size(placed, paths)
    if placed.origin != IDENTITY:
        document["pose"] = pose_numbers(placed.origin)
    return document


def _size(placed: Collision, paths: ScenePaths) -> dict[str, Any]:
    shape = placed.shape
    if isinstance(shape, Box):
        return {"box": list(shape.size)}
    if isinstance(shape, Sphere):
        return {"sphere": shape.radius}
    if isinstance(shape, Cylinder):
        return {"cylinder": [shape.radius, shape.length]}
    if isinstance(shape, Capsule):
        return {"capsule": [shape.radius, shape.length]}
    if isinstance(shape, HeightField):
        return {"heights": [list(row) for row in shape.heights], "size": list(shape.size)}
    if isinstance(shape, Mesh):
        return {"mesh": paths.write(shape.file), "scale": list(shape.scale)}
    assert isinstance(shape, Plane)
    return {"plane": True}


def _constraint(constraint: Constraint) -> dict[str, Any]:
    ends: dict[str, Any] = {"a": constraint.a, "b": constraint.b}
    if isinstance(constraint, Weld):
        pose: Pose | None = constraint.T_a_b
        return {"kind": "weld", **ends, **({} if pose is None else {"pose": pose_numbers(pose)})}
    points = {"point_a": list(constraint.point_a), "point_b": list(constraint.point_b)}
    return {"kind": "point", **ends, **points}


def _material(material: Material) -> dict[str, Any]:
    found = {each.name: getattr(material, each.name) for each in fields(material)}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in found.items()}
