"""Pairs of shapes that may be near each other, by boxes along the axes of the world.

D. Baraff, "Dynamic simulation of non-penetrating rigid bodies" (1992): sorted along one axis, only neighbours
whose intervals overlap are compared. Grounds without end are compared with all others, by their normal.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.distance.cores import BoxCore, Core, CylinderCore, EllipsoidCore, HullCore, SegmentCore
from dynx.distance.solids import Solid
from dynx.spatial.scalar import Floats


class Boxes(NamedTuple):
    """Boxes along the axes of the world: lower and upper corners (n, 3) [m], infinite without a bound."""

    lower: Floats
    upper: Floats


class SolidBounds:
    """Boxes around n shapes at any poses, computed for all of them at once.

    Each shape is a ball swept over a box of its own frame, or inside of one: a ball over a point, a capsule
    over a segment, other shapes in their boxes.
    """

    def __init__(self, solids: Sequence[Solid]) -> None:
        parts = [_swept_ball(each) for each in solids]
        self._centers = np.array([part[0] for part in parts]).reshape(-1, 3)
        self._halves = np.array([part[1] for part in parts]).reshape(-1, 3)
        self._radii = np.array([part[2] for part in parts]).reshape(-1)
        self._planes = [k for k, each in enumerate(solids) if each.core is None and each.field is None]

    def boxes(self, T: Floats) -> Boxes:
        """Return the boxes around the shapes at the poses T (n, 4, 4) of their frames in the world."""
        R, p = T[:, :3, :3], T[:, :3, 3]
        centers = np.einsum("kij,kj->ki", R, self._centers) + p
        reach = np.einsum("kij,kj->ki", np.abs(R), self._halves) + self._radii[:, None]
        lower, upper = centers - reach, centers + reach
        lower[self._planes], upper[self._planes] = -np.inf, np.inf
        return Boxes(lower, upper)

    def pairs(self, T: Floats, margin: float, allowed: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
        """Return the pairs (m, 2) of shapes whose distance may be at most `margin` [m], in order.

        `allowed` (n, n) is True for pairs that count; without it, all do. Two planes are no pair.
        """
        boxes = self.boxes(T)
        found = pairs_within(boxes, margin, allowed)
        if not self._planes:
            return found
        keep: NDArray[np.bool_] = np.asarray(~np.isin(found, self._planes).all(axis=1))
        for plane in self._planes:
            rows = np.flatnonzero(keep & (found == plane).any(axis=1))
            others = found[rows].sum(axis=1) - plane
            lower, upper = boxes.lower[others], boxes.upper[others]
            normal, height = T[plane, :3, 2], float(T[plane, :3, 2] @ T[plane, :3, 3])
            lowest = 0.5 * ((lower + upper) @ normal - (upper - lower) @ np.abs(normal))
            keep[rows] = lowest <= height + margin
        return found[keep]


def pairs_within(boxes: Boxes, margin: float, allowed: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """Return the pairs (m, 2), each with the lower number first and in order, of boxes that are at most
    `margin` [m] apart along each axis, and `allowed` (n, n)."""
    lower, upper = boxes.lower - 0.5 * margin, boxes.upper + 0.5 * margin
    finite = np.isfinite(lower).all(axis=1) & np.isfinite(upper).all(axis=1)
    bounded, unbounded = np.flatnonzero(finite), np.flatnonzero(~finite)
    first, second = _neighbours(lower[bounded], upper[bounded])
    firsts, seconds = [bounded[first]], [bounded[second]]
    for k in unbounded.tolist():
        others = np.concatenate([bounded, unbounded[unbounded < k]])
        firsts.append(others)
        seconds.append(np.full(len(others), k))
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    i, j = np.minimum(first, second), np.maximum(first, second)
    for axis in range(3):
        low, high = lower[:, axis], upper[:, axis]
        near = np.flatnonzero((low[i] <= high[j]) & (low[j] <= high[i]))
        i, j = i[near], j[near]
    if allowed is not None:
        near = np.flatnonzero(allowed[i, j])
        i, j = i[near], j[near]
    order = np.lexsort((j, i))
    return np.stack([i[order], j[order]], axis=1)


def _neighbours(lower: Floats, upper: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the pairs of intervals that overlap along the axis on which their centres spread most."""
    count = len(lower)
    if count < 2:
        empty = np.empty(0, dtype=np.intp)
        return empty, empty
    axis = int(np.argmax((lower + upper).var(axis=0)))
    order = np.argsort(lower[:, axis], kind="stable")
    ends = np.searchsorted(lower[order, axis], upper[order, axis], side="right")
    counts = np.maximum(ends - np.arange(count) - 1, 0)
    first = np.repeat(np.arange(count), counts)
    second = np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts) + first + 1
    return order[first], order[second]


def _swept_ball(solid: Solid) -> tuple[Floats, Floats, float]:
    """Return centre, half edges and radius of a box swept by a ball, in the frame of the shape."""
    core: Core | None = solid.core
    if core is None:
        if solid.field is None:
            return np.zeros(3), np.zeros(3), 0.0
        lower, upper = solid.field.box
        return 0.5 * (lower + upper), 0.5 * (upper - lower), 0.0
    halves = np.zeros(3)
    if isinstance(core, SegmentCore):
        halves[2] = core.half
    elif isinstance(core, CylinderCore):
        halves[:] = core.rim_radius, core.rim_radius, core.half
    elif isinstance(core, BoxCore):
        halves[:] = core.halves
    elif isinstance(core, EllipsoidCore):
        halves[:] = core.radii
    elif isinstance(core, HullCore):
        lower, upper = core.vertices.min(axis=0), core.vertices.max(axis=0)
        return 0.5 * (lower + upper), 0.5 * (upper - lower), 0.0
    return np.zeros(3), halves, core.radius
