"""Error of a frame along axes, with weights and tolerances, traced (`dynx.ik.axis_residual` on symbols).

A kernel is compiled for what is weighted and bounded (`AxisKind`); the weights and bounds are its inputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.ik.axes import AxisRequirement
from dynx.ik.axis_residual import INSIDE, SMALL_SINE
from dynx.ik.kernels.residual import TracedResidual, root, rotation_vector, squared_length
from dynx.simd.inlining import less, less_equal, maximum, select
from dynx.spatial.scalar import Array, Floats, arctan
from dynx.spatial.so3 import cross


@dataclass(frozen=True)
class AxisKind:
    """Axes that are not free, parts whose components are bounded one by one, and whose axes they are."""

    used: tuple[bool, ...]
    """Whether each of position x, y, z and rotation x, y, z has a weight above 0."""
    bounds_position: bool
    bounds_rotation: bool
    of_target: bool
    free_rotation: int | None

    @classmethod
    def of(cls, axes: AxisRequirement) -> AxisKind:
        """Return the kind of a requirement."""
        return cls(
            tuple(weight != 0.0 for weight in axes.weights),
            axes.position_tolerances is not None,
            axes.rotation_tolerances is not None,
            axes.of_target,
            axes.free_rotation,
        )

    def bounded(self, component: int) -> bool:
        """Return whether a component has a bound of its own."""
        return self.bounds_position if component < 3 else self.bounds_rotation


N_AXIS_VALUES = 12
"""Number of weights and bounds."""


def axis_values(axes: AxisRequirement) -> Floats:
    """Return the weights (6,), then the bounds (6,), 0 where there is none."""
    bounds = [*(axes.position_tolerances or (0.0,) * 3), *(axes.rotation_tolerances or (0.0,) * 3)]
    return np.array([*axes.weights, *(bound if bound < math.inf else 0.0 for bound in bounds)])


def axis_residual(
    kind: AxisKind,
    frame: tuple[Array, Array, Array],
    position: Array | None,
    rotation: Array | None,
    values: Array,
) -> tuple[TracedResidual, Array]:
    """Return the weighted error (m,) of a frame (R, p, J) with respect to its target, and its Jacobian."""
    R, p, J = frame
    of_target = kind.of_target and rotation is not None

    def along(a: Array) -> Array:
        """Return vectors (3, ...) along the axes that count."""
        assert not of_target or rotation is not None
        return np.asarray(rotation.T @ a) if of_target and rotation is not None else a

    errors: list[Any] = [0.0] * 6
    rows: list[Array] = [J[0]] * 6
    if position is not None:
        errors[:3], rows[:3] = along(position - p), list(along(J[:3]))
    if rotation is not None:
        turning = J[3:]
        if kind.free_rotation is None:
            vector, _ = rotation_vector(rotation @ R.T)
        else:
            k = kind.free_rotation
            direction = rotation[:, k] if of_target else np.eye(3)[k]
            current = np.asarray(R[:, k] if of_target else R @ rotation[k])
            vector = _turn_between(current, direction)
            turning = turning - current[:, None] * (current @ turning)[None]
        errors[3:], rows[3:] = along(vector), list(along(turning))
    weighted: list[Any] = []
    counted: list[Array] = []
    within: Any = 1.0
    for k in (k for k in range(6) if kind.used[k]):
        excess, counts = errors[k], values[k]
        if kind.bounded(k):
            size, bound = abs(errors[k]), values[6 + k]
            over = maximum(size - INSIDE * bound, 0.0)
            excess = select(less(errors[k], 0.0), -over, over)
            # An error within its tolerance restricts nothing.
            counts = counts * less(0.0, over)
            within = within * less_equal(size, bound)
        weighted.append(counts * excess)
        counted.append(counts * rows[k])
    distance, angle = (
        root(sum((errors[k] * errors[k] for k in part if kind.used[k]), start=0.0 * values[0]))
        for part in (range(3), range(3, 6))
    )
    residual = TracedResidual(
        np.array(weighted, dtype=object), distance, angle, within,
        not kind.bounds_position, not kind.bounds_rotation,
    )  # fmt: skip
    return residual, np.array(counted, dtype=object)


def _turn_between(a: Array, b: Array) -> Array:
    """Return the smallest rotation vector (3,) [rad] that turns the unit vector a to b."""
    normal = np.asarray(cross(a, b))
    sine, cosine = root(squared_length(normal)), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    obtuse = less(cosine, 0.0)
    half = np.asarray(arctan(sine / (abs(cosine) + 1.0)))[()]
    angle = select(obtuse, math.pi - 2.0 * half, 2.0 * half)
    small = less(sine, SMALL_SINE)
    scale = select(small, 1.0, angle / maximum(sine, SMALL_SINE))
    # Opposite directions: any axis perpendicular to them, here across the smallest component of b.
    squares = [b[k] * b[k] for k in range(3)]
    first = less_equal(squares[0], squares[1]) * less_equal(squares[0], squares[2])
    second = (1.0 - first) * less_equal(squares[1], squares[2])
    least = np.array([first, second, 1.0 - first - second], dtype=object)
    across = least - b * (least @ b)
    length = maximum(root(squared_length(across)), SMALL_SINE)
    opposite = small * obtuse
    return np.array(
        [select(opposite, math.pi * x / length, scale * y) for x, y in zip(across, normal, strict=True)],
        dtype=object,
    )
