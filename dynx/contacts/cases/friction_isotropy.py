"""Friction of plates that slide in several directions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import farthest
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, box, ground

FRICTION = 0.5
SPEED = 2.0
SIZE = (0.3, 0.3, 0.05)
"""Edges of the plates [m]."""

DIRECTIONS = (0.0, 15.0, 30.0, 45.0, 60.0)
"""Directions of sliding [deg], in the plane, from an edge of the plates."""

STARTING = 0.15
"""Time [s] after which the plates slide steadily."""

DURATION = 0.2
"""Time [s] of the measurement, at the end of which the plates still slide."""


class FrictionIsotropy(ContactCase):
    """Equal plates that slide along a plane in five directions."""

    name: ClassVar[str] = "friction_isotropy"
    title: ClassVar[str] = "Friction in several directions"
    law: ClassVar[str] = (
        "dv/dt = -mu g v / |v|, for friction mu: the same deceleration in every direction, on a straight line"
    )
    source: ClassVar[str] = "Coulomb's law of friction"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=FRICTION)
        plates = (
            box(
                _name(direction),
                SIZE,
                mass=1.0,
                pose=Pose((0.0, 3.0 * k, 0.5 * SIZE[2])),
                twist=(*(SPEED * along(direction)).tolist(), 0.0, 0.0, 0.0),
                material=material,
            )
            for k, direction in enumerate(DIRECTIONS)
        )
        return Scene("plates", bodies=(ground(material=material), *plates))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.run(STARTING)
        motion = record(world, DURATION)
        exact = FRICTION * G
        decelerations, drifts = [], []
        for direction in DIRECTIONS:
            velocities = motion.velocities(_name(direction))[:, :3]
            ahead = along(direction)
            decelerations.append(-acceleration(motion.times, velocities @ ahead))
            moved = motion.positions(_name(direction))[-1] - motion.positions(_name(direction))[0]
            drifts.append(abs(float(np.cross(ahead, moved)[2])))
        found = farthest(decelerations, exact)
        return [
            Figure("deceleration farthest from mu g", found, exact, "m/s^2", exact),
            Figure("largest drift to a side", max(drifts), 0.0, "m", SPEED * DURATION),
        ]


def along(direction: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the unit vector (3,) of a direction [deg] in the plane."""
    angle = math.radians(direction)
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def _name(direction: float) -> str:
    return f"plate at {direction:g} deg"
