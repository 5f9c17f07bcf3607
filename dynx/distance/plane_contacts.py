"""Points of a shape near a half-space, in closed form."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from dynx.distance.contact_reduction import ContactCandidate
from dynx.distance.cores import BoxCore, CylinderCore, EllipsoidCore, HullCore, PointCore, SegmentCore
from dynx.distance.hull_surface import hull_surface
from dynx.distance.placed_solids import PlacedSolid
from dynx.distance.support_features import (
    LOWEST_RIM,
    MAX_OUTLINE,
    MIN_RIM_TILT,
    RIM,
    RIM_POINTS,
    capsule_reach,
    frame_along,
)
from dynx.spatial.plain import Vector3, dot

AddPoint = Callable[[float, float, float, float, int], None]

GROUND = -1
"""Number of the surface of a half-space."""

FINE_RIM = 16
"""Number of points of a rim with its spares: their polygon lies inside the disc by at most
1 - cos(pi / 16) = 1.9 % of the radius."""

FIRST_FINE_RIM = LOWEST_RIM + 2
"""Number of the first of the fine points of a rim; those of the other end follow."""

_FINE_RIM = [
    (math.cos(2.0 * math.pi * k / FINE_RIM), math.sin(2.0 * math.pi * k / FINE_RIM)) for k in range(FINE_RIM)
]


def plane_candidates(
    a: PlacedSolid, plane: PlacedSolid, within: float
) -> tuple[Vector3, list[ContactCandidate], float]:
    """Return the unit normal of the half-space, the points of a that are at most `within` above it, and the
    size of a."""
    up = plane.axes[2]
    length = math.sqrt(dot(up, up))
    up = up[0] / length, up[1] / length, up[2] / length
    core = a.solid.core
    assert core is not None
    ux, uy, uz = up
    px, py, pz = a.p
    height = ux * (px - plane.p[0]) + uy * (py - plane.p[1]) + uz * (pz - plane.p[2])
    size = core.extent + core.radius
    # A quick end for all that is far above the plane.
    if height - size > within:
        return up, [], size
    found: list[ContactCandidate] = []
    add = _adding_to(found, a.p, up, within)
    if isinstance(core, PointCore):
        r = core.radius
        add(-r * ux, -r * uy, -r * uz, height - r, 0)
    elif isinstance(core, SegmentCore):
        r, (x, y, z) = core.radius, a.axes[2]
        sine = x * ux + y * uy + z * uz
        low, cosine = height - core.half * abs(sine), math.sqrt(max(1.0 - sine * sine, 0.0))
        beyond = capsule_reach(r, abs(sine), cosine, 2.0 * core.half * cosine)
        for part, s in enumerate((-core.half, core.half)):
            above = low - (r if s * sine <= 0.0 else beyond)
            t = above - (height + s * sine)
            add(s * x + t * ux, s * y + t * uy, s * z + t * uz, above, part)
    elif isinstance(core, BoxCore):
        _add_box(core, a, up, height, add)
    elif isinstance(core, CylinderCore):
        _add_cylinder(core, a, up, height, add)
    elif isinstance(core, HullCore):
        _add_hull(core, a, up, height, within, add)
    else:
        assert isinstance(core, EllipsoidCore)
        core.place(a.R, (0.0, 0.0, 0.0))
        x, y, z = core.support((-ux, -uy, -uz))
        add(x, y, z, height + ux * x + uy * y + uz * z, 0)
    return up, found, size


def fine_rim(a: PlacedSolid, plane: PlacedSolid, within: float) -> list[ContactCandidate]:
    """Return further points of the lower rim of a cylinder that are at most `within` above a half-space,
    beside the four of `plane_candidates`; none for other shapes."""
    core = a.solid.core
    if not isinstance(core, CylinderCore):
        return []
    up = plane.axes[2]
    x, y, z = a.axes
    cx, cy, cz = dot(x, up), dot(y, up), dot(z, up)
    if math.hypot(cx, cy) >= abs(cz):
        return []
    found: list[ContactCandidate] = []
    add = _adding_to(found, a.p, up, within)
    height = dot(up, (a.p[0] - plane.p[0], a.p[1] - plane.p[1], a.p[2] - plane.p[2]))
    end = 0 if cz > 0.0 else 1
    s, first = core.half if end else -core.half, FIRST_FINE_RIM + end * FINE_RIM
    r = core.rim_radius
    points = [(r * c, r * d, first + k) for k, (c, d) in enumerate(_FINE_RIM) if 4 * k % FINE_RIM]
    _add_rim(points, s, a, height, (cx, cy, cz), add)
    return found


def _adding_to(found: list[ContactCandidate], origin: Vector3, up: Vector3, within: float) -> AddPoint:
    """Return a function that adds a point of a shape at an offset from its origin, at a height above the
    half-space."""
    frame = frame_along(up)
    (eu, ev, ew), (fu, fv, fw) = frame.u, frame.v
    (px, py, pz), (ux, uy, uz) = origin, up

    def add(x: float, y: float, z: float, above: float, part: int) -> None:
        if above <= within:
            on_a = px + x, py + y, pz + z
            on_plane = on_a[0] - above * ux, on_a[1] - above * uy, on_a[2] - above * uz
            u, v = eu * x + ev * y + ew * z, fu * x + fv * y + fw * z
            found.append(ContactCandidate(u, v, above, on_a, on_plane, (part, GROUND)))

    return add


def _add_box(core: BoxCore, a: PlacedSolid, up: Vector3, height: float, add: AddPoint) -> None:
    """Add the corners of the lowest face."""
    along = [h * dot(axis, up) for h, axis in zip(core.halves, a.axes, strict=True)]
    cosines = [abs(c / h) for c, h in zip(along, core.halves, strict=True)]
    k = cosines.index(max(cosines))
    i, j = (k + 1) % 3, (k + 2) % 3
    sign = -1.0 if along[k] > 0.0 else 1.0
    s = sign * core.halves[k]
    x, y, z = s * a.axes[k][0], s * a.axes[k][1], s * a.axes[k][2]
    number = 1 << k if sign > 0.0 else 0
    base = height + sign * along[k]
    (di, ei, fi), (dj, ej, fj) = a.axes[i], a.axes[j]
    hi, hj = core.halves[i], core.halves[j]
    for si, sj in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)):
        p, q = si * hi, sj * hj
        part = number | (si > 0.0) << i | (sj > 0.0) << j
        above = base + si * along[i] + sj * along[j]
        add(x + p * di + q * dj, y + p * ei + q * ej, z + p * fi + q * fj, above, part)


def _add_cylinder(core: CylinderCore, a: PlacedSolid, up: Vector3, height: float, add: AddPoint) -> None:
    """Add points of the rim of the lower end, its lowest point, and that of the upper end."""
    x, y, z = a.axes
    cx, cy, cz = dot(x, up), dot(y, up), dot(z, up)
    across = math.hypot(cx, cy)
    r, end = core.rim_radius, 0 if cz > 0.0 else 1
    for this_end in (end, 1 - end):
        s = core.half if this_end else -core.half
        points: list[tuple[float, float, int]] = []
        if this_end == end and across < abs(cz):
            # Four of the points, because a quarter of a turn apart they bear most loads.
            step = RIM_POINTS // 4
            points = [
                (r * c, r * d, this_end * RIM_POINTS + k) for k, (c, d) in enumerate(RIM) if k % step == 0
            ]
        if across > MIN_RIM_TILT:
            points.append((-r * cx / across, -r * cy / across, LOWEST_RIM + this_end))
        _add_rim(points, s, a, height, (cx, cy, cz), add)


def _add_rim(
    points: list[tuple[float, float, int]], s: float, a: PlacedSolid, height: float, c: Vector3, add: AddPoint
) -> None:
    """Add points of a rim at s along the axis, whose axes have the components c along the normal."""
    x, y, z = a.axes
    for p, q, part in points:
        px, py, pz = (p * x[k] + q * y[k] + s * z[k] for k in range(3))
        add(px, py, pz, height + p * c[0] + q * c[1] + s * c[2], part)


def _add_hull(
    core: HullCore, a: PlacedSolid, up: Vector3, height: float, within: float, add: AddPoint
) -> None:
    """Add the vertices near the plane; of many, those that are farthest in some directions."""
    R = a.R
    local = R.T @ np.array(up)
    corners = hull_surface(core).corners
    heights = height + corners @ local
    near = np.flatnonzero(heights <= within)
    if len(near) > 2 * MAX_OUTLINE:
        frame = frame_along(up)
        places = corners[near] @ (R.T @ np.array([frame.u, frame.v]).T)
        angles = 2.0 * np.pi * np.arange(MAX_OUTLINE) / MAX_OUTLINE
        chosen = np.argmax(places @ np.stack([np.cos(angles), np.sin(angles)]), axis=0)
        near = near[np.unique([*chosen, int(np.argmin(heights[near]))])]
    points = corners[near] @ R.T
    for (x, y, z), above, part in zip(points.tolist(), heights[near].tolist(), near.tolist(), strict=True):
        add(x, y, z, above, part)
