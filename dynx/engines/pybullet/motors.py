"""Commands to the motors inside PyBullet, as data: importing this module imports no engine.

The motors are constraints of PyBullet's solver, which determines their torque during the step.
`dynx.control.bullet` has controllers that return such commands.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from dynx.errors import ArgumentError, ShapeError, UnsupportedFeatureError, shown
from dynx.model.model import Model
from dynx.model.numbers import checked_array
from dynx.steppers.forces import EngineCommand

MODES = ("POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "PD_CONTROL")
"""Control modes of Bullet for a joint's motor."""

_BULLET_NAMES = {
    "positions": "targetPositions",
    "velocities": "targetVelocities",
    "forces": "forces",
    "position_gains": "positionGains",
    "velocity_gains": "velocityGains",
}


@dataclass(frozen=True)
class BulletMotorCommand(EngineCommand):
    """Arguments of `setJointMotorControlArray`, one number per joint each; None for the engine's default."""

    mode: str
    """One of `MODES`."""
    positions: list[float] | None = None
    """Targets [rad or m]."""
    velocities: list[float] | None = None
    """Targets [rad/s or m/s]."""
    forces: list[float] | None = None
    """Largest forces [N m or N]; the forces themselves in TORQUE_CONTROL."""
    position_gains: list[float] | None = None
    velocity_gains: list[float] | None = None

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ArgumentError(f"mode is {shown(self.mode)}; wanted one of {', '.join(MODES)}")

    def checked(self, model: Model) -> BulletMotorCommand:
        refuse_mimic_joints(model, "use those of dynx.world")
        n = len(model.joint_names)
        numbers: dict[str, Any] = {}
        for name in _BULLET_NAMES:
            if getattr(self, name) is not None:
                array = checked_array(f"{name} of a motor command", getattr(self, name), n)
                if array.ndim != 1:
                    raise ShapeError(f"{name} of a motor command has shape {array.shape}; wanted ({n},)")
                numbers[name] = array.tolist()
        return replace(self, **numbers)

    def options(self) -> dict[str, list[float]]:
        """Return the lists that are given, by their names in Bullet."""
        given = {_BULLET_NAMES[each.name]: getattr(self, each.name) for each in fields(self)[1:]}
        return {name: numbers for name, numbers in given.items() if numbers is not None}


def refuse_mimic_joints(model: Model, remedy: str) -> None:
    """Raise UnsupportedFeatureError for a robot with mimic joints, which Bullet's motors do not support."""
    if model.mechanism.coupling is not None:
        raise UnsupportedFeatureError(
            f"PyBullet's motors do not support the mimic joints of {model.name}; {remedy}"
        )
