"""Intersections of rays with a height field, cell by cell along the ray."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dynx.model.geometry import HeightField
from dynx.spatial.scalar import Floats

ROUNDING = 1e-9
"""Barycentric coordinate below zero that counts as on the edge, so that no ray passes between triangles."""


def cast_on_height_field(shape: HeightField, origins: Floats, directions: Floats) -> tuple[Floats, Floats]:
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
