"""`Scene`: a frozen description of a world, and its parts, which `dynx.world` exports."""

from typing import TYPE_CHECKING

from dynx.registry import moved_names

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    _PARTS = "Material PointToPoint Scene SceneBody SceneRobot Weld body_to_urdf box capsule contact_material"
    _PARTS += " cylinder ellipsoid ground mesh read_scene scene_names scene_to_mjcf sphere write_scene"
    __getattr__ = moved_names(__name__, {name: f"dynx.world.{name}" for name in _PARTS.split()})
