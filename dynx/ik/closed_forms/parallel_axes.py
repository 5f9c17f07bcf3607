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
from typing import ClassVar, Literal

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

ParallelCase = Literal["intersecting_5_6", "parallel_5_6", "parallel_4_5", "intersecting_4_5", "general"]

Terms = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class _ThreeParallelAxes:
    """Geometry at the zero configuration; lengths are relative."""

    case: ParallelCase
    axes: Floats
    """Directions (6, 3); those of the parallel axes are that of the first of them or its opposite."""
    points: Floats
    """Points on the axes (6, 3); those on axes that count as meeting coincide."""
    preferred: Floats
    """Angles (6,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of the parallel axes."""

    first: ClassVar[int]
    """Number of the first parallel axis."""

    @property
    def plane(self) -> PlanarArm:
        """The parallel axes."""
        three = slice(self.first, self.first + 3)
        return PlanarArm(self.axes[three], self.points[three], self.normal)

    def reaches(self, least: float) -> bool:
        """Return whether every joint changes the terms that determine it by more than `least`."""
        return self.plane.reaches(least)

    def _within_reach(self, joint: int, angle: Angle, centre: Array, back: Array, at: Array) -> Angle:
        """Return the angle of a joint, and where it is arbitrary one that puts the third parallel axis within
        reach of the first.

        The joint's axis is then normal to the plane, and the third axis moves on a circle about it: about
        `centre` as seen from the first axis, which is `back` in the axes of the joint, through `at`.
        """
        h = self.axes[joint]
        # |centre + R^-1 R_joint^-1 at|^2 in the plane.
        _, cosine, sine = component_terms(back, -h, at)
        across = at - h * append_axis(dot(h, at))
        middle = dot(centre, centre) + dot(across, across)
        return self.plane.reachable(angle, (middle, 2.0 * cosine, 2.0 * sine), self.preferred[joint])


class ParallelAxes(_ThreeParallelAxes):
    """Axes 2, 3 and 4 are parallel; the points on axes 5 and 6 are nearest to each other."""

    first = 1
    arbitrary: tuple[int, ...] = (0, 1, 5)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Angle]:
        """Return the six angles of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        h, x = self.axes, self.points
        q1, q5 = self._outer(R, p, signs[..., 0], signs[..., 2])
        # Axis 6 as seen from it: R_6 turns R_G^-1 R_1 h into R_5^-1 h.
        common = h[1]
        seen = rotate_back(R, turn(h[0], q1, common))
        q6 = angle_from_to(h[5], seen, turn_back(h[4], q5, common), self.preferred[5])
        at_5 = x[4] + turn_back(h[4], q5, x[3] - x[4])
        centre = self.plane.across(x[0] + turn_back(h[0], q1, rotate(R, x[5]) + p - x[0]) - x[1])
        q6 = self._within_reach(5, q6, centre, rotate_back(R, turn(h[0], q1, centre)), at_5 - x[5])

        # The plane motion, by its effect on a normal and on axis 4.
        turned = turn_back(h[0], q1, rotate(R, turn_back(h[5], q6, turn_back(h[4], q5, self.normal))))
        at_6 = x[5] + turn_back(h[5], q6, at_5 - x[5])
        tip = np.asarray(x[0] + turn_back(h[0], q1, rotate(R, at_6) + p - x[0]))
        q2, q3, q4 = self.plane.angles(turned, tip, signs[..., 1], self.preferred[1])
        return [q1, q2, q3, q4, q5, q6]

    def _outer(self, R: Array, p: Array, shoulder: Array, wrist: Array) -> tuple[Angle, Angle]:
        """Return q_1 and q_5."""
        h, x = self.axes, self.points
        # Terms of R_1 h times a vector, and of h times R_5 times a vector, whose difference is the last.
        tip = rotate(R, x[5]) + p - x[0]
        by_axis = component_terms(rotate(R, h[5]), h[0], h[1]), component_terms(h[1], h[4], h[5]), 0.0
        by_point = (
            component_terms(tip, h[0], h[1]),
            component_terms(h[1], h[4], x[5] - x[4]),
            float(h[1] @ (x[4] - x[0])),
        )
        first, other = (by_point, by_axis) if self.case == "intersecting_5_6" else (by_axis, by_point)
        quartic = self.case == "general"
        return _linear_pair(first, other, -1.0, quartic, shoulder, wrist, self.preferred[0])


class OuterParallelAxes(_ThreeParallelAxes):
    """Axes 1, 2 and 3 are parallel."""

    first = 0
    arbitrary: tuple[int, ...] = (0, 4, 5)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Angle]:
        """Return the six angles of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        h, x, common = self.axes, self.points, self.axes[0]
        w = rotate_back(R, common)
        q6, q4 = self._outer(R, p, w, signs[..., 0], signs[..., 2])
        q5 = angle_from_to(h[4], turn(h[5], q6, w), turn_back(h[3], q4, common), self.preferred[4])
        at_4 = x[3] + turn_back(h[3], q4, x[2] - x[3]) - x[4]
        at_6 = turn_back(h[5], q6, x[4] - x[5])
        centre = self.plane.across(rotate(R, x[5] + at_6) + p - x[0])
        q5 = self._within_reach(4, q5, centre, turn(h[5], q6, rotate_back(R, centre)), at_4)

        def before_wrist(a: Array) -> Array:
            """Return R_G R_6' a."""
            return rotate(R, turn_back(h[5], q6, a))

        at_5 = x[4] + turn_back(h[4], q5, at_4)
        tip = rotate(R, x[5]) + p + before_wrist(at_5 - x[5])
        turned = before_wrist(turn_back(h[4], q5, turn_back(h[3], q4, self.normal)))
        return [*self.plane.angles(turned, tip, signs[..., 1], self.preferred[0]), q4, q5, q6]

    def _outer(self, R: Array, p: Array, w: Array, first: Array, second: Array) -> tuple[Angle, Angle]:
        """Return q_6 and q_4."""
        h, x, common = self.axes, self.points, self.axes[0]
        height = dot(common, rotate(R, x[5]) + p - x[3])
        # Terms in q_6 and q_4 of both equations, whose sum is the last.
        of_axis = component_terms(-h[4], h[5], w), component_terms(common, h[3], h[4]), 0.0 * height
        of_point = (
            component_terms(x[5] - x[4], h[5], w),
            component_terms(common, h[3], x[4] - x[3]),
            height,
        )
        alone, other = (of_point, of_axis) if self.case == "intersecting_4_5" else (of_axis, of_point)
        quartic = self.case == "general"
        return _linear_pair(alone, other, 1.0, quartic, first, second, self.preferred[5])


