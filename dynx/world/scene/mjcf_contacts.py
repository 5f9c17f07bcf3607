"""Coefficients of contacts, and pairs that may not touch, as elements of MJCF."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, product
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dynx.steppers.contact_springs import damping_ratio
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.mean_coefficients import contact_directions, contact_priorities
from dynx.world.scene.filters import CollisionFilter
from dynx.world.scene.scene import Scene

STEP = 0.002
"""Step [s] of a document that states none, by MuJoCo's default."""

FREQUENCY = 200.0
"""Natural frequency [rad/s] of contacts that rebound."""


class ContactWriter:
    """Attributes of the geoms of every part of a scene, and the elements of pairs."""

    def __init__(self, scene: Scene) -> None:
        self._names = [name for name in scene.parts if _has_shapes(scene, name)]
        filters = CollisionFilter(scene.robots, scene.bodies, ())
        fixed = [filters.is_fixed(name) for name in self._names]
        n = len(self._names)
        self._touch = np.zeros((n, n), dtype=bool)
        self._excluded: list[tuple[str, str]] = []
        for i, j in combinations(range(n), 2):
            pair = self._names[i], self._names[j]
            if scene.may_collide(*pair):
                self._touch[i, j] = self._touch[j, i] = True
            elif not (fixed[i] and fixed[j]):
                # MuJoCo itself tests none that are both fixed.
                self._excluded.append(pair)
        materials, self._material = material_numbers(map(scene.material, self._names))
        means = geometric_means(materials)
        self._rows, inverse = np.unique(means.reshape(-1, 4), axis=0, return_inverse=True)
        self._combination = inverse.reshape(means.shape[:2])
        self._found = contact_priorities(self._material, self._combination, self._touch)

    def geom(self, name: str) -> dict[str, str]:
        """Return the attributes of the geoms of a part."""
        number = self._names.index(name)
        attributes = self._attributes(int(self._found.combination[number]), 1)
        priority = int(self._found.priority[number])
        return attributes | ({"priority": str(priority)} if priority else {})

    def add_pairs(self, contact: Element, geoms: Mapping[str, int]) -> None:
        """Add the pairs that have coefficients of their own, and those that may not touch.

        `geoms` is the number of geoms of each part.
        """
        for i, j in self._found.pairs:
            a, b = self._names[i], self._names[j]
            combination = int(self._combination[self._material[i], self._material[j]])
            for first, second in product(range(geoms[a]), range(geoms[b])):
                ends = {"geom1": f"{a}/{first}", "geom2": f"{b}/{second}"}
                SubElement(contact, "pair", ends | self._attributes(combination, 2))
        for a, b in self._excluded:
            SubElement(contact, "exclude", body1=a, body2=b)

    def _attributes(self, combination: int, axes: int) -> dict[str, str]:
        """Return the coefficients, those of sliding and rolling once for each of the `axes`."""
        sliding, torsional, rolling, restitution = self._rows[combination].tolist()
        friction = [*[sliding] * axes, torsional, *[rolling] * axes]
        attributes = {
            "friction": " ".join(map(repr, friction)),
            "condim": str(contact_directions(sliding, torsional, rolling)),
        }
        if restitution:
            ratio = damping_ratio(restitution, FREQUENCY * STEP)
            attributes["solref"] = f"{-(FREQUENCY**2)!r} {-2.0 * ratio * FREQUENCY!r}"
        return attributes


def _has_shapes(scene: Scene, name: str) -> bool:
    owner, _, link = name.partition("/")
    return not link or bool(scene.robot(owner).model.geometry.collisions(link))
