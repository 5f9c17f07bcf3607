"""Convex hulls of points. No other module of geometry imports SciPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.spatial.scalar import Floats

FLATNESS = 1e-4
"""Thickness of the hull of flat points, relative to its diagonal."""


def convex_hull(points: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) of the hull of `points` and its triangles (m, 3), counter-clockwise from
    outside.

    Flat points, which bound no volume, get a thickness of `FLATNESS` times the diagonal of their box, half of
    it on each side, because engines refuse a flat solid. Raises ArgumentError for points on one line.
    """
    center = points.mean(axis=0)
    _, extents, axes = np.linalg.svd(points - center, full_matrices=False)
    rounding = 1e-9 * np.sqrt(len(points))
    if len(points) < 3 or extents[1] <= rounding * extents[0]:
        raise ArgumentError("all points of the mesh lie on one line, so that it has no hull")
    thickness = float(np.ptp((points - center) @ axes[2]))
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    if thickness < FLATNESS * diagonal:
        offset = 0.5 * (FLATNESS * diagonal - thickness) * axes[2]
        points = np.concatenate([points - offset, points + offset])
    return _hull_of_solid(points)


def _hull_of_solid(points: Floats) -> tuple[Floats, NDArray[np.intp]]:
    from scipy.spatial import ConvexHull, QhullError

    # Qhull's tolerances are absolute, so points are scaled to a box of size 1.
    low = points.min(axis=0)
    scale = float(np.max(np.ptp(points, axis=0)))
    try:
        hull = ConvexHull((points - low) / scale)
    except QhullError:
        raise ArgumentError("the points of the mesh are too close to a plane to have a hull") from None
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3)
    vertices = points[used]
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = np.einsum("ij,ij->i", normals, hull.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    return vertices, faces.astype(np.intp)
