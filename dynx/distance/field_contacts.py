"""Contact points of a convex shape with a height field, triangle by triangle.

The surface is that of `HeightField.triangles`. The normal at a point inside a triangle is the triangle's. On
a ridge or a summit it may be any along which the surface around lies below (the normal cone): the directions
along which a separating plane supports the surface there. No other direction counts, so that a shape that
slides over the edge between two triangles of one plane meets no obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dynx.distance.contact_reduction import TIE, ContactCandidate
from dynx.distance.cores import Core, HullCore
from dynx.distance.distance import distance_of_cores
from dynx.distance.overlap_polygon import EDGE_BASE, NEAREST, overlap
from dynx.distance.placed_solids import PlacedSolid
from dynx.distance.support_features import SupportFeature, frame_along, support_feature
from dynx.distance.terrain import GridPoint, Terrain
from dynx.spatial.plain import Vector3, cross, dot, minus, rotate, rotate_back
from dynx.spatial.scalar import Floats

MARGIN = 1e-8
"""Distance outside of a triangle, relative to the size of the shape, that counts as inside."""

CONE = 1e-9
"""Sine of the angle by which the surface may rise above the plane across a normal on a ridge."""

RIDGE = 1e-6
"""Height of a vertex below the plane of the triangle across an edge, relative to the edge, from which the
edge is a ridge."""


class NormalAndCandidate(NamedTuple):
    """A candidate with its normal, which differs from triangle to triangle."""

    normal: Vector3
    candidate: ContactCandidate


def field_candidates(a: PlacedSolid, ground: PlacedSolid, within: float) -> list[NormalAndCandidate]:
    """Return the points of a that are at most `within` above the surface of a height field, in world axes."""
    field, core = ground.solid.field, a.solid.core
    assert field is not None
    assert core is not None
    terrain = field.terrain
    near = PlacedSolid(a.solid)
    near.p = rotate_back(ground.rows, minus(a.p, ground.p))
    columns = [rotate_back(ground.rows, axis) for axis in a.axes]
    near.axes = columns[0], columns[1], columns[2]
    near.rows = tuple(zip(*columns, strict=True))  # type: ignore[assignment]
    box = _box(near, core, within)
    if box[1][2] < terrain.bottom:
        return []
    found = [
        *_on_triangles(near, core, terrain, within, box),
        *_on_ridges(near, core, terrain, within, box),
    ]
    return [_in_world(each, ground) for each in found]


def _in_world(each: NormalAndCandidate, ground: PlacedSolid) -> NormalAndCandidate:
    def moved(p: Vector3) -> Vector3:
        x, y, z = rotate(ground.rows, p)
        return x + ground.p[0], y + ground.p[1], z + ground.p[2]

    c = each.candidate
    points = moved(c.point_a), moved(c.point_b)
    return NormalAndCandidate(
        rotate(ground.rows, each.normal), ContactCandidate(c.u, c.v, c.gap, *points, c.feature)
    )


def _box(a: PlacedSolid, core: Core, within: float) -> tuple[Floats, Floats]:
    """Return the box around a shape in the frame of the field, enlarged by `within`."""
    core.place(a.R, a.p)
    reach = core.radius + within
    axes: Floats = np.eye(3)
    upper = np.einsum("ij,ij->i", core.supports(axes), axes) + reach
    lower = -np.einsum("ij,ij->i", core.supports(-axes), -axes) - reach
    return lower, upper


def _on_triangles(
    a: PlacedSolid, core: Core, terrain: Terrain, within: float, box: tuple[Floats, Floats]
) -> Iterator[NormalAndCandidate]:
    """Yield the candidates along the normals of triangles."""
    size = core.extent + core.radius
    lower, upper = box
    rows, columns = terrain.cells(lower, upper)
    if not rows or not columns:
        return
    tops, normals = terrain.triangles(rows, columns)
    core.place(a.R, a.p)
    heights = np.einsum("ij,ij->i", core.supports(-normals) - tops, normals) - core.radius
    for k in np.flatnonzero(heights <= within).tolist():
        cell, half = divmod(k, 2)
        row, column = rows[cell // len(columns)], columns[cell % len(columns)]
        corners = [(row, column), (row, column + 1), (row + 1, column + 1), (row + 1, column)]
        vertices = [corners[0], *corners[1 + half : 3 + half]]
        points = [terrain.vertex(*each) for each in vertices]
        if max(p[2] for p in points) < lower[2]:
            continue
        numbers = [terrain.number(*each) for each in vertices]
        x, y, z = normals[k].tolist()
        yield from _on_triangle(a, points, numbers, (x, y, z), terrain, within, size)


def _on_triangle(
    a: PlacedSolid,
    points: list[Vector3],
    numbers: list[int],
    normal: Vector3,
    terrain: Terrain,
    within: float,
    size: float,
) -> Iterator[NormalAndCandidate]:
    frame = frame_along(normal)
    feature_a = support_feature(a, a.p, frame, -1.0)
    height = dot(normal, points[0])
    places = [(dot(frame.u, p), dot(frame.v, p), height, k) for p, k in zip(points, numbers, strict=True)]
    triangle = SupportFeature(places, lambda u, v: height)
    for place in overlap(feature_a, triangle, MARGIN * size, within):
        gap = place.height_a - height
        if gap > within:
            continue
        point_a = frame.point(place.u, place.v, place.height_a)
        point_b = frame.point(place.u, place.v, height)
        # Through a steep triangle beside it a point may be deep, which is near the surface above it.
        below = terrain.height(point_a[0], point_a[1]) - point_a[2]
        if gap < 0.0 and -gap > below + TIE * size:
            continue
        parts = place.part_a, place.part_b
        yield NormalAndCandidate(
            normal, ContactCandidate(point_b[0], point_b[1], gap, point_a, point_b, parts)
        )


def _on_ridges(
    a: PlacedSolid, core: Core, terrain: Terrain, within: float, box: tuple[Floats, Floats]
) -> Iterator[NormalAndCandidate]:
    """Yield the candidates on ridges and summits, along normals of their cones."""
    size = core.extent + core.radius
    lower, upper = box
    rows, columns = terrain.cells(lower, upper)
    R = a.R
    for first, second, beside in _edges(terrain, rows, columns):
        p, q = terrain.vertex(*first), terrain.vertex(*second)
        if max(p[2], q[2]) < lower[2] or not _is_ridge(p, q, [terrain.vertex(*each) for each in beside]):
            continue
        # A quick lower bound of the distance: the separation along one normal of the cone.
        middle = _middle_of_cone(p, q, terrain, beside)
        core.place(R, a.p)
        lowest = dot(middle, core.support((-middle[0], -middle[1], -middle[2]))) - core.radius
        if lowest - max(dot(middle, p), dot(middle, q)) > within:
            continue
        edge = HullCore(np.array([p, q]) - a.p)
        T: Floats = np.eye(4)
        T[:3, :3] = R
        nearest = distance_of_cores(core, T, edge, np.eye(4), within)
        if nearest is None or nearest.distance > within:
            continue
        x, y, z = nearest.normal.tolist()
        normal = x, y, z
        on_edge = nearest.point_b + a.p
        around = [terrain.vertex(*each) for each in beside]
        for end, point in ((first, p), (second, q)):
            if np.linalg.norm(on_edge - point) <= 1e-9 * size:
                around = terrain.around(*end)
        foot = (float(on_edge[0]), float(on_edge[1]), float(on_edge[2]))
        numbers = terrain.number(*first), terrain.number(*second)
        if z > 0.0 and all(_is_below(w, foot, normal) for w in around):
            found = list(_along_ridge(a, core, (p, q), numbers, normal, within))
            least = min((each.candidate.gap for each in found), default=math.inf)
            if least > nearest.distance + TIE * size:
                ax, ay, az = (nearest.point_a + a.p).tolist()
                feature = (NEAREST, _edge_number(numbers))
                gap = dot(normal, (ax - foot[0], ay - foot[1], az - foot[2]))
                candidate = ContactCandidate(foot[0], foot[1], gap, (ax, ay, az), foot, feature)
                found.append(NormalAndCandidate(normal, candidate))
            yield from found
        elif nearest.distance <= 0.0:
            # The shortest way out of an edge may lead along the surface; the middle of the cone leads up.
            yield from _along_ridge(a, core, (p, q), numbers, middle, within)


def _middle_of_cone(p: Vector3, q: Vector3, terrain: Terrain, beside: list[GridPoint]) -> Vector3:
    """Return the direction in the middle between the normals of the triangles on both sides of an edge."""
    x = y = z = 0.0
    for each in beside:
        normal = _unit(cross(minus(q, p), minus(terrain.vertex(*each), p)))
        sign = 1.0 if normal[2] > 0.0 else -1.0
        x, y, z = x + sign * normal[0], y + sign * normal[1], z + sign * normal[2]
    return _unit((x, y, z))


def _edge_number(numbers: tuple[int, int]) -> int:
    return (min(numbers) + 1) * EDGE_BASE + max(numbers)


def _edges(
    terrain: Terrain, rows: range, columns: range
) -> Iterator[tuple[GridPoint, GridPoint, list[GridPoint]]]:
    """Yield the edges of some cells, with the other vertices of their triangles."""
    last_row, last_column = terrain.rows - 1, terrain.columns - 1
    for row in rows:
        for column in columns:
            low, right = (row, column), (row, column + 1)
            above, across = (row + 1, column), (row + 1, column + 1)
            yield low, across, [right, above]
            yield low, right, [across, *([(row - 1, column)] if row > 0 else [])]
            yield low, above, [across, *([(row, column - 1)] if column > 0 else [])]
            if row == rows[-1]:
                yield above, across, [low, *([(row + 2, column + 1)] if row + 1 < last_row else [])]
            if column == columns[-1]:
                yield right, across, [low, *([(row + 1, column + 2)] if column + 1 < last_column else [])]


def _is_ridge(p: Vector3, q: Vector3, beside: list[Vector3]) -> bool:
    """Check whether the surface falls away on one side of an edge, seen from the plane of the other side."""
    if len(beside) < 2:
        return True
    along = minus(q, p)
    normal = cross(along, minus(beside[0], p))
    if normal[2] < 0.0:
        normal = -normal[0], -normal[1], -normal[2]
    return dot(normal, minus(beside[1], p)) < -RIDGE * dot(along, along) * math.sqrt(dot(along, along))


def _is_below(w: Vector3, foot: Vector3, normal: Vector3) -> bool:
    way = minus(w, foot)
    return dot(way, normal) <= CONE * math.sqrt(dot(way, way))


def _along_ridge(
    a: PlacedSolid,
    core: Core,
    ends: tuple[Vector3, Vector3],
    numbers: tuple[int, int],
    normal: Vector3,
    within: float,
) -> Iterator[NormalAndCandidate]:
    size = core.extent + core.radius
    frame = frame_along(normal)
    on_edge = [
        (dot(frame.u, p), dot(frame.v, p), dot(normal, p), k) for p, k in zip(ends, numbers, strict=True)
    ]
    (ua, va, ha, _), (ub, vb, hb, _) = on_edge
    du, dv = ub - ua, vb - va
    slope = (hb - ha) / max(du * du + dv * dv, 1e-300)
    segment = SupportFeature(on_edge, lambda u, v: ha + slope * ((u - ua) * du + (v - va) * dv), 0.0)
    if abs(hb - ha) > 0.25 * math.hypot(du, dv):
        # Only the nearest end of a steep ridge is in the plane of contact.
        segment = SupportFeature([max(on_edge, key=lambda q: q[2])], lambda u, v: max(ha, hb))
    feature_a = support_feature(a, a.p, frame, -1.0)
    for place in overlap(feature_a, segment, MARGIN * size, within):
        gap = place.height_a - place.height_b
        if gap <= within:
            point_a = frame.point(place.u, place.v, place.height_a)
            point_b = frame.point(place.u + place.offset_u, place.v + place.offset_v, place.height_b)
            part = place.part_b if place.part_b >= 0 else _edge_number(numbers)
            yield NormalAndCandidate(
                normal,
                ContactCandidate(point_b[0], point_b[1], gap, point_a, point_b, (place.part_a, part)),
            )


def _unit(v: Vector3) -> Vector3:
    length = math.sqrt(dot(v, v))
    return v[0] / length, v[1] / length, v[2] / length
