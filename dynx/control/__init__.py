"""Controllers, one per file: frozen dataclasses with a torque of measurement, setpoint and state."""

from dynx.control.base import Controller, Measurement, ModelBased
from dynx.control.computed_torque import ComputedTorque
from dynx.control.discrete_computed_torque import DiscreteComputedTorque
from dynx.control.engine_motors import EngineMotor, PDMotor, PositionMotor, TorqueMotor, VelocityMotor
from dynx.control.feed_forward import FeedForward
from dynx.control.friction import JointFriction
from dynx.control.friction_compensation import FrictionCompensation
from dynx.control.gravity_compensation import GravityCompensatedPD
from dynx.control.impedance import Impedance
from dynx.control.open_loop import OpenLoop
from dynx.control.operational_space import OperationalSpace
from dynx.control.pd import PD
from dynx.control.pid import PID
from dynx.control.saturation import Saturated
from dynx.control.velocity import Velocity

__all__ = [
    "PD",
    "PID",
    "ComputedTorque",
    "Controller",
    "DiscreteComputedTorque",
    "EngineMotor",
    "FeedForward",
    "FrictionCompensation",
    "GravityCompensatedPD",
    "Impedance",
    "JointFriction",
    "Measurement",
    "ModelBased",
    "OpenLoop",
    "OperationalSpace",
    "PDMotor",
    "PositionMotor",
    "Saturated",
    "TorqueMotor",
    "Velocity",
    "VelocityMotor",
]
