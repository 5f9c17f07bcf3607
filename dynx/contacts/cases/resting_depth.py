"""Depth to which bodies at rest penetrate the ground."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.cases.resting_force import SETTLING
from dynx.contacts.scenes import resting_bodies
from dynx.world import Scene, World

HEIGHT = 0.2
"""Height of the bodies [m]."""


class RestingDepth(ContactCase):
    """Bodies of three shapes on a plane, which rigid bodies do not penetrate."""

    name: ClassVar[str] = "resting_depth"
    title: ClassVar[str] = "Penetration of a body at rest"
    law: ClassVar[str] = "z - h / 2 = 0, for the height z of the centre of a body of height h"
    source: ClassVar[str] = "impenetrability of rigid bodies"

    def scene(self, parameters: None) -> Scene:
        return resting_bodies()

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(SETTLING)
        bodies = world.state.bodies
        # A hundred-thousandth of the height is far less than the accuracy of any machine.
        return [
            Figure(
                f"depth of the {body.name}",
                HEIGHT / 2 - float(bodies[body.name].T_world_body[2, 3]),
                0.0,
                "m",
                HEIGHT,
                1e-5,
            )
            for body in world.scene.bodies
            if not body.fixed
        ]
