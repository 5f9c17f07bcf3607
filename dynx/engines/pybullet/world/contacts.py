"""Contacts of a Bullet world, by the numbers of colliders."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.filters import Place
from dynx.spatial.scalar import Floats
from dynx.steppers.stepper import TouchingPoint


class ContactReader:
    """Translation of Bullet's reports, which name bodies and links by number."""

    def __init__(self, client: WorldClient, places: Sequence[Sequence[Place]]) -> None:
        """`places` are the bodies and links of each collider."""
        self._client = client
        self.places = places
        self._collider = {place: k for k, found in enumerate(places) for place in found}
        self.fresh = True
        """True if no step was taken since the state was set, so that there are no forces."""

    def contacts(self) -> list[TouchingPoint]:
        """Return the contacts that have a force, or overlap."""
        found = []
        for a, b, point in self._touching_points():
            force, friction = (0.0, np.zeros(3)) if self.fresh else (point[9], _friction(point))
            found.append(touching_point(a, b, point, force, friction))
        return found

    def pairs(self) -> set[tuple[int, int]]:
        """Return the colliders that have one of `contacts`."""
        return {(a, b) for a, b, _ in self._touching_points()}

    def _touching_points(self) -> Iterator[tuple[int, int, Sequence[Any]]]:
        """Yield the colliders and Bullet's report of each contact."""
        for point in self._client.call(self._client.engine.getContactPoints) or ():
            a, b = self._collider.get((point[1], point[3])), self._collider.get((point[2], point[4]))
            if a is not None and b is not None and (point[8] <= 0.0 or point[9] > 0.0):
                yield a, b, point


def _friction(point: Sequence[Any]) -> Floats:
    """Return the friction on the first body: two forces along two directions of the tangent plane."""
    return np.asarray(point[10] * np.array(point[11]) + point[12] * np.array(point[13]))


def touching_point(
    a: int, b: int, point: Sequence[Any], force: float, friction: Floats | None
) -> TouchingPoint:
    """Return a contact or nearest point from Bullet's report of it."""
    return TouchingPoint(
        a, b, np.array(point[5]), np.array(point[6]), np.array(point[7]), point[8], force, friction
    )
