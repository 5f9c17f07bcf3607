"""Bounds on distances, heights and angles of a frame, each with the sentence that states it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynx.ik.reach.intervals import (
    Interval,
    angle_sum,
    closed_under,
    distance_sum,
    rotated_product,
    segment_lengths,
)
from dynx.ik.reach.stations import Slide, Stations, points_of_least_length
from dynx.spatial.scalar import Floats

_PARALLEL = 1e-9
"""Sine of the angle between two axes below which they count as parallel."""


@dataclass(frozen=True, eq=False)
class DistanceBound:
    """Distances [m] that a point of the frame can have from a fixed point."""

    start: Floats
    start_name: str
    in_frame: Floats
    """The point in the axes of the frame (3,) [m]."""
    placed: Floats
    """The point (3,) [m] of the frame that the target places."""
    point_name: str
    """Name of the point; empty for the point that is placed, whose position the target prescribes."""
    allowed: Interval

    @property
    def needs_rotation(self) -> bool:
        """Whether the rotation of the target prescribes where the point is."""
        return bool(self.point_name)

    @property
    def offset(self) -> Floats:
        """The point (3,) [m] from where the target places, in the axes of the frame."""
        return self.in_frame - self.placed if self.needs_rotation else np.zeros(3)

    def sentence(self, value: float) -> str:
        """State the bound and what is wanted."""
        subject = f"it puts {self.point_name}" if self.point_name else "it is"
        if value > self.allowed.high:
            limit = f"the chain reaches at most {self.allowed.high:.6g} m"
        else:
            limit = f"the chain cannot come nearer than {self.allowed.low:.6g} m"
        return f"{subject} {value:.6g} m from {self.start_name}; {limit}"


@dataclass(frozen=True, eq=False)
class HeightBound:
    """Coordinates [m] along a fixed direction that the placed point can have."""

    direction: Floats
    name: str
    allowed: Interval

    def sentence(self, value: float) -> str:
        """State the bound and what is wanted."""
        return f"it is at {value:.6g} m along {self.name}; the chain reaches {_range(self.allowed, 'm')}"


@dataclass(frozen=True, eq=False)
class AngleBound:
    """Angles [rad] that an axis of the frame can have with a fixed direction."""

    direction: Floats
    in_frame: Floats
    name: str
    allowed: Interval

    def measured(self, rotations: Floats) -> Floats:
        """Return the angle (n,) that each target prescribes."""
        turned = rotations @ self.in_frame
        across = np.linalg.norm(np.cross(turned, self.direction), axis=-1)
        return np.asarray(np.arctan2(across, turned @ self.direction))

    def sentence(self, value: float) -> str:
        """State the bound and what is wanted."""
        return f"it wants {value:.6g} rad between {self.name}; the chain has {_range(self.allowed, 'rad')}"


def _range(allowed: Interval, unit: str) -> str:
    if allowed.high - allowed.low < 1e-9:
        return f"only {allowed.high:.6g} {unit}"
    return f"{allowed.low:.6g} to {allowed.high:.6g} {unit}"


def distance_bounds(stations: Stations, in_frame: Floats) -> list[DistanceBound]:
    """Return bounds for the point `in_frame` (3,) of the frame, and for points on the last axis."""
    end = stations.p_zero + stations.R_zero @ in_frame
    n = len(stations.joints)
    if n == 0:
        return []
    choices = [points_of_least_length(stations, None), points_of_least_length(stations, end), stations.points]
    found: list[DistanceBound] = []
    for points in choices:
        chain = np.concatenate([points, [end]])
        # Points on the first axis are fixed in the world unless a prismatic joint moves that.
        table = _distances(stations, chain)
        first = f"the point {_shown(chain[0])} m on the axis of {stations.joints[0]}"
        if stations.slides[0]:
            travel = segment_lengths(np.zeros(3), list(stations.slides[0]))
            table = {pair: distance_sum(travel, each) for pair, each in table.items()}
            first = f"the point {_shown(chain[0])} m"
        found.append(DistanceBound(chain[0], first, in_frame, in_frame, "", table[0, n]))
        if n > 1 and not stations.slides[n]:
            last = stations.R_zero.T @ (chain[n - 1] - stations.p_zero)
            name = f"the axis of {stations.joints[-1]}"
            found.append(DistanceBound(chain[0], first, last, in_frame, name, table[0, n - 1]))
    distinct: dict[tuple[float, ...], DistanceBound] = {}
    for bound in found:
        numbers = (*bound.start, *bound.in_frame, bound.allowed.low, bound.allowed.high)
        distinct.setdefault(tuple(round(float(x), 9) for x in numbers), bound)
    return list(distinct.values())


def _distances(stations: Stations, chain: Floats) -> dict[tuple[int, int], Interval]:
    """Return the distances between all stations (n + 1, 3), of which the last is the placed point."""
    n = len(stations.joints)
    gaps = [chain[k + 1] - chain[k] for k in range(n)]
    pairs = {(k, k + 1): segment_lengths(gaps[k], list(stations.slides[k + 1])) for k in range(n)}
    for k in range(1, n):
        if stations.slides[k] or stations.slides[k + 1]:
            continue
        before, after = gaps[k - 1], gaps[k]
        product = rotated_product(before, after, stations.axes[k], stations.turns[k])
        square = float(before @ before + after @ after)
        low, high = (math.sqrt(max(0.0, square + 2.0 * x)) for x in (product.low, product.high))
        pairs[k - 1, k + 1] = Interval(low, high)
    return closed_under(pairs, n + 1, distance_sum)


def height_bounds(stations: Stations, in_frame: Floats) -> list[HeightBound]:
    """Return bounds along the first axis; for a chain without rotating joints along the axes of the world."""
    end = stations.p_zero + stations.R_zero @ in_frame
    if not stations.joints:
        return [
            HeightBound(direction, f"the world's {name} axis", _slid(direction, end, [stations.slides[0]]))
            for direction, name in zip(np.eye(3), "xyz", strict=True)
        ]
    axis, chain = stations.axes[0], np.concatenate([stations.points, [end]])
    n = len(stations.joints)
    parallel = 1
    while parallel < n and np.linalg.norm(np.cross(axis, stations.axes[parallel])) < _PARALLEL:
        parallel += 1
    name = f"the axis of {stations.joints[0]}, {_shown(axis)}"
    allowed = _slid(axis, chain[parallel], stations.slides[: parallel + 1])
    if parallel == n:
        return [HeightBound(axis, name, allowed)]
    # The first joint across the axis moves the next station on a circle; the others reach any direction.
    after = chain[parallel + 1] - chain[parallel]
    if stations.slides[parallel + 1]:
        longest = segment_lengths(after, list(stations.slides[parallel + 1])).high
        allowed += Interval(-longest, longest)
    else:
        allowed += rotated_product(axis, after, stations.axes[parallel], stations.turns[parallel])
    if parallel + 1 < n:
        rest = _distances(stations, chain)[parallel + 1, n].high
        allowed += Interval(-rest, rest)
    return [HeightBound(axis, name, allowed)]


def _slid(direction: Floats, point: Floats, slides: Sequence[Sequence[Slide]]) -> Interval:
    """Return the coordinates along a direction of a point that prismatic joints move."""
    allowed = Interval(float(point @ direction), float(point @ direction))
    for each in slides:
        for axis, travel in each:
            share = float(axis @ direction)
            if share != 0.0:
                ends = sorted((share * travel.low, share * travel.high))
                allowed += Interval(ends[0], ends[1])
    return allowed


def angle_bounds(stations: Stations) -> list[AngleBound]:
    """Return bounds on the angle between the first and the last axis, or of a frame that does not rotate."""
    n = len(stations.joints)
    if n == 0:
        still = Interval(0.0, 0.0)
        return [
            AngleBound(
                stations.R_zero[:, k], np.eye(3)[k], f"the frame's {name} axis and where it stays", still
            )
            for k, name in enumerate("xyz")
        ]
    axes = stations.axes
    pairs: dict[tuple[int, int], Interval] = {}
    for k in range(n - 1):
        angle = math.atan2(
            float(np.linalg.norm(np.cross(axes[k], axes[k + 1]))), float(axes[k] @ axes[k + 1])
        )
        pairs[k, k + 1] = Interval(angle, angle)
    for k in range(1, n - 1):
        product = rotated_product(axes[k - 1], axes[k + 1], axes[k], stations.turns[k])
        cosines = [min(max(x, -1.0), 1.0) for x in (product.high, product.low)]
        pairs[k - 1, k + 1] = Interval(math.acos(cosines[0]), math.acos(cosines[1]))
    name = f"the axes of {stations.joints[0]} and {stations.joints[-1]}"
    allowed = Interval(0.0, 0.0) if n == 1 else closed_under(pairs, n, angle_sum)[0, n - 1]
    if n == 1:
        name = f"the axis of {stations.joints[0]} and the direction that it keeps"
    return [AngleBound(axes[0], stations.R_zero.T @ axes[-1], name, allowed)]


def _shown(vector: Floats) -> str:
    return "(" + ", ".join(f"{0.0 if abs(x) < 1e-12 else x:.4g}" for x in vector.tolist()) + ")"
