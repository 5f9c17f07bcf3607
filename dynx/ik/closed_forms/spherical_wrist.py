"""Six revolute joints of which the axes of the last three meet in a point, the wrist centre.

The first three joints place the wrist centre, the last three turn about it (Pieper 1968). For its position x
before the turn about axis 1, at height a along that axis and at squared distance b from its foot point,

    x = p_2 + (u zu + v zv + h_2 k),   v from axis 1 to axis 2 along their common normal, u = v x h_2 turned
                                       to h_1,
    a = zu sin + k cos                 with the angle between axes 1 and 2,
    b = (l + zv)^2 + zu^2 + k^2        with their distance l,
    s = zu^2 + zv^2 + k^2              the squared distance from p_2,

where k and s depend on q_3 alone, linearly in its cosine and sine. What determines what depends on the arm:

- axes 2 and 3 parallel: k is constant; the equations give zu, zv (two solutions), s and from it q_3 (two).
- axes 1 and 2 intersecting (l = 0): s = b gives q_3 (two), then zu, and zv (two).
- axes 1 and 2 parallel (sin = 0): k = a gives q_3 (two), then zv, and zu (two).
- otherwise the elimination of zu and zv gives a quartic for q_3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

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
from dynx.spatial.so3 import cross, rotate

ArmCase = Literal["parallel_2_3", "intersecting_1_2", "parallel_1_2", "general"]


@dataclass(frozen=True, eq=False)
class SphericalWrist:
    """Geometry at the zero configuration; lengths are relative."""

    case: ArmCase
    axes: Floats
    """Directions (6, 3)."""
    p1: Floats
    """Foot on axis 1 of the common normal with axis 2."""
    p2: Floats
    """Foot on axis 2."""
    p3: Floats
    """Point on axis 3."""
    centre: Floats
    """Wrist centre."""
    u: Floats
    v: Floats
    """Unit vectors normal to axis 2; h_1 = cos h_2 + sin u."""
    cos: float
    sin: float
    """Cosine and sine of the angle from axis 2 to axis 1."""
    distance: float
    """Distance l between axes 1 and 2."""
    preferred: Floats
    """Angles (6,) [rad] that stand for arbitrary ones."""
    arbitrary: tuple[int, ...] = (0, 1, 3)
    """Joints whose angle is arbitrary at some poses."""

    def angles(self, R: Array, p: Array, signs: Array) -> list[Angle]:
        """Return the six angles of the branch `signs` (..., 3) for E_1 ... E_6 = (R, p)."""
        h, arm, elbow, flip = self.axes, signs[..., 0], signs[..., 1], signs[..., 2]
        x = rotate(R, self.centre) + p - self.p1
        a, b = dot(h[0], x), dot(x, x)
        q3, k, zu, zv, root = self._elbow(a, b, arm, elbow)
        z = self.p3 - self.p2 + turn(h[2], q3, self.centre - self.p3)
        placed = append_axis(zu) * self.u + append_axis(zv) * self.v + append_axis(k) * h[1]
        q2 = replace(angle_from_to(h[1], z, placed, self.preferred[1]), separation=root)
        q1 = angle_from_to(h[0], self.p2 - self.p1 + turn(h[1], q2, z), x, self.preferred[0])

        def back(a: Array) -> Array:
            """Return the inverse rotation of the arm, after R, of a vector."""
            return turn_back(h[2], q3, turn_back(h[1], q2, turn_back(h[0], q1, rotate(R, a))))

        return [q1, q2, q3, *wrist_angles(h[3:], unit_normal(h[5]), back, flip, self.preferred[3])]

    @property
    def points(self) -> Floats:
        """A point on each axis (6, 3)."""
        return np.array([self.p1, self.p2, self.p3, self.centre, self.centre, self.centre])

    def reaches(self, least: float) -> bool:
        """Return whether every joint changes the terms that determine it by more than `least`."""
        K, S = self._terms()
        if self.case == "general":
            return bool(max(np.hypot(*K[1:]), np.hypot(*S[1:])) > least)
        return bool(np.hypot(*(K if self.case == "parallel_1_2" else S)[1:]) > least)

    def _elbow(
        self, a: Array, b: Array, arm: Array, elbow: Array
    ) -> tuple[Angle, Array, Array, Array, Array | float]:
        """Return q_3, k, zu and zv, and the root of which `arm` is the sign, or 1."""
        distance = self.distance
        K, S = self._terms()
        if self.case == "parallel_2_3":
            k = K[0] + 0.0 * a
            zu = (a - self.cos * k) / self.sin
            root = positive_root(b - zu * zu - k * k)
            zv = arm * root - distance
            q3 = solve_linear(S[1], S[2], zu * zu + zv * zv + k * k - S[0], elbow, 0.0)
            return q3, k, zu, zv, root
        if self.case == "intersecting_1_2":
            q3 = solve_linear(S[1], S[2], b - S[0], elbow, 0.0)
            k = value_at(K, q3)
            zu = (a - self.cos * k) / self.sin
            root = positive_root(b - zu * zu - k * k)
            return q3, k, zu, arm * root, root
        if self.case == "parallel_1_2":
            q3 = solve_linear(K[1], K[2], self.cos * a - K[0], elbow, 0.0)
        else:
            q3 = self._quartic(a, b, arm, elbow)
        k, s = value_at(K, q3), value_at(S, q3)
        zv = (b - s - distance * distance) / (2.0 * distance)
        if self.case == "parallel_1_2":
            root = positive_root(s - k * k - zv * zv)
            return q3, k, arm * root, zv, root
        return q3, k, (a - self.cos * k) / self.sin, zv, 1.0

    def _quartic(self, a: Array, b: Array, first: Array, second: Array) -> Angle:
        """Return the root of sin^2 (b - l^2 - s)^2 + 4 l^2 (a^2 - 2 a k cos + k^2 - s sin^2), which is
        4 l^2 sin^2 (zu^2 + zv^2 + k^2 - s)."""
        l2, (k0, k1, k2), (s0, s1, s2) = self.distance**2, *self._terms()
        sin2, one = self.sin**2, 1.0 + 0.0 * a
        S = (s0 + l2 - b, s1 * one, s2 * one)
        K = (k0 * one, k1 * one, k2 * one)
        rest = linear((a * a - 2.0 * self.cos * a * k0 - sin2 * s0, *_scaled(-2.0 * self.cos * a, k1, k2)))
        rest = combined((1.0, rest), (-sin2, linear((0.0 * a, s1 * one, s2 * one))), (1.0, squared(K)))
        return conic_root(combined((sin2, squared(S)), (4.0 * l2, rest)), first, second)

    def _terms(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return (constant, cosine, sine) of k and of s as functions of q_3."""
        h, upper, fore = self.axes, self.p3 - self.p2, self.centre - self.p3
        k0, k1, k2 = (float(each) for each in component_terms(h[1], h[2], fore))
        s0, s1, s2 = (2.0 * float(each) for each in component_terms(upper, h[2], fore))
        return (k0 + float(h[1] @ upper), k1, k2), (s0 + float(upper @ upper + fore @ fore), s1, s2)


def _scaled(factor: Array, *terms: float) -> tuple[Array, Array]:
    x, y = (factor * each for each in terms)
    return x, y


def wrist_angles(
    axes: Floats, normal: Floats, rotated: Callable[[Array], Array], flip: Array, preferred: float
) -> list[Angle]:
    """Return the angles about three axes (3, 3) whose rotations make the rotation `rotated` together.

    They follow from its effect on the last axis and on a `normal` of that; `flip` (1 or -1) selects one of
    two solutions. The first angle is `preferred` [rad] where the other axes put the last along the first.
    """
    first, second, last = axes
    tip, side = rotated(last), rotated(normal)
    known, cosine, sine = component_terms(first, second, last)
    q_second = solve_linear(cosine, sine, dot(first, tip) - known, flip, 0.0)
    q_first = angle_from_to(first, turn(second, q_second, last), tip, preferred)
    turned = turn_back(second, q_second, turn_back(first, q_first, side))
    return [q_first, q_second, angle_from_to(last, normal, turned, 0.0)]


def unit_normal(axis: Floats) -> Floats:
    """Return a unit normal of an axis, along a coordinate axis if possible."""
    a = cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    normal: Floats = a / np.linalg.norm(a)
    return normal
