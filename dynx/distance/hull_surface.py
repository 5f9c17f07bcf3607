"""Vertices and facets of the hull of points, computed once for each hull."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dynx.distance.cores import HullCore
from dynx.errors import ArgumentError
from dynx.model.geometry.hulls import convex_hull
from dynx.spatial.scalar import Floats


class HullSurface(NamedTuple):
    """Surface of a hull in its own frame."""

    corners: Floats
    """Vertices (m, 3) of the hull without points inside it; all points of a hull without facets."""
    normals: Floats | None
    """Outward unit normals (k, 3) of the facets; None for points in a plane or on a line."""
    offsets: Floats | None
    """Distances (k,) of the planes of the facets from the origin."""
    faces: Floats
    """Normals (j, 3), one for all triangles of a plane."""


@lru_cache(maxsize=1024)
def hull_surface(core: HullCore) -> HullSurface:
    """Return the surface of a hull."""
    points = core.vertices
    try:
        vertices, faces = convex_hull(points)
    except ArgumentError:
        return _flat(points)
    # Flat points have no facets but those of the thickness that they are given.
    known = set(map(tuple, points.tolist()))
    if not known.issuperset(map(tuple, vertices.tolist())):
        return _flat(points)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0.0] / lengths[lengths > 0.0, None]
    offsets = (normals @ vertices.T).max(axis=1)
    _, first = np.unique(np.round(normals, 9) + 0.0, axis=0, return_index=True)
    return HullSurface(vertices, normals, offsets, normals[np.sort(first)])


def _flat(points: Floats) -> HullSurface:
    return HullSurface(points, None, None, np.empty((0, 3)))
