"""Intervals of distances and angles between points and directions of a chain, for all joint positions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross

FULL_TURN = 2.0 * math.pi


@dataclass(frozen=True)
class Interval:
    """Closed interval from `low` to `high`."""

    low: float
    high: float

    def __and__(self, other: Interval) -> Interval:
        """Return the intersection; rounding may make it a point."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        return Interval(min(low, high), high)

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.low + other.low, self.high + other.high)


def distance_sum(a: Interval, b: Interval) -> Interval:
    """Return the distances of two points that are in a and b from a third (triangle inequality)."""
    return Interval(max(0.0, a.low - b.high, b.low - a.high), a.high + b.high)


def angle_sum(a: Interval, b: Interval) -> Interval:
    """Return the angles between two directions whose angles with a third are in a and b (on the sphere)."""
    high = min(a.high + b.high, FULL_TURN - a.low - b.low, math.pi)
    return Interval(min(max(0.0, a.low - b.high, b.low - a.high), high), high)


def rotated_product(v: Floats, w: Floats, axis: Floats, turn: Interval) -> Interval:
    """Return the values of v . w, when w (3,) rotates about the axis by an angle within `turn` [rad]."""
    along = float(v @ axis) * float(w @ axis)
    cosine, sine = float(v @ w) - along, float(v @ cross(axis, w))
    amplitude, phase = math.hypot(cosine, sine), math.atan2(sine, cosine)
    ends = [amplitude * math.cos(angle - phase) for angle in (turn.low, turn.high) if math.isfinite(angle)]
    low, high = min(ends, default=-amplitude), max(ends, default=amplitude)
    if _contains(turn, phase):
        high = amplitude
    if _contains(turn, phase + math.pi):
        low = -amplitude
    return Interval(along + low, along + high)


def _contains(turn: Interval, angle: float) -> bool:
    """Check whether an interval contains an angle up to full turns."""
    if turn.high - turn.low >= FULL_TURN:
        return True
    return turn.low + (angle - turn.low) % FULL_TURN <= turn.high


def closed_under(
    pairs: dict[tuple[int, int], Interval], count: int, combined: Callable[[Interval, Interval], Interval]
) -> dict[tuple[int, int], Interval]:
    """Return the intervals of all pairs i < j below `count`, from those of neighbours and of some others."""
    found = dict(pairs)
    for span in range(2, count):
        for i in range(count - span):
            j = i + span
            for k in range(i + 1, j):
                through = combined(found[i, k], found[k, j])
                found[i, j] = found[i, j] & through if (i, j) in found else through
    return found


def segment_lengths(offset: Floats, slides: list[tuple[Floats, Interval]]) -> Interval:
    """Return the lengths of ``offset + sum(t_j u_j)``, for directions u_j and travels t_j in intervals."""
    corners = [offset]
    for direction, travel in slides:
        if not (math.isfinite(travel.low) and math.isfinite(travel.high)):
            return Interval(0.0, math.inf)
        corners = [corner + t * direction for corner in corners for t in (travel.low, travel.high)]
    # The length is convex, so it is greatest at a corner.
    lengths = [float(np.linalg.norm(corner)) for corner in corners]
    if not slides:
        return Interval(lengths[0], lengths[0])
    if len(slides) > 1:
        return Interval(0.0, max(lengths))
    direction, travel = slides[0]
    nearest = min(max(-float(offset @ direction), travel.low), travel.high)
    return Interval(float(np.linalg.norm(offset + nearest * direction)), max(lengths))
