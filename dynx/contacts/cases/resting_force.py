"""Force of the ground on bodies at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import Case, Figure
from dynx.contacts.motion import mean_contact_force
from dynx.contacts.scenes import resting_bodies
from dynx.world import Scene, World

SETTLING = 0.8
"""Time [s] until bodies that are placed on the ground are at rest."""

AVERAGING = 0.2
"""Time [s] over which forces are averaged."""


class RestingForce(Case):
    """Bodies of three shapes on a plane, each of whose weight the ground carries."""

    name: ClassVar[str] = "resting_force"
    title: ClassVar[str] = "Force of the ground on a body at rest"
    law: ClassVar[str] = "N = m g, for mass m and gravity g"
    source: ClassVar[str] = "balance of forces (Newton's first law)"

    def scene(self, parameters: None) -> Scene:
        return resting_bodies()

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(SETTLING)
        start = world.save()
        g = -world.scene.gravity[2]
        figures = []
        for body in world.scene.bodies:
            if body.mass is not None:
                world.restore(start)
                force = mean_contact_force(world, body.name, AVERAGING)
                weight = body.mass * g
                figures.append(Figure(f"force on the {body.name}", float(force[2]), weight, "N", weight))
        return figures