Equation = tuple[Terms, Terms, Array | float]
"""Terms f of an angle x, terms g of an angle y, and the value of f + g or f - g."""


def _linear_pair(
    alone: Equation,
    other: Equation,
    sign: float,
    quartic: bool,
    first: Array,
    second: Array,
    preferred: float,
) -> tuple[Angle, Angle]:
    """Return the angles x and y with f(x) + sign g(y) = value in two equations (subproblem 6).

    The equation `alone` contains no y, unless y is eliminated from both, which leaves a `quartic`. The signs
    (...,) select x, and y if x is known. x is `preferred` [rad] where it is arbitrary.
    """
    (a, A, total), (b, B, total_of_other) = alone, other
    if not quartic:
        x = solve_linear(a[1], a[2], total - sign * A[0] - a[0], first, preferred)
        rest = sign * (total_of_other - value_at(b, x)) - B[0]
        return x, solve_linear(B[1], B[2], rest, second, 0.0)
    determinant = A[1] * B[2] - A[2] * B[1]
    left, right = (
        (sign * (value - terms[0]) - known, -sign * terms[1], -sign * terms[2])
        for terms, (known, *_), value in ((a, A, total), (b, B, total_of_other))
    )
    cosine = tuple((u * B[2] - w * A[2]) / determinant for u, w in zip(left, right, strict=True))
    sine = tuple((w * A[1] - u * B[1]) / determinant for u, w in zip(left, right, strict=True))
    one = (1.0 + 0.0 * left[0], 0.0 * left[0], 0.0 * left[0])
    unit = combined((1.0, squared(cosine)), (1.0, squared(sine)), (-1.0, linear(one)))
    x = conic_root(unit, first, second)
    c, s = value_at(cosine, x), value_at(sine, x)
    length = positive_root(c * c + s * s) + 1e-300
    return x, Angle(c / length, s / length, separation=x.separation)
