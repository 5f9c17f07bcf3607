"""Scenes of robots and bodies, and worlds in which they move and touch, on every engine alike."""

from dynx.world.contacts import ClosestPoints, Contact, RayHits
from dynx.world.loads import Wrench
from dynx.world.motors import Motor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
from dynx.world.registry import register as register_world
from dynx.world.registry import unregister as unregister_world
from dynx.world.registry import world_names
from dynx.world.scene import Material, PointToPoint, Scene, SceneBody, SceneRobot, Weld, box, ground, sphere
from dynx.world.snapshot import Snapshot
from dynx.world.state import BodyState, RobotState, WorldState
from dynx.world.world import World

__all__ = [
    "BodyState",
    "ClosestPoints",
    "Contact",
    "Material",
    "Motor",
    "PDMotor",
    "PointToPoint",
    "PositionMotor",
    "RayHits",
    "RobotState",
    "Scene",
    "SceneBody",
    "SceneRobot",
    "Snapshot",
    "TorqueMotor",
    "VelocityMotor",
    "Weld",
    "World",
    "WorldState",
    "Wrench",
    "box",
    "ground",
    "register_world",
    "sphere",
    "unregister_world",
    "world_names",
]
