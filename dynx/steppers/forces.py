"""What acts on the robots and bodies of a scene in one call of a stepper."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, escaped, nearest, shown
from dynx.model.model import Model
from dynx.model.numbers import checked_entries, is_real, real_array
from dynx.option_names import checks_field_names
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, REFERENCES
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import cross

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from dynx.backends.base import Backend

Self = TypeVar("Self", bound="EngineCommand")


class EngineCommand(ABC):
    """A command to an engine's own motors of one robot, which its solver moves during a step."""

    @abstractmethod
    def checked(self: Self, model: Model) -> Self:
        """Return the command with one number per joint in each of its lists.

        Raises ArgumentError and its subclasses for invalid numbers, UnsupportedFeatureError for a robot
        without such motors.
        """


NO_COMMANDS: Mapping[int, EngineCommand] = MappingProxyType({})

TIME_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Relative difference of two times that counts as rounding."""

SLIVER = 1e-6
"""Largest part of a duration that may be counted in the step before or after its own."""

LOCAL, WORLD = "local", "world"
ORIGIN = (0.0, 0.0, 0.0)


@checks_field_names(frame="on")
@dataclass(frozen=True)
class ExternalForce:
    """A wrench (6,), force [N] then moment [N m], on a part from `start` [s] for `duration` [s].

    In a world `on` is a body, ``robot/link`` or ``robot/frame``; if the world has one robot, the frame's name
    suffices. In a simulation `on` is a frame of the robot. `reference` names the point and the axes of the
    wrench, as for `external_forces` of a backend. ``local_world_aligned`` is the origin of the frame and the
    axes of the world. ``local`` is the origin and the axes of the frame, ``world`` those of the world. The
    force acts at `point` (3,) [m] of the frame, which moves with it, instead of at its origin.

    In each step of an engine the wrench is constant, multiplied by the share of the step in which it lasts.
    So the impulse is exact for any start, duration and step, on every engine and under every integrator.

    Raises ArgumentError unless the wrench and the point are finite numbers, the start is finite and not
    before 0, the duration is positive and `reference` is one of the three, and for a point in the reference
    ``world``.
    """

    on: str
    wrench: ArrayLike
    start: float = 0.0
    duration: float = math.inf
    reference: str = LOCAL_WORLD_ALIGNED
    point: ArrayLike = ORIGIN

    def __post_init__(self) -> None:
        if not isinstance(self.on, str):
            raise ArgumentError(
                f"an external force acts on {shown(self.on)}; "
                "wanted a body, a frame, robot/link or robot/frame"
            )
        what = f"an external force on {shown(self.on)}"
        wrench = checked_entries(f"the wrench of {what}", real_array(f"the wrench of {what}", self.wrench))
        point = checked_entries(f"the point of {what}", real_array(f"the point of {what}", self.point))
        if wrench.shape != (6,):
            raise ArgumentError(
                f"the wrench of {what} has shape {wrench.shape}; wanted (6,), a force [N] and then a moment "
                "[N m], such as (0, 0, -10, 0, 0, 0)"
            )
        if not isinstance(self.reference, str) or self.reference not in REFERENCES:
            raise ArgumentError(
                f"the reference of {what} is {shown(self.reference)}{nearest(self.reference, REFERENCES)}"
            )
        if point.shape != (3,):
            raise ArgumentError(f"the point of {what} has shape {point.shape}; wanted (3,) in its frame")
        if point.any() and self.reference == WORLD:
            raise ArgumentError(
                f"{what} has the point {point.tolist()} in the reference {WORLD}, whose wrenches are about "
                f"the origin of the world; wanted {LOCAL_WORLD_ALIGNED} or {LOCAL}, or no point"
            )
        if not is_real(self.start) or not 0.0 <= self.start < math.inf:
            raise ArgumentError(
                f"the start of {what} is {_as_given(self.start)}; wanted a finite time [s] of at least 0, "
                "that of the beginning"
            )
        if not is_real(self.duration) or not self.duration > 0.0:
            raise ArgumentError(
                f"the duration of {what} is {_as_given(self.duration)}; wanted a positive number of seconds, "
                "or inf for a force that does not end"
            )

    @checks_types
    def checked(self, model: Model) -> ExternalForce:
        """Return a copy on a frame of the robot with its wrench as an array.

        Raises UnknownNameError for a frame of another robot.
        """
        model.frame_index(self.on)
        wrench, point = real_array("wrench", self.wrench), real_array("point", self.point)
        return replace(
            self, wrench=wrench, point=point, start=float(self.start), duration=float(self.duration)
        )

    def share(self, t: float, h: float) -> float:
        """Return the share, from 0 to 1, of the step of length `h` [s] from time `t` [s] in which it acts."""
        # Times on the grid are rounded; a step that begins with the force must not miss the last bit of it.
        rounding = min(TIME_ROUNDING * max(abs(t) + h, abs(self.start)), SLIVER * self.duration)
        since = t - self.start
        if since >= -rounding and since + h <= self.duration + rounding:
            return 1.0
        before, after = (
            0.0 if each <= rounding else self.duration if each >= self.duration - rounding else each
            for each in (since, since + h)
        )
        return (after - before) / h

    @property
    def has_point(self) -> bool:
        """True if the force acts elsewhere than at the origin of the frame."""
        return any(self.point)  # type: ignore[arg-type]  # an array or a sequence of three numbers

    def at_origin(self, wrench: Array, R: Array) -> Array:
        """Return a wrench (6,) at `point` as one at the origin of the frame, whose axes in the world are the
        columns of `R` (3, 3); numbers or symbols."""
        lever = np.asarray(self.point) if self.reference == LOCAL else R @ np.asarray(self.point)
        return np.concatenate([wrench[:3], wrench[3:] + cross(lever, wrench[:3])])

    def at_frame(self, engine: Backend, frame: str, q: Floats, share: float) -> tuple[Floats, Floats]:
        """Return the Jacobian (6, nv) of a frame at q (nq,), and the wrench (6,) in a step."""
        wrench: Floats = share * np.asarray(self.wrench)
        if self.has_point:
            wrench = self.at_origin(wrench, engine.forward_kinematics(q, frame)[:3, :3])
        return engine.jacobian(q, frame, reference=self.reference), wrench

    def at_center(self, T: Floats, center: Floats, share: float) -> Floats:
        """Return the force and the moment about the point `center` (3,) of a body (..., 6) with pose `T`
        (..., 4, 4), in world axes."""
        R = T[..., :3, :3]
        wrench: Floats = share * np.asarray(self.wrench)
        force, moment = wrench[:3], wrench[3:]
        if self.reference == LOCAL:
            force, moment = R @ force, R @ moment
        lever = R @ (np.asarray(self.point) - center)
        if self.reference == WORLD:
            lever = -(T[..., :3, 3] + R @ center)
        if T.ndim > 2:
            force, moment, lever = np.broadcast_arrays(force, moment, lever)
        return np.concatenate([force, moment + cross(lever, force)], axis=-1)


def _as_given(value: object) -> str:
    return shown(value) if isinstance(value, str) else escaped(value)


class JointLaw(NamedTuple):
    """The law of motors of a robot: torque + kp (target - q) + kd (velocity - v), within +-max_force.

    Arrays (n,) over joints, zero without a motor. If `implicit`, q and v are those at the end of a step.
    """

    target: Floats
    velocity: Floats
    kp: Floats
    kd: Floats
    torque: Floats
    max_force: Floats
    implicit: bool


NO_MOTORS: Mapping[int, JointLaw] = MappingProxyType({})


class Forces(NamedTuple):
    """Everything that acts in the steps of one call: what is not given does not act.

    The arrays may change after the call.
    """

    torques: Sequence[tuple[int, Floats]] = ()
    """Numbers of robots, each with a generalised force (nv,) on it [N m or N]. The first six entries of a
    floating base are force and moment at the base frame, in its axes; the caller takes one step at a time
    where they are not zero, so that they may be converted to other axes once a call."""
    wrenches: Floats | None = None
    """Force [N], and moment about the centre of mass [N m], on every body of the scene (n_bodies, 6), in
    world axes."""
    commands: Mapping[int, EngineCommand] = NO_COMMANDS
    """Commands to the engine's own motors by number of the robot, of classes in `Stepper.commands`. A mapping
    that is the same object as in the call before has the same commands."""
    motors: Mapping[int, JointLaw] = NO_MOTORS
    """Motors at the end of each step by number of the robot, for an engine that `solves_motors`."""


NO_FORCES = Forces()
