"""Review of candidates by NumPy: which are solutions, and which of those are distinct.

A candidate is a solution if it reaches the pose and lies within the limits. Few need a second look: those
near a singularity, where Newton's method takes more steps and two branches may be one, and those at a limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.ik.closed_forms.branches import N_BRANCHES, SIGNS
from dynx.ik.closed_forms.candidates import (
    N_MEASURES,
    POSITION,
    ROTATION,
    SEPARATION,
    VIOLATION,
    Candidates,
)
from dynx.ik.coordinates import FULL_TURN
from dynx.spatial.scalar import Floats

ACCURACY = 1e-11
"""Largest error of a solution: of the position relative to the length of the chain, and of the rotation
[rad]."""

ROUNDING = 1e-14
"""Error up to which a candidate is a solution at once; above it, it is polished further."""

AT_LIMIT = 1e-8
"""Violation [rad or m] of a limit that counts as rounding: the solution is moved to the limit if it still
reaches the pose."""

_SAME = 1e-6
"""Difference [rad or m] up to which two candidates are one solution. At a singularity rounding moves a
solution by the square root of its error."""

_FURTHER_STEPS = 3, 17
"""Newton steps for rough candidates, and for those that are rough after them."""

_CHUNK = 4096
"""Number of poses that NumPy evaluates at once, so that its intermediate arrays stay in the cache."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reviewed:
    """Candidates of n poses, and which of them are solutions."""

    angles: Floats
    """Coordinates (n, 8, joints) [rad or m]."""
    measures: Floats
    """Measures (n, 8, 5) of `Candidates`."""
    found: Mask
    """Distinct solutions (n, 8)."""


@dataclass(frozen=True, eq=False)
class Review:
    """Function from poses to their solutions, for one chain."""

    candidates: Candidates
    nearness: float
    """Error above which a candidate is not near a solution."""
    separation: float
    """Separation of two branches below which they may be one solution."""
    repeats: bool
    """True if different branches may be one solution anywhere."""

    def __call__(self, pose: Floats, ignore_limits: bool) -> Reviewed:
        """Return all candidates of poses (n, 3, 4), whose lengths are relative, polished."""
        n = len(pose)
        angles = np.empty((n, N_BRANCHES, len(self.candidates.lower)))
        measures = np.empty((n, N_BRANCHES, N_MEASURES))
        found = np.empty((n, N_BRANCHES), dtype=np.bool_)
        for first in range(0, n, _CHUNK):
            rows = slice(first, first + _CHUNK)
            result = self.candidates(pose[rows, None], SIGNS)
            angles[rows], measures[rows] = result["q"], result["measures"]
            found[rows] = self._found(pose[rows], angles[rows], measures[rows], ignore_limits)
        return Reviewed(angles, measures, found)

    def _found(self, pose: Floats, angles: Floats, measures: Floats, ignore_limits: bool) -> Mask:
        """Return which candidates (n, 8) are distinct solutions; polish those that need it, in place."""
        error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
        rough = (error > ROUNDING) & (error < self.nearness)
        if rough.any():
            self._polish(pose, angles, measures, error, rough)
        found: Mask = error <= ACCURACY
        if not ignore_limits:
            violation = measures[..., VIOLATION]
            at_limit = found & (violation > 0.0) & (violation <= AT_LIMIT)
            if at_limit.any():
                self._move_to_limits(pose, angles, measures, at_limit)
                error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
            found &= (measures[..., VIOLATION] <= 0.0) & (error <= ACCURACY)
        doubtful = found if self.repeats else found & (measures[..., SEPARATION] < self.separation)
        poses = np.flatnonzero(doubtful.any(axis=1) & (found.sum(axis=1) > 1))
        if poses.size:
            found[poses] = _distinct(angles[poses], found[poses], self.candidates.revolute)
        return found

    def _polish(self, pose: Floats, angles: Floats, measures: Floats, error: Floats, rough: Mask) -> None:
        """Polish the candidates `rough` further, where that reduces their error."""
        rows = np.nonzero(rough)
        first, more = _FURTHER_STEPS
        result = self.candidates.measured(pose[rows[0]], angles[rows], first)
        after = result["measures"]
        reached = np.maximum(after[..., POSITION], after[..., ROTATION])
        remaining = np.flatnonzero(reached > ROUNDING)
        if remaining.size:
            again = self.candidates.measured(pose[rows[0][remaining]], result["q"][remaining], more)
            result["q"][remaining], after[remaining] = again["q"], again["measures"]
            reached = np.maximum(after[..., POSITION], after[..., ROTATION])
        better = reached < error[rows]
        rows = tuple(each[better] for each in rows)
        after = after[better]
        after[..., SEPARATION:] = measures[rows][..., SEPARATION:]
        angles[rows], measures[rows], error[rows] = result["q"][better], after, reached[better]

    def _move_to_limits(self, pose: Floats, angles: Floats, measures: Floats, at_limit: Mask) -> None:
        rows = np.nonzero(at_limit)
        angles[rows] = np.clip(angles[rows], self.candidates.lower, self.candidates.upper)
        after = self.candidates.measured(pose[rows[0]], angles[rows], 0)["measures"]
        after[..., SEPARATION:] = measures[rows][..., SEPARATION:]
        after[..., VIOLATION] = 0.0
        measures[rows] = after


def near_to(
    angles: Floats, start: Floats, limits: tuple[Floats, Floats] | None, revolute: tuple[bool, ...]
) -> Floats:
    """Return coordinates with angles shifted by full turns to be near `start`, and within limits if they
    are."""
    turns = np.array(revolute)
    start = np.where(turns, start, angles)
    near = np.asarray(start + np.remainder(angles - start + np.pi, FULL_TURN) - np.pi)
    if limits is None:
        return near
    low, high = limits
    near += FULL_TURN * (turns & (near < low - AT_LIMIT))
    near -= FULL_TURN * (turns & (near > high + AT_LIMIT))
    clipped = np.clip(near, low, high)
    return np.asarray(np.where(np.abs(near - clipped) <= AT_LIMIT, clipped, angles))


def _distinct(angles: Floats, found: Mask, revolute: tuple[bool, ...]) -> Mask:
    """Return `found` (n, 8) without solutions that repeat an earlier one."""
    found = found.copy()
    for later in range(1, N_BRANCHES):
        for earlier in range(later):
            difference = angles[:, later] - angles[:, earlier]
            difference -= FULL_TURN * np.round(difference / FULL_TURN) * revolute
            same = np.abs(difference).max(axis=-1) < _SAME
            found[:, later] &= ~(same & found[:, earlier])
    return found
