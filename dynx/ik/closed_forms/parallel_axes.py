"""Six revolute joints of which axes 2, 3 and 4 are parallel, as in the arms of Universal Robots.

The plane motion E_2 E_3 E_4 preserves components along the common direction h. With G = E_1 ... E_6, the
direction of axis 6 and a point x_6 on it, both unmoved by E_6, therefore satisfy

    h' R_1^-1 R_G h_6 = h' R_5 h_6,        h' E_1^-1 G x_6 = h' E_5 x_6,

two equations that are linear in cosine and sine of q_1 and of q_5 (subproblem 6 of Elias and Wen 2022). If
axes 5 and 6 intersect or are parallel, one of them contains q_1 alone: two solutions, and from the other
equation two of q_5. In general q_5 is eliminated, which leaves a quartic for q_1. Then follow q_6, the
distance between axes 2 and 4 with two solutions of q_3, and q_2 and q_4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynx.ik.closed_forms.planar_arm import PlanarArm
from dynx.ik.closed_forms.quartic import combined, conic_root, linear, squared
from dynx.ik.closed_forms.subproblems import (
    Angle,
    angle_from_to,
    component_terms,
    dot,
    positive_root,
    solve_linear,
    turn,
    turn_back,
    value_at,
)
from dynx.spatial.scalar import Array, Floats, append_axis
from dynx.spatial.so3 import rotate, rotate_back

WristCase = Literal["intersecting_5_6", "parallel_5_6", "general"]

Terms = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class ParallelAxes:
    """Geometry at the zero configuration; lengths are relative."""

    case: WristCase
    axes: Floats
    """Directions (6, 3); those of axes 3 and 4 are h_2 or its opposite."""
    points: Floats
    """Points on the axes (6, 3); the last two are nearest to each other."""
    preferred: Floats
    """Angles (6,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of h_2."""
    arbitrary: tuple[int, ...] = (0, 1, 5)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Angle]:
        """Return the six angles of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        h = self.axes
        q1, q5 = self._outer(R, p, signs[..., 0], signs[..., 2])
        # Axis 6 as seen from it: R_6 turns R_G^-1 R_1 h into R_5^-1 h.
        common = h[1]
        seen = rotate_back(R, turn(h[0], q1, common))
        q6 = angle_from_to(h[5], seen, turn_back(h[4], q5, common), self.preferred[5])
        q6 = self._chosen(R, p, q1, q5, q6)

        # The plane motion, by its effect on a normal and on axis 4.
        turned = turn_back(h[0], q1, rotate(R, turn_back(h[5], q6, turn_back(h[4], q5, self.normal))))
        tip = self._axis_4(R, p, q1, q5, q6)
        q2, q3, q4 = self.plane.angles(turned, tip, signs[..., 1], self.preferred[1])
        return [q1, q2, q3, q4, q5, q6]

    @property
    def plane(self) -> PlanarArm:
        """Axes 2, 3 and 4."""
        return PlanarArm(self.axes[1:4], self.points[1:4], self.normal)

    def reaches(self, least: float) -> bool:
        """Return whether every joint changes the terms that determine it by more than `least`."""
        return self.plane.reaches(least)

    def _outer(self, R: Array, p: Array, shoulder: Array, wrist: Array) -> tuple[Angle, Angle]:
        """Return q_1 and q_5."""
        h, x = self.axes, self.points
        # Sides of both equations: terms of R_1 h times a vector, and of h times R_5 times a vector.
        tip = rotate(R, x[5]) + p - x[0]
        by_axis = _turned_terms(h[1], h[0], rotate(R, h[5])), component_terms(h[1], h[4], h[5])
        by_point = _turned_terms(h[1], h[0], tip), component_terms(h[1], h[4], x[5] - x[4])
        offset = float(h[1] @ (x[4] - x[0]))
        if self.case == "general":
            return self._by_quartic(by_axis, by_point, offset, shoulder, wrist)
        if self.case == "intersecting_5_6":
            (known, *first), (of_5, *_) = by_point
            q1 = solve_linear(first[0], first[1], of_5 + offset - known, shoulder, self.preferred[0])
            left, (constant, *right) = value_at(by_axis[0], q1), by_axis[1]
        else:
            (known, *first), (of_5, *_) = by_axis
            q1 = solve_linear(first[0], first[1], of_5 - known, shoulder, self.preferred[0])
            left, (constant, *right) = value_at(by_point[0], q1) - offset, by_point[1]
        return q1, solve_linear(right[0], right[1], left - constant, wrist, 0.0)

    def _by_quartic(
        self,
        by_axis: tuple[Terms, Terms],
        by_point: tuple[Terms, Terms],
        offset: float,
        first: Array,
        second: Array,
    ) -> tuple[Angle, Angle]:
        (a0, *a), (A0, A1, A2) = by_axis
        (b0, *b), (B0, B1, B2) = by_point
        determinant = A1 * B2 - A2 * B1
        left, right = (a0 - A0, *a), (b0 - B0 - offset, *b)
        cosine = tuple((x * B2 - y * A2) / determinant for x, y in zip(left, right, strict=True))
        sine = tuple((y * A1 - x * B1) / determinant for x, y in zip(left, right, strict=True))
        one = (1.0 + 0.0 * left[0], 0.0 * left[0], 0.0 * left[0])
        unit = combined((1.0, squared(cosine)), (1.0, squared(sine)), (-1.0, linear(one)))
        q1 = conic_root(unit, first, second)
        c, s = value_at(cosine, q1), value_at(sine, q1)
        length = positive_root(c * c + s * s) + 1e-300
        return q1, Angle(c / length, s / length, separation=q1.separation)

    def _axis_4(self, R: Array, p: Array, q1: Angle, q5: Angle, q6: Angle) -> Array:
        """Return where E_2 E_3 E_4 moves the point on axis 4."""
        h, x = self.axes, self.points
        at_5 = x[4] + turn_back(h[4], q5, x[3] - x[4])
        at_6 = x[5] + turn_back(h[5], q6, at_5 - x[5])
        return np.asarray(x[0] + turn_back(h[0], q1, rotate(R, at_6) + p - x[0]))

    def _chosen(self, R: Array, p: Array, q1: Angle, q5: Angle, q6: Angle) -> Angle:
        """Return q_6, and where it is arbitrary an angle for which axis 4 is within reach of axis 2.

        Axis 6 is then normal to the plane, and axis 4 moves on a circle about it.
        """
        h, x = self.axes, self.points
        at_5 = x[4] + turn_back(h[4], q5, x[3] - x[4]) - x[5]
        centre = x[0] + turn_back(h[0], q1, rotate(R, x[5]) + p - x[0]) - x[1]
        centre = centre - h[1] * append_axis(dot(h[1], centre))
        back = rotate_back(R, turn(h[0], q1, centre))
        # |centre + R_1^-1 R_G R_6^-1 at_5|^2 in the plane.
        _, c6, s6 = component_terms(back, -h[5], at_5)
        across = at_5 - h[5] * append_axis(dot(h[5], at_5))
        middle = dot(centre, centre) + dot(across, across)
        return self.plane.reachable(q6, (middle, 2.0 * c6, 2.0 * s6), self.preferred[5])


def _turned_terms(direction: Floats, axis: Floats, a: Array) -> Terms:
    """Return (constant, cosine, sine): the terms of (R direction)' a, with R a rotation about `axis`."""
    return component_terms(a, axis, direction)
