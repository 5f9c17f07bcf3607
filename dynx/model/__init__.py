"""Robot description: immutable model, URDF reader and writer, library of robots, configuration arithmetic."""

from dynx.model.elements import (
    Frame,
    Inertial,
    Joint,
    JointDynamics,
    Limits,
    Link,
    Mimic,
    Note,
    Pose,
)
from dynx.model.mechanism import Mechanism, build_mechanism
from dynx.model.model import Model

__all__ = [
    "Frame",
    "Inertial",
    "Joint",
    "JointDynamics",
    "Limits",
    "Link",
    "Mechanism",
    "Mimic",
    "Model",
    "Note",
    "Pose",
    "build_mechanism",
]
