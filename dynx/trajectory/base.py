"""`Trajectory`: a motion that defines the setpoint q, v, a at any time, with the robot at rest outside it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, DTypeError
from dynx.model.numbers import checked_entries, positive_seconds, read_only, real_array
from dynx.spatial.scalar import Floats

Self = TypeVar("Self", bound="Trajectory")


class Setpoint(NamedTuple):
    """Desired position, velocity and acceleration of a robot.

    `q` (nq,), `v` and `a` (nv,) for one time; (..., nq), (..., nv) for times (...,).
    """

    q: Floats
    v: Floats
    a: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(ABC):
    """A motion over ``0 <= t <= duration`` [s]: ``trajectory(t)`` returns its `Setpoint`.

    `v` and `a` are velocity and acceleration as in all of dynx. `v` has the velocities of the joints and,
    with a floating base, the linear and angular velocity of the base frame in its own axes; of a ball joint,
    the angular velocity of its child link in the link's axes. `a` has their time derivatives. Where `a`
    jumps, its value is the one after the jump; at ``duration``, the one before the jump.

    Before 0 and after `duration` the robot is at rest at `start.q` and `end.q`. At these two times the
    setpoint is exactly `start` or `end`, without rounding. Trajectories are immutable and can be pickled;
    evaluated for an array of times, the results equal those for each single time bit for bit.

    `dynx.trajectory.from_function` makes one of a formula q(t). To give velocity and acceleration yourself,
    derive a class and implement `inside`; a class without it raises DTypeError.
    """

    duration: float
    """Duration [s], greater than 0."""
    start: Setpoint
    """The setpoint at time 0."""
    end: Setpoint
    """The setpoint at `duration`."""

    def __new__(cls: type[Self], *_: Any, **__: Any) -> Self:
        """Refuse a class without `inside`, with what to write instead."""
        if getattr(cls, "__abstractmethods__", ()):
            raise DTypeError(
                f"class {cls.__name__} has no method inside(self, t), which returns the Setpoint (q, v, a) "
                "at times t (n,); a formula q(t) becomes a motion by trajectory.from_function(f, duration)"
            )
        return super().__new__(cls)

    @property
    def nq(self) -> int:
        """Length of a configuration."""
        return len(self.start.q)

    @property
    def nv(self) -> int:
        """Length of a velocity."""
        return len(self.start.v)

    @property
    def knots(self) -> Floats:
        """Times (n,), ascending from 0 to `duration`, between which the motion is smooth."""
        return np.array([0.0, self.duration])

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.nv} coordinates, {self.duration:.6g} s>"

    @abstractmethod
    def inside(self, t: Floats) -> Setpoint:
        """Return the setpoints at times (n,) within ``[0, duration]``, by array code over the times."""

    def __call__(self, t: ArrayLike) -> Setpoint:
        """Return the setpoint at a time, or at times (...,) [s].

        Raises DTypeError or NotFiniteError for a time that is not a finite number.
        """
        times = checked_entries("t", real_array("t", t))
        flat = times.ravel()
        q, v, a = self.inside(np.clip(flat, 0.0, self.duration))
        # Masks are applied only if needed, because most times lie between the ends.
        early, late = flat <= 0.0, flat >= self.duration
        if early.any() or late.any():
            q, v, a = np.array(q), np.array(v), np.array(a)
            for where, end in ((early, self.start), (late, self.end)):
                q[where], v[where], a[where] = end
            outside = (flat < 0.0) | (flat > self.duration)
            v[outside] = 0.0
            a[outside] = 0.0
        shape = times.shape
        return Setpoint(q.reshape(*shape, self.nq), v.reshape(*shape, self.nv), a.reshape(*shape, self.nv))


MIN_DURATION, MAX_DURATION = 1e-30, 1e30
"""Bounds on a duration [s], so that its fifth power neither underflows nor overflows."""


def checked_duration(duration: float) -> float:
    """Return a duration [s] as a float; raise ArgumentError unless it is within the bounds."""
    seconds = positive_seconds("duration", duration)
    if not MIN_DURATION <= seconds <= MAX_DURATION:
        raise ArgumentError(
            f"duration is {seconds:g}; wanted between {MIN_DURATION:g} and {MAX_DURATION:g} s"
        )
    return seconds


def read_only_setpoint(q: Floats, v: Floats, a: Floats) -> Setpoint:
    """Return a setpoint of read-only copies."""
    return Setpoint(read_only(q), read_only(v), read_only(a))
