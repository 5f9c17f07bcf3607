"""Places at which the outlines of two features overlap, seen along a normal.

The vertices of the intersection of two convex polygons are those of each inside the other, and the crossings
of their edges: what clipping gives (I. Sutherland, G. Hodgman, "Reentrant polygon clipping", Communications
of the ACM 17 (1974)), found as a set, so that each place is named by its vertex or its two edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from dynx.distance.support_features import PointOfFeature, SupportFeature

INSIDE = -1
"""Number of a feature's interior, below which a vertex of the other one lies."""

NEAREST = -2
"""Number of the nearest point of a shape, where it belongs to none of its features."""

EDGE_BASE = 2**32
"""Base in which two numbers of vertices are one number of the edge between them."""

PARALLEL_SINE = 0.1
"""Sine of the angle between two segments up to which they touch along their length."""


class OverlapPlace(NamedTuple):
    """Coordinates of a place in two features, with the heights of both and the numbers of their parts."""

    u: float
    v: float
    height_a: float
    height_b: float
    part_a: int
    part_b: int
    offset_u: float = 0.0
    """Offset of the point of b from that of a across the normal, for segments that do not cross."""
    offset_v: float = 0.0


def overlap(a: SupportFeature, b: SupportFeature, margin: float, within: float) -> list[OverlapPlace]:
    """Return the places of both features: vertices of a, vertices of b, and crossings of edges.

    A place may lie outside a feature by `margin` [m]. Nearly parallel segments overlap where they are beside
    each other; a round surface falls away there by at most `within` [m].
    """
    if len(a.points) == len(b.points) == 2:
        return _of_segments(a, b, margin, within)
    sides_a, inside_a = _sides(a.points, b.points, margin)
    sides_b, inside_b = _sides(b.points, a.points, margin)
    found = [
        OverlapPlace(u, v, h, b.height(u, v), k, INSIDE)
        for (u, v, h, k), inside in zip(a.points, inside_a, strict=True)
        if inside
    ]
    found += [
        OverlapPlace(u, v, a.height(u, v), h, INSIDE, k)
        for (u, v, h, k), inside in zip(b.points, inside_b, strict=True)
        if inside
    ]
    if not sides_a or not sides_b:
        return found
    count_a, count_b = len(a.points), len(b.points)
    for j, of_edge_b in enumerate(sides_a):
        next_j = (j + 1) % count_b
        for i, of_edge_a in enumerate(sides_b):
            next_i = (i + 1) % count_a
            s, t = of_edge_b[i], of_edge_b[next_i]
            if (s > margin and t < -margin) or (s < -margin and t > margin):
                x, y = of_edge_a[j], of_edge_a[next_j]
                if (x > margin and y < -margin) or (x < -margin and y > margin):
                    p, q = a.points[i], a.points[next_i]
                    share = s / (s - t)
                    u, v = p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1])
                    edges = _edge(p, q), _edge(b.points[j], b.points[next_j])
                    found.append(OverlapPlace(u, v, a.height(u, v), b.height(u, v), *edges))
    return found


def _edge(p: PointOfFeature, q: PointOfFeature) -> int:
    low, high = (p[3], q[3]) if p[3] < q[3] else (q[3], p[3])
    return (low + 1) * EDGE_BASE + high


def _sides(
    points: list[PointOfFeature], outline: list[PointOfFeature], margin: float
) -> tuple[list[list[float]], list[bool]]:
    """Return the distances of points to the left of each edge of an outline, and which points are inside."""
    count = len(outline)
    if count == 1:
        u, v = outline[0][:2]
        return [], [math.hypot(p[0] - u, p[1] - v) <= margin for p in points]
    sides: list[list[float]] = []
    inside = [True] * len(points)
    for k in range(count if count > 2 else 1):
        (ua, va, *_), (ub, vb, *_) = outline[k], outline[(k + 1) % count]
        du, dv = ub - ua, vb - va
        length = math.hypot(du, dv)
        if length == 0.0:
            sides.append([0.0] * len(points))
            continue
        du, dv = du / length, dv / length
        row = [du * (p[1] - va) - dv * (p[0] - ua) for p in points]
        sides.append(row)
        if count > 2:
            inside = [old and side >= -margin for old, side in zip(inside, row, strict=True)]
        else:
            along = [du * (p[0] - ua) + dv * (p[1] - va) for p in points]
            inside = [
                abs(side) <= margin and -margin <= s <= length + margin
                for side, s in zip(row, along, strict=True)
            ]
    return sides, inside


def _of_segments(a: SupportFeature, b: SupportFeature, margin: float, within: float) -> list[OverlapPlace]:
    """Return the crossing of two segments, or the ends of the stretch along which they are parallel."""
    (p, q), (r, s) = a.points, b.points
    du, dv, eu, ev = q[0] - p[0], q[1] - p[1], s[0] - r[0], s[1] - r[1]
    length_a, length_b = math.hypot(du, dv), math.hypot(eu, ev)
    if length_a <= margin or length_b <= margin:
        return []
    du, dv, eu, ev = du / length_a, dv / length_a, eu / length_b, ev / length_b
    sine = du * ev - dv * eu
    gu, gv = r[0] - p[0], r[1] - p[1]
    edges = _edge(p, q), _edge(r, s)
    if abs(sine) > PARALLEL_SINE:
        x, y = (gu * ev - gv * eu) / sine, (gu * dv - gv * du) / sine
        if -margin <= x <= length_a + margin and -margin <= y <= length_b + margin:
            x = min(max(x, 0.0), length_a)
            u, v = p[0] + x * du, p[1] + x * dv
            return [OverlapPlace(u, v, a.height(u, v), b.height(u, v), *edges)]
        return []
    found: list[OverlapPlace] = []
    for mine, (start, x, y, length), other, swapped in (
        ((p, q), (r, eu, ev, length_b), b, False),
        ((r, s), (p, du, dv, length_a), a, True),
    ):
        for u, v, h, k in mine:
            along = (u - start[0]) * x + (v - start[1]) * y
            if not -margin <= along <= length + margin:
                continue
            foot_u, foot_v = start[0] + along * x, start[1] + along * y
            away = math.hypot(foot_u - u, foot_v - v)
            radius = min(a.round_radius, b.round_radius)
            if away > margin and (radius == 0.0 or away * away > 2.0 * radius * within):
                continue
            there = other.height(foot_u, foot_v)
            if swapped:
                found.append(OverlapPlace(foot_u, foot_v, there, h, edges[0], k, u - foot_u, v - foot_v))
            else:
                found.append(OverlapPlace(u, v, h, there, k, edges[1], foot_u - u, foot_v - v))
    # Between two ends of a straight stretch the gap is between theirs.
    if abs(sine) > 0.0 and len(found) < 2:
        x, y = (gu * ev - gv * eu) / sine, (gu * dv - gv * du) / sine
        if 0.0 <= x <= length_a and 0.0 <= y <= length_b:
            u, v = p[0] + x * du, p[1] + x * dv
            found.append(OverlapPlace(u, v, a.height(u, v), b.height(u, v), *edges))
    return found
