"""Robots as engines load them from the file itself, by the call that their users make.

`dynx.backends` hands every engine a model that dynx has read, so that all give one answer. Here each
engine reads the file, so that its own reading shows. Answers are in the coordinates of dynx all the
same: what is compared is the robot, not conventions.
"""

from dynx.loaded.description import LoadedInertial, LoadedJoint, LoadedModel
from dynx.loaded.registry import ENGINES, installed_engines, load_as, loader_class
from dynx.loaded.robot import LoadedRobot

__all__ = [
    "ENGINES",
    "LoadedInertial",
    "LoadedJoint",
    "LoadedModel",
    "LoadedRobot",
    "installed_engines",
    "load_as",
    "loader_class",
]
