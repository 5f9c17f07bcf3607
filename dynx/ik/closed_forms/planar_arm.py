"""Three parallel revolute axes: their angles from the plane motion that they make together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.ik.closed_forms.subproblems import (
    ALIGNMENT,
    Angle,
    angle_from_to,
    component_terms,
    dot,
    solve_linear,
    turn,
    turn_back,
)
from dynx.spatial.scalar import Array, Floats, append_axis, where_less


@dataclass(frozen=True, eq=False)
class PlanarArm:
    """Geometry at the zero configuration: directions (3, 3), which are the first or its opposite, points on
    the axes (3, 3), and a unit normal of the axes."""

    axes: Floats
    points: Floats
    normal: Floats

    def angles(self, turned: Array, tip: Array, elbow: Array, preferred: float) -> list[Angle]:
        """Return the three angles for a plane motion that moves the normal to `turned` and the point on the
        third axis to `tip`; `elbow` (1 or -1) selects one of two solutions.

        The first angle is `preferred` [rad] where the first and the third axis coincide.
        """
        h = self.axes
        upper, fore = self.links
        reach = self.across(tip - self.points[0])
        constant, cosine, sine = (2.0 * float(each) for each in component_terms(upper, h[1], fore))
        fixed = constant + float(upper @ upper + fore @ fore)
        second = solve_linear(cosine, sine, dot(reach, reach) - fixed, elbow, 0.0)
        first = angle_from_to(h[0], upper + turn(h[1], second, fore), reach, preferred)
        rest = turn_back(h[1], second, turn_back(h[0], first, turned))
        return [first, second, angle_from_to(h[2], self.normal, rest, 0.0)]

    @property
    def links(self) -> tuple[Floats, Floats]:
        """The vectors from the first to the second axis and from that to the third, normal to the axes."""
        upper, fore = (self.across(self.points[k + 1] - self.points[k]) for k in (0, 1))
        return upper, fore

    @property
    def extent(self) -> tuple[float, float]:
        """Least and greatest distance between the first and the third axis."""
        upper, fore = (float(np.linalg.norm(each)) for each in self.links)
        return abs(upper - fore), upper + fore

    def reaches(self, least: float) -> bool:
        """Return whether both links are longer than `least`."""
        return bool(min(np.linalg.norm(each) for each in self.links) > least)

    def reachable(self, angle: Angle, terms: tuple[Array, Array, Array], preferred: float) -> Angle:
        """Return the angle of another joint, and where it is arbitrary one that puts the third axis within
        reach: `preferred` [rad] if possible, otherwise the nearest to the border.

        `terms` are (constant, cosine, sine) of the squared distance from the first axis as a function of it.
        """
        constant, cosine, sine = terms
        here = constant + cosine * np.cos(preferred) + sine * np.sin(preferred)
        least, most = (each * each for each in self.extent)
        wanted = where_less(here, least, least, where_less(most, here, most, here))
        found = solve_linear(cosine, sine, wanted - constant, 1.0 + 0.0 * constant, preferred)
        inside = where_less(abs(wanted - here), ALIGNMENT, 1.0, 0.0)
        c = where_less(0.5, inside, np.cos(preferred), found.cos)
        s = where_less(0.5, inside, np.sin(preferred), found.sin)
        return Angle(
            where_less(0.5, angle.arbitrary, c, angle.cos),
            where_less(0.5, angle.arbitrary, s, angle.sin),
            angle.arbitrary,
        )

    def across(self, a: Array) -> Array:
        """Return the part of vectors (..., 3) that is normal to the axes."""
        return np.asarray(a - self.axes[0] * append_axis(dot(self.axes[0], a)))
