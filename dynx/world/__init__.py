"""Scenes: robots, bodies, materials, constraints and collision filters, for every engine alike."""

from dynx.world.scene import Material, PointToPoint, Scene, SceneBody, SceneRobot, Weld, box, ground, sphere

__all__ = [
    "Material",
    "PointToPoint",
    "Scene",
    "SceneBody",
    "SceneRobot",
    "Weld",
    "box",
    "ground",
    "sphere",
]
