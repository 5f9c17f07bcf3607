"""`Scene`: a frozen description of a world, and its parts.

Each name is imported when it is first used.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.model.library import scene_names
    from dynx.steppers.material import Material, contact_material
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
    "ellipsoid",
    "ground",
    "mesh",
    "read_scene",
    "scene_names",
    "sphere",
    "write_scene",
]

_HOME = {
    "Material": "dynx.steppers.material",
    "PointToPoint": "dynx.world.scene.bodies",
    "Scene": "dynx.world.scene.scene",
    "SceneBody": "dynx.world.scene.bodies",
    "SceneRobot": "dynx.world.scene.robots",
    "Weld": "dynx.world.scene.bodies",
    "body_to_urdf": "dynx.world.scene.bodies",
    "box": "dynx.world.scene.bodies",
    "capsule": "dynx.world.scene.bodies",
    "contact_material": "dynx.steppers.material",
    "cylinder": "dynx.world.scene.bodies",
    "ellipsoid": "dynx.world.scene.bodies",
    "ground": "dynx.world.scene.bodies",
    "mesh": "dynx.world.scene.bodies",
    "read_scene": "dynx.world.scene.files",
    "scene_names": "dynx.model.library",
    "sphere": "dynx.world.scene.bodies",
    "write_scene": "dynx.world.scene.files",
}

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {"scene_to_mjcf": "dynx.world.scene_to_mjcf"}, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
