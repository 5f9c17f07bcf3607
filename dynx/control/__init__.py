"""Controllers: frozen dataclasses that compute torques from measurement, setpoint, state.

Each name is imported when it is first used.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names

if TYPE_CHECKING:
    from dynx.backends.joint_friction import JointFriction
    from dynx.control.base import Controller, Measurement, ModelBased, model_dynamics
    from dynx.control.bullet import (
        BulletMotor,
        BulletPDMotor,
        BulletPositionMotor,
        BulletTorqueMotor,
        BulletVelocityMotor,
    )
    from dynx.control.computed_torque import ComputedTorque, DiscreteComputedTorque
    from dynx.control.friction import FrictionCompensation
    from dynx.control.joint_space import PD, PID, FeedForward, GravityCompensatedPD, Velocity
    from dynx.control.motors_and_encoders import Encoders, MotorLag
    from dynx.control.observers.momentum_observer import MomentumObserver
    from dynx.control.observers.tool import SensorMotion, Tool, identify_tool
    from dynx.control.observers.wrench_estimate import WrenchEstimate
    from dynx.control.open_loop import OpenLoop
    from dynx.control.registry import from_document as controller_from_document
    from dynx.control.registry import register as register_controller
    from dynx.control.registry import to_document as controller_to_document
    from dynx.control.registry import unregister as unregister_controller
    from dynx.control.saturation import Saturated
    from dynx.control.task_space import Impedance, OperationalSpace

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
    "MomentumObserver",
    "MotorLag",
    "OpenLoop",
    "OperationalSpace",
    "Saturated",
    "SensorMotion",
    "Tool",
    "Velocity",
    "WrenchEstimate",
    "controller_from_document",
    "controller_to_document",
    "identify_tool",
    "model_dynamics",
    "register_controller",
    "unregister_controller",
]

_HOME = {
    "BulletMotor": "dynx.control.bullet",
    "BulletPDMotor": "dynx.control.bullet",
    "BulletPositionMotor": "dynx.control.bullet",
    "BulletTorqueMotor": "dynx.control.bullet",
    "BulletVelocityMotor": "dynx.control.bullet",
    "ComputedTorque": "dynx.control.computed_torque",
    "Controller": "dynx.control.base",
    "DiscreteComputedTorque": "dynx.control.computed_torque",
    "Encoders": "dynx.control.motors_and_encoders",
    "FeedForward": "dynx.control.joint_space",
    "FrictionCompensation": "dynx.control.friction",
    "GravityCompensatedPD": "dynx.control.joint_space",
    "Impedance": "dynx.control.task_space",
    "JointFriction": "dynx.backends.joint_friction",
    "Measurement": "dynx.control.base",
    "ModelBased": "dynx.control.base",
    "MomentumObserver": "dynx.control.observers.momentum_observer",
    "MotorLag": "dynx.control.motors_and_encoders",
    "OpenLoop": "dynx.control.open_loop",
    "OperationalSpace": "dynx.control.task_space",
    "PD": "dynx.control.joint_space",
    "PID": "dynx.control.joint_space",
    "Saturated": "dynx.control.saturation",
    "Velocity": "dynx.control.joint_space",
    "SensorMotion": "dynx.control.observers.tool",
    "Tool": "dynx.control.observers.tool",
    "identify_tool": "dynx.control.observers.tool",
    "WrenchEstimate": "dynx.control.observers.wrench_estimate",
    "controller_from_document": "dynx.control.registry:from_document",
    "controller_to_document": "dynx.control.registry:to_document",
    "model_dynamics": "dynx.control.base",
    "register_controller": "dynx.control.registry:register",
    "unregister_controller": "dynx.control.registry:unregister",
}

# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:
    _MOVED = {
        "EngineMotor": "dynx.control.BulletMotor",
        **{
            name: f"dynx.control.Bullet{name} (the motor of any engine is dynx.world.{name})"
            for name in ("PDMotor", "PositionMotor", "TorqueMotor", "VelocityMotor")
        },
    }
    __getattr__ = moved_names(__name__, _MOVED, _HOME)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
