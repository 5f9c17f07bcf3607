"""Proofs that targets are out of reach, in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

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
from dynx.ik.reach.stations import stations_to
from dynx.model import Model
from dynx.spatial.scalar import Floats

_RELATIVE_ROUNDING = 1e-9
"""Rounding of a distance relative to its magnitude, above that of forward kinematics."""

_ANGLE_ROUNDING = 1e-7
"""Rounding of an angle near 0 [rad], where its cosine does not determine it."""


class FrameBounds(NamedTuple):
    """Bounds of one frame."""

    distances: tuple[DistanceBound, ...]
    heights: tuple[HeightBound, ...]
    angles: tuple[AngleBound, ...]


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


def proof_of(model: Model, requirement: Requirement, number: int) -> str:
    """Return the sentence that proves target `number` of a requirement (n,) out of reach; empty without."""
    if model.floating:
        return ""
    at = np.array([number], dtype=np.intp)
    return _of_frame(model, requirement, requirement.targets.batch, at).get(number, "")


def _of_frame(
    model: Model, requirement: Requirement, batch: tuple[int, ...], at: NDArray[np.intp]
) -> dict[int, str]:
    """Return sentences by index, for the targets with the indices `at`."""
    point = (0.0, 0.0, 0.0) if requirement.point is None else tuple(requirement.point.tolist())
    bounds = frame_bounds(model, requirement.frame, point)
    position_slack, rotation_slack = _slacks(requirement)
    positions = _chosen(requirement.targets.positions, batch, (3,), at)
    rotations = _chosen(requirement.targets.rotations, batch, (3, 3), at)
    if not math.isfinite(rotation_slack):
        rotations = None
    excess, sentences = np.zeros(len(at)), {}

    def examine(
        each: Sequence[DistanceBound | HeightBound | AngleBound], values: Floats, slack: Floats
    ) -> None:
        """Compare values (n, k) of the targets with k bounds, whose slacks are (k,) or (n, k)."""
        low, high = (np.array([getattr(bound.allowed, end) for bound in each]) for end in ("low", "high"))
        beyond = np.maximum(values - high, low - values) - slack
        for k in np.flatnonzero((beyond > excess[:, None]).any(axis=1)).tolist():
            worst = int(beyond[k].argmax())
            excess[k] = beyond[k, worst]
            sentences[int(at[k])] = each[worst].sentence(float(values[k, worst]))

    if positions is not None and math.isfinite(position_slack):
        distances = [bound for bound in bounds.distances if rotations is not None or not bound.needs_rotation]
        if distances:
            starts, offsets = (
                np.array([getattr(b, name) for b in distances]) for name in ("start", "offset")
            )
            points = positions[:, None, :] - starts
            if rotations is not None:
                points = points + np.swapaxes(rotations @ offsets.T, 1, 2)
            values = np.sqrt((points * points).sum(axis=-1))
            levers = np.sqrt((offsets * offsets).sum(axis=-1)) if rotations is not None else np.zeros(1)
            turned = levers * rotation_slack if rotations is not None else levers
            examine(distances, values, position_slack + turned + _RELATIVE_ROUNDING * (1.0 + values))
        values = positions @ np.array([height.direction for height in bounds.heights]).T
        examine(bounds.heights, values, position_slack + _RELATIVE_ROUNDING * (1.0 + np.abs(values)))
    if rotations is not None and not sentences:
        values = np.stack([angle.measured(rotations) for angle in bounds.angles], axis=1)
        examine(bounds.angles, values, np.asarray(rotation_slack + _ANGLE_ROUNDING))
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
def frame_bounds(model: Model, frame: str, point: tuple[float, float, float]) -> FrameBounds:
    """Return the bounds on distances, heights and angles of a frame with a point (3,) [m] in its axes."""
    stations, in_frame = stations_to(model, frame), np.array(point)
    return FrameBounds(
        tuple(distance_bounds(stations, in_frame)),
        tuple(height_bounds(stations, in_frame)),
        tuple(angle_bounds(stations)),
    )
