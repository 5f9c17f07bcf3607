"""Scenes of robots and bodies, and worlds in which they move and touch, on every engine alike.

Each name is imported when it is first used: a world that moves needs no camera and no distances.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.world.separation import Separation, separation

if TYPE_CHECKING:
    from dynx.model.library import scene_names
    from dynx.steppers.camera import Camera
    from dynx.steppers.forces import ExternalForce
    from dynx.steppers.material import Material, contact_material
    from dynx.steppers.materials import InexactMaterial
    from dynx.steppers.registry import register as register_world
    from dynx.steppers.registry import unregister as unregister_world
    from dynx.steppers.registry import world_names
    from dynx.steppers.state import BodyState, RobotState, WorldState
    from dynx.world.camera import Picture
    from dynx.world.comparison import WorldComparison
    from dynx.world.contacts import ClosestPoints, Contact, MeanContact, RayHits
    from dynx.world.mjcf import scene_to_mjcf
    from dynx.world.motors import Motor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
    from dynx.world.record import Record
    from dynx.world.scene.bodies import (
        PointToPoint,
        SceneBody,
        Weld,
        body_to_urdf,
        box,
        capsule,
        cylinder,
        ellipsoid,
        ground,
        mesh,
        sphere,
    )
    from dynx.world.scene.files import read_scene, write_scene
    from dynx.world.scene.robots import SceneRobot
    from dynx.world.scene.scene import Scene
    from dynx.world.sensors.errors import SensorErrors
    from dynx.world.sensors.kinds import (
        ContactSensor,
        Encoder,
        ForceTorqueSensor,
        Imu,
        JointTorqueSensor,
        RaySensor,
    )
    from dynx.world.sensors.readings import Readings, SensorReading
    from dynx.world.sensors.sensor import Sensor
    from dynx.world.snapshot import Snapshot
    from dynx.world.surroundings import ContactTable, Surroundings
    from dynx.world.world import World

__all__ = [
    "BodyState",
    "Camera",
    "ClosestPoints",
    "Contact",
    "ContactSensor",
    "ContactTable",
    "Encoder",
    "ExternalForce",
    "ForceTorqueSensor",
    "Imu",
    "InexactMaterial",
    "JointTorqueSensor",
    "Material",
    "MeanContact",
    "Motor",
    "PDMotor",
    "Picture",
    "PointToPoint",
    "PositionMotor",
    "RayHits",
    "RaySensor",
    "Readings",
    "Record",
    "RobotState",
    "Scene",
    "SceneBody",
    "SceneRobot",
    "Sensor",
    "SensorErrors",
    "SensorReading",
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
    "ellipsoid",
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

_HOME = {
    "BodyState": "dynx.steppers.state",
    "Camera": "dynx.steppers.camera",
    "ClosestPoints": "dynx.world.contacts",
    "Contact": "dynx.world.contacts",
    "ContactSensor": "dynx.world.sensors.kinds",
    "ContactTable": "dynx.world.surroundings",
    "Encoder": "dynx.world.sensors.kinds",
    "ExternalForce": "dynx.steppers.forces",
    "ForceTorqueSensor": "dynx.world.sensors.kinds",
    "Imu": "dynx.world.sensors.kinds",
    "InexactMaterial": "dynx.steppers.materials",
    "JointTorqueSensor": "dynx.world.sensors.kinds",
    "Material": "dynx.steppers.material",
    "MeanContact": "dynx.world.contacts",
    "Motor": "dynx.world.motors",
    "PDMotor": "dynx.world.motors",
    "Picture": "dynx.world.camera",
    "PointToPoint": "dynx.world.scene.bodies",
    "PositionMotor": "dynx.world.motors",
    "RayHits": "dynx.world.contacts",
    "RaySensor": "dynx.world.sensors.kinds",
    "Readings": "dynx.world.sensors.readings",
    "Record": "dynx.world.record",
    "RobotState": "dynx.steppers.state",
    "Scene": "dynx.world.scene.scene",
    "SceneBody": "dynx.world.scene.bodies",
    "SceneRobot": "dynx.world.scene.robots",
    "Sensor": "dynx.world.sensors.sensor",
    "SensorErrors": "dynx.world.sensors.errors",
    "SensorReading": "dynx.world.sensors.readings",
    "Snapshot": "dynx.world.snapshot",
    "Surroundings": "dynx.world.surroundings",
    "TorqueMotor": "dynx.world.motors",
    "VelocityMotor": "dynx.world.motors",
    "Weld": "dynx.world.scene.bodies",
    "World": "dynx.world.world",
    "WorldComparison": "dynx.world.comparison",
    "WorldState": "dynx.steppers.state",
    "body_to_urdf": "dynx.world.scene.bodies",
    "box": "dynx.world.scene.bodies",
    "capsule": "dynx.world.scene.bodies",
    "contact_material": "dynx.steppers.material",
    "cylinder": "dynx.world.scene.bodies",
    "ellipsoid": "dynx.world.scene.bodies",
    "ground": "dynx.world.scene.bodies",
    "mesh": "dynx.world.scene.bodies",
    "read_scene": "dynx.world.scene.files",
    "register_world": "dynx.steppers.registry:register",
    "scene_names": "dynx.model.library",
    "scene_to_mjcf": "dynx.world.mjcf",
    "sphere": "dynx.world.scene.bodies",
    "unregister_world": "dynx.steppers.registry:unregister",
    "world_names": "dynx.steppers.registry",
    "write_scene": "dynx.world.scene.files",
}

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    _MOVED = {"compare_worlds": "dynx.compare", "Wrench": "dynx.ExternalForce"}
    __getattr__ = moved_names(__name__, _MOVED, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
