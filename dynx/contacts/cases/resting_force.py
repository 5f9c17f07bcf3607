"""Force of the ground on bodies at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import mean_contact_forces
from dynx.contacts.scenes import G, resting_bodies
from dynx.world import Scene, World

SETTLING = 0.8
"""Time [s] until bodies that are placed on the ground are at rest."""

AVERAGING = 0.2
"""Time [s] over which forces are averaged."""


class RestingForce(ContactCase):
    """Bodies of three shapes on a plane, each of whose weight the ground carries."""

    name: ClassVar[str] = "resting_force"
    title: ClassVar[str] = "Force of the ground on a body at rest"
    law: ClassVar[str] = "N = m g, for mass m and gravity g"
    source: ClassVar[str] = "balance of forces (Newton's first law)"

    def scene(self, parameters: None) -> Scene:
        return resting_bodies()

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(SETTLING)
        weights = {body.name: body.mass * G for body in world.scene.bodies if body.mass is not None}
        forces = mean_contact_forces(world, [*weights], AVERAGING)
        return [
            Figure(f"force on the {name}", float(forces[name][2]), weight, "N", weight)
            for name, weight in weights.items()
        ]
