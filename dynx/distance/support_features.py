"""Faces, edges and vertices of a shape that face a direction, seen along it.

A frame (u, v, n) has the contact normal n as its third axis. The feature of a shape is a convex polygon, a
segment or a point in the coordinates u and v, with the height of the surface along n at each place. A face
counts as facing the direction up to `FACE_ANGLE` from it, so that all corners of a face remain candidates
when the shape tips.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dynx.distance.cores import BoxCore, CylinderCore, HullCore, PointCore, SegmentCore
from dynx.distance.hull_surface import hull_surface
from dynx.distance.placed_solids import PlacedSolid
from dynx.spatial.plain import Vector3, dot
from dynx.spatial.scalar import Floats

FACE_ANGLE = 0.25
"""Angle [rad] between a face (or an edge) and the plane across the normal up to which all of it is a
feature."""

_SINE, _COSINE = math.sin(FACE_ANGLE), math.cos(FACE_ANGLE)

RIM_POINTS = 8
"""Number of points that stand for the rim of a cylinder: their polygon lies inside the disc by at most
1 - cos(pi / 8) = 7.6 % of the radius."""

RIM = [
    (math.cos(2.0 * math.pi * k / RIM_POINTS), math.sin(2.0 * math.pi * k / RIM_POINTS))
    for k in range(RIM_POINTS)
]

LOWEST_RIM = 2 * RIM_POINTS
"""Number of the point of a rim that is farthest along the direction; the other end of the cylinder has the
next one."""

MIN_RIM_TILT = 1e-9
"""Sine of the angle between the axis of a cylinder and the normal below which its whole rim is alike."""

MAX_OUTLINE = 16
"""Largest number of vertices of a face of a hull; of more, the farthest in as many directions remain."""

PointOfFeature = tuple[float, float, float, int]
"""Coordinates along u, v and n [m], and the number of the point in its shape."""


class ContactFrame(NamedTuple):
    """Orthonormal axes: two across a contact normal, and the normal."""

    u: Vector3
    v: Vector3
    n: Vector3

    def point(self, u: float, v: float, h: float) -> Vector3:
        """Return the point with these coordinates."""
        (a, b, c), (d, e, f), (x, y, z) = self
        return u * a + v * d + h * x, u * b + v * e + h * y, u * c + v * f + h * z


def frame_along(n: Vector3) -> ContactFrame:
    """Return a frame of a unit normal.

    T. Duff and others, "Building an orthonormal basis, revisited", Journal of Computer Graphics Techniques 6
    (2017).
    """
    x, y, z = n
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return ContactFrame((1.0 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y), n)


class SupportFeature(NamedTuple):
    """The part of a surface that faces a direction: one point, two, or a polygon counter-clockwise."""

    points: list[PointOfFeature]
    height: Callable[[float, float], float]
    """Height of the surface above coordinates (u, v) of the feature [m]."""
    round_radius: float = math.inf
    """Radius of the surface across a segment [m]; infinite for other features, 0 for sharp edges."""


def support_feature(solid: PlacedSolid, p: Vector3, frame: ContactFrame, sign: float) -> SupportFeature:
    """Return the feature of a shape, with its origin at `p`, that faces ``sign * n``."""
    core = solid.solid.core
    if isinstance(core, BoxCore):
        return _of_box(core, solid, p, frame, sign)
    if isinstance(core, CylinderCore):
        return _of_cylinder(core, solid, p, frame, sign)
    if isinstance(core, SegmentCore):
        return _of_capsule(core, solid, p, frame, sign)
    if isinstance(core, HullCore):
        return _of_hull(core, solid, p, frame, sign)
    assert core is not None
    radius = core.radius if isinstance(core, PointCore) else 0.0
    core.place(solid.R, p)
    x, y, z = core.support((sign * frame.n[0], sign * frame.n[1], sign * frame.n[2]))
    point = (*_coordinates(frame, (x, y, z)), 0)
    return _point((point[0], point[1], point[2] + sign * radius, 0))


def _coordinates(frame: ContactFrame, p: Vector3) -> Vector3:
    return dot(frame.u, p), dot(frame.v, p), dot(frame.n, p)


def _point(point: PointOfFeature) -> SupportFeature:
    height = point[2]
    return SupportFeature([point], lambda u, v: height)


def _segment(a: PointOfFeature, b: PointOfFeature, round_radius: float) -> SupportFeature:
    (ua, va, ha, _), (ub, vb, hb, _) = a, b
    du, dv = ub - ua, vb - va
    square = du * du + dv * dv
    slope = (hb - ha) / square if square > 0.0 else 0.0
    return SupportFeature([a, b], lambda u, v: ha + slope * ((u - ua) * du + (v - va) * dv), round_radius)


def _polygon(points: list[PointOfFeature], normal: Vector3) -> SupportFeature:
    """Return a flat feature with the normal in coordinates of the frame."""
    u0, v0, h0, _ = points[0]
    gu, gv = -normal[0] / normal[2], -normal[1] / normal[2]
    return SupportFeature(_counter_clockwise(points), lambda u, v: h0 + gu * (u - u0) + gv * (v - v0))


def _counter_clockwise(points: list[PointOfFeature]) -> list[PointOfFeature]:
    (ua, va, *_), (ub, vb, *_), (uc, vc, *_) = points[:3]
    return points if (ub - ua) * (vc - va) - (uc - ua) * (vb - va) >= 0.0 else points[::-1]


def _of_box(
    core: BoxCore, solid: PlacedSolid, p: Vector3, frame: ContactFrame, sign: float
) -> SupportFeature:
    center = _coordinates(frame, p)
    u, v, h = center
    free: list[tuple[int, Vector3]] = []
    number = 0
    for k, (axis, half) in enumerate(zip(solid.axes, core.halves, strict=True)):
        along = _coordinates(frame, axis)
        c = sign * along[2]
        step = half * along[0], half * along[1], half * along[2]
        if abs(c) <= _SINE:
            free.append((k, step))
        elif c > 0.0:
            u, v, h, number = u + step[0], v + step[1], h + step[2], number | 1 << k
        else:
            u, v, h = u - step[0], v - step[1], h - step[2]
    if not free:
        return _point((u, v, h, number))
    k, (a, b, c) = free[0]
    bit = 1 << k
    if len(free) == 1:
        return _segment((u - a, v - b, h - c, number), (u + a, v + b, h + c, number | bit), 0.0)
    k, (d, e, f) = free[1]
    other = 1 << k
    points = [
        (u - a - d, v - b - e, h - c - f, number),
        (u + a - d, v + b - e, h + c - f, number | bit),
        (u + a + d, v + b + e, h + c + f, number | bit | other),
        (u - a + d, v - b + e, h - c + f, number | other),
    ]
    return _polygon(points, (b * f - c * e, c * d - a * f, a * e - b * d))


def _of_cylinder(
    core: CylinderCore, solid: PlacedSolid, p: Vector3, frame: ContactFrame, sign: float
) -> SupportFeature:
    x, y, z = (_coordinates(frame, axis) for axis in solid.axes)
    u, v, h = _coordinates(frame, p)
    radius, half = core.rim_radius, core.half
    cx, cy, cz = sign * x[2], sign * y[2], sign * z[2]
    across = math.hypot(cx, cy)
    end = 1 if cz > 0.0 else 0
    step = half if cz > 0.0 else -half
    # Direction from the axis to the side that faces n.
    a, b = (cx / across, cy / across) if across > MIN_RIM_TILT else (0.0, 0.0)
    du, dv, dh = (radius * (a * x[i] + b * y[i]) for i in range(3))
    if abs(cz) < _COSINE:
        near = (u + du + step * z[0], v + dv + step * z[1], h + dh + step * z[2], LOWEST_RIM + end)
        if abs(cz) > _SINE:
            return _point(near)
        far = (u + du - step * z[0], v + dv - step * z[1], h + dh - step * z[2], LOWEST_RIM + 1 - end)
        return _segment(far, near, radius) if end else _segment(near, far, radius)
    u, v, h = u + step * z[0], v + step * z[1], h + step * z[2]
    first = RIM_POINTS * end
    rim = [(radius * c, radius * s, first + k) for k, (c, s) in enumerate(RIM)]
    if across > MIN_RIM_TILT:
        at = math.atan2(b, a) % (2.0 * math.pi) * RIM_POINTS / (2.0 * math.pi)
        if abs(at - round(at)) > 1e-6:
            rim.insert(int(at) + 1, (radius * a, radius * b, LOWEST_RIM + end))
    points = [
        (u + s * x[0] + t * y[0], v + s * x[1] + t * y[1], h + s * x[2] + t * y[2], k) for s, t, k in rim
    ]
    return _polygon(points, z)


def _of_capsule(
    core: SegmentCore, solid: PlacedSolid, p: Vector3, frame: ContactFrame, sign: float
) -> SupportFeature:
    z = _coordinates(frame, solid.axes[2])
    u, v, h = _coordinates(frame, p)
    half, radius = core.half, core.radius
    rises = sign * z[2] < 0.0
    # From the end that is farther along the direction to the other one.
    step = -half if rises else half
    near = u + step * z[0], v + step * z[1], h + step * z[2]
    first, second = (0, 1) if rises else (1, 0)
    if abs(z[2]) > _SINE:
        return _point((near[0], near[1], near[2] + sign * radius, first))
    far = u - step * z[0], v - step * z[1], h - step * z[2]
    sine = abs(z[2])
    cosine = math.sqrt(1.0 - sine * sine)
    du, dv = (far[0] - near[0]) / (2.0 * half * cosine), (far[1] - near[1]) / (2.0 * half * cosine)
    un, vn, hn = near

    def height(u: float, v: float) -> float:
        along = (u - un) * du + (v - vn) * dv
        return hn + sign * capsule_reach(radius, sine, cosine, along)

    a: PointOfFeature = (un, vn, hn + sign * radius, first)
    b: PointOfFeature = (far[0], far[1], height(far[0], far[1]), second)
    return SupportFeature([a, b] if first == 0 else [b, a], height, radius)


def capsule_reach(radius: float, sine: float, cosine: float, along: float) -> float:
    """Return how far the surface of a capsule is beyond the near end of its axis, along the normal.

    `sine` and `cosine` are those of the angle between the axis and the plane across the normal, `along` is
    the distance from that end in that plane. The surface is that of the half ball, then of the cylinder.
    """
    if along < radius * sine:
        return math.sqrt(max(radius * radius - along * along, 0.0))
    return (radius - along * sine) / cosine


def _of_hull(
    core: HullCore, solid: PlacedSolid, p: Vector3, frame: ContactFrame, sign: float
) -> SupportFeature:
    axes: Floats = np.array(frame) @ solid.R
    surface = hull_surface(core)
    local: Floats = surface.corners @ axes.T
    heights = sign * local[:, 2]
    best = int(heights.argmax())
    shift = _coordinates(frame, p)
    across = np.hypot(local[:, 0] - local[best, 0], local[:, 1] - local[best, 1])
    near = np.flatnonzero(heights[best] - heights <= _SINE / _COSINE * across)
    points: list[PointOfFeature] = [
        (u + shift[0], v + shift[1], h + shift[2], k)
        for (u, v, h), k in zip(local[near].tolist(), near.tolist(), strict=True)
    ]
    points = _outline(points)
    if len(points) == 1:
        return _point(points[0])
    if surface.normals is None or surface.offsets is None:
        if len(points) == 2:
            return _segment(points[0], points[1], 0.0)
        rows = np.array([[u, v, 1.0] for u, v, _, _ in points])
        gu, gv, h0 = np.linalg.lstsq(rows, np.array([q[2] for q in points]), rcond=None)[0].tolist()
        return SupportFeature(points, lambda u, v: h0 + gu * u + gv * v)
    normals: Floats = surface.normals @ axes.T
    facing = np.flatnonzero(sign * normals[:, 2] > 1e-9)
    normals = normals[facing]
    slopes: Floats = normals[:, :2] / normals[:, 2:]
    offsets: Floats = surface.offsets[facing] / normals[:, 2]

    def height(u: float, v: float) -> float:
        """Return the height at which the line along n through a place leaves the hull."""
        at = offsets - slopes @ np.array((u - shift[0], v - shift[1]))
        return shift[2] + float(at.min() if sign > 0.0 else at.max())

    radius = 0.0 if len(points) == 2 else math.inf
    return SupportFeature(points, height, radius)


def _outline(points: list[PointOfFeature]) -> list[PointOfFeature]:
    """Return the convex outline of points in u and v, counter-clockwise, by A. Andrew's chains (1979)."""
    if len(points) > 3 * MAX_OUTLINE:
        points = _extremes(points)
    ordered = sorted(points)
    if len(ordered) < 3:
        return ordered
    chains: list[list[PointOfFeature]] = []
    for sequence in (ordered, ordered[::-1]):
        chain: list[PointOfFeature] = []
        for q in sequence:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], q) <= 0.0:
                chain.pop()
            chain.append(q)
        chains.append(chain[:-1])
    outline = chains[0] + chains[1]
    return _extremes(outline) if len(outline) > MAX_OUTLINE else outline


def _extremes(points: list[PointOfFeature]) -> list[PointOfFeature]:
    """Return the points that are farthest in `MAX_OUTLINE` directions, and the first one, in order."""
    array = np.array([q[:2] for q in points])
    angles = 2.0 * np.pi * np.arange(MAX_OUTLINE) / MAX_OUTLINE
    rows = np.stack([np.cos(angles), np.sin(angles)])
    return [points[k] for k in sorted({*np.argmax(array @ rows, axis=0).tolist()})]


def _turn(a: PointOfFeature, b: PointOfFeature, c: PointOfFeature) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
