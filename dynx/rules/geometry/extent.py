"""Bounds of a body in space, as the convex hull of balls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class Extent:
    """The convex hull of balls: centres `points` (n, 3) [m] with `radii` (n,) [m], in some frame.

    It may be larger than the body, never smaller: no point outside belongs to the body.
    """

    points: Floats
    radii: Floats

    @classmethod
    def of_points(cls, points: Iterable[Iterable[float]], radius: float = 0.0) -> Extent:
        """Return the balls of one radius about the points."""
        array = np.array([list(point) for point in points], dtype=np.float64).reshape(-1, 3)
        return cls(array, np.full(len(array), radius))

    @classmethod
    def union(cls, parts: Iterable[Extent]) -> Extent:
        """Return the union of the parts, which must be in one frame."""
        found = list(parts)
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.points for part in found)]),
            np.concatenate([np.zeros(0), *(part.radii for part in found)]),
        )

    @property
    def empty(self) -> bool:
        """True if there is no shape at all."""
        return len(self.points) == 0

    def transform(self, T: Floats) -> Extent:
        """Return the region in frame A, where T (4, 4) is the pose of this frame in A."""
        return Extent(self.points @ T[:3, :3].T + T[:3, 3], self.radii)

    def box(self) -> tuple[Floats, Floats]:
        """Return the lowest and highest corner, (3,) each, of the bounding box along the frame's axes."""
        radii = self.radii[:, None]
        return (self.points - radii).min(axis=0), (self.points + radii).max(axis=0)

    def diagonal(self) -> float:
        """Return the length of the diagonal of `box` [m]."""
        low, high = self.box()
        return float(np.linalg.norm(high - low))

    def reach_from_axis(self, origin: Floats, direction: Floats) -> float:
        """Return the largest distance [m] of a point of the region from the line through `origin` (3,) along
        the unit vector `direction` (3,). Distance from a line is convex, so it is largest on a ball."""
        offset = self.points - origin
        across = offset - np.outer(offset @ direction, direction)
        return float(np.max(np.linalg.norm(across, axis=1) + self.radii))
