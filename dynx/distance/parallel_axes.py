"""Depth of cylinders, segments and points whose axes are parallel, in closed form.

The difference of such cores is a cylinder again, with the sums of the radii and of the lengths. Where their
axes coincide all directions across are equally near, and no polytope has enough facets. A small angle between
the axes moves points of the second core, and with them the bounds, by at most its sine times their distance.
"""

from __future__ import annotations

import numpy as np

from dynx.distance.cores import Core, CylinderCore, PointCore, SegmentCore
from dynx.distance.penetration import Penetration
from dynx.spatial.plain import dot, minus

MAX_SINE = 1e-4
"""Largest sine of the angle between axes at which the bounds may be better than those of a polytope."""


def penetration_of_parallel(a: Core, b: Core) -> Penetration | None:
    """Return the depth of overlapping cores with parallel axes, at least one a cylinder; None for others."""
    if isinstance(b, CylinderCore) and not isinstance(a, CylinderCore):
        found = penetration_of_parallel(b, a)
        return found and Penetration(found.lower, found.upper, -found.normal, found.point_b, found.point_a)
    if not isinstance(a, CylinderCore) or not isinstance(b, PointCore | SegmentCore | CylinderCore):
        return None
    axis, axis_b, slack = a.R[:, 2], a.R[:, 2], 0.0
    if not isinstance(b, PointCore):
        axis_b = np.copysign(1.0, axis @ b.R[:, 2]) * b.R[:, 2]
        sine = float(np.linalg.norm(np.cross(axis, axis_b)))
        slack = sine * b.extent
        if sine > MAX_SINE:
            return None
    (radius_a, half_a), (radius_b, half_b) = _sizes(a), _sizes(b)
    p_a, p_b = np.array(a.p), np.array(b.p)
    along = float((p_b - p_a) @ axis)
    across = p_b - p_a - along * axis
    offset = float(np.linalg.norm(across))
    to_side, to_end = radius_a + radius_b - offset, half_a + half_b - abs(along)
    if to_side <= to_end:
        depth, normal = to_side, across / offset if offset > 0.0 else a.R[:, 0].copy()
        on_axis = np.clip(along, -half_a, half_a)
        on_a = p_a + radius_a * normal + on_axis * axis
        across_b = normal - normal @ axis_b * axis_b
        on_b = p_b - radius_b * across_b / np.linalg.norm(across_b) + (on_axis - along) * axis_b
    else:
        sign, total = np.copysign(1.0, along), radius_a + radius_b
        depth, normal = to_end, sign * axis
        on_a = p_a + half_a * normal + radius_a / total * across
        on_b = p_b - half_b * sign * axis_b - radius_b / total * (across - across @ axis_b * axis_b)
    x, y, z = normal.tolist()
    upper = dot(minus(a.support((x, y, z)), b.support((-x, -y, -z))), (x, y, z))
    return Penetration(max(0.0, min(upper, depth - slack)), upper, normal, on_a, on_b)


def _sizes(core: PointCore | SegmentCore | CylinderCore) -> tuple[float, float]:
    """Return the radius and half the length of a core as a cylinder."""
    if isinstance(core, CylinderCore):
        return core.rim_radius, core.half
    return 0.0, core.half if isinstance(core, SegmentCore) else 0.0
