"""Recognition of chains that have a closed form, from the lines of their axes.

Families are looked for along the chain and along its inverse (from the frame to the world): a spherical
wrist, three parallel axes, and those of chains with
prismatic joints and of three parallel axes alone. Axes count as parallel, or as meeting, within
a tolerance; the recognised geometry is that of the idealised chain, in which they do exactly.

Recognition of chains with prismatic joints, and of three parallel axes alone, that have a closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.errors import NoClosedFormError
from dynx.ik.closed_forms.chain import (
    MAX_JOINTS,
    Chain,
    SpatialLines,
    along,
    angle_between,
    common_point,
    normal_feet,
)
from dynx.ik.closed_forms.parallel_axes import OuterParallelAxes, ParallelAxes, ParallelCase
from dynx.ik.closed_forms.sliding_arms import ParallelArm, SlidingArm, ThreeSlides
from dynx.ik.closed_forms.spherical_wrist import ArmCase, SphericalWrist, unit_normal
from dynx.ik.closed_forms.subproblems import component_terms
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross

TOLERANCES = (1e-9, 1e-6, 5e-4)
"""Relative lengths, and angles [rad], within which axes count as meeting or parallel. A chain is recognised
at the first tolerance at which it has a family: rounding, files with about six digits, files with three."""

NEGLIGIBLE = 1e-6
"""Relative length, or angle [rad], below which an offset within a recognised family is idealised."""

Geometry = SphericalWrist | ParallelAxes | OuterParallelAxes | ThreeSlides | ParallelArm | SlidingArm


@dataclass(frozen=True, eq=False)
class Recognised:
    """Geometry of a chain with a closed form."""

    geometry: Geometry
    inverted: bool
    """True if the geometry is that of the inverse chain, whose joint 1 is joint 6 of the chain."""
    tolerance: float
    """Deviation of the chain from the geometry, relative to its length or [rad], at most."""
    deviation: float
    """Largest deviation of its lines from those of the geometry."""
    description: str


def recognise(chain: Chain, preferred: Floats) -> Recognised:
    """Return the geometry of a chain of at most six joints; `preferred` (n,) stand for arbitrary angles.

    Raises NoClosedFormError, which says how far the chain is from each family.
    """
    lines = SpatialLines(chain.axes, chain.points)
    for tolerance in TOLERANCES:
        for inverted in (False, True):
            here, angles, kinds = lines, preferred, chain.revolute
            if inverted:
                here, angles, kinds = lines.reversed(), preferred[::-1], kinds[::-1]
            find = _revolute_family if kinds == (True,) * MAX_JOINTS else _sliding_family
            found = find(here, kinds, angles, tolerance, inverted)
            if found is not None:
                geometry, text = found
                return Recognised(geometry, inverted, tolerance, _deviation(here, geometry), text)
    raise NoClosedFormError(_why_none(chain))


def _revolute_family(
    lines: SpatialLines, kinds: Kinds, preferred: Floats, tolerance: float, inverted: bool
) -> tuple[Geometry, str] | None:
    """Return the geometry of six revolute joints, and the property of their axes, or None."""
    wrist = _spherical_wrist(lines, preferred, tolerance)
    if wrist is not None:
        return wrist, f"axes of the {'first' if inverted else 'last'} three joints meet in a point"
    parallel = _parallel_axes(lines, preferred, tolerance)
    if parallel is not None:
        return parallel, f"axes {'3, 4 and 5' if inverted else '2, 3 and 4'} are parallel"
    outer = _outer_parallel_axes(lines, preferred, tolerance)
    if outer is not None:
        return outer, f"axes {'4, 5 and 6' if inverted else '1, 2 and 3'} are parallel"
    return None


def _sliding_family(
    lines: SpatialLines, kinds: Kinds, preferred: Floats, tolerance: float, inverted: bool
) -> tuple[Geometry, str] | None:
    """Return the geometry of joints of which some are prismatic, and what it is, or None."""
    near = max(tolerance, NEGLIGIBLE)
    slides = three_slides(lines, kinds, preferred, near)
    if slides is not None:
        return slides, "three prismatic joints, and revolute ones that determine the rotation alone"
    plane = parallel_arm(lines, kinds, preferred, near, tolerance)
    if plane is not None:
        return plane, "all axes are parallel" if all(
            kinds
        ) else "all axes are parallel, one of a prismatic joint"
    arm = sliding_arm(lines, kinds, preferred, near, tolerance)
    if arm is not None:
        end = "first" if inverted else "last"
        return arm, f"axes of the {end} three joints meet in a point, and others are prismatic"
    return None


def _deviation(lines: SpatialLines, geometry: Geometry) -> float:
    """Return the largest distance, at its point, or angle of a line from that of the geometry."""
    angles = [angle_between(a, b) for a, b in zip(lines.axes, geometry.axes, strict=True)]
    return float(
        max(*angles, np.linalg.norm(cross(lines.axes, geometry.points - lines.points), axis=-1).max())
    )


def _spherical_wrist(lines: SpatialLines, preferred: Floats, tolerance: float) -> SphericalWrist | None:
    h = lines.axes
    centre, distance = common_point(SpatialLines(h[3:], lines.points[3:]))
    near = max(tolerance, NEGLIGIBLE)
    if distance > tolerance or angle_between(h[3], h[4]) < near or angle_between(h[4], h[5]) < near:
        return None
    h = h.copy()
    h1_h2, h2_h3 = angle_between(h[0], h[1]), angle_between(h[1], h[2])
    case: ArmCase = "general"
    if h2_h3 < near:
        case, h[2] = "parallel_2_3", along(h[1], h[2])
    if h1_h2 < near:
        if case == "parallel_2_3":
            return None
        case, h[0] = "parallel_1_2", along(h[1], h[0])
    p1, p2 = normal_feet(h[0], lines.points[0], h[1], lines.points[1])
    p3 = normal_feet(h[1], p2, h[2], lines.points[2])[1]
    if case == "parallel_1_2":
        distance = float(np.linalg.norm(p2 - p1))
        if distance < near:
            return None
        v = (p2 - p1) / distance
        u, cos, sin = cross(v, h[1]), float(np.sign(h[0] @ h[1])), 0.0
    else:
        n = cross(h[0], h[1])
        v = n / np.linalg.norm(n)
        distance = float((p2 - p1) @ v)
        cos, sin = float(h[0] @ h[1]), float(np.linalg.norm(n))
        u = (h[0] - cos * h[1]) / sin
        if case == "general" and abs(distance) < near:
            case, distance = "intersecting_1_2", 0.0
            p1 = p2 = 0.5 * (p1 + p2)
    found = SphericalWrist(case, h, p1, p2, p3, centre, u, v, cos, sin, distance, preferred)
    return found if found.reaches(near) else None


def _parallel_axes(lines: SpatialLines, preferred: Floats, tolerance: float) -> ParallelAxes | None:
    h, points = lines.axes.copy(), lines.points.copy()
    near = max(tolerance, NEGLIGIBLE)
    if max(angle_between(h[1], h[2]), angle_between(h[1], h[3])) > tolerance:
        return None
    if min(angle_between(h[0], h[1]), angle_between(h[3], h[4])) < near:
        return None
    h[2], h[3] = along(h[1], h[2]), along(h[1], h[3])
    case: ParallelCase = "general"
    if angle_between(h[4], h[5]) < near:
        case, h[5] = "parallel_5_6", along(h[4], h[5])
    points[4], points[5] = normal_feet(h[4], points[4], h[5], points[5])
    if case == "parallel_5_6":
        if np.linalg.norm(points[5] - points[4]) < near:
            return None
    else:
        shift = _meeting_shift(h[1], h[4], h[5], points[5] - points[4], near)
        if shift is not None:
            case = "intersecting_5_6"
            points[5] = points[5] - shift * h[5]
            if np.linalg.norm(points[5] - points[4]) < near:
                points[4] = points[5] = 0.5 * (points[4] + points[5])
    found = ParallelAxes(case, h, points, preferred, unit_normal(h[1]))
    return found if found.reaches(near) else None


def _outer_parallel_axes(
    lines: SpatialLines, preferred: Floats, tolerance: float
) -> OuterParallelAxes | None:
    h, points = lines.axes.copy(), lines.points.copy()
    near = max(tolerance, NEGLIGIBLE)
    if max(angle_between(h[0], h[1]), angle_between(h[0], h[2])) > tolerance:
        return None
    if angle_between(h[0], h[3]) < near:
        return None
    h[1], h[2] = along(h[0], h[1]), along(h[0], h[2])
    case: ParallelCase = "general"
    points[4], points[5] = normal_feet(h[4], points[4], h[5], points[5])
    if angle_between(h[3], h[4]) < near:
        case, h[4] = "parallel_4_5", along(h[3], h[4])
        link = points[4] - points[3]
        if angle_between(h[4], h[5]) < near or np.linalg.norm(cross(h[3], link)) < near:
            return None
    else:
        shift = _meeting_shift(h[0], h[3], h[4], points[4] - points[3], near)
        if shift is not None:
            case = "intersecting_4_5"
            points[4] = points[4] - shift * h[4]
            points[3] = points[3] + h[3] * float(h[3] @ (points[4] - points[3]))
            if np.linalg.norm(points[4] - points[3]) < near:
                points[3] = points[4] = 0.5 * (points[3] + points[4])
            if np.linalg.norm(cross(h[5], points[5] - points[4])) < near:
                return None
    found = OuterParallelAxes(case, h, points, preferred, unit_normal(h[0]))
    return found if found.reaches(near) else None


def _meeting_shift(
    common: Floats, axis: Floats, next_axis: Floats, offset: Floats, near: float
) -> float | None:
    """Return by how much a point is to move back along the next axis so that the angle about `axis` drops out
    of the equation of that point's height along `common`, or None if it does not.

    A point elsewhere on that axis mixes this equation with that of the direction of the axis.
    """
    by_axis, by_point = (
        np.array(component_terms(common, axis, across)[1:]) for across in (next_axis, offset)
    )
    shift = float(by_axis @ by_point / (by_axis @ by_axis))
    return shift if np.linalg.norm(by_point - shift * by_axis) < near else None


def _why_none(chain: Chain) -> str:
    """Return how far a chain is from each family."""
    if not all(chain.revolute) or len(chain.revolute) != MAX_JOINTS:
        kinds = ", ".join("revolute" if turns else "prismatic" for turns in chain.revolute)
        return (
            f"no closed form: the joints are {kinds}; with prismatic joints it needs three of them and at "
            "most three revolute joints, or one or two and a spherical wrist, or three parallel revolute "
            "joints and one along them"
        )
    lines = SpatialLines(chain.axes, chain.points)
    parts = []
    for end, three in (("first", slice(0, 3)), ("last", slice(3, 6))):
        _, distance = common_point(SpatialLines(lines.axes[three], lines.points[three]))
        parts.append(
            f"the axes of the {end} three joints miss a common point by {distance * chain.length:.2g} m"
        )
    for numbers, first in (("1, 2 and 3", 0), ("2, 3 and 4", 1), ("3, 4 and 5", 2), ("4, 5 and 6", 3)):
        h = lines.axes[first : first + 3]
        angle = max(angle_between(h[0], h[1]), angle_between(h[1], h[2]))
        parts.append(f"axes {numbers} are off parallel by {np.rad2deg(angle):.2g} deg")
    return f"no closed form: {'; '.join(parts)}, or its other joints move it in fewer than six directions"


Kinds = tuple[bool, ...]
"""Whether each joint turns; the others slide."""


def three_slides(lines: SpatialLines, revolute: Kinds, preferred: Floats, near: float) -> ThreeSlides | None:
    """Return the geometry of three prismatic and up to three revolute joints, or None."""
    turning = [k for k, turns in enumerate(revolute) if turns]
    if revolute.count(False) != 3:
        return None
    h = lines.axes
    normal = unit_normal(h[turning[-1] if turning else 0])
    first = (turning[0],) if len(turning) == 3 else ()
    found = ThreeSlides(h, lines.points, revolute, preferred, normal, first)
    return found if found.reaches(near) else None


def parallel_arm(
    lines: SpatialLines, revolute: Kinds, preferred: Floats, near: float, tolerance: float
) -> ParallelArm | None:
    """Return the geometry of three parallel revolute joints with at most one slide along them, or None."""
    if revolute.count(True) != 3 or revolute.count(False) > 1:
        return None
    first = revolute.index(True)
    h = lines.axes[first]
    if max(angle_between(h, each) for each in lines.axes) > tolerance:
        return None
    axes = np.array([along(h, each) for each in lines.axes])
    found = ParallelArm(axes, lines.points, revolute, preferred, unit_normal(h), (first,))
    return found if found.reaches(near) else None


def sliding_arm(
    lines: SpatialLines, revolute: Kinds, preferred: Floats, near: float, tolerance: float
) -> SlidingArm | None:
    """Return the geometry of a spherical wrist on an arm with one or two prismatic joints, or None."""
    kinds = "".join("R" if turns else "P" for turns in revolute)
    if kinds[3:] != "RRR" or kinds[:3] in ("RRR", "PPP"):
        return None
    h, points = lines.axes.copy(), lines.points.copy()
    centre, distance = common_point(SpatialLines(h[3:], points[3:]))
    if distance > tolerance or min(angle_between(h[3], h[4]), angle_between(h[4], h[5])) < near:
        return None
    points[3:] = centre
    case = _case(kinds[:3], h, points, near)
    if case is None:
        return None
    found = SlidingArm(case, h, points, preferred, unit_normal(h[5]))
    return found if found.reaches(near) else None


def _case(kinds: str, h: Floats, points: Floats, near: float) -> str | None:
    """Return the case of the first three joints, and idealise their axes."""
    if kinds in ("PPR", "PRP", "RPP"):
        return kinds
    if kinds == "RRP":
        if angle_between(h[0], h[1]) < near:
            h[1] = along(h[0], h[1])
            return "RRP parallel"
        feet = normal_feet(h[0], points[0], h[1], points[1])
        if np.linalg.norm(feet[1] - feet[0]) > near:
            return None
        points[0] = points[1] = 0.5 * (feet[0] + feet[1])
        return "RRP meeting"
    before, slide = (0, 1) if kinds == "RPR" else (1, 0)
    is_level = abs(float(h[before] @ h[slide])) < near
    is_parallel = angle_between(h[before], h[2]) < near
    if is_level:
        h[slide] = h[slide] - h[before] * float(h[before] @ h[slide])
        h[slide] /= np.linalg.norm(h[slide])
    if is_parallel:
        h[2] = along(h[before], h[2])
    level = "level" if is_level else "parallel" if is_parallel else "general"
    return f"{kinds} {level}"
