"""Friction of two different materials."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations_with_replacement
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, box

FRICTION = (0.0, 0.1, 0.5, 1.0)
SIZE = (0.2, 0.2, 0.1)
"""Edges of the boxes [m]."""

SPEED = 3.0
"""Speed at the start [m/s], so that no box stops."""

DURATION = 0.2


class FrictionPairs(ContactCase):
    """Boxes that slide on slabs, one for every pair of four materials."""

    name: ClassVar[str] = "friction_pairs"
    title: ClassVar[str] = "Friction of two materials"
    law: ClassVar[str] = "mu = sqrt(mu_a mu_b), for the friction of two materials"
    source: ClassVar[str] = "Coulomb's law, with the rule of dynx for two materials: the geometric mean"

    def scene(self, parameters: None) -> Scene:
        width = 1.5 * len(FRICTION) * SIZE[1]
        bodies = []
        for k, friction in enumerate(FRICTION):
            pose = Pose((0.0, k * width, -0.5))
            bodies.append(
                box(f"slab {k}", (3.0, width, 1.0), pose=pose, material=Material(friction=friction))
            )
        for name, i, j in _pairs():
            pose = Pose((-0.5, (i + (j - 1.5) / len(FRICTION)) * width, 0.5 * SIZE[2]))
            twist = (SPEED, 0.0, 0.0, 0.0, 0.0, 0.0)
            material = Material(friction=FRICTION[j])
            bodies.append(box(name, SIZE, mass=1.0, pose=pose, twist=twist, material=material))
        return Scene("friction_pairs", bodies=tuple(bodies))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(DURATION)
        figures = []
        for name, i, j in _pairs():
            vx, _, vz = world.state.bodies[name].twist[:3].tolist()
            # The impulse of friction relative to that of the normal force, which counts for boxes that hop.
            measured = (SPEED - vx) / (G * world.time + vz)
            figures.append(Figure(name, measured, math.sqrt(FRICTION[i] * FRICTION[j]), "", 1.0))
        return figures


def _pairs() -> Iterator[tuple[str, int, int]]:
    for i, j in combinations_with_replacement(range(len(FRICTION)), 2):
        yield f"friction of {FRICTION[i]:g} and {FRICTION[j]:g}", i, j
