"""Scenes of robots and bodies, and worlds in which they move and touch, on every engine alike."""

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.steppers.forces import ExternalForce
from dynx.steppers.materials import InexactMaterial
from dynx.steppers.registry import register as register_world
from dynx.steppers.registry import unregister as unregister_world
from dynx.steppers.registry import world_names
from dynx.steppers.state import BodyState, RobotState, WorldState
from dynx.world.camera import Camera, Picture
from dynx.world.comparison import WorldComparison
from dynx.world.contacts import ClosestPoints, Contact, RayHits
from dynx.world.motors import Motor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
from dynx.world.record import Record
from dynx.world.scene import (
    Material,
    PointToPoint,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    body_to_urdf,
    box,
    capsule,
    contact_material,
    cylinder,
    ground,
    mesh,
    read_scene,
    scene_names,
    scene_to_mjcf,
    sphere,
    write_scene,
)
from dynx.world.separation import Separation, separation
from dynx.world.snapshot import Snapshot
from dynx.world.surroundings import ContactTable, Surroundings
from dynx.world.world import World

__all__ = [
    "BodyState",
    "Camera",
    "ClosestPoints",
    "Contact",
    "ContactTable",
    "ExternalForce",
    "InexactMaterial",
    "Material",
    "Motor",
    "PDMotor",
    "Picture",
    "PointToPoint",
    "PositionMotor",
    "RayHits",
    "Record",
    "RobotState",
    "Scene",
    "SceneBody",
    "SceneRobot",
    "Separation",
    "Snapshot",
    "Surroundings",
    "TorqueMotor",
    "VelocityMotor",
    "Weld",
    "World",
    "WorldComparison",
    "WorldState",
    "body_to_urdf",
    "box",
    "capsule",
    "contact_material",
    "cylinder",
    "ground",
    "mesh",
    "read_scene",
    "register_world",
    "scene_names",
    "scene_to_mjcf",
    "separation",
    "sphere",
    "unregister_world",
    "world_names",
    "write_scene",
]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {"compare_worlds": "dynx.compare", "Wrench": "dynx.ExternalForce"})
