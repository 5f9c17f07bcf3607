"""A stack of ten boxes at rest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import farthest
from dynx.contacts.motion import step_count
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Scene, World, box, ground

BOXES = 10
EDGE = 0.1
"""Edge of the boxes [m], whose mass is 1 kg."""

DURATION = 0.5
FORCES = 10
"""Number of last steps over which the forces are averaged."""


class Stack(ContactCase):
    """Ten cubes on top of each other, which touch at the start."""

    name: ClassVar[str] = "stack"
    title: ClassVar[str] = "A stack of ten boxes"
    law: ClassVar[str] = (
        "N_k = k m g between the k upper boxes and the rest, and height 10 h for boxes of height h"
    )
    source: ClassVar[str] = "balance of forces on the boxes above each contact (Newton's first law)"

    def scene(self, parameters: None) -> Scene:
        boxes = [
            box(_name(k), (EDGE,) * 3, mass=1.0, pose=Pose((0.0, 0.0, EDGE * (k + 0.5))))
            for k in range(BOXES)
        ]
        return Scene("stack", bodies=(ground(), *boxes))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.step(max(1, step_count(world, DURATION) - FORCES))
        forces = np.zeros(BOXES)
        number = {_name(k): k for k in range(BOXES)} | {"ground": -1}
        for _ in range(FORCES):
            world.step()
            for contact in world.contacts():
                upper = max(number[contact.a], number[contact.b])
                forces[upper] += abs(float(contact.force[2])) / FORCES
        ratios = forces / (G * np.arange(BOXES, 0, -1))
        centers = np.array([world.state.bodies[_name(k)].T_world_body[:3, 3] for k in range(BOXES)])
        height = float(centers[-1, 2]) + 0.5 * EDGE
        drift = float(np.max(np.linalg.norm(centers[:, :2], axis=1)))
        return [
            Figure(
                "force between two boxes, relative to the weight above",
                farthest(ratios.tolist(), 1.0),
                1.0,
                "",
                1.0,
            ),
            Figure("height", height, BOXES * EDGE, "m", BOXES * EDGE, 1e-5),
            Figure("largest drift to the side", drift, 0.0, "m", EDGE, 1e-4),
        ]


def _name(number: int) -> str:
    return f"box {number + 1}"
