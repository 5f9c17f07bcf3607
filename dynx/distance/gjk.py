"""Nearest points of two cores that do not overlap, by the algorithm of Gilbert, Johnson and Keerthi.

E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between complex
objects in three-dimensional space", IEEE Journal of Robotics and Automation 4 (1988), and G. van den Bergen,
"A fast and robust GJK implementation for collision detection of convex objects" (1999). The distance is the
length of the shortest vector v of the difference C = A - B. v is the nearest point of a simplex of points of
C; the support point w of C along -v bounds the distance from below by w . v / |v| (van den Bergen's section
on termination) and becomes a vertex, until the bounds meet.

The nearest point of a simplex follows from signed volumes: M. Montanari, N. Petrinic, E. Barbieri, "Improving
the GJK algorithm for faster and more reliable distance queries between convex objects", ACM Transactions on
Graphics 36 (2017). The origin is projected onto the plane or line of the simplex, and barycentric coordinates
are areas in the coordinate plane where they are largest, which thin simplices do not spoil.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from dynx.distance.cores import Core
from dynx.spatial.plain import Vector3, combination, cross, dot, minus, norm

MAX_ITERATIONS = 200

TOLERANCE = 1e-14
"""Gap between the bounds, relative to the distance, at which the search stops."""

ROUNDING = 4e-16
"""Gap relative to the size of the shapes that is rounding, and distance at which cores count as touching."""

STALLS = 3
"""Number of iterations in a row without progress after which rounding leaves nothing to gain."""


@dataclass
class CorePair:
    """The search for the nearest points of two cores, and its result so far."""

    a: Core
    b: Core
    normal: Vector3
    """Direction from b to a; at first a guess, in the end that of the largest lower bound."""
    lower: float = -float("inf")
    """Separation of the cores along the normal."""
    upper: float = float("inf")
    """Distance of the points."""
    point_a: Vector3 = (0.0, 0.0, 0.0)
    point_b: Vector3 = (0.0, 0.0, 0.0)

    @property
    def separated(self) -> bool:
        """True if a plane between the cores was found; otherwise they touch or overlap, and the upper bound
        and the points mean nothing."""
        return self.lower > 0.0

    def run(self, limit: float = math.inf) -> CorePair:
        """Search until the bounds meet or rounding prevents progress, or until the lower bound exceeds
        `limit`; return the pair."""
        a, b = self.a, self.b
        direction = self.normal
        on_a: list[Vector3] = []
        on_b: list[Vector3] = []
        simplex: list[Vector3] = []
        best: tuple[tuple[float, ...], list[Vector3], list[Vector3]] = (), [], []
        size = a.extent + b.extent
        stalled = 0
        for _ in range(MAX_ITERATIONS):
            p = a.support((-direction[0], -direction[1], -direction[2]))
            q = b.support(direction)
            w = minus(p, q)
            length = norm(direction)
            separation = dot(w, direction) / length
            better = separation > self.lower
            if better:
                self.lower = separation
                self.normal = (direction[0] / length, direction[1] / length, direction[2] / length)
            enough = TOLERANCE * self.upper + ROUNDING * size
            if (simplex and self.upper - self.lower <= enough) or w in simplex or self.lower > limit:
                break
            nearest = nearest_to_origin([*simplex, w], outside=self.lower > 0.0)
            if nearest is None:
                break
            on_a, on_b, simplex = (
                [points[k] for k in nearest.vertices] for points in ([*on_a, p], [*on_b, q], [*simplex, w])
            )
            distance = norm(nearest.point)
            closer = distance < self.upper
            if closer:
                self.upper, best = distance, (nearest.weights, on_a, on_b)
            if distance <= ROUNDING * size:
                break
            stalled = 0 if closer or better else stalled + 1
            if stalled >= STALLS:
                break
            direction = nearest.point
        weights, best_a, best_b = best
        self.point_a, self.point_b = combination(weights, best_a), combination(weights, best_b)
        return self


class Nearest(NamedTuple):
    """Numbers of the vertices that span the nearest point, their weights, and the point."""

    vertices: tuple[int, ...]
    weights: tuple[float, ...]
    point: Vector3


def nearest_to_origin(points: list[Vector3], *, outside: bool = False) -> Nearest | None:
    """Return the nearest point of a simplex of one to four vertices; None if a tetrahedron has the origin
    inside, which `outside` excludes."""
    if len(points) == 1:
        return Nearest((0,), (1.0,), points[0])
    if len(points) == 2:
        return _segment(points, 0, 1)
    if len(points) == 3:
        return _triangle(points, 0, 1, 2)
    return _tetrahedron(points, outside)


def _segment(points: list[Vector3], i: int, j: int) -> Nearest:
    a, b = points[i], points[j]
    d = minus(b, a)
    square = dot(d, d)
    t = -dot(a, d) / square if square > 0.0 else 0.0
    if t <= 0.0:
        return Nearest((i,), (1.0,), a)
    if t >= 1.0:
        return Nearest((j,), (1.0,), b)
    if t < 0.5:
        return Nearest((i, j), (1.0 - t, t), (a[0] + t * d[0], a[1] + t * d[1], a[2] + t * d[2]))
    s = dot(b, d) / square
    return Nearest((i, j), (s, 1.0 - s), (b[0] - s * d[0], b[1] - s * d[1], b[2] - s * d[2]))


def _triangle(points: list[Vector3], i: int, j: int, k: int) -> Nearest:
    a, b, c = points[i], points[j], points[k]
    ab, ac = minus(b, a), minus(c, a)
    normal = cross(ab, ac)
    square = dot(normal, normal)
    if square > 0.0:
        # Foot of the perpendicular; the vertex nearest to the origin gives the least rounding.
        at = min((a, b, c), key=lambda p: dot(p, p))
        height = dot(at, normal) / square
        foot = (height * normal[0], height * normal[1], height * normal[2])
        sizes = (abs(normal[0]), abs(normal[1]), abs(normal[2]))
        drop = sizes.index(max(sizes))
        u, v = (drop + 1) % 3, (drop + 2) % 3
        au, av, bu, bv, cu, cv = (
            a[u] - foot[u],
            a[v] - foot[v],
            b[u] - foot[u],
            b[v] - foot[v],
            c[u] - foot[u],
            c[v] - foot[v],
        )
        total = normal[drop]
        weights = (bu * cv - bv * cu) / total, (cu * av - cv * au) / total, (au * bv - av * bu) / total
        if min(weights) > 0.0:
            scale = 1.0 / (weights[0] + weights[1] + weights[2])
            return Nearest((i, j, k), (weights[0] * scale, weights[1] * scale, weights[2] * scale), foot)
    sides = (_segment(points, i, j), _segment(points, j, k), _segment(points, i, k))
    return min(sides, key=_square)


def _tetrahedron(points: list[Vector3], outside: bool) -> Nearest | None:
    faces = ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0))
    found: list[Nearest] = []
    for i, j, k, opposite in faces:
        a = points[i]
        normal = cross(minus(points[j], a), minus(points[k], a))
        inside = dot(normal, minus(points[opposite], a))
        origin = -dot(normal, a)
        if inside * origin <= 0.0:
            found.append(_triangle(points, i, j, k))
    if found:
        return min(found, key=_square)
    # The volume of a sliver is rounding, so that its signs mean nothing.
    return min((_triangle(points, *face[:3]) for face in faces), key=_square) if outside else None


def _square(nearest: Nearest) -> float:
    return dot(nearest.point, nearest.point)
