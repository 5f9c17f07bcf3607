"""Distances of convex shapes from height fields: from the prism below each triangle that may be nearest."""

from __future__ import annotations

import numpy as np

from dynx.distance.cores import Core, HullCore
from dynx.distance.distance import Distance, distance_of_cores
from dynx.model.geometry import HeightField
from dynx.spatial.scalar import Floats


class Field:
    """The triangles of a height field, each the top of a prism."""

    def __init__(self, shape: HeightField) -> None:
        vertices, faces = shape.triangles()
        self._tops: Floats = vertices[faces]
        normals = np.cross(self._tops[:, 1] - self._tops[:, 0], self._tops[:, 2] - self._tops[:, 0])
        self._normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self._bottom = float(vertices[:, 2].min()) - shape.DEPTH
        self._lower, self._upper = self._tops.min(axis=1), self._tops.max(axis=1)
        self._lower[:, 2] = self._bottom

    def distance(self, T_field: Floats, core: Core, T: Floats, limit: float) -> Distance | None:
        """Return the distance of a shape, first, from the nearest prism; None if it is above `limit`."""
        R = T_field[:3, :3]
        near: Floats = np.eye(4)
        near[:3, :3], near[:3, 3] = R.T @ T[:3, :3], R.T @ (T[:3, 3] - T_field[:3, 3])
        bounds = self._lower_bounds(core, near)
        best: Distance | None = None
        candidates = np.flatnonzero(bounds <= limit)
        for number in candidates[np.argsort(bounds[candidates])].tolist():
            if bounds[number] >= limit:
                break
            found = distance_of_cores(core, near, HullCore(self._prism(number)), np.eye(4), limit)
            if found is not None and found.distance <= limit:
                best, limit = found, found.distance
        if best is None:
            return None
        point_a, point_b = R @ best.point_a + T_field[:3, 3], R @ best.point_b + T_field[:3, 3]
        return Distance(best.lower, best.upper, point_a, point_b, R @ best.normal)

    def _lower_bounds(self, core: Core, T: Floats) -> Floats:
        """Return lower bounds of the signed distance from each prism: separations along some normals."""
        core.place(T[:3, :3], (0.0, 0.0, 0.0))
        p = T[:3, 3]
        highest = np.einsum("ij,ij->i", core.supports(np.eye(3)), np.eye(3)) + core.radius + p
        lowest = -np.einsum("ij,ij->i", core.supports(-np.eye(3)), -np.eye(3)) - core.radius + p
        bounds = np.maximum(lowest - self._upper, self._lower - highest).max(axis=1)
        # The planes of the triangles are closer, and worth their time where the boxes overlap.
        near = np.flatnonzero(bounds <= 0.0)
        normals = self._normals[near]
        deepest = core.supports(-normals) - core.radius * normals + p
        heights = np.einsum("ij,ij->i", normals, deepest - self._tops[near, 0])
        bounds[near] = np.maximum(bounds[near], heights)
        return np.asarray(bounds)

    def _prism(self, number: int) -> Floats:
        bottom = self._tops[number].copy()
        bottom[:, 2] = self._bottom
        return np.concatenate([self._tops[number], bottom])
