"""Error of a frame with respect to its target, traced (`dynx.ik.residual` on symbols)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.simd.inlining import less, less_equal, maximum, select
from dynx.spatial.scalar import Array, arctan, sqrt

_SMALL_SINE = 1e-7
"""Twice the sine of an angle below which the antisymmetric part of a rotation does not give its axis."""


@dataclass(frozen=True)
class TracedResidual:
    """Error vector (m,), the distance [m] and the angle [rad]; a part that is free has no rows."""

    vector: Array
    distance: Any
    angle: Any
    within: Any = 1.0
    """1 where every component is within its own bound."""
    bounds_distance: bool = True
    bounds_angle: bool = True
    """Whether the tolerances bound the distance and the angle; otherwise the bounds of components do."""

    def reached(self, position_tolerance: Any, rotation_tolerance: Any) -> Any:
        """Return 1 where the error is within the tolerances, otherwise 0."""
        within = self.within
        if self.bounds_distance:
            within = within * less_equal(self.distance, position_tolerance)
        return within * less_equal(self.angle, rotation_tolerance) if self.bounds_angle else within

    @classmethod
    def of(cls, position: Array | None, rotation: Array | None) -> TracedResidual:
        """Make the error from the displacement (3,) to the target and the rotation (3, 3) to it, in world
        axes."""
        parts: list[Array] = []
        distance: Any = 0.0
        angle: Any = 0.0
        if position is not None:
            parts.append(position)
            distance = root(squared_length(position))
        if rotation is not None:
            vector, angle = rotation_vector(rotation)
            parts.append(vector)
        return cls(np.concatenate(parts), distance, angle)


def rotation_vector(R: Array) -> tuple[Array, Any]:
    """Return the rotation vector of R (3, 3) and its norm in [0, pi] [rad] (Siciliano et al., eq. 2.27)."""
    axial = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    twice_sine = root(squared_length(axial))
    twice_cosine = R[0, 0] + R[1, 1] + R[2, 2] - 1.0
    obtuse = less(twice_cosine, 0.0)
    # tan(angle / 2), or that of pi - angle, so that its denominator is at least 2.
    half = np.asarray(arctan(twice_sine / (abs(twice_cosine) + 2.0)))[()]
    angle = select(obtuse, math.pi - 2.0 * half, 2.0 * half)
    # At an angle of pi the antisymmetric part vanishes: R + 1 = 2 a a'.
    columns = list((R + np.eye(3)).T)
    longest, square = columns[0], squared_length(columns[0])
    for column in columns[1:]:
        other = squared_length(column)
        longer = less(square, other)
        longest = np.array([select(longer, a, b) for a, b in zip(column, longest, strict=True)])
        square = select(longer, other, square)
    small = less(twice_sine, _SMALL_SINE)
    straight = small * obtuse
    divisor = select(straight, root(square), maximum(twice_sine, _SMALL_SINE))
    scale = select(small * (1.0 - obtuse), 0.5, angle / divisor)
    vector = [scale * select(straight, a, b) for a, b in zip(longest, axial, strict=True)]
    return np.array(vector), angle


def squared_length(a: Array) -> Any:
    """Return a' a for a vector (3,)."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


def root(x: Any) -> Any:
    """Return the square root of a symbol."""
    return np.asarray(sqrt(np.asarray(x)))[()]
