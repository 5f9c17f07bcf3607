"""Proofs that targets are out of reach, in words."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dynx.ik.problem import Problem, Requirement
from dynx.ik.reach.bounds import (
    AngleBound,
    DistanceBound,
    HeightBound,
    angle_bounds,
    distance_bounds,
    height_bounds,
)
from dynx.ik.reach.intervals import Interval
from dynx.ik.reach.stations import stations_to
from dynx.model import Model
from dynx.spatial.scalar import Floats

_RELATIVE_ROUNDING = 1e-9
"""Rounding of a distance relative to its magnitude, above that of forward kinematics."""

_ANGLE_ROUNDING = 1e-7
"""Rounding of an angle near 0 [rad], where its cosine does not determine it."""

Bounds = tuple[tuple[DistanceBound, ...], tuple[HeightBound, ...], tuple[AngleBound, ...]]


def proofs(problem: Problem, model: Model, unreached: NDArray[np.bool_]) -> NDArray[np.object_]:
    """Return a sentence (count,) for each target that is proved out of reach; others have an empty one.

    Only those `unreached` (count,) are examined. The bounds hold within position limits, for every frame on
    its own; a model with a floating base has none.
    """
    found = np.full(problem.count, "", dtype=object)
    if model.floating or not unreached.any():
        return found
    at = np.flatnonzero(unreached)
    for requirement in problem.requirements:
        remaining = at[found[at] == ""]
        several = len(problem.requirements) > 1
        for index, sentence in _of_frame(model, requirement, problem.batch, remaining).items():
            found[index] = f"{requirement.frame}: {sentence}" if several else sentence
    return found


def _of_frame(
    model: Model, requirement: Requirement, batch: tuple[int, ...], at: NDArray[np.intp]
) -> dict[int, str]:
    """Return sentences by index, for the targets with the indices `at`."""
    point = (0.0, 0.0, 0.0) if requirement.point is None else tuple(requirement.point.tolist())
    distances, heights, angles = frame_bounds(model, requirement.frame, point)
    position_slack, rotation_slack = _slacks(requirement)
    positions = _chosen(requirement.targets.positions, batch, (3,), at)
    rotations = _chosen(requirement.targets.rotations, batch, (3, 3), at)
    excess = np.zeros(len(at))
    sentences: dict[int, str] = {}

    def examine(bound: DistanceBound | HeightBound | AngleBound, values: Floats, slack: float) -> None:
        allowed: Interval = bound.allowed
        beyond = np.maximum(values - allowed.high, allowed.low - values) - slack
        for k in np.flatnonzero(beyond > excess).tolist():
            excess[k] = beyond[k]
            sentences[int(at[k])] = bound.sentence(float(values[k]))

    if positions is not None and math.isfinite(position_slack):
        for bound in distances:
            if not bound.needs_rotation:
                values = bound.measured(positions, None)
            elif rotations is not None and math.isfinite(rotation_slack):
                values = bound.measured(positions, rotations)
            else:
                continue
            turned = rotation_slack * bound.lever() if bound.needs_rotation else 0.0
            examine(
                bound,
                values,
                position_slack + turned + _RELATIVE_ROUNDING * (1.0 + float(values.max(initial=0.0))),
            )
        for height in heights:
            values = height.measured(positions)
            size = float(np.abs(values).max(initial=0.0))
            examine(height, values, position_slack + _RELATIVE_ROUNDING * (1.0 + size))
    if rotations is not None and math.isfinite(rotation_slack) and not sentences:
        for angle in angles:
            examine(angle, angle.measured(rotations), rotation_slack + _ANGLE_ROUNDING)
    return sentences


def _chosen(
    array: Floats | None, batch: tuple[int, ...], shape: tuple[int, ...], at: NDArray[np.intp]
) -> Floats | None:
    """Return the entries of targets with the indices `at` after broadcasting to the leading axes `batch`."""
    if array is None:
        return None
    return np.broadcast_to(array, (*batch, *shape)).reshape(-1, *shape)[at]


def _slacks(requirement: Requirement) -> tuple[float, float]:
    """Return the greatest distance [m] and angle [rad] from a target that is reached; infinite if a part of
    either is free."""
    slacks = [requirement.tolerances.position_tolerance, requirement.tolerances.rotation_tolerance]
    axes = requirement.axes
    if axes is not None:
        for part, bounds in enumerate((axes.position_tolerances, axes.rotation_tolerances)):
            if bounds is not None:
                slacks[part] = math.sqrt(sum(bound * bound for bound in bounds))
            if not all(axes.weights[3 * part : 3 * part + 3]):
                slacks[part] = math.inf
    return slacks[0], slacks[1]


@lru_cache(maxsize=64)
def frame_bounds(model: Model, frame: str, point: tuple[float, float, float]) -> Bounds:
    """Return the bounds on distances, heights and angles of a frame with a point (3,) [m] in its axes."""
    stations, in_frame = stations_to(model, frame), np.array(point)
    return (
        tuple(distance_bounds(stations, in_frame)),
        tuple(height_bounds(stations, in_frame)),
        tuple(angle_bounds(stations)),
    )
