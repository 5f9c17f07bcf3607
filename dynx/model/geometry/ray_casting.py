"""Intersections of rays with shapes, in closed form, where an engine has none of its own or misses shapes.

A ray that begins inside a solid hits the surface where it leaves; the normal is the outward one there. A
plane is hit from above only. A height field is a surface without thickness.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.shapes import Box, Capsule, Cylinder, Ellipsoid, HeightField, Plane, Sphere
from dynx.spatial.scalar import Floats

MAX_PRODUCTS = 2_000_000
"""Largest number of pairs of a ray and a face of a hull that are computed at once."""

ROUNDING = 1e-9
"""Barycentric coordinate below zero that counts as on the edge, so that no ray passes between triangles."""


class Interval(NamedTuple):
    """Where n rays are inside a convex solid: from `start` to `end` (n,), with the outward normals (n, 3)
    there; empty where `start` is above `end`."""

    start: Floats
    end: Floats
    start_normal: Floats
    end_normal: Floats


def cast_on_shape(shape: object, T: Floats, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Return the distances (n,), infinite without a hit, and the outward normals (n, 3) in world axes.

    `T` (4, 4) is the pose of the shape; `origins` (n, 3) and unit `directions` (n, 3) are in world axes.
    """
    R = T[:3, :3]
    local = (origins - T[:3, 3]) @ R
    along = directions @ R
    if isinstance(shape, HeightField):
        distance, normal = _cast_on_height_field(shape, local, along)
    elif isinstance(shape, Plane):
        distance, normal = _cast_on_plane(local, along)
    elif isinstance(shape, Mesh):
        distance, normal = _cast_on_hull(shape, local, along)
    else:
        distance, normal = _first_hit(_solid(shape, local, along))
    return distance, normal @ R.T


def _first_hit(inside: Interval) -> tuple[Floats, Floats]:
    """Return the entry into a solid, or the exit for rays that begin inside."""
    hit = (inside.start <= inside.end) & (inside.end >= 0.0)
    enters = inside.start >= 0.0
    distance = np.where(hit, np.where(enters, inside.start, inside.end), np.inf)
    return distance, np.where(enters[:, None], inside.start_normal, inside.end_normal)


