"""Arms with prismatic joints, and of three parallel revolute axes alone.

Three prismatic joints and up to three revolute ones, in any order, such as a gantry with a wrist.

The revolute joints alone determine the rotation: with three of them in two ways, whether or not their axes
meet. With their angles the position is linear in the positions of the prismatic joints.

A spherical wrist on an arm of three joints of which one or two are prismatic, such as the Stanford arm.

The arm places the wrist centre c at x. With a the direction of a prismatic joint and d its position, what the
revolute joints do not change gives equations in few unknowns. With two prismatic joints:

- P P R, R P P: the component of the position normal to both slides gives the angle (two solutions);
- P R P: components along axis 2 give one slide by the other, distances from it a quadratic equation.

With one, K(q_3) and S(q_3) being heights along the axis before and squared distances from a point of it,

- R R P, axes 1 and 2 meeting: the distance from the common point gives d (two), its height q_2 (two); - R R
P, axes 1 and 2 parallel: the height gives d, the distance q_2 (two); - R P R, P R R: height = K + d a'h and
distance^2 = S + 2 d (...) + d^2. If the slide is normal to the axis, K gives q_3 (two) and the other equation
d (two); if both axes are parallel, K is constant; in general the first gives d by q_3, and the second a
quartic for q_3.

Three parallel revolute axes: their angles from the plane motion that they make together.

Three parallel revolute joints, alone or with one prismatic joint along them: SCARA arms.

The joints move the frame in four directions: a pose has solutions if its rotation is one about the axes, and
without a prismatic joint if its height is that of the arm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dynx.ik.closed_forms.spherical_wrist import wrist_angles
from dynx.ik.closed_forms.subproblems import (
    ALIGNMENT,
    Angle,
    Coordinate,
    Slide,
    angle_from_to,
    combined,
    component_terms,
    conic_root,
    dot,
    linear,
    multiplied,
    quadratic_root,
    solve_linear,
    squared,
    turn,
    turn_back,
    value_at,
)
from dynx.spatial.scalar import Array, Floats, append_axis, where_less
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


Terms = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class SlidingArm:
    """Geometry at the zero configuration; lengths are relative."""

    case: str
    """Kinds of the first three joints, such as ``PPR``, and for some ``meeting``, ``parallel``, ``level`` or
    ``general``."""
    axes: Floats
    """Directions (6, 3)."""
    points: Floats
    """Points on the axes (6, 3); the last three are the wrist centre, and those of two axes that meet one."""
    preferred: Floats
    """Angles (6,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of axis 6."""
    arbitrary: tuple[int, ...] = (0, 1, 3)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        """Return the coordinates of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        arm, elbow, flip = signs[..., 0], signs[..., 1], signs[..., 2]
        x = rotate(R, self.points[5]) + p
        solvers = {
            "PPR": self._ppr, "PRP": self._prp, "RPP": self._rpp, "RRP": self._rrp,
            "RPR": self._rpr, "PRR": self._prr,
        }  # fmt: skip
        first, second, third = solvers[self.case[:3]](x, arm, elbow)

        def back(a: Array) -> Array:
            """Return the inverse rotation of the arm, after R, of a vector."""
            turned = rotate(R, a)
            for axis, q in zip(self.axes, (first, second, third), strict=False):
                turned = turn_back(axis, q, turned) if isinstance(q, Angle) else turned
            return turned

        wrist = wrist_angles(self.axes[3:], self.normal, back, flip, self.preferred[3])
        return [first, second, third, *wrist]

    def reaches(self, least: float) -> bool:
        """Return whether every joint changes the terms that determine it by more than `least`."""
        h, x, c = self.axes, self.points, self.points[5]
        if self.case in ("PPR", "RPP"):
            first = 0 if self.case == "PPR" else 1
            n = cross(h[first], h[first + 1])
            turning = 2 if self.case == "PPR" else 0
            size = np.linalg.norm(n)
            if size < least or np.linalg.norm(cross(n / max(size, least), h[turning])) < least:
                return False
            return self.case == "RPP" or bool(np.linalg.norm(cross(h[2], c - x[2])) > least)
        if self.case == "PRP":
            before, after = abs(h[1] @ h[0]), abs(h[1] @ h[2])
            return bool(max(before, after) > least and abs(before - after) > least)
        if self.case.startswith("RRP"):
            if self.case == "RRP meeting":
                return bool(np.linalg.norm(cross(h[0], h[1])) > least)
            link = np.linalg.norm(cross(h[0], x[1] - x[0]))
            return bool(abs(h[0] @ h[2]) > least and link > least)
        K, S, L, C = self._terms()
        if self.case.endswith("level"):
            return bool(np.hypot(*K[1:]) > least)
        if self.case.endswith("parallel"):
            return bool(abs(C) > least and np.hypot(*S[1:]) > least)
        return bool(abs(C) > least and max(np.hypot(*each[1:]) for each in (K, S, L)) > least)

    def _ppr(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, c, at = self.axes, self.points[5], self.points[2]
        n = cross(h[0], h[1])
        known, cosine, sine = component_terms(n, h[2], c - at)
        q3 = solve_linear(cosine, sine, dot(n, x - at) - known, elbow, self.preferred[2])
        d1, d2 = _in_plane(x - at - turn(h[2], q3, c - at), h[0], h[1])
        return [Slide(d1, separation=arm), Slide(d2), q3]

    def _rpp(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, c, at = self.axes, self.points[5], self.points[0]
        n = cross(h[1], h[2])
        known, cosine, sine = component_terms(x - at, h[0], n)
        q1 = solve_linear(cosine, sine, float(n @ (c - at)) - known, elbow, self.preferred[0])
        d2, d3 = _in_plane(turn_back(h[0], q1, x - at) + at - c, h[1], h[2])
        return [q1, Slide(d2, separation=arm), Slide(d3)]

    def _prp(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, at = self.axes, self.points[1]
        a, b, g, u = h[0], h[2], self.points[5] - at, x - at
        C, B, height = float(h[1] @ a), float(h[1] @ b), dot(h[1], x - self.points[5])
        if abs(C) > abs(B):
            # |u - d1 a| = |g + d3 b| with d1 = (height - B d3) / C.
            start, along = u - append_axis(height / C) * a, (B / C) * a
            d3 = quadratic_root(
                float(along @ along) - 1.0, dot(start, along) - float(g @ b), dot(start, start) - g @ g, arm
            )
            d1 = replace(d3, value=(height - B * d3.value) / C)
        else:
            start, along = g + append_axis(height / B) * b, (C / B) * b
            d1 = quadratic_root(
                1.0 - float(along @ along), dot(start, along) - dot(u, a), dot(u, u) - dot(start, start), arm
            )
            d3 = replace(d1, value=(height - C * d1.value) / B)
        q2 = angle_from_to(
            h[1], g + append_axis(d3.value) * b, u - append_axis(d1.value) * a, self.preferred[1]
        )
        return [d1, q2, replace(d3, separation=where_less(elbow, 0.0, -1.0, d3.separation))]

    def _rrp(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, points = self.axes, self.points
        a, u, link = h[2], x - points[0], points[1] - points[0]
        g = points[5] - points[1]
        if self.case == "RRP meeting":
            d3 = quadratic_root(1.0, float(g @ a), float(g @ g) - dot(u, u), arm)
            z = g + append_axis(d3.value) * a
            known, cosine, sine = component_terms(h[0], h[1], z)
            total = dot(h[0], u)
        else:
            d3 = Slide(dot(h[0], x - points[5]) / float(h[0] @ a), separation=arm)
            z = g + append_axis(d3.value) * a
            across, flat, level = (each - h[0] * append_axis(dot(h[0], each)) for each in (link, z, u))
            known, cosine, sine = (2.0 * each for each in component_terms(across, h[1], flat))
            total = dot(level, level) - dot(flat, flat) - float(across @ across)
        q2 = solve_linear(cosine, sine, total - known, elbow, self.preferred[1])
        q1 = angle_from_to(h[0], link + turn(h[1], q2, z), u, self.preferred[0])
        return [q1, q2, d3]

    def _rpr(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, points = self.axes, self.points
        u, a = x - points[0], h[1]
        K, S, L, C = self._terms()
        height, square = dot(h[0], u), dot(u, u)
        if self.case == "RPR level":
            q3 = solve_linear(K[1], K[2], height - K[0], elbow, self.preferred[2])
            d2 = quadratic_root(1.0, value_at(L, q3), value_at(S, q3) - square, arm)
        elif self.case == "RPR parallel":
            d = (height - K[0]) / C
            s0, s1, s2 = (each_s + 2.0 * d * each_l for each_s, each_l in zip(S, L, strict=True))
            q3 = solve_linear(s1, s2, square - d * d - s0, elbow, self.preferred[2])
            d2 = Slide(d, separation=arm)
        else:
            D = _slide_terms(height, K, C)
            S, L = _like(S, height), _like(L, height)
            rest = linear((S[0] - square, S[1], S[2]))
            q3 = conic_root(combined((1.0, squared(D)), (2.0, multiplied(L, D)), (1.0, rest)), arm, elbow)
            d2 = Slide(value_at(D, q3))
        y = points[2] - points[0] + turn(h[2], q3, points[5] - points[2]) + append_axis(d2.value) * a
        return [angle_from_to(h[0], y, u, self.preferred[0]), d2, q3]

    def _prr(self, x: Array, arm: Array, elbow: Array) -> list[Coordinate]:
        h, points = self.axes, self.points
        u, a = x - points[1], h[0]
        K, S, _, C = self._terms()
        height, square, along = dot(h[1], u), dot(u, u), dot(a, u)
        if self.case == "PRR level":
            q3 = solve_linear(K[1], K[2], height - K[0], elbow, self.preferred[2])
            d1 = quadratic_root(1.0, -along, square - value_at(S, q3), arm)
        elif self.case == "PRR parallel":
            d = (height - K[0]) / C
            q3 = solve_linear(S[1], S[2], square - 2.0 * d * along + d * d - S[0], elbow, self.preferred[2])
            d1 = Slide(d, separation=arm)
        else:
            D, S = _slide_terms(height, K, C), _like(S, height)
            first, cosine, sine = (-2.0 * along * each - s for each, s in zip(D, S, strict=True))
            rest = linear((first + square, cosine, sine))
            q3 = conic_root(combined((1.0, squared(D)), (1.0, rest)), arm, elbow)
            d1 = Slide(value_at(D, q3))
        reach = points[2] - points[1] + turn(h[2], q3, points[5] - points[2])
        q2 = angle_from_to(h[1], reach, u - append_axis(d1.value) * a, self.preferred[1])
        return [d1, q2, q3]

    def _terms(self) -> tuple[Terms, Terms, Terms, float]:
        """Return (constant, cosine, sine) in q_3 of the height K, of the squared distance S, and of the
        component L along the slide, all from the revolute axis before axis 3, and that axis' component along
        the slide."""
        h, points = self.axes, self.points
        base, slide = (0, 1) if self.case.startswith("RPR") else (1, 0)
        e, f = points[2] - points[base], points[5] - points[2]
        k, el = (component_terms(h[each], h[2], f) for each in (base, slide))
        s = component_terms(e, h[2], f)
        return (
            (k[0] + h[base] @ e, k[1], k[2]),
            (2.0 * s[0] + e @ e + f @ f, 2.0 * s[1], 2.0 * s[2]),
            (el[0] + h[slide] @ e, el[1], el[2]),
            float(h[base] @ h[slide]),
        )


def _in_plane(r: Array, a: Floats, b: Floats) -> tuple[Array, Array]:
    """Return the coefficients of a vector in the plane of a and b."""
    n = cross(a, b)
    square = float(n @ n)
    return dot(cross(b, n), r) / square, dot(cross(n, a), r) / square


def _slide_terms(height: Array, K: Terms, C: float) -> Terms:
    """Return the terms of d = (height - K(q_3)) / C."""
    return (height - K[0]) / C, -K[1] / C + 0.0 * height, -K[2] / C + 0.0 * height


def _like(terms: Terms, x: Array) -> Terms:
    """Return constant terms with the shape of x."""
    a, b, c = (each + 0.0 * x for each in terms)
    return a, b, c


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


@dataclass(frozen=True, eq=False)
class ParallelArm:
    """Geometry at the zero configuration; lengths are relative. The joints are in any order."""

    axes: Floats
    """Directions (n, 3), n 3 or 4, all along the first revolute axis or opposite to it."""
    points: Floats
    """Points on the axes (n, 3)."""
    revolute: tuple[bool, ...]
    preferred: Floats
    """Angles (n,) [rad] that stand for arbitrary ones."""
    normal: Floats
    """A unit normal of the axes."""
    arbitrary: tuple[int, ...]
    """The first revolute joint, whose angle is arbitrary where the first axis and the third coincide."""
    case: str = "parallel arm"

    def angles(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        """Return the coordinates of the branch `signs` (..., 3) for E_1 ... E_n = (R, p)."""
        arm, elbow, flip = signs[..., 0], signs[..., 1], signs[..., 2]
        exists = where_less(arm, flip, arm, flip)
        plane, lifted = self.plane, p
        slide: Slide | None = None
        if not all(self.revolute):
            axis = self.axes[self.revolute.index(False)]
            slide = Slide(dot(axis, p), separation=exists)
            lifted = p - axis * append_axis(slide.value)
        tip = rotate(R, plane.points[2]) + lifted
        first, second, third = plane.angles(
            rotate(R, self.normal), tip, elbow, self.preferred[self.arbitrary[0]]
        )
        least = where_less(second.separation, exists, second.separation, exists)
        angles = iter([first, replace(second, separation=least), third])
        return [next(angles) if turning or slide is None else slide for turning in self.revolute]

    @property
    def plane(self) -> PlanarArm:
        """The revolute axes."""
        turning = list(self.revolute)
        return PlanarArm(self.axes[turning], self.points[turning], self.normal)

    def reaches(self, least: float) -> bool:
        """Return whether both links are longer than `least`."""
        return self.plane.reaches(least)
