"""Robots as engines load them from the file itself, by the call that their users make.

`dynx.backends` gives every engine a model that dynx has read, so that all results agree. Here each engine
reads the file itself, so that differences in reading show. Results are still in the coordinates of dynx:
robots are compared, not conventions.
"""

from typing import TYPE_CHECKING

from dynx.loaded.order import EngineOrder
from dynx.loaded.registry import (
    COMMON_VARIANTS,
    ENGINES,
    VARIANTS,
    engine_of,
    installed_engines,
    load_as,
    loader_class,
)
from dynx.loaded.robot import (
    EngineBase,
    EngineCoordinates,
    LoadedInertial,
    LoadedJoint,
    LoadedModel,
    LoadedRobot,
)
from dynx.registry import moved_names

__all__ = [
    "COMMON_VARIANTS",
    "ENGINES",
    "VARIANTS",
    "EngineBase",
    "EngineCoordinates",
    "EngineOrder",
    "LoadedInertial",
    "LoadedJoint",
    "LoadedModel",
    "LoadedRobot",
    "engine_of",
    "installed_engines",
    "load_as",
    "loader_class",
]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
