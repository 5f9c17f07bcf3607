"""Depth of two cores that touch or overlap, by expanding polytopes.

G. van den Bergen, "Proximity queries and penetration depth computation on 3D game objects", Game Developers
Conference (2001). With C = A - B and its support function h, the depth is the least h(n) over all unit n:
moved by h(n) along -n, a is free of b. The hull of points of C, a polytope, lies inside C. The distance of
its nearest facet from the origin is a lower bound of the depth, because no shorter translation moves the
origin out of C; h along the normal of any facet is an upper bound. The support point of each facet nearer
than the upper bound becomes a vertex, until these facets belong to the surface of C.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.distance.cores import Core
from dynx.distance.gjk import CorePair, nearest_to_origin
from dynx.spatial.plain import dot, minus
from dynx.spatial.scalar import Floats
from dynx.time_limit import not_counted

MAX_EXPANSIONS = 40

MAX_VERTICES = 4000
"""Largest number of vertices of the polytope, which round shapes with equal depth all around reach."""

NEW_VERTICES = 16
"""Largest number of vertices that are added at once."""

ROUNDS_OF_SCALING = 4
"""Largest number of choices of coordinates in which the difference of the cores is as thick as long."""

REFINEMENTS = 4
"""Largest number of refinements of the normal and the points."""

TOLERANCE = 1e-10
"""Gap between the bounds of the depth, relative to it, at which the polytope is large enough."""

ROUNDING = 4e-15
"""Gap relative to the size of the shapes that is rounding."""

SMALLEST_SIZE = 1e-150
"""Size [m] that stands for that of two points, by which lengths are divided."""

SLIVER = 1e-14
"""Twice the area, in coordinates in which the polytope has size 1, below which three points are on a line."""

FLATNESS = 1e-13
"""Thickness of a difference of cores, relative to its size, below which it is flat: its depth is zero."""


@dataclass(frozen=True)
class Penetration:
    """Bounds of the depth of two cores, the direction in which a leaves b, and points of both cores."""

    lower: float
    upper: float
    normal: Floats
    point_a: Floats
    point_b: Floats


class _SeparatingDirection(NamedTuple):
    """A direction, and the facet whose normal it is; None for a direction that is not of a facet."""

    normal: Floats
    corners: NDArray[np.intp] | None


def penetration(a: Core, b: Core) -> Penetration:
    """Return the depth of two cores that touch or overlap."""
    polytope = Polytope(a, b)
    if polytope.flat_normal is not None:
        return polytope.flat_result(polytope.flat_normal)
    for _ in range(MAX_EXPANSIONS):
        if not polytope.find_facets() or not polytope.expand() or len(polytope.on_a) > MAX_VERTICES:
            break
    return polytope.result()


class Polytope:
    """The hull of points of A - B, with the points of A and B of which they are differences."""

    def __init__(self, a: Core, b: Core) -> None:
        self._a, self._b = a, b
        self._size = max(a.extent + b.extent, SMALLEST_SIZE)
        self._lower, self._facets = 0.0, np.empty((0, 3), dtype=np.intp)
        self._normals, self._offsets = np.empty((0, 3)), np.empty(0)
        self.on_a, self.on_b = np.empty((0, 3)), np.empty((0, 3))
        # Qhull's tolerances are absolute: a hull is the same in coordinates in which it is as thick as long.
        scaled = np.eye(3)
        for _ in range(ROUNDS_OF_SCALING):
            self._add(FIRST_DIRECTIONS @ scaled)
            self._center = self._points.mean(axis=0)
            _, _, axes = np.linalg.svd(self._points - self._center, full_matrices=False)
            thickness = np.ptp((self._points - self._center) @ axes.T, axis=0)
            scaled = axes / np.maximum(thickness, FLATNESS * self._size)[:, None]
            if thickness[2] > 0.1 * thickness[0]:
                break
        self.flat_normal = axes[2] if thickness[2] <= FLATNESS * max(self._size, thickness[0]) else None
        self._axes = scaled
        directions = np.concatenate([a.R.T, b.R.T, -a.R.T, -b.R.T])
        heights = np.einsum("ij,ij->i", self._add(directions), directions)
        best = int(np.argmin(heights))
        self._upper, self._best = float(heights[best]), _SeparatingDirection(directions[best], None)

    def _add(self, directions: Floats) -> Floats:
        """Add the support points along directions (m, 3); return them."""
        on_a, on_b = self._a.supports(directions), self._b.supports(-directions)
        self.on_a, self.on_b = np.concatenate([self.on_a, on_a]), np.concatenate([self.on_b, on_b])
        self._points = self.on_a - self.on_b
        return np.asarray(on_a - on_b)

    def find_facets(self) -> bool:
        """Compute the facets: their vertices, unit outward normals, and distances from the origin.

        Returns False where the points are too close to a plane to have a hull in floats.
        """
        with not_counted():
            from scipy.spatial import ConvexHull, QhullError

        scaled = (self._points - self._center) @ self._axes.T
        try:
            hull = ConvexHull(scaled)
        except QhullError:
            return False
        self._facets = hull.simplices.astype(np.intp)
        corners = self._points[hull.simplices]
        normals = _normals(corners)
        outward = hull.equations[:, :3] @ self._axes
        # The plane of three points on a line is the one that Qhull gives their facet.
        slivers = np.linalg.norm(_normals(scaled[hull.simplices]), axis=1) <= SLIVER
        slivers |= ~normals.any(axis=1)
        normals[slivers] = outward[slivers]
        normals[np.einsum("ij,ij->i", normals, outward) < 0.0] *= -1.0
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._offsets = np.einsum("ij,ikj->ik", self._normals, corners).min(axis=1)
        self._lower = max(0.0, float(self._offsets.min()))
        return True

    def expand(self) -> bool:
        """Add the support points of the facets that may be nearest; return whether the bounds are apart."""
        margin = TOLERANCE * abs(self._upper) + ROUNDING * self._size
        open_facets = np.flatnonzero(self._offsets < self._upper - margin)
        open_facets = open_facets[np.argsort(self._offsets[open_facets])[:NEW_VERTICES]]
        if not len(open_facets):
            return False
        before = len(self._points)
        normals = self._normals[open_facets]
        heights = np.einsum("ij,ij->i", self._add(normals), normals)
        best = int(np.argmin(heights))
        if heights[best] < self._upper:
            self._upper = float(heights[best])
            self._best = _SeparatingDirection(normals[best], self._facets[open_facets[best]])
        gained = heights - self._offsets[open_facets] > margin
        keep = np.concatenate([np.ones(before, dtype=bool), gained])
        self.on_a, self.on_b, self._points = self.on_a[keep], self.on_b[keep], self._points[keep]
        return bool(gained.any())

    def result(self) -> Penetration:
        """Return the bounds, and the direction and points of the facet that fits them best."""
        margin = TOLERANCE * abs(self._upper) + ROUNDING * self._size
        near = np.flatnonzero(self._offsets <= self._lower + margin)
        near = near[np.argsort(self._offsets[near])[:NEW_VERTICES]]
        candidates = [self._best, *(_SeparatingDirection(self._normals[k], self._facets[k]) for k in near)]
        chosen, least = None, np.inf
        for candidate in candidates:
            normal = candidate.normal
            height = self._height(normal)
            points = self._nearest(candidate.corners)
            # A facet whose nearest point is not below the origin does not bound the depth where it is least.
            misfit = height + float(np.linalg.norm(points[0] - points[1] - height * normal))
            if misfit < least:
                chosen, least = Penetration(min(self._lower, height), height, normal, *points), misfit
        assert chosen is not None
        return self._refined(chosen) if least - chosen.upper > margin else chosen

    def _height(self, normal: Floats) -> float:
        x, y, z = normal.tolist()
        return dot(minus(self._a.support((x, y, z)), self._b.support((-x, -y, -z))), (x, y, z))

    def _nearest(self, corners: NDArray[np.intp] | None) -> tuple[Floats, Floats]:
        """Return the points of the cores whose difference is the nearest point of a facet to the origin."""
        if corners is None:
            return self.on_a[0], self.on_b[0]
        found = nearest_to_origin([(x, y, z) for x, y, z in self._points[corners].tolist()])
        assert found is not None
        used, weights = corners[list(found.vertices)], np.array(found.weights)
        return weights @ self.on_a[used], weights @ self.on_b[used]

    def _refined(self, found: Penetration) -> Penetration:
        """Return a penetration with the points whose difference is the depth along the normal.

        A point of C with this outward normal is the nearest one of C to all points above it: the nearest
        points of the cores after a has been moved out of b, and their normal is the better one.
        """
        a, (x, y, z) = self._a, self._a.p
        for _ in range(REFINEMENTS):
            move = (found.upper + 0.01 * self._size) * found.normal
            dx, dy, dz = move.tolist()
            a.place(a.R, (x - dx, y - dy, z - dz))
            pair = CorePair(a, self._b, (-dx, -dy, -dz)).run()
            a.place(a.R, (x, y, z))
            if not pair.separated:
                break
            normal = -np.array(pair.normal)
            depth = self._height(normal)
            points = np.array(pair.point_a) + move, np.array(pair.point_b)
            if depth >= found.upper:
                return Penetration(found.lower, found.upper, found.normal, *points)
            found = Penetration(min(found.lower, max(depth, 0.0)), depth, normal, *points)
        return found

    def flat_result(self, normal: Floats) -> Penetration:
        """Return the depth zero of a flat difference, such as that of two segments."""
        a, b = self._a, self._b
        x, y, z = normal.tolist()
        height = normal @ (np.array(a.support((x, y, z))) - b.support((-x, -y, -z)))
        return Penetration(0.0, max(float(height), 0.0), normal, *self._common_point())

    def _common_point(self) -> tuple[Floats, Floats]:
        """Return points of both cores that agree but for rounding: a convex combination that vanishes."""
        with not_counted():
            from scipy.optimize import nnls

        rows = np.concatenate([self._points.T / self._size, np.ones((1, len(self._points)))])
        weights = nnls(rows, np.array([0.0, 0.0, 0.0, 1.0]))[0]
        weights /= weights.sum()
        return weights @ self.on_a, weights @ self.on_b


def _normals(corners: Floats) -> Floats:
    """Return the normals of triangles (m, 3, 3), of any length and side."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


FIRST_DIRECTIONS: Floats = np.array(
    [
        [x, y, z]
        for x in (-1.0, 0.0, 1.0)
        for y in (-1.0, 0.0, 1.0)
        for z in (-1.0, 0.0, 1.0)
        if abs(x) + abs(y) + abs(z) in (1.0, 3.0)
    ]
)
"""Directions of the first vertices."""
