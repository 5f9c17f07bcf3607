"""`Scene`: a frozen description of a world, and its parts."""

from dynx.model.library import scene_names
from dynx.steppers.material import Material, contact_material
from dynx.world.scene.bodies import SceneBody, body_to_urdf, box, capsule, cylinder, ground, mesh, sphere
from dynx.world.scene.constraints import PointToPoint, Weld
from dynx.world.scene.files import read_scene, write_scene
from dynx.world.scene.mjcf import scene_to_mjcf
from dynx.world.scene.robots import SceneRobot
from dynx.world.scene.scene import Scene

__all__ = [
    "Material",
    "PointToPoint",
    "Scene",
    "SceneBody",
    "SceneRobot",
    "Weld",
    "body_to_urdf",
    "box",
    "capsule",
    "contact_material",
    "cylinder",
    "ground",
    "mesh",
    "read_scene",
    "scene_names",
    "scene_to_mjcf",
    "sphere",
    "write_scene",
]
