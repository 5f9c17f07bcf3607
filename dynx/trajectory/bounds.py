"""Limits of velocity, acceleration and jerk as a caller gives them, and what they leave of a line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.model.configuration import real_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.displacement import Ends

ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
"""How far inside its limits a motion is planned, as a part of them, so that rounding cannot break them."""

EXTREME = 1e-100, 1e100
"""What limits of the scalar s are brought within, so that no product of them vanishes or overflows."""


def checked_bound(name: str, bound: ArrayLike, nv: int) -> Floats:
    """A limit (nv,) from one number for all or one for each; infinity is no limit.

    Raises ArgumentError for one that is negative or NaN, ShapeError for a wrong shape.
    """
    array = real_array(name, bound)
    if array.shape not in ((), (nv,)):
        raise ShapeError(f"{name} has shape {array.shape}; wanted one number, or ({nv},)")
    array = np.array(np.broadcast_to(array, (nv,)))
    wrong = np.flatnonzero(~(array >= 0.0))
    if wrong.size:
        k = int(wrong[0])
        raise ArgumentError(f"{name}[{k}] is {array[k]:g}; wanted a limit above 0")
    return array


def velocity_bound(bound: ArrayLike | None, ends: Ends) -> Floats:
    """The limit of velocity (nv,): what is given, or the model's."""
    if bound is not None:
        return checked_bound("velocity", bound, ends.nv)
    if ends.model is None:
        raise ArgumentError("velocity is not given, nor a model that has limits; wanted one of them")
    return ends.model.velocity_limit


def along_line(name: str, bound: Floats, ends: Ends) -> float:
    """The limit of a scalar s of which every coordinate is a multiple: the least of bound / |displacement|.

    Infinite if no coordinate that moves has one. Raises TrajectoryError for a coordinate that has to
    move and may not.
    """
    distance = np.abs(ends.displacement)
    moving = distance > 0.0
    stuck = np.flatnonzero(moving & (bound == 0.0))
    if stuck.size:
        k = int(stuck[0])
        raise TrajectoryError(
            f"{ends.name(k)} has to move by {ends.displacement[k]:g} but its limit of {name} is 0"
        )
    with np.errstate(over="ignore"):
        least = float(np.min(bound[moving] / distance[moving], initial=np.inf))
    if np.isfinite(bound[moving]).any():
        # Beyond these it takes less or more time than a trajectory may (`SHORTEST`, `LONGEST`).
        least = min(max(least, EXTREME[0]), EXTREME[1])
    return least * (1.0 - ROUNDING)


def refuse_unusable(name: str, bound: Floats, ends: Ends) -> None:
    """Raise TrajectoryError for a limit of 0, or of infinity where a number is needed."""
    wrong = np.flatnonzero(~((bound > 0.0) & np.isfinite(bound)))
    if wrong.size:
        k = int(wrong[0])
        raise TrajectoryError(
            f"the limit of {name} of {ends.name(k)} is {bound[k]:g}; wanted one above 0 and finite"
        )


def refuse_standstill(ends: Ends) -> None:
    """Raise ArgumentError where nothing moves, so that no shortest duration exists."""
    if not ends.displacement.any():
        raise ArgumentError("q0 and q1 are the same; give a duration to stand still for")
