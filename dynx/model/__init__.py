"""Robot description: immutable model, URDF reader and writer, library of robots, configuration arithmetic."""

from typing import TYPE_CHECKING

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
from dynx.registry import moved_names

__all__ = [
    "Actuator",
    "Frame",
    "Inertial",
    "Joint",
    "JointDynamics",
    "Limits",
    "Link",
    "Mechanism",
    "Mimic",
    "Model",
    "NamedConfiguration",
    "Note",
    "Pose",
    "StatedEquality",
    "StatedGravityCompensation",
    "StatedSensor",
    "StatedTendon",
    "build_mechanism",
]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    _STATED = [name for name in __all__ if name.startswith("Stated")]
    _STATED += ["Actuator", "NamedConfiguration"]
    __getattr__ = moved_names(__name__, {}, dict.fromkeys(_STATED, "dynx.model.stated_parts"))
else:
    from dynx.model.stated_parts import (
        Actuator,
        NamedConfiguration,
        StatedEquality,
        StatedGravityCompensation,
        StatedSensor,
        StatedTendon,
    )
