"""A box on a slope, which sticks below the friction angle and slides above it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G, inclined, slope_axes
from dynx.world import Material, Scene, World, box, ground

FRICTION = 0.5
SIZE = (0.4, 0.4, 0.2)
"""Edges of the box [m]."""

SETTLING = 0.3
"""Time [s] after which the box sticks or slides steadily."""

DURATION = 0.7
"""Time [s] over which the motion is measured."""


class Slope(ContactCase):
    """A box of friction 0.5 on slopes of several tangents, with its edges along the slope."""

    name: ClassVar[str] = "slope"
    title: ClassVar[str] = "A box on a slope: stick and slide"
    law: ClassVar[str] = (
        "v = 0 where tan(a) < mu, dv/dt = g (sin(a) - mu cos(a)) above, for the angle a of the slope and "
        "friction mu"
    )
    source: ClassVar[str] = "Coulomb's law of friction"
    trials: ClassVar[dict[str, float]] = {"tangent 0.4": 0.4, "tangent 1": 1.0}

    def scene(self, parameters: float) -> Scene:
        material = Material(friction=FRICTION)
        angle = math.atan(parameters)
        _, normal = slope_axes(angle)
        brick = box("box", SIZE, mass=1.0, pose=inclined(angle, 0.5 * SIZE[2] * normal), material=material)
        return Scene("slope", bodies=(ground(pose=inclined(angle), material=material), brick))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        angle = math.atan(parameters)
        down, normal = slope_axes(angle)
        world.run(SETTLING)
        motion = record(world, DURATION)
        if parameters < FRICTION:
            moved = float((motion.positions("box")[-1] - motion.positions("box")[0]) @ down)
            creep = moved / float(motion.times[-1] - motion.times[0])
            # Relative to the speed that a body gains when it falls by its own height.
            return [Figure("creep speed", creep, 0.0, "m/s", math.sqrt(2.0 * G * SIZE[2]), 1e-6)]
        exact = G * (math.sin(angle) - FRICTION * math.cos(angle))
        measured = acceleration(motion.times, motion.velocities("box")[:, :3] @ down)
        lift = motion.positions("box") @ normal - 0.5 * SIZE[2]
        return [
            Figure("acceleration", measured, exact, "m/s^2", exact),
            Figure("largest lift off the slope", float(np.max(lift)), 0.0, "m", SIZE[2], 1e-4),
        ]
