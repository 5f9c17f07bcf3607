"""What a trajectory is: a motion that gives the setpoint q, v, a at any time, and stands still outside."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.model.configuration import checked_entries, real_array
from dynx.spatial.scalar import Floats


class Setpoint(NamedTuple):
    """Where a robot is to be, how fast, and how fast that is to change.

    `q` (nq,), `v` and `a` (nv,) for one time; (..., nq), (..., nv) for times (...,).
    """

    q: Floats
    v: Floats
    a: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(ABC):
    """A motion over ``0 <= t <= duration`` [s]: ``trajectory(t)`` is its `Setpoint`.

    `v` is the velocity and `a` the acceleration of dynx's contract: rates of the joints and, with a
    floating base, linear and angular velocity of the base frame in its own axes, and their derivatives.
    Where `a` jumps it is the value after the jump; at ``duration`` the value before.

    Before 0 and after `duration` the robot stands still at `start.q`, `end.q`. At both times the
    setpoint is `start` or `end` exactly, with no rounding. Trajectories are never changed after they
    are made, and pickle; evaluated for an array of times they give, bit for bit, what each time gives.

    A motion of your own is a subclass with `inside`.
    """

    duration: float
    """How long it takes [s], more than 0."""
    start: Setpoint
    """The setpoint at time 0."""
    end: Setpoint
    """The setpoint at `duration`."""

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
        """The setpoints at times (n,) that lie in ``[0, duration]``; to be array code over the times."""

    def __call__(self, t: ArrayLike) -> Setpoint:
        """The setpoint at a time, or at times (...,) [s].

        Raises DTypeError or NotFiniteError for what is no finite time.
        """
        times = checked_entries("t", real_array("t", t))
        flat = times.ravel()
        q, v, a = self.inside(np.clip(flat, 0.0, self.duration))
        # Masked writing where it is needed only: most calls lie between the ends.
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


SHORTEST, LONGEST = 1e-30, 1e30
"""Bounds on a duration [s]: its fifth power must neither vanish nor overflow."""


def checked_duration(duration: float) -> float:
    """A time span [s] as a float, or an ArgumentError for what is not positive, or out of all proportion."""
    number = isinstance(duration, int | float | np.number) and not isinstance(duration, bool)
    if not number or not 0.0 < duration < np.inf:
        raise ArgumentError(f"duration is {shown(duration)}; wanted a positive number of seconds")
    if not SHORTEST <= duration <= LONGEST:
        raise ArgumentError(f"duration is {duration:g}; wanted between {SHORTEST:g} and {LONGEST:g} s")
    return float(duration)


def frozen(array: Floats) -> Floats:
    """A copy of `array` that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def frozen_setpoint(q: Floats, v: Floats, a: Floats) -> Setpoint:
    """A setpoint of copies that cannot be written to."""
    return Setpoint(frozen(q), frozen(v), frozen(a))
