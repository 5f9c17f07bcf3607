"""Commands to the motors inside PyBullet, as data: importing this module imports no engine.

The motors are constraints of PyBullet's solver, which determines their torque during the step.
`dynx.control.bullet` has controllers that return such commands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, ShapeError, UnsupportedFeatureError, shown
from dynx.model.model import Model
from dynx.model.numbers import checked_array
from dynx.option_names import checks_field_names
from dynx.steppers.forces import EngineCommand

MODES = ("POSITION_CONTROL", "VELOCITY_CONTROL", "TORQUE_CONTROL", "PD_CONTROL")
"""Control modes of Bullet for a joint's motor."""

_BULLET_NAMES = {
    "positions": ("targetPosition", "targetPositions"),
    "velocities": ("targetVelocity", "targetVelocities"),
    "forces": ("force", "forces"),
    "position_gains": ("positionGain", "positionGains"),
    "velocity_gains": ("velocityGain", "velocityGains"),
    "max_velocities": ("maxVelocity", ""),
}
"""Names in `setJointMotorControl2` and in `setJointMotorControlArray`."""


@checks_field_names()
@dataclass(frozen=True)
class BulletMotorCommand(EngineCommand):
    """Arguments of PyBullet's `setJointMotorControlArray`: lists with one number per joint, or one number for
    all joints. None is the engine's default.

    `max_velocities` is an argument of `setJointMotorControl2`. Raises ArgumentError for another mode, and for
    `max_velocities` in another mode than POSITION_CONTROL, in which alone PyBullet 3.2.7 reads them.
    """

    mode: str
    """One of `MODES`."""
    positions: list[float] | float | None = None
    """Targets [rad or m], by default 0."""
    velocities: list[float] | float | None = None
    """Targets [rad/s or m/s], by default 0."""
    forces: list[float] | float | None = None
    """Largest forces [N m or N], by default 100,000; the forces themselves in TORQUE_CONTROL."""
    position_gains: list[float] | float | None = None
    """Gains of positions, by default 0.1: a share of the error per step in POSITION_CONTROL, kp [N m/rad or
    N/m] in PD_CONTROL."""
    velocity_gains: list[float] | float | None = None
    """Gains of velocities, by default 1: a share of the error per step in POSITION_CONTROL, kd [N m s/rad or
    N s/m] in PD_CONTROL."""
    max_velocities: list[float] | float | None = None
    """Largest speeds [rad/s or m/s] of POSITION_CONTROL, above 0; by default unlimited."""

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ArgumentError(f"mode is {shown(self.mode)}; wanted one of {', '.join(MODES)}")
        if self.max_velocities is not None and self.mode != "POSITION_CONTROL":
            raise ArgumentError(
                f"max_velocities of a motor command are for POSITION_CONTROL alone, and mode is {self.mode}"
            )

    def checked(self, model: Model) -> BulletMotorCommand:
        refuse_mimic_joints(model, "use those of dynx.world")
        n = len(model.joint_names)
        numbers: dict[str, Any] = {}
        for name in _BULLET_NAMES:
            if getattr(self, name) is not None:
                given = getattr(self, name)
                if np.ndim(given) == 0:
                    given = [given] * n
                array = checked_array(f"{name} of a motor command", given, n)
                if array.ndim != 1:
                    raise ShapeError(f"{name} of a motor command has shape {array.shape}; wanted ({n},)")
                numbers[name] = array.tolist()
        if not all(speed > 0.0 for speed in numbers.get("max_velocities", ())):
            # PyBullet takes 0 for no limit.
            raise ArgumentError("max_velocities of a motor command must be above 0")
        return replace(self, **numbers)

    def lists(self) -> dict[str, list[float]]:
        """Return the lists of a checked command that are given, by their fields."""
        given = {name: getattr(self, name) for name in _BULLET_NAMES}
        return {name: numbers for name, numbers in given.items() if numbers is not None}

    def options(self, joint: int | None = None) -> dict[str, Any]:
        """Return the arguments of a checked command for one joint, by its place in the lists, by their names
        in `setJointMotorControl2`; without one for all, by their names in `setJointMotorControlArray`."""
        lists = self.lists().items()
        if joint is None:
            return {_BULLET_NAMES[name][1]: numbers for name, numbers in lists}
        return {_BULLET_NAMES[name][0]: numbers[joint] for name, numbers in lists}


def refuse_mimic_joints(model: Model, remedy: str) -> None:
    """Raise UnsupportedFeatureError for a robot with mimic joints, which Bullet's motors do not support."""
    if model.mechanism.coupling is not None:
        raise UnsupportedFeatureError(
            f"PyBullet's motors do not support the mimic joints of {model.name}; {remedy}"
        )
