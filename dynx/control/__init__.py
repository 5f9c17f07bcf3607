"""Controllers, one per file: frozen dataclasses that compute torques from measurement, setpoint, state."""

from typing import TYPE_CHECKING, Any

from dynx.control.base import Controller, Measurement, ModelBased, model_dynamics
from dynx.control.bullet import (
    BulletMotor,
    BulletPDMotor,
    BulletPositionMotor,
    BulletTorqueMotor,
    BulletVelocityMotor,
)
from dynx.control.computed_torque import ComputedTorque
from dynx.control.discrete_computed_torque import DiscreteComputedTorque
from dynx.control.feed_forward import FeedForward
from dynx.control.friction import JointFriction
from dynx.control.friction_compensation import FrictionCompensation
from dynx.control.gravity_compensation import GravityCompensatedPD
from dynx.control.impedance import Impedance
from dynx.control.motors_and_encoders import Encoders, MotorLag
from dynx.control.open_loop import OpenLoop
from dynx.control.operational_space import OperationalSpace
from dynx.control.pd import PD
from dynx.control.pid import PID
from dynx.control.registry import from_document as controller_from_document
from dynx.control.registry import register as register_controller
from dynx.control.registry import to_document as controller_to_document
from dynx.control.registry import unregister as unregister_controller
from dynx.control.saturation import Saturated
from dynx.control.velocity import Velocity

__all__ = [
    "PD",
    "PID",
    "BulletMotor",
    "BulletPDMotor",
    "BulletPositionMotor",
    "BulletTorqueMotor",
    "BulletVelocityMotor",
    "ComputedTorque",
    "Controller",
    "DiscreteComputedTorque",
    "Encoders",
    "FeedForward",
    "FrictionCompensation",
    "GravityCompensatedPD",
    "Impedance",
    "JointFriction",
    "Measurement",
    "ModelBased",
    "MotorLag",
    "OpenLoop",
    "OperationalSpace",
    "Saturated",
    "Velocity",
    "controller_from_document",
    "controller_to_document",
    "model_dynamics",
    "register_controller",
    "unregister_controller",
]

_FORMER_NAMES = {
    "EngineMotor": "BulletMotor",
    "PDMotor": "BulletPDMotor",
    "PositionMotor": "BulletPositionMotor",
    "TorqueMotor": "BulletTorqueMotor",
    "VelocityMotor": "BulletVelocityMotor",
}

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _FORMER_NAMES:
            also = "" if name == "EngineMotor" else f" (the motor of any engine is dynx.world.{name})"
            raise AttributeError(f"dynx.control.{name} is now dynx.control.{_FORMER_NAMES[name]}{also}")
        raise AttributeError(f"module 'dynx.control' has no attribute {name!r}")
