"""Newton's cradle: a ball that meets a row of balls of its mass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import CONTACT_DELAYS, farthest
from dynx.model import Pose
from dynx.world import Material, Scene, World, sphere

RADIUS = 0.05
SPEED = 1.0
"""Speed of the first ball [m/s]."""

BALLS = 5
GAP = 0.06
"""Distance between the surfaces of neighbours [m].

Of balls that touch all at once, momentum and energy alone do not determine the speeds after the impact; with
gaps the balls collide two at a time. The gaps are longer than the way of a ball during a contact of a few
hundredths of a second, so that contacts that are springs are separate as well.
"""

ROWS = len(CONTACT_DELAYS)
DURATION = 0.5
"""Time [s] by which the last ball has been hit and has left its neighbour."""


class NewtonsCradle(ContactCase):
    """Rows of five balls in free flight, of which the first moves, with restitution 1."""

    name: ClassVar[str] = "newtons_cradle"
    title: ClassVar[str] = "Newton's cradle"
    law: ClassVar[str] = "v5' = v1 and v1' = v2' = v3' = v4' = 0: equal masses exchange their speeds"
    source: ClassVar[str] = "conservation of momentum and energy, for one collision after the other"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=0.0, restitution=1.0)
        bodies = []
        for row in range(ROWS):
            for k in range(BALLS):
                x = k * (2.0 * RADIUS + GAP) - (CONTACT_DELAYS[row] * SPEED if k == 0 else 0.0)
                twist = (SPEED if k == 0 else 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
                pose = Pose((x, 0.5 * row, 0.0))
                bodies.append(
                    sphere(_name(row, k), RADIUS, mass=1.0, pose=pose, twist=twist, material=material)
                )
        return Scene("newtons_cradle", bodies=tuple(bodies), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(DURATION)
        speeds = [
            [float(world.state.bodies[_name(row, k)].twist[0]) for k in range(BALLS)] for row in range(ROWS)
        ]
        last = farthest([row[-1] for row in speeds], SPEED)
        others = farthest([speed for row in speeds for speed in row[:-1]], 0.0)
        rests_on = ("restitution",)
        return [
            Figure("speed of the last ball", last, SPEED, "m/s", SPEED, rests_on=rests_on),
            Figure("largest speed of the others", others, 0.0, "m/s", SPEED, rests_on=rests_on),
        ]


def _name(row: int, ball: int) -> str:
    return f"ball {row}.{ball + 1}"
