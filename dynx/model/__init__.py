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
    _PLACES = {"StatedEquality": "equalities", "StatedGravityCompensation": "gravity_compensation"}
    _PLACES |= {"Actuator": "actuators", "NamedConfiguration": "stated_configurations"}
    _PLACES |= {"StatedSensor": "sensors", "StatedTendon": "tendons"}
    __getattr__ = moved_names(__name__, {}, {name: f"dynx.model.{at}" for name, at in _PLACES.items()})
else:
    from dynx.model.actuators import Actuator
    from dynx.model.equalities import StatedEquality
    from dynx.model.gravity_compensation import StatedGravityCompensation
    from dynx.model.sensors import StatedSensor
    from dynx.model.stated_configurations import NamedConfiguration
    from dynx.model.tendons import StatedTendon
