"""Classes that documents name by an earlier module or name, and where they are now."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

MODULES = {
    "dynx.control.dynamics": "dynx.backends.dynamics",
    "dynx.control.discrete_computed_torque": "dynx.control.computed_torque",
    "dynx.control.engine_motors": "dynx.control.bullet",
    "dynx.control.feed_forward": "dynx.control.joint_space",
    "dynx.control.friction_compensation": "dynx.control.friction",
    "dynx.control.gravity_compensation": "dynx.control.joint_space",
    "dynx.control.impedance": "dynx.control.task_space",
    "dynx.control.operational_space": "dynx.control.task_space",
    "dynx.control.pd": "dynx.control.joint_space",
    "dynx.control.pid": "dynx.control.joint_space",
    "dynx.control.velocity": "dynx.control.joint_space",
    "dynx.sim.clock": "dynx.steppers.clock",
    "dynx.sim.loop.noise": "dynx.sim.noise",
    "dynx.sim.plants.model_error": "dynx.rbd.parameters",
    "dynx.trajectory.cycloidal": "dynx.trajectory.rest_to_rest",
    "dynx.trajectory.excitation": "dynx.trajectory.identification",
    "dynx.trajectory.line": "dynx.trajectory.straight_line",
    "dynx.trajectory.polynomials": "dynx.trajectory.rest_to_rest",
    "dynx.trajectory.time_scaling": "dynx.trajectory.curve",
    "dynx.world.camera.view": "dynx.steppers.camera",
    "dynx.world.layout": "dynx.steppers.layout",
    "dynx.world.scene.constraints": "dynx.world.scene.bodies",
    "dynx.world.scene.material": "dynx.steppers.material",
    "dynx.world.settings": "dynx.steppers.settings",
    "dynx.world.state": "dynx.steppers.state",
}
"""Modules that moved with all their classes."""

CLASSES = {
    "dynx.control.bullet:EngineMotor": "dynx.control.bullet:BulletMotor",
    "dynx.control.bullet:MotorCommand": "dynx.engines.pybullet.motors:BulletMotorCommand",
    "dynx.control.bullet:PDMotor": "dynx.control.bullet:BulletPDMotor",
    "dynx.control.bullet:PositionMotor": "dynx.control.bullet:BulletPositionMotor",
    "dynx.control.bullet:TorqueMotor": "dynx.control.bullet:BulletTorqueMotor",
    "dynx.control.bullet:VelocityMotor": "dynx.control.bullet:BulletVelocityMotor",
    "dynx.control.friction:JointFriction": "dynx.backends.joint_friction:JointFriction",
    "dynx.sim.plants.disturbances:Push": "dynx.steppers.forces:ExternalForce",
}
"""Classes by module and name, the module being the present one."""


FIELDS = {"dynx.sim.plants.disturbances:Push": {"frame": "on"}}
"""Fields that were renamed, by the earlier name of their class."""

ABSENT: dict[str, dict[str, object]] = {
    "dynx.control.observers.momentum_observer:MomentumObserver": {
        "joint_damping": False,
        "joint_friction": False,
        "joint_armature": False,
    }
}
"""Values of fields that earlier documents of a class do not have, where they are not the default."""


def present_name(name: str) -> str:
    """Return the present ``module:Class`` of a class that a document names."""
    module, colon, kind = name.partition(":")
    name = MODULES.get(module, module) + colon + kind
    return CLASSES.get(name, name)


def present_fields(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a class that a document names, with their present names, and those that it had
    without saying so."""
    renamed, absent = FIELDS.get(name, {}), ABSENT.get(name, {})
    return {**absent, **{renamed.get(field, field): value for field, value in given.items()}}
