"""Motors of joints: controllers inside a world, with one law on every engine.

A motor acts on the joints that it names, or on all of a robot. With h the step of the engine:

- `TorqueMotor` applies a torque;
- `PDMotor` is the textbook's law kp (q* - q) + kd (v* - v) at the beginning of each step, which is unstable
  where h kd is more than about twice the inertia that the joint feels;
- `PositionMotor` and `VelocityMotor` evaluate the same law at the *end* of the step, which is stable at any
  gain in short steps (Tan, Liu and Turk, Stable proportional-derivative controllers, 2011). The velocity
  there follows from the mass matrix and from the forces of the step before, those of contacts included. An
  engine that `solves_motors` finds it together with all forces of the step, and is stable in long steps too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import (
    ArgumentError,
    GainError,
    ShapeError,
    UnknownNameError,
    UnsupportedFeatureError,
    nearest,
    shown,
)
from dynx.model import Model
from dynx.model.numbers import checked_entries, real_array
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import JointLaw

LAW = ("target", "velocity", "kp", "kd", "torque", "max_force")
"""Numbers of a law."""


@dataclass(frozen=True)
class Motor(ABC):
    """A motor on the joints named in `joints`, or on every joint of the robot."""

    def __post_init__(self) -> None:
        # Tuples compare and hash, as the scenes that have motors do; what is invalid is refused by `law`.
        for each in fields(self):
            value = getattr(self, each.name)
            value = value.tolist() if isinstance(value, np.ndarray) else value
            object.__setattr__(self, each.name, tuple(value) if isinstance(value, list) else value)

    @abstractmethod
    @checks_types
    def law(self, model: Model) -> tuple[tuple[int, ...], JointLaw]:
        """Return the numbers of the joints, in the order of `Model.coordinate_names`, and the law of each.

        Raises ArgumentError or GainError for numbers that the robot's joints cannot have.
        """

    def _law(self, model: Model, *, implicit: bool) -> tuple[tuple[int, ...], JointLaw]:
        kind = type(self).__name__
        given = {each.name: getattr(self, each.name) for each in fields(self)}
        joints = _joint_numbers(kind, model, given.pop("joints"))
        n = len(joints)
        numbers = {
            name: _per_joint(kind, name, value, n) for name, value in given.items() if value is not None
        }
        for name in ("kp", "kd", "max_force"):
            if name in numbers and (numbers[name] < 0.0).any():
                raise GainError(f"{name} of a {kind} is {shown(given[name])}; wanted numbers of at least 0")
        absent = {**dict.fromkeys(LAW, np.zeros(n)), "max_force": np.full(n, np.inf)}
        return joints, JointLaw(**{**absent, **numbers}, implicit=implicit)


@checks_types
@dataclass(frozen=True)
class TorqueMotor(Motor):
    """A motor with a given `torque` [N m or N], one number or one per joint."""

    torque: ArrayLike
    max_force: ArrayLike | None = None
    joints: Sequence[str] | None = None

    @checks_types
    def law(self, model: Model) -> tuple[tuple[int, ...], JointLaw]:
        return self._law(model, implicit=False)


@dataclass(frozen=True)
class _Servo(Motor):
    """Arguments of motors that follow a position."""

    target: ArrayLike
    kp: ArrayLike
    kd: ArrayLike
    velocity: ArrayLike = 0.0
    max_force: ArrayLike | None = None
    joints: Sequence[str] | None = None


@checks_types
@dataclass(frozen=True)
class PDMotor(_Servo):
    """A motor with the torque kp (target - q) + kd (velocity - v) at the beginning of each step.

    `kp` [N m/rad or N/m], `kd` [N m s/rad or N s/m] and `max_force` [N m or N] are one number or one per
    joint.
    """

    @checks_types
    def law(self, model: Model) -> tuple[tuple[int, ...], JointLaw]:
        return self._law(model, implicit=False)


@checks_types
@dataclass(frozen=True)
class PositionMotor(_Servo):
    """A motor with the torque kp (target - q) + kd (velocity - v) at the end of each step; arguments as
    for `PDMotor`.

    Where the other forces (Coriolis, contacts, limits) hardly change from one step to the next the motor is
    stable at any gain: it uses these forces of the step before. In long steps high gains diverge. The engine
    `dynx` solves for the end of the step instead, and has no such bound."""

    @checks_types
    def law(self, model: Model) -> tuple[tuple[int, ...], JointLaw]:
        return self._law(model, implicit=True)


@checks_types
@dataclass(frozen=True)
class VelocityMotor(Motor):
    """A motor with the torque kd (velocity - v) at the end of each step, with the stability of
    `PositionMotor`."""

    velocity: ArrayLike
    kd: ArrayLike
    max_force: ArrayLike | None = None
    joints: Sequence[str] | None = None

    @checks_types
    def law(self, model: Model) -> tuple[tuple[int, ...], JointLaw]:
        return self._law(model, implicit=True)


def combine(model: Model, motors: Sequence[Motor]) -> tuple[JointLaw, Floats]:
    """Return the law of all joints (n,) of a robot, and 1 for the joints where it is implicit, else 0.

    Joints without a motor have no gains and no torque. Raises ArgumentError for a joint with two motors.
    """
    n = len(model.coordinate_names)
    columns = {name: np.zeros(n) for name in LAW}
    columns["max_force"] += np.inf
    implicit, taken = np.zeros(n), np.zeros(n, dtype=bool)
    for motor in motors:
        joints, law = motor.law(model)
        for joint in joints:
            if taken[joint]:
                raise ArgumentError(
                    f"two motors act on {shown(model.coordinate_names[joint])}; wanted one for a joint"
                )
            taken[joint] = True
        index = list(joints)
        for name, column in columns.items():
            column[index] = getattr(law, name)
        implicit[index] = float(law.implicit)
    return JointLaw(**columns, implicit=bool(implicit.any())), implicit


def _joint_numbers(kind: str, model: Model, joints: Sequence[str] | None) -> tuple[int, ...]:
    names = list(model.joint_names)
    if joints is None:
        joints = names
    if isinstance(joints, str) or not isinstance(joints, Sequence):
        raise ArgumentError(f"joints of a {kind} is {shown(joints)}; wanted a list of names")
    for name in joints:
        if name not in names:
            raise UnknownNameError(
                f"{model.name} has no joint {shown(name)} with a coordinate{nearest(name, names)}"
            )
        if model.joint(name).type == "ball":
            raise UnsupportedFeatureError(
                f"{shown(name)} of {model.name} is a ball joint, on which no {kind} acts; name other joints "
                "in `joints`, or give torques"
            )
    base = 6 if model.floating else 0
    return tuple(model.coordinate_index(name) - base for name in joints)


def _per_joint(kind: str, name: str, value: ArrayLike, n: int) -> Floats:
    array = real_array(f"{name} of a {kind}", value)
    if array.ndim > 1 or (array.ndim == 1 and len(array) != n):
        raise ShapeError(f"{name} of a {kind} has shape {array.shape}; wanted one number or ({n},)")
    if name == "max_force" and not np.isnan(array).any():
        return np.asarray(array + np.zeros(n))
    return np.asarray(checked_entries(f"{name} of a {kind}", np.atleast_1d(array)) + np.zeros(n))
