"""Central collisions of two balls in free flight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import CONTACT_DELAYS, farthest, speeds_after_collision
from dynx.model import Pose
from dynx.world import Material, Scene, World, sphere

RADIUS = 0.05
SPEED = 1.0
"""Speed of the moving ball [m/s]; the other is at rest, and its mass is 1 kg."""

GAPS = tuple(0.1 + delay * SPEED for delay in CONTACT_DELAYS)
"""Distances [m] between the surfaces at the start."""

DURATION = 0.25
"""Time [s] by which every pair has collided and separated."""

MASSES = {"equal masses": 1.0, "a third of the mass": 1.0 / 3.0, "thrice the mass": 3.0}
"""Masses of the moving ball [kg]."""


class CentralCollision(ContactCase):
    """Balls that meet balls at rest, without gravity and friction."""

    name: ClassVar[str] = "collision"
    title: ClassVar[str] = "Central collision of two balls"
    law: ClassVar[str] = (
        "v2' - v1' = e (v1 - v2) and m1 v1' + m2 v2' = m1 v1 + m2 v2, for speeds v before and v' after the "
        "impact and restitution e"
    )
    source: ClassVar[str] = (
        "Beer and Johnston, Vector Mechanics for Engineers: Dynamics, 9th ed., direct central impact, "
        "eqs. 13.37 and 13.43"
    )
    trials: ClassVar[dict[str, float]] = {"inelastic": 0.0, "restitution 0.5": 0.5, "elastic": 1.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=0.0, restitution=parameters)
        bodies = []
        for row, mass in enumerate(MASSES.values()):
            for column, gap in enumerate(GAPS):
                at = 0.5 * column, 0.5 * row
                moving, resting = _names(row, column)
                pose = Pose((-gap - 2.0 * RADIUS, *at))
                twist = (SPEED, 0.0, 0.0, 0.0, 0.0, 0.0)
                bodies.append(sphere(moving, RADIUS, mass=mass, pose=pose, twist=twist, material=material))
                bodies.append(sphere(resting, RADIUS, mass=1.0, pose=Pose((0.0, *at)), material=material))
        return Scene("collision", bodies=tuple(bodies), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        world.run(DURATION)
        bodies = world.state.bodies
        figures, momenta = [], []
        for row, (name, mass) in enumerate(MASSES.items()):
            pairs = [
                tuple(float(bodies[ball].twist[0]) for ball in _names(row, column))
                for column in range(len(GAPS))
            ]
            momenta += [(mass * v1 + v2) / (mass * SPEED) for v1, v2 in pairs]
            v1, v2 = speeds_after_collision(mass, 1.0, SPEED, 0.0, parameters)
            for ball, exact, found in (
                ("moving", v1, [pair[0] for pair in pairs]),
                ("hit", v2, [pair[1] for pair in pairs]),
            ):
                figures.append(
                    Figure(
                        f"speed of the {ball} ball, {name}",
                        farthest(found, exact),
                        exact,
                        "m/s",
                        SPEED,
                        rests_on=("restitution",),
                    )
                )
        return [
            *figures,
            Figure("momentum, relative to that before", farthest(momenta, 1.0), 1.0, "", 1.0, 1e-9),
        ]


def _names(row: int, column: int) -> tuple[str, str]:
    return f"moving {row}.{column}", f"hit {row}.{column}"
