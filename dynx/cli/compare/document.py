"""The JSON document of ``dynx compare``: distances in rad or m, times in s."""

from __future__ import annotations

import math
from typing import Literal, TypedDict

from dynx.sim.comparison.comparison import Cause, RolloutComparison
from dynx.world.separation import Separation

SCHEMA: Literal["dynx.compare/1"] = "dynx.compare/1"

THRESHOLDS = (1e-6, 1e-3, 1e-2, 1e-1)
"""Distances [rad or m] whose first time is reported."""


class PartingEntry(TypedDict):
    """First time at which a coordinate or body is farther apart than `distance`; null for never."""

    distance: float
    time: float | None
    name: str | None


class CoordinateEntry(TypedDict):
    """Largest distance of a coordinate or body, its time, and the distance at the end."""

    name: str
    unit: str
    largest: float | None
    time: float
    end: float | None


class CauseEntry(TypedDict):
    """A difference of the scenarios: `alone` is the largest distance from A if it alone is taken over from B,
    `without` that from B if all others are. Null: not simulated, or infinite; `obstacle` says why."""

    name: str
    first: str
    second: str
    alone: float | None
    without: float | None
    acts: bool
    obstacle: str | None


class CompareDocument(TypedDict):
    """Two rollouts; `repeated` and `remaining` are the distances of a rerun of A from A, and of A with all
    differences from B."""

    schema: Literal["dynx.compare/1"]
    first: str
    second: str
    robot: str
    tolerance: float
    alike: bool
    proved: bool
    duration: float
    largest: float | None
    parted: list[PartingEntry]
    coordinates: list[CoordinateEntry]
    causes: list[CauseEntry]
    repeated: float | None
    remaining: float | None
    notes: list[str]


def document(comparison: RolloutComparison, first: str, second: str) -> CompareDocument:
    """Return the document of a comparison of the files `first` and `second`."""
    apart = comparison.separation
    return {
        "schema": SCHEMA,
        "first": first,
        "second": second,
        "robot": comparison.ours.model.name,
        "tolerance": comparison.tolerance,
        "alike": comparison.alike,
        "proved": comparison.proved,
        "duration": float(apart.times[-1] - apart.times[0]),
        "largest": _finite(apart.largest),
        "parted": [_parting(apart, each) for each in sorted({comparison.tolerance, *THRESHOLDS})],
        "coordinates": [_coordinate(apart, column) for column in range(len(apart.names))],
        "causes": [_cause(each, comparison.tolerance) for each in comparison.causes],
        "repeated": _finite(comparison.repeated),
        "remaining": _finite(comparison.remaining),
        "notes": list(comparison.notes),
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def _parting(apart: Separation, distance: float) -> PartingEntry:
    time, name = apart.first_beyond(distance) or (None, None)
    return {"distance": distance, "time": time, "name": name}


def _coordinate(apart: Separation, column: int) -> CoordinateEntry:
    distances = apart.distances[:, column]
    k = int(distances.argmax())
    return {
        "name": apart.names[column],
        "unit": apart.units[column],
        "largest": _finite(float(distances[k])),
        "time": float(apart.times[k]),
        "end": _finite(float(distances[-1])),
    }


def _cause(cause: Cause, tolerance: float) -> CauseEntry:
    return {
        "name": cause.factor.name,
        "first": cause.factor.ours,
        "second": cause.factor.theirs,
        "alone": _finite(cause.alone),
        "without": _finite(cause.without),
        "acts": cause.acts(tolerance),
        "obstacle": cause.obstacle,
    }
