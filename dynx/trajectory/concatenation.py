"""Concatenation of trajectories."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.model.numbers import read_only
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory

GAP_TOLERANCE = 1e-9
"""Largest gap [rad, m; rad/s, m/s] between the end of a trajectory and the start of the next one.

It is far above rounding, since ends are specified and not computed, and far below a jump that matters.
"""


@dataclass(frozen=True, eq=False, repr=False)
class ConcatenatedTrajectory(Trajectory):
    """`parts` in order; part k starts at `start_times[k]` [s]."""

    parts: tuple[Trajectory, ...]
    start_times: Floats = field(repr=False)

    @property
    def knots(self) -> Floats:
        """The knots of all parts."""
        shifted = [begin + part.knots for part, begin in zip(self.parts, self.start_times, strict=True)]
        return np.unique(np.clip(np.concatenate(shifted), 0.0, self.duration))

    def inside(self, t: Floats) -> Setpoint:
        """Return the setpoint of the part that contains each time; the later part at a boundary."""
        number = np.searchsorted(self.start_times, t, side="right") - 1
        whole = Setpoint(*(np.empty((len(t), n)) for n in (self.nq, self.nv, self.nv)))
        for k, part in enumerate(self.parts):
            here = np.flatnonzero(number == k)
            if here.size:
                # Clipped, since the sum of durations is rounded and a time may fall outside its part.
                values = part(np.clip(t[here] - self.start_times[k], 0.0, part.duration))
                for array, value in zip(whole, values, strict=True):
                    array[here] = value
        return whole


def concatenate(*trajectories: Trajectory) -> Trajectory:
    """Return the trajectories one after another, each starting when the previous one ends.

    Raises ShapeError if they belong to different robots, and TrajectoryError if one does not start at the
    position and velocity at which the previous one ends (to 1e-9); the acceleration may jump.
    """
    if not trajectories:
        raise ArgumentError("trajectories is empty; wanted at least one")
    for k, part in enumerate(trajectories):
        if not isinstance(part, Trajectory):
            raise ArgumentError(f"argument {k} is of type {type(part).__name__}; wanted a Trajectory")
    for k, (one, following) in enumerate(pairwise(trajectories)):
        _refuse_gap(k, one, following)
    ends = np.cumsum([part.duration for part in trajectories])
    start_times = read_only(np.concatenate([[0.0], ends[:-1]]))
    return ConcatenatedTrajectory(
        float(ends[-1]), trajectories[0].start, trajectories[-1].end, tuple(trajectories), start_times
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
        if jump[worst] > GAP_TOLERANCE:
            raise TrajectoryError(
                f"{name}[{worst}] is {left[worst]:.9g} where trajectory {k} ends and {right[worst]:.9g} "
                f"where trajectory {k + 1} begins"
            )
