"""Depth of cylinders, segments and points whose axes are parallel, in closed form.

The difference of such cores is a cylinder again, with the sums of the radii and of the lengths. Where their
axes coincide all directions across are equally near, and no polytope has enough facets.
"""

from __future__ import annotations

import numpy as np

from dynx.distance.cores import Core, CylinderCore, PointCore, SegmentCore
from dynx.distance.penetration import Penetration
from dynx.spatial.scalar import Floats

PARALLEL = 1e-15
"""Sine of the angle between axes that are parallel but for rounding."""


def penetration_of_parallel(a: Core, b: Core) -> Penetration | None:
    """Return the depth of overlapping cores with parallel axes, at least one a cylinder; None for others."""
    if isinstance(b, CylinderCore) and not isinstance(a, CylinderCore):
        found = penetration_of_parallel(b, a)
        return found and Penetration(found.lower, found.upper, -found.normal, found.point_b, found.point_a)
    if not isinstance(a, CylinderCore) or not isinstance(b, PointCore | SegmentCore | CylinderCore):
        return None
    axis = a.R[:, 2]
    if not isinstance(b, PointCore) and np.linalg.norm(np.cross(axis, b.R[:, 2])) > PARALLEL:
        return None
    (radius_a, half_a), (radius_b, half_b) = _sizes(a), _sizes(b)
    p_a, p_b = np.array(a.p), np.array(b.p)
    along = float((p_b - p_a) @ axis)
    across = p_b - p_a - along * axis
    offset = float(np.linalg.norm(across))
    to_side, to_end = radius_a + radius_b - offset, half_a + half_b - abs(along)
    if to_side <= to_end:
        normal = across / offset if offset > 0.0 else a.R[:, 0].copy()
        on_axis = np.clip(along, -half_a, half_a)
        on_a = p_a + radius_a * normal + on_axis * axis
        on_b = p_b - radius_b * normal + (on_axis - along) * axis
        return _exact(to_side, normal, on_a, on_b)
    normal = np.copysign(1.0, along) * axis
    total = radius_a + radius_b
    on_a = p_a + half_a * normal + radius_a / total * across
    on_b = p_b - half_b * normal - radius_b / total * across
    return _exact(to_end, normal, on_a, on_b)


def _exact(depth: float, normal: Floats, on_a: Floats, on_b: Floats) -> Penetration:
    return Penetration(max(depth, 0.0), depth, normal, on_a, on_b)


def _sizes(core: PointCore | SegmentCore | CylinderCore) -> tuple[float, float]:
    """Return the radius and half the length of a core as a cylinder."""
    if isinstance(core, CylinderCore):
        return core.rim_radius, core.half
    return 0.0, core.half if isinstance(core, SegmentCore) else 0.0
