"""One candidate of a branch and its errors, in array code for any scalar: a kernel, or NumPy for batches."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from dynx.ik.closed_forms.polish import AxisFrames, errors_of, polished
from dynx.ik.closed_forms.recognition import Geometry
from dynx.ik.closed_forms.subproblems import Angle, Coordinate, Slide
from dynx.ik.coordinates import FULL_TURN
from dynx.spatial.scalar import Array, Floats, arctan2, cos, sin, where_less
from dynx.spatial.so3 import rotate, rotate_back

POSITION, ROTATION, VIOLATION, SEPARATION, ARBITRARY = range(5)
"""Columns of the measures of a candidate."""

N_MEASURES = 5


@dataclass(frozen=True, eq=False)
class Candidates:
    """Function from a pose and a branch to the coordinates of one chain."""

    geometry: Geometry
    inverted: bool
    frames: AxisFrames
    R_zero: Floats
    p_zero: Floats
    """Pose of the frame at the zero configuration; lengths are relative."""
    lower: Floats
    upper: Floats
    """Limits (n,) [rad or m]."""
    revolute: tuple[bool, ...]
    """Whether each joint turns; the others slide."""
    length: float
    """Length [m] of the chain."""
    steps: int
    """Number of Newton steps."""

    def __call__(self, pose: Array, signs: Array) -> dict[str, Array]:
        """Return the coordinates `q` (..., n) [rad or m] and `measures` (..., 5) for poses (..., 3, 4), with
        relative lengths, and signs (..., 3).

        The measures are the errors of position (relative) and rotation (`polish.errors_of`), the violation of
        the limits [rad or m], the least separation of the branches (`subproblems.Angle`), and the sum of 2^k
        for the entries k of `geometry.arbitrary` whose angles are arbitrary.
        """
        R, p = pose[..., :3], pose[..., 3]
        return self._measured(R, p, self._closed_form(R, p, signs), self.steps)

    def measured(self, pose: Array, q: Array, steps: int) -> dict[str, Array]:
        """Return the same for coordinates q (..., n), after some Newton steps; the separation is 1."""
        angles = [
            Angle(cos(q[..., k]), sin(q[..., k])) if turns else Slide(q[..., k] / self.length)
            for k, turns in enumerate(self.revolute)
        ]
        return self._measured(pose[..., :3], pose[..., 3], angles, steps)

    @property
    def content(self) -> tuple[object, ...]:
        """Numbers and cases that determine the function."""
        values = [
            getattr(part, field.name) for part in (self.geometry, self.frames, self) for field in fields(part)
        ]
        arrays = [each for value in values for each in (value if isinstance(value, tuple) else (value,))]
        numbers = [each.tolist() if isinstance(each, np.ndarray) else str(each) for each in arrays]
        return type(self.geometry).__name__, *numbers

    def _measured(self, R: Array, p: Array, angles: list[Coordinate], steps: int) -> dict[str, Array]:
        angles = polished(self.frames, R, p, angles, steps)
        position, rotation = errors_of(self.frames, R, p, angles)
        within = [
            _slide_within(q.value * self.length, float(low), float(high))
            if isinstance(q, Slide)
            else _within(arctan2(q.sin, q.cos), float(low), float(high))
            for q, low, high in zip(angles, self.lower, self.upper, strict=True)
        ]
        violation = within[0][1]
        for _, each in within[1:]:
            violation = where_less(violation, each, each, violation)
        separation = np.asarray(angles[0].separation)
        for q in angles[1:]:
            separation = where_less(q.separation, separation, q.separation, separation)
        joints = (
            [len(angles) - 1 - k for k in self.geometry.arbitrary]
            if self.inverted
            else self.geometry.arbitrary
        )
        arbitrary = sum(2.0**place * np.asarray(angles[k].arbitrary) for place, k in enumerate(joints))
        measures = np.broadcast_arrays(position, rotation, violation, separation, np.asarray(arbitrary))
        return {
            "q": np.stack(np.broadcast_arrays(*(value for value, _ in within)), axis=-1),
            "measures": np.stack(measures, axis=-1),
        }

    def _closed_form(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        R_G = R @ self.R_zero.T
        p_G = p - rotate(R_G, self.p_zero)
        if not self.inverted:
            return [*self.geometry.angles(R_G, p_G, signs)]
        return [*self.geometry.angles(np.swapaxes(R_G, -1, -2), -rotate_back(R_G, p_G), signs)][::-1]


def _within(value: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return an angle from -pi to pi moved by a full turn into its limits where possible, and by how much it
    violates them."""
    if low <= -np.pi and high >= np.pi:
        # The angle itself is within the limits.
        return value, 0.0 * value
    shifts = [s for s in (FULL_TURN, -FULL_TURN) if low <= np.pi + s and high >= s - np.pi]
    turns = [value, *(value + shift for shift in shifts)]
    found, least = turns[0], _excess(turns[0], low, high)
    for each in turns[1:]:
        excess = _excess(each, low, high)
        found, least = where_less(excess, least, each, found), where_less(excess, least, excess, least)
    return found, least


def _slide_within(value: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return a position and by how much it violates its limits."""
    return value, _excess(value, low, high)


def _excess(value: Array, low: float, high: float) -> Array:
    below = low - value if np.isfinite(low) else -1.0 + 0.0 * value
    above = value - high if np.isfinite(high) else -1.0 + 0.0 * value
    most = where_less(below, above, above, below)
    return where_less(0.0, most, most, 0.0)
