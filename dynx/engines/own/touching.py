"""Contact points between the colliders of a scene that may touch in a step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dynx.distance.broad_phase import SolidBounds
from dynx.distance.contact_manifold import contact_points
from dynx.distance.placed_solids import PlacedSolid
from dynx.distance.solids import Solid
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout, Owner
from dynx.steppers.material import contact_material

MARGIN = 1e-5
"""Gap [m] within which two surfaces count as a possible contact even at rest."""

REACH = 2.0
"""Ways of both surfaces in a step, at their speeds without contacts, within which they may touch: impulses
may make a surface faster than it was."""


class TouchablePair(NamedTuple):
    """Two shapes of colliders that may touch, by number, and the coefficients of their contact."""

    a: int
    b: int
    collider_a: int
    collider_b: int
    owner_a: Owner
    owner_b: Owner
    friction: tuple[float, float, float]
    """Coefficient of friction; coefficients of torsional and rolling friction [m]."""
    restitution: float


class PossibleContact(NamedTuple):
    """A contact point of two shapes, which may touch in this step, in axes of the world."""

    pair: TouchablePair
    feature: tuple[int, int]
    """Numbers of the features of the shapes that meet (`dynx.distance.ContactPoint`)."""
    point_a: Floats
    point_b: Floats
    normal: Floats
    """Unit vector (3,) from b to a."""
    gap: float
    spare: bool = False
    """True for a point that is needed only where the others do not bear the load
    (`dynx.distance.ContactPoint`)."""


class ContactFinder:
    """Shapes of a scene, and the pairs of them that may touch."""

    def __init__(self, layout: Layout, h: float) -> None:
        self._h, self._colliders = h, layout.colliders
        self.owners: tuple[Owner, ...] = tuple(dict.fromkeys(each.owner for each in layout.colliders))
        """Rigid bodies with shapes."""
        number = {owner: k for k, owner in enumerate(self.owners)}
        shapes = [(k, placed) for k, each in enumerate(layout.colliders) for placed in each.shapes]
        self._collider = np.array([k for k, _ in shapes], dtype=np.intp)
        self._owner = np.array([number[layout.colliders[k].owner] for k, _ in shapes], dtype=np.intp)
        self._allowed = layout.collides[np.ix_(self._collider, self._collider)]
        self._local: Floats = np.array([placed.T for _, placed in shapes])
        solids = [Solid(placed.shape, np.eye(4)) for _, placed in shapes]
        self._solids = [PlacedSolid(each) for each in solids]
        self._bounds = SolidBounds(solids)
        # Distance of the farthest point of a shape from the origin of its owner; a plane has no arm.
        boxes = self._bounds.boxes(self._local)
        corners = np.maximum(np.abs(boxes.lower), np.abs(boxes.upper))
        self._arms = np.linalg.norm(np.where(np.isfinite(corners), corners, 0.0), axis=1)
        self._pairs: dict[tuple[int, int], TouchablePair] = {}

    def find(
        self, poses: Mapping[Owner, Floats], speeds: Mapping[Owner, tuple[float, float]] | None
    ) -> list[PossibleContact]:
        """Return the contact points whose gap is at most `MARGIN`, or may close in a step.

        `poses` (4, 4) are those of the owners in the world, `speeds` their linear and angular speeds [m/s,
        rad/s] in the step; without them nothing moves.
        """
        T = np.array([poses[owner] for owner in self.owners])[self._owner] @ self._local
        ways = np.zeros(len(T))
        if speeds is not None:
            rates = np.array([speeds[owner] for owner in self.owners])[self._owner]
            ways = REACH * self._h * (rates[:, 0] + rates[:, 1] * self._arms)
        margin = 2.0 * float(ways.max(initial=0.0)) + MARGIN
        found: list[PossibleContact] = []
        moved: set[int] = set()
        for a, b in self._bounds.pairs(T, margin, self._allowed).tolist():
            for k in (a, b):
                if k not in moved:
                    moved.add(k)
                    self._solids[k].move(T[k])
            within = float(ways[a] + ways[b]) + MARGIN
            points = contact_points(self._solids[a], self._solids[b], within, spares=True)
            if points:
                pair = self._pairs.get((a, b)) or self._new_pair(a, b)
                found += [
                    PossibleContact(
                        pair,
                        each.feature,
                        np.array(each.point_a),
                        np.array(each.point_b),
                        np.array(each.normal),
                        each.gap,
                        each.spare,
                    )
                    for each in points
                ]
        return found

    def names(self, a: int, b: int) -> tuple[str, str]:
        """Return the names of the colliders of two shapes, by number."""
        first, second = (self._colliders[int(self._collider[k])].name for k in (a, b))
        return first, second

    def _new_pair(self, a: int, b: int) -> TouchablePair:
        i, j = int(self._collider[a]), int(self._collider[b])
        first, second = self._colliders[i], self._colliders[j]
        material = contact_material(first.material, second.material)
        friction = material.friction, material.torsional_friction, material.rolling_friction
        pair = TouchablePair(a, b, i, j, first.owner, second.owner, friction, material.restitution)
        self._pairs[a, b] = pair
        return pair
