"""Depth of two cores that touch or overlap in closed form: parallel axes, and a point in an ellipsoid.

The difference of cylinders, segments and points whose axes are parallel is a cylinder again, with the sums of
the radii and of the lengths. Where their axes coincide all directions across are equally near, and no
polytope has enough facets. A small angle between the axes moves points of the second core, and with them the
bounds, by at most its sine times their distance.
"""

from __future__ import annotations

import numpy as np

from dynx.distance.cores import Core, CylinderCore, EllipsoidCore, PointCore, SegmentCore
from dynx.distance.penetration import Penetration
from dynx.spatial.plain import dot, minus
from dynx.spatial.scalar import Floats

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


def penetration_of_point(a: Core, b: Core) -> Penetration | None:
    """Return the depth of a point in an ellipsoid, which no polytope has where it is alike all around; None
    for other cores."""
    if isinstance(b, EllipsoidCore) and isinstance(a, PointCore):
        found = penetration_of_point(b, a)
        return found and Penetration(found.lower, found.upper, -found.normal, found.point_b, found.point_a)
    if not isinstance(a, EllipsoidCore) or not isinstance(b, PointCore):
        return None
    p_a, p_b = np.array(a.p), np.array(b.p)
    local = _nearest_on_ellipsoid(a.radii, a.R.T @ (p_b - p_a))
    normal = a.R @ (local / a.radii**2)
    normal /= np.linalg.norm(normal)
    point = p_a + a.R @ local
    x, y, z = normal.tolist()
    upper = dot(minus(a.support((x, y, z)), b.p), (x, y, z))
    return Penetration(max(0.0, min(upper, float(np.linalg.norm(point - p_b)))), upper, normal, point, p_b)


def _nearest_on_ellipsoid(radii: Floats, p: Floats) -> Floats:
    """Return the point (3,) of the surface of an ellipsoid that is nearest to a point p (3,) inside.

    With lengths divided by the shortest half axis, it is z^2 q / (u + z^2 - 1), where u in [0, 1] puts it on
    the surface (D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid", 2013).
    """
    least = radii.min()
    z, q = radii / least, p / least
    beyond = z * z - 1.0
    short = z == 1.0
    low, high = 0.0, 1.0
    while low < (u := 0.5 * (low + high)) < high:
        with np.errstate(over="ignore"):
            above = np.sum((z * q / (u + beyond)) ** 2) > 1.0
        low, high = (u, high) if above else (low, u)
    x = np.where(short, 0.0, z * z * q / np.where(short, 1.0, high + beyond))
    # Along the shortest axes is what remains, also where p is on the plane across them.
    length = float(np.linalg.norm(q[short]))
    along = q[short] / length if length > 0.0 else np.eye(int(short.sum()))[0]
    x[short] = np.sqrt(max(0.0, 1.0 - float(np.sum((x / z) ** 2)))) * along
    return np.asarray(least * x)


def _sizes(core: PointCore | SegmentCore | CylinderCore) -> tuple[float, float]:
    """Return the radius and half the length of a core as a cylinder."""
    if isinstance(core, CylinderCore):
        return core.rim_radius, core.half
    return 0.0, core.half if isinstance(core, SegmentCore) else 0.0
