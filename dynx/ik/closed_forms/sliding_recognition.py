"""Recognition of chains with prismatic joints, and of three parallel axes alone, that have a closed form."""

from __future__ import annotations

import numpy as np

from dynx.ik.closed_forms.lines import Lines, along, angle_between, common_point, normal_feet
from dynx.ik.closed_forms.parallel_arm import ParallelArm
from dynx.ik.closed_forms.sliding_arm import SlidingArm, SlidingCase
from dynx.ik.closed_forms.spherical_wrist import unit_normal
from dynx.ik.closed_forms.three_slides import ThreeSlides
from dynx.spatial.scalar import Floats

Kinds = tuple[bool, ...]
"""Whether each joint turns; the others slide."""


def three_slides(lines: Lines, revolute: Kinds, preferred: Floats, near: float) -> ThreeSlides | None:
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
    lines: Lines, revolute: Kinds, preferred: Floats, near: float, tolerance: float
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
    lines: Lines, revolute: Kinds, preferred: Floats, near: float, tolerance: float
) -> SlidingArm | None:
    """Return the geometry of a spherical wrist on an arm with one or two prismatic joints, or None."""
    kinds = "".join("R" if turns else "P" for turns in revolute)
    if kinds[3:] != "RRR" or kinds[:3] in ("RRR", "PPP"):
        return None
    h, points = lines.axes.copy(), lines.points.copy()
    centre, distance = common_point(Lines(h[3:], points[3:]))
    if distance > tolerance or min(angle_between(h[3], h[4]), angle_between(h[4], h[5])) < near:
        return None
    points[3:] = centre
    case = _case(kinds[:3], h, points, near)
    if case is None:
        return None
    found = SlidingArm(case, h, points, preferred, unit_normal(h[5]))
    return found if found.reaches(near) else None


def _case(kinds: str, h: Floats, points: Floats, near: float) -> SlidingCase | None:
    """Return the case of the first three joints, and idealise their axes."""
    if kinds == "PPR":
        return "PPR"
    if kinds == "PRP":
        return "PRP"
    if kinds == "RPP":
        return "RPP"
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
    if kinds == "RPR":
        return "RPR level" if is_level else "RPR parallel" if is_parallel else "RPR general"
    return "PRR level" if is_level else "PRR parallel" if is_parallel else "PRR general"
