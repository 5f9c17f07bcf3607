"""Balls that roll and are slowed by rolling friction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, ground, sphere

RADIUS = 0.1
COEFFICIENT = 0.002
"""Rolling friction [m]: moment per normal force."""

SPEED = 1.0
"""Speed at the start [m/s]."""

DIRECTIONS = {"along x": 0.0, "along y": 0.5 * math.pi, "diagonally": 0.25 * math.pi}
"""Directions of motion [rad]."""

SETTLING = 0.1
DURATION = 0.4


class RollingResistance(ContactCase):
    """Homogeneous balls that roll without slipping, in three directions."""

    name: ClassVar[str] = "rolling_resistance"
    title: ClassVar[str] = "A rolling ball under rolling friction"
    law: ClassVar[str] = "7/5 m dv/dt = -c m g / r, for radius r and rolling friction c"
    source: ClassVar[str] = (
        "Coulomb's law for the moment that opposes rolling, and Newton's and Euler's equations"
    )

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=1.0, rolling_friction=COEFFICIENT)
        balls = []
        for k, (name, angle) in enumerate(DIRECTIONS.items()):
            x, y = SPEED * math.cos(angle), SPEED * math.sin(angle)
            twist = (x, y, 0.0, -y / RADIUS, x / RADIUS, 0.0)
            pose = Pose((-2.0 * k, 2.0 * k, RADIUS))
            balls.append(sphere(name, RADIUS, mass=1.0, pose=pose, twist=twist, material=material))
        return Scene("rolling_resistance", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        exact = 5.0 / 7.0 * COEFFICIENT * G / RADIUS
        world.run(SETTLING)
        motion = record(world, DURATION)
        figures = []
        for name, angle in DIRECTIONS.items():
            along = motion.velocities(name)[:, :2] @ np.array([math.cos(angle), math.sin(angle)])
            slowing = -acceleration(motion.times, along)
            figures.append(
                Figure(f"deceleration {name}", slowing, exact, "m/s^2", exact, rests_on=("rolling_friction",))
            )
        return figures
