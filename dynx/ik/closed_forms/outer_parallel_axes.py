"""Six revolute joints of which axes 1, 2 and 3 are parallel, such as a wrist on an arm in a plane.

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
