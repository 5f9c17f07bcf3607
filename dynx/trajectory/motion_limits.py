"""Limits of velocity, acceleration and jerk given by a caller, and the limits of a scalar path parameter."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.model.numbers import real_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.displacement import Ends

LIMIT_MARGIN = 64.0 * float(np.finfo(np.float64).eps)
"""Relative margin to its limits with which a motion is planned, so that rounding cannot violate them."""

SCALAR_LIMIT_RANGE = 1e-100, 1e100
"""Range to which limits of the path parameter s are clamped, so that no product under- or overflows."""


def checked_limit(name: str, bound: ArrayLike, nv: int) -> Floats:
    """Return a limit (nv,) from one number for all coordinates or one for each; infinity means no limit.

    Raises ArgumentError for a negative number or NaN, ShapeError for a wrong shape, DTypeError for anything
    but real numbers.
    """
    array = real_array(name, bound)
    if array.shape not in ((), (nv,)):
        raise ShapeError(f"{name} has shape {array.shape}; wanted one number, or ({nv},)")
    array = np.array(np.broadcast_to(array, (nv,)))
    wrong = np.flatnonzero(~(array >= 0.0))
    if wrong.size:
        k = int(wrong[0])
        raise ArgumentError(f"{name}[{k}] is {array[k]:g}; wanted 0 or more, or infinity for no limit")
    return array


def velocity_limits(bound: ArrayLike | None, ends: Ends) -> Floats:
    """Return the velocity limits (nv,): those given, or the model's.

    Raises ArgumentError with neither, and the errors of `checked_limit`.
    """
    if bound is not None:
        return checked_limit("velocity", bound, ends.nv)
    if ends.model is None:
        raise ArgumentError("neither velocity nor a model with velocity limits is given; wanted one of them")
    return ends.model.velocity_limit


def scalar_limit(name: str, bound: Floats, ends: Ends) -> float:
    """Return the limit of the path parameter s, from 0 to 1.

    Each coordinate moves by s times its displacement. The limit is the least limit / |displacement| of the
    coordinates that move, clamped to `SCALAR_LIMIT_RANGE` and less the relative margin `LIMIT_MARGIN`;
    infinite if none of them has a limit. Raises TrajectoryError if a coordinate has to move but its limit is
    0.
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
        # Outside this range the duration would violate `MIN_DURATION` or `MAX_DURATION`.
        least = min(max(least, SCALAR_LIMIT_RANGE[0]), SCALAR_LIMIT_RANGE[1])
    return least * (1.0 - LIMIT_MARGIN)


def require_positive_finite(name: str, bound: Floats, ends: Ends) -> None:
    """Raise TrajectoryError for a limit that is 0 or infinite."""
    wrong = np.flatnonzero(~((bound > 0.0) & np.isfinite(bound)))
    if wrong.size:
        k = int(wrong[0])
        raise TrajectoryError(
            f"the limit of {name} of {ends.name(k)} is {bound[k]:g}; wanted one above 0 and finite"
        )


def require_motion(ends: Ends) -> None:
    """Raise ArgumentError if nothing moves, so that no shortest duration exists."""
    if not ends.displacement.any():
        raise ArgumentError("q0 and q1 are the same; give a duration to stand still for")
