"""Three prismatic joints and up to three revolute ones, in any order, such as a gantry with a wrist.

The revolute joints alone determine the rotation: with three of them in two ways, whether or not their axes
meet. With their angles the position is linear in the positions of the prismatic joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.ik.closed_forms.spherical_wrist import wrist_angles
from dynx.ik.closed_forms.subproblems import Angle, Coordinate, Slide, angle_from_to, dot, turn, turn_back
from dynx.spatial.scalar import Array, Floats, where_less
from dynx.spatial.so3 import cross, rotate

_SINGULAR = 1e-12
"""Determinant of the directions of the slides below which they do not span space."""


@dataclass(frozen=True, eq=False)
class ThreeSlides:
    """Geometry at the zero configuration; lengths are relative."""

    axes: Floats
    """Directions (n, 3), n from 3 to 6."""
    points: Floats
    """Points on the axes (n, 3)."""
    revolute: tuple[bool, ...]
    preferred: Floats
    """Angles (n,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of the last revolute axis."""
    arbitrary: tuple[int, ...]
    """The first of three revolute joints: its angle is arbitrary if the other axes put the third along it."""
    case: str = "three slides"

    def angles(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        """Return the coordinates of the branch `signs` (..., 3) for E_1 ... E_n = (R, p)."""
        arm, elbow, flip = signs[..., 0], signs[..., 1], signs[..., 2]
        turns = dict(zip(self._turning, self._rotations(R, flip), strict=True))
        a, b, c = (self._before(k, turns) for k, turning in enumerate(self.revolute) if not turning)
        y: Array = np.zeros(3)
        for k in reversed(self._turning):
            y = self.points[k] + turn(self.axes[k], turns[k], y - self.points[k])
        r = p - y
        determinant = dot(a, cross(b, c))
        determinant = where_less(abs(determinant), _SINGULAR, _SINGULAR, determinant)
        # The signs that select nothing are 1.
        exists = where_less(arm, elbow, arm, elbow)
        if len(turns) < 3:
            exists = where_less(flip, exists, flip, exists)
        slides = iter(
            Slide(dot(r, each) / determinant, separation=exists)
            for each in (cross(b, c), cross(c, a), cross(a, b))
        )
        return [turns[k] if turning else next(slides) for k, turning in enumerate(self.revolute)]

    def reaches(self, least: float) -> bool:
        """Return whether the joints move the frame in as many directions as there are joints."""
        h = self.axes[self._turning]
        if any(np.linalg.norm(cross(h[k], h[k + 1])) < least for k in range(len(h) - 1)):
            return False
        largest = 0.0
        for value in (0.3, 1.4, 2.9):
            angles = value + 0.7 * np.arange(len(self.axes))
            turns = {k: Angle(np.cos(angles[k]), np.sin(angles[k])) for k in self._turning}
            a, b, c = (self._before(k, turns) for k, turning in enumerate(self.revolute) if not turning)
            largest = max(largest, abs(float(a @ cross(b, c))))
        return largest > least

    @property
    def _turning(self) -> list[int]:
        """Numbers of the revolute joints."""
        return [k for k, turning in enumerate(self.revolute) if turning]

    def _rotations(self, R: Array, flip: Array) -> list[Angle]:
        """Return the angles of the revolute joints."""
        of, h = self._turning, self.axes[self._turning]
        if len(of) == 3:
            return wrist_angles(h, self.normal, lambda a: rotate(R, a), flip, self.preferred[of[0]])
        if not of:
            return []
        found, side = [], rotate(R, self.normal)
        if len(of) == 2:
            found = [angle_from_to(h[0], h[1], rotate(R, h[1]), 0.0)]
            side = turn_back(h[0], found[0], side)
        return [*found, angle_from_to(h[-1], self.normal, side, 0.0)]

    def _before(self, k: int, turns: dict[int, Angle]) -> Array:
        """Return the direction of joint k after the turns of the joints before it."""
        a: Array = self.axes[k]
        for j in reversed(self._turning):
            if j < k:
                a = turn(self.axes[j], turns[j], a)
        return a
