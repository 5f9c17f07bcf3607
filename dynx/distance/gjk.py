"""Nearest points of two cores that do not overlap, by the algorithm of Gilbert, Johnson and Keerthi.

E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A fast procedure for computing the distance between complex
objects in three-dimensional space", IEEE Journal of Robotics and Automation 4 (1988), and G. van den Bergen,
"A fast and robust GJK implementation for collision detection of convex objects" (1999). The distance is the
length of the shortest vector v of the difference C = A - B. v is the nearest point of a simplex of points of
C; the support point w of C along -v bounds the distance from below by w . v / |v| (van den Bergen's section
on termination) and becomes a vertex, until the bounds meet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from dynx.distance.cores import Core
from dynx.distance.simplices import nearest_to_origin
from dynx.spatial.plain import Vector3, combination, dot, minus, norm

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
