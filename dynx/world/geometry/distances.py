"""Nearest points of colliders by `dynx.distance` from the poses of the world, the same on every engine."""

from __future__ import annotations

import math
from collections.abc import Iterator

from dynx.distance import Distance
from dynx.distance.solids import Solid, distance_of_solids
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.state import WorldState
from dynx.world.geometry.owner_poses import OwnerPoses


class Distances:
    """Distances of the colliders of one layout."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._solids: dict[int, list[Solid]] = {}

    def closest(
        self, state: WorldState, first: list[int], second: list[int], within: float
    ) -> Iterator[tuple[int, int, Distance]]:
        """Yield the distance of each pair of colliders that are at most `within` [m] apart.

        Of colliders with several shapes it is the pair of shapes with the least signed distance.
        """
        poses = OwnerPoses(self._layout, state)
        placed = {number: self._placed(number, poses) for number in {*first, *second}}
        for i in first:
            for j in second:
                if i == j:
                    continue
                best: Distance | None = None
                for solid_a, T_a, ball_a in placed[i]:
                    for solid_b, T_b, ball_b in placed[j]:
                        limit = within if best is None else best.distance
                        if math.dist(ball_a[:3], ball_b[:3]) - ball_a[3] - ball_b[3] > limit:
                            continue
                        found = distance_of_solids(solid_a, T_a, solid_b, T_b, limit)
                        if found is not None and found.distance <= limit:
                            best = found
                if best is not None:
                    yield i, j, best

    def _placed(self, number: int, poses: OwnerPoses) -> list[tuple[Solid, Floats, list[float]]]:
        """Return the solids of a collider, each with its pose and the ball around it."""
        collider = self._layout.colliders[number]
        if number not in self._solids:
            self._solids[number] = [Solid(placed.shape, placed.T) for placed in collider.shapes]
        pose = poses[collider.owner]
        return [solid.place(pose) for solid in self._solids[number]]
