"""Six revolute joints of which three in a row are parallel.

Six revolute joints of which axes 2, 3 and 4 are parallel, as in the arms of Universal Robots.

The plane motion E_2 E_3 E_4 preserves components along the common direction h. With G = E_1 ... E_6, the
direction of axis 6 and a point x_6 on it, both unmoved by E_6, therefore satisfy

    h' R_1^-1 R_G h_6 = h' R_5 h_6,        h' E_1^-1 G x_6 = h' E_5 x_6,

two equations that are linear in cosine and sine of q_1 and of q_5 (subproblem 6 of Elias and Wen 2022). If
axes 5 and 6 intersect or are parallel, one of them contains q_1 alone: two solutions, and from the other
equation two of q_5. In general q_5 is eliminated, which leaves a quartic for q_1. Then follow q_6, the
distance between axes 2 and 4 with two solutions of q_3, and q_2 and q_4.

Six revolute joints of which axes 1, 2 and 3 are parallel, such as a wrist on an arm in a plane.

The plane motion E_1 E_2 E_3 preserves components along the common direction h. With G = E_1 ... E_6, the
direction w = R_G' h and points x_5, x_6 on the axes, R_4 R_5 R_6 w = h and the height of G x_6 are

    h' R_4 h_5 - h_5' R_6 w = 0,        h' R_4 (x_5 - x_4) + (x_6 - x_5)' R_6 w = h' (G x_6 - x_4),

two equations that are linear in cosine and sine of q_4 and of q_6 (subproblem 6 of Elias and Wen 2022). If
axes 4 and 5 are parallel, or meet, one of them contains q_6 alone. In general q_4 is eliminated, which leaves
a quartic for q_6. Then follow q_5, which turns R_6 w into R_4' h, and the angles of the plane motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynx.ik.closed_forms.sliding_arms import PlanarArm
from dynx.ik.closed_forms.subproblems import (
    Angle,
    angle_from_to,
    combined,
    component_terms,
    conic_root,
    dot,
    linear,
    positive_root,
    solve_linear,
    squared,
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


OuterWristCase = Literal["parallel_4_5", "intersecting_4_5", "general"]


@dataclass(frozen=True, eq=False)
class OuterParallelAxes:
    """Geometry at the zero configuration; lengths are relative."""

    case: OuterWristCase
    axes: Floats
    """Directions (6, 3); those of axes 2 and 3 are h_1 or its opposite."""
    points: Floats
    """Points on the axes (6, 3); those on axes 4 and 5 coincide if the axes meet."""
    preferred: Floats
    """Angles (6,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of h_1."""
    arbitrary: tuple[int, ...] = (0, 4, 5)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Angle]:
        """Return the six angles of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        h, x, common = self.axes, self.points, self.axes[0]
        w = rotate_back(R, common)
        q4, q6 = self._outer(R, p, w, signs[..., 0], signs[..., 2])
        q5 = angle_from_to(h[4], turn(h[5], q6, w), turn_back(h[3], q4, common), self.preferred[4])
        at_4 = x[3] + turn_back(h[3], q4, x[2] - x[3]) - x[4]
        q5 = self._chosen(R, p, q5, q6, at_4)

        def before_wrist(a: Array) -> Array:
            """Return R_G R_6' a."""
            return rotate(R, turn_back(h[5], q6, a))

        at_5 = x[4] + turn_back(h[4], q5, at_4)
        tip = rotate(R, x[5]) + p + before_wrist(at_5 - x[5])
        turned = before_wrist(turn_back(h[4], q5, turn_back(h[3], q4, self.normal)))
        return [*self.plane.angles(turned, tip, signs[..., 1], self.preferred[0]), q4, q5, q6]

    @property
    def plane(self) -> PlanarArm:
        """Axes 1, 2 and 3."""
        return PlanarArm(self.axes[:3], self.points[:3], self.normal)

    def reaches(self, least: float) -> bool:
        """Return whether every joint changes the terms that determine it by more than `least`."""
        return self.plane.reaches(least)

    def _outer(self, R: Array, p: Array, w: Array, first: Array, second: Array) -> tuple[Angle, Angle]:
        """Return q_4 and q_6."""
        h, x, common = self.axes, self.points, self.axes[0]
        height = dot(common, rotate(R, x[5]) + p - x[3])
        # Terms in q_4 and q_6 of both equations, whose sum is `total`.
        of_axis = component_terms(common, h[3], h[4]), component_terms(-h[4], h[5], w)
        of_point = component_terms(common, h[3], x[4] - x[3]), component_terms(x[5] - x[4], h[5], w)
        if self.case == "general":
            return self._by_quartic(of_axis, of_point, height, first, second)
        if self.case == "parallel_4_5":
            alone, total, both, total_of_both = of_axis, 0.0 * height, of_point, height
        else:
            alone, total, both, total_of_both = of_point, height, of_axis, 0.0 * height
        (constant, *_), (known, *terms) = alone
        q6 = solve_linear(terms[0], terms[1], total - constant - known, first, self.preferred[5])
        (constant, *terms), of_6 = both
        return solve_linear(
            terms[0], terms[1], total_of_both - constant - value_at(of_6, q6), second, 0.0
        ), q6

    def _by_quartic(
        self,
        of_axis: tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]],
        of_point: tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]],
        height: Array,
        first: Array,
        second: Array,
    ) -> tuple[Angle, Angle]:
        (A0, A1, A2), (a0, *a) = of_axis
        (B0, B1, B2), (b0, *b) = of_point
        determinant = A1 * B2 - A2 * B1
        left, right = (-a0 - A0, *(-each for each in a)), (height - b0 - B0, *(-each for each in b))
        cosine = tuple((x * B2 - y * A2) / determinant for x, y in zip(left, right, strict=True))
        sine = tuple((y * A1 - x * B1) / determinant for x, y in zip(left, right, strict=True))
        one = (1.0 + 0.0 * height, 0.0 * height, 0.0 * height)
        unit = combined((1.0, squared(cosine)), (1.0, squared(sine)), (-1.0, linear(one)))
        q6 = conic_root(unit, first, second)
        c, s = value_at(cosine, q6), value_at(sine, q6)
        length = positive_root(c * c + s * s) + 1e-300
        return Angle(c / length, s / length, separation=q6.separation), q6

    def _chosen(self, R: Array, p: Array, q5: Angle, q6: Angle, at_4: Array) -> Angle:
        """Return q_5, and where it is arbitrary an angle for which axis 3 is within reach of axis 1.

        Axis 5 is then normal to the plane, and axis 3 moves on a circle about it.
        """
        h, x, plane = self.axes, self.points, self.plane
        at_6 = turn_back(h[5], q6, x[4] - x[5])
        centre = plane.across(rotate(R, x[5] + at_6) + p - x[0])
        back = turn(h[5], q6, rotate_back(R, centre))
        _, cosine, sine = component_terms(back, -h[4], at_4)
        across = at_4 - h[4] * append_axis(dot(h[4], at_4))
        middle = dot(centre, centre) + dot(across, across)
        return plane.reachable(q5, (middle, 2.0 * cosine, 2.0 * sine), self.preferred[4])