def _cast_on_plane(origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    falls = (directions[:, 2] < 0.0) & (origins[:, 2] >= 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.where(falls, -origins[:, 2] / directions[:, 2], np.inf)
    return distance, np.tile([0.0, 0.0, 1.0], (len(origins), 1))


def _solid(shape: object, origins: Floats, directions: Floats) -> Interval:
    if isinstance(shape, Box):
        half = 0.5 * np.array(shape.size)
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return _between_planes(normals, np.concatenate([half, half]), origins, directions)
    if isinstance(shape, Sphere):
        return _in_ball(shape.radius, 0.0, origins, directions)
    if isinstance(shape, Cylinder):
        return _in_cylinder(shape.radius, shape.length, origins, directions)
    if isinstance(shape, Capsule):
        middle = _in_cylinder(shape.radius, shape.length, origins, directions)
        for end in (-0.5, 0.5):
            middle = _union(middle, _in_ball(shape.radius, end * shape.length, origins, directions))
        return middle
    if isinstance(shape, Ellipsoid):
        return _in_ellipsoid(np.array(shape.radii), origins, directions)
    raise TypeError(f"no rays on a {type(shape).__name__}")


def _between_planes(normals: Floats, offsets: Floats, origins: Floats, directions: Floats) -> Interval:
    """Return where rays are inside the intersection of half-spaces normal . x <= offset."""
    speed = directions @ normals.T
    height = origins @ normals.T - offsets
    with np.errstate(divide="ignore", invalid="ignore"):
        times = -height / speed
    entry = np.where(speed < 0.0, times, -np.inf)
    leave = np.where(speed > 0.0, times, np.inf)
    # A ray along a face and outside of it never enters.
    leave = np.where((speed == 0.0) & (height > 0.0), -np.inf, leave)
    first, last = entry.argmax(axis=1), leave.argmin(axis=1)
    rows = np.arange(len(origins))
    return Interval(entry[rows, first], leave[rows, last], normals[first], normals[last])


def _in_ball(radius: float, z: float, origins: Floats, directions: Floats) -> Interval:
    center = np.array([0.0, 0.0, z])
    return _roots(origins - center, directions, radius)


def _roots(origins: Floats, directions: Floats, radius: float) -> Interval:
    """Return where |origin + t direction| <= radius."""
    a = np.einsum("ij,ij->i", directions, directions)
    b = np.einsum("ij,ij->i", origins, directions)
    c = np.einsum("ij,ij->i", origins, origins) - radius * radius
    with np.errstate(divide="ignore", invalid="ignore"):
        # The squared distance of the centre from the line is more exact than b^2 - a c far away.
        nearest = origins - (b / a)[:, None] * directions
        discriminant = radius * radius - np.einsum("ij,ij->i", nearest, nearest)
        half = np.sqrt(np.maximum(discriminant, 0.0) / a)
        start, end = -b / a - half, -b / a + half
    parallel = a == 0.0
    misses = np.where(parallel, c > 0.0, discriminant < 0.0)
    start = np.where(misses, np.inf, np.where(parallel, -np.inf, start))
    end = np.where(misses, -np.inf, np.where(parallel, np.inf, end))
    return Interval(start, end, *(_unit_points(origins, directions, times) for times in (start, end)))


def _in_ellipsoid(radii: Floats, origins: Floats, directions: Floats) -> Interval:
    """Return where rays are inside an ellipsoid: in coordinates divided by its half axes, a ball."""
    inside = _roots(origins / radii, directions / radii, 1.0)
    normals = inside.start_normal / radii, inside.end_normal / radii
    # A ray that misses may have no point, and a normal of zero.
    lengths = (np.linalg.norm(each, axis=1, keepdims=True) for each in normals)
    units = (each / np.where(size > 0.0, size, 1.0) for each, size in zip(normals, lengths, strict=True))
    return Interval(inside.start, inside.end, *units)


def _unit_points(origins: Floats, directions: Floats, times: Floats) -> Floats:
    points = origins + np.where(np.isfinite(times), times, 0.0)[:, None] * directions
    length = np.linalg.norm(points, axis=1)
    return np.asarray(points / np.where(length > 0.0, length, 1.0)[:, None])


def _in_cylinder(radius: float, length: float, origins: Floats, directions: Floats) -> Interval:
    flat = np.array([1.0, 1.0, 0.0])
    normals = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    side = _roots(origins * flat, directions * flat, radius)
    ends = _between_planes(normals, np.full(2, 0.5 * length), origins, directions)
    by_end, to_end = ends.start > side.start, ends.end < side.end
    return Interval(
        np.maximum(side.start, ends.start),
        np.minimum(side.end, ends.end),
        np.where(by_end[:, None], ends.start_normal, side.start_normal),
        np.where(to_end[:, None], ends.end_normal, side.end_normal),
    )


def _union(a: Interval, b: Interval) -> Interval:
    """Return the interval of two solids whose union is convex."""
    some_a, some_b = a.start <= a.end, b.start <= b.end
    first = some_b & (~some_a | (b.start < a.start))
    last = some_b & (~some_a | (b.end > a.end))
    return Interval(
        np.where(first, b.start, a.start),
        np.where(last, b.end, a.end),
        np.where(first[:, None], b.start_normal, a.start_normal),
        np.where(last[:, None], b.end_normal, a.end_normal),
    )


def _cast_on_hull(shape: Mesh, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    normals, offsets, center, radius = _hull_planes(shape)
    distance, normal = np.full(len(origins), np.inf), np.zeros((len(origins), 3))
    # Only rays through the ball around the hull are tested against its faces.
    ball = _roots(origins - center, directions, radius)
    near = np.flatnonzero((ball.start <= ball.end) & (ball.end >= 0.0))
    size = max(1, MAX_PRODUCTS // len(normals))
    for part in range(0, len(near), size):
        rays = near[part : part + size]
        inside = _between_planes(normals, offsets, origins[rays], directions[rays])
        distance[rays], normal[rays] = _first_hit(inside)
    return distance, normal


@lru_cache(maxsize=64)
def _hull_planes(shape: Mesh) -> tuple[Floats, Floats, Floats, float]:
    """Return outward normals (m, 3) and offsets (m,) of the faces, and the centre and radius of a ball
    around the hull."""
    vertices, faces = shape.hull
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    kept: NDArray[np.bool_] = lengths > 0.0
    normals, a = normals[kept] / lengths[kept, None], a[kept]
    center = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    radius = float(np.max(np.linalg.norm(vertices - center, axis=1))) * (1.0 + 1e-9)
    return normals, np.einsum("ij,ij->i", normals, a), center, radius


def _cast_on_height_field(shape: HeightField, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Return the distances (n,), infinite without a hit, and upward normals (n, 3), in the axes of the
    field. The surface is hit from both sides."""
    heights, x, y = _grid(shape)
    distance, normal = np.full(len(origins), np.inf), np.zeros((len(origins), 3))
    low = np.array([x[0], y[0], heights.min()])
    high = np.array([x[-1], y[-1], heights.max()])
    # A margin keeps rays within the plane of a level field.
    slack = ROUNDING * (1.0 + np.abs(high - low).max())
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (low - slack - origins) / directions, (high + slack - origins) / directions
    still = directions == 0.0
    between = (origins >= low - slack) & (origins <= high + slack)
    start = np.where(still, np.where(between, -np.inf, np.inf), np.minimum(first, second)).max(axis=1)
    end = np.where(still, np.where(between, np.inf, -np.inf), np.maximum(first, second)).min(axis=1)
    start = np.maximum(start, 0.0)
    for ray in np.flatnonzero(start <= end):
        found = _first_triangle(heights, x, y, origins[ray], directions[ray], start[ray], end[ray])
        if found is not None:
            distance[ray], normal[ray] = found
    return distance, normal


def _first_triangle(
    heights: Floats, x: Floats, y: Floats, origin: Floats, direction: Floats, start: float, end: float
) -> tuple[float, Floats] | None:
    """Return the first hit of one ray between the times `start` and `end`: time and upward normal."""
    times = [np.array([start, end])]
    for axis, lines in ((0, x), (1, y)):
        if direction[axis] != 0.0:
            crossings = (lines - origin[axis]) / direction[axis]
            times.append(crossings[(crossings > start) & (crossings < end)])
    ordered = np.unique(np.concatenate(times))
    middles = 0.5 * (ordered[1:] + ordered[:-1]) if len(ordered) > 1 else ordered
    columns, rows = (
        np.clip(np.searchsorted(lines, origin[axis] + middles * direction[axis]) - 1, 0, len(lines) - 2)
        for axis, lines in ((0, x), (1, y))
    )
    corners = {
        (i, j): np.stack([x[columns + j], y[rows + i], heights[rows + i, columns + j]], axis=-1)
        for i in (0, 1)
        for j in (0, 1)
    }
    best: tuple[float, Floats] | None = None
    for second, third in (((0, 1), (1, 1)), ((1, 1), (1, 0))):
        a, e1, e2 = corners[0, 0], corners[second] - corners[0, 0], corners[third] - corners[0, 0]
        # Moeller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
        across = np.cross(direction, e2)
        determinant = np.einsum("ij,ij->i", e1, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (across @ origin - np.einsum("ij,ij->i", across, a)) / determinant
            offset = np.cross(origin - a, e1)
            v = offset @ direction / determinant
            t = np.einsum("ij,ij->i", offset, e2) / determinant
        hit = (u >= -ROUNDING) & (v >= -ROUNDING) & (u + v <= 1.0 + ROUNDING) & (t >= 0.0)
        for k in np.flatnonzero(hit)[:1]:
            if best is None or t[k] < best[0]:
                normal = np.cross(e1[k], e2[k])
                best = float(t[k]), normal / np.linalg.norm(normal)
    return best


@lru_cache(maxsize=16)
def _grid(shape: HeightField) -> tuple[Floats, Floats, Floats]:
    """Return heights (rows, columns), x of the columns and y of the rows."""
    heights = np.array(shape.heights)
    rows, columns = heights.shape
    x = np.linspace(-0.5 * shape.size[0], 0.5 * shape.size[0], columns)
    return heights, x, np.linspace(-0.5 * shape.size[1], 0.5 * shape.size[1], rows)
