"""Trajectories one after another."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory, frozen

MEETING = 1e-9
"""How far apart [rad, m; rad/s, m/s] two trajectories may be where one follows the other: their ends are
given numbers, not computed ones, so this is far above rounding and far below what a robot can show."""


@dataclass(frozen=True, eq=False, repr=False)
class JoinedTrajectory(Trajectory):
    """`parts` in order; part k begins at `begins[k]` [s]."""

    parts: tuple[Trajectory, ...]
    begins: Floats = field(repr=False)

    @property
    def knots(self) -> Floats:
        """The knots of all parts."""
        shifted = [begin + part.knots for part, begin in zip(self.parts, self.begins, strict=True)]
        return np.unique(np.clip(np.concatenate(shifted), 0.0, self.duration))

    def inside(self, t: Floats) -> Setpoint:
        """What the part says that a time falls into; where two meet, the later one."""
        number = np.searchsorted(self.begins, t, side="right") - 1
        whole = Setpoint(*(np.empty((len(t), n)) for n in (self.nq, self.nv, self.nv)))
        for k, part in enumerate(self.parts):
            here = np.flatnonzero(number == k)
            if here.size:
                # Clipped, since rounding of the sum of durations must not put a time outside its part.
                values = part(np.clip(t[here] - self.begins[k], 0.0, part.duration))
                for array, value in zip(whole, values, strict=True):
                    array[here] = value
        return whole


def concatenate(*trajectories: Trajectory) -> Trajectory:
    """The trajectories one after another, each beginning when the one before it ends.

    Raises ShapeError where they are of different robots, and TrajectoryError where one does not begin
    where, and as fast as, the one before it ended (to 1e-9); the acceleration may jump.
    """
    if not trajectories:
        raise ArgumentError("no trajectory was given; wanted at least one")
    for k, part in enumerate(trajectories):
        if not isinstance(part, Trajectory):
            raise ArgumentError(f"argument {k} is of type {type(part).__name__}; wanted a Trajectory")
    for k, (one, following) in enumerate(pairwise(trajectories)):
        _refuse_gap(k, one, following)
    ends = np.cumsum([part.duration for part in trajectories])
    begins = frozen(np.concatenate([[0.0], ends[:-1]]))
    return JoinedTrajectory(
        float(ends[-1]), trajectories[0].start, trajectories[-1].end, tuple(trajectories), begins
    )


def _refuse_gap(k: int, one: Trajectory, following: Trajectory) -> None:
    if (one.nq, one.nv) != (following.nq, following.nv):
        raise ShapeError(
            f"trajectory {k} has nq {one.nq}, nv {one.nv}; trajectory {k + 1} has nq {following.nq}, "
            f"nv {following.nv}"
        )
    for name, left, right in (("q", one.end.q, following.start.q), ("v", one.end.v, following.start.v)):
        jump = np.abs(right - left)
        worst = int(np.argmax(jump))
        if jump[worst] > MEETING:
            raise TrajectoryError(
                f"{name}[{worst}] is {left[worst]:.9g} where trajectory {k} ends and {right[worst]:.9g} "
                f"where trajectory {k + 1} begins"
            )
