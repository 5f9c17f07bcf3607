"""The robot description: frozen model, URDF reader and writer, names of robots, configurations."""

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
