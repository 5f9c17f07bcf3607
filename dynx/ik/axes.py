"""Requirements per axis: free axes, weights and tolerances along the axes of the target or of the world."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, nearest, shown
from dynx.model.numbers import real_array
from dynx.model.targets import FREE, Targets

AXIS_NAMES = ("position_x", "position_y", "position_z", "rotation_x", "rotation_y", "rotation_z")
"""Names of single axes, which `free` takes, in the order of `weights`."""

AXES = ("target", "world")
"""Axes along which free axes, weights and tolerances count."""

Six = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class AxisRequirement:
    """Weights and tolerances of the error along six axes: position [m], then rotation vector [rad].

    An axis of weight 0 is free. If exactly one rotation is free, the error of the others is the smallest
    rotation that turns the frame's axis to that of the target: any rotation about the axis is allowed. Other
    rotation errors are the components of the rotation vector from the frame to the target.
    """

    weights: Six
    position_tolerances: tuple[float, float, float] | None
    """Bounds on the components [m]; None for a bound on their norm."""
    rotation_tolerances: tuple[float, float, float] | None
    """Bounds on the components [rad]; None for a bound on their norm."""
    of_target: bool
    """True if x, y and z are the axes of the target; False if they are those of the world."""

    @property
    def free_rotation(self) -> int | None:
        """The only axis about which rotation is free: 0, 1 or 2, or None."""
        free = [k for k in range(3) if self.weights[3 + k] == 0.0]
        return free[0] if len(free) == 1 else None

    def for_targets(self, targets: Targets) -> AxisRequirement:
        """Return the requirement for targets of which a part may be absent, which is free then.

        Raises ArgumentError if no axis remains.
        """
        present = [targets.positions is not None] * 3 + [targets.rotations is not None] * 3
        w = [weight * there for weight, there in zip(self.weights, present, strict=True)]
        if not any(w):
            raise ArgumentError("every axis of the target is free; nothing remains to be reached")
        weights: Six = (w[0], w[1], w[2], w[3], w[4], w[5])
        return AxisRequirement(
            weights,
            self.position_tolerances,
            self.rotation_tolerances,
            self.of_target and targets.rotations is not None,
        )


def checked_axes(
    free: str | Sequence[str] | None,
    weights: ArrayLike | None,
    position_tolerance: ArrayLike,
    rotation_tolerance: ArrayLike,
    axes: str,
) -> tuple[str | None, AxisRequirement | None]:
    """Return the free part of a target, and the requirement per axis if there is one.

    Raises ArgumentError, ShapeError or DTypeError for options that cannot be used, with the nearest name.
    """
    if not isinstance(axes, str) or axes not in AXES:
        raise ArgumentError(f"axes is {shown(axes)}{nearest(str(axes), AXES)}")
    names = _free_names(free)
    along = [
        checked_tolerance("position_tolerance", position_tolerance),
        checked_tolerance("rotation_tolerance", rotation_tolerance),
    ]
    per_axis = [bound if isinstance(bound, tuple) else None for bound in along]
    if (
        weights is None
        and per_axis == [None, None]
        and (len(names) == 0 or names in (("rotation",), ("position",)))
    ):
        return (names[0] if names else None), None
    w = [1.0] * 6 if weights is None else _checked_weights(weights)
    for part, bounds in enumerate(per_axis):
        for k, bound in enumerate(bounds or ()):
            if bound == math.inf:
                w[3 * part + k] = 0.0
    for name in names:
        if name in FREE:
            first = 0 if name == "position" else 3
            w[first : first + 3] = [0.0] * 3
        else:
            w[AXIS_NAMES.index(name)] = 0.0
    if not any(w):
        raise ArgumentError("every axis of the target is free; nothing remains to be reached")
    six: Six = (w[0], w[1], w[2], w[3], w[4], w[5])
    return None, AxisRequirement(six, per_axis[0], per_axis[1], axes == "target")


def _free_names(free: Any) -> tuple[str, ...]:
    """Return the names of what is free."""
    names: tuple[Any, ...] = ()
    if isinstance(free, str):
        names = (free,)
    elif isinstance(free, Sequence):
        names = tuple(free)
    elif free is not None:
        raise ArgumentError(
            f"free is {shown(free)}; wanted a name or several: {', '.join(FREE + AXIS_NAMES)}"
        )
    for name in names:
        if not isinstance(name, str) or name not in FREE + AXIS_NAMES:
            raise ArgumentError(f"free is {shown(name)}{nearest(str(name), FREE + AXIS_NAMES)}")
    return names


def checked_tolerance(name: str, tolerance: ArrayLike) -> float | tuple[float, float, float]:
    """Return a tolerance as a number, or as three numbers along the axes, of which some may be infinite."""
    if isinstance(tolerance, int | float | np.number) and not isinstance(tolerance, bool):
        if 0.0 < tolerance < math.inf:
            return float(tolerance)
    elif isinstance(tolerance, Sequence | np.ndarray) and not isinstance(tolerance, str | bytes):
        array = real_array(name, tolerance)
        if array.shape != (3,):
            raise ShapeError(f"{name} has shape {array.shape}; wanted a number, or (3,) along x, y and z")
        if (array > 0.0).all():
            x, y, z = array.tolist()
            return x, y, z
    raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number, or three")


def _checked_weights(weights: ArrayLike) -> list[float]:
    array = real_array("weights", weights)
    if array.shape != (6,):
        raise ShapeError(
            f"weights has shape {array.shape}; wanted (6,): position x, y, z [1/m], rotation x, y, z [1/rad]"
        )
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise ArgumentError(f"weights is {shown(array.tolist())}; wanted finite numbers, at least 0")
    found: list[float] = array.tolist()
    return found
