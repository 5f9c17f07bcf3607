"""A tall box on a slope: it rests, slides or tips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, rate_at, record, tilts
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, box, ground

HALF_WIDTH, HALF_HEIGHT = 0.1, 0.2
"""Half the edges of the box along the slope and normal to it [m]: it tips above the tangent 0.5."""

DEPTH = 0.2
ANGLES = (0.2, 0.4)
"""Angles of tilt [rad] at which the angular velocity of the box is measured."""

SETTLING = 0.2
"""Time [s] after which the box slides steadily."""

DURATION = 0.6
"""Time [s] in which a box that tips exceeds the angles."""


class Incline(NamedTuple):
    """A slope, and the friction of box and slope."""

    tangent: float
    friction: float


class TippingBox(ContactCase):
    """A box twice as tall as wide, released on slopes; gravity is inclined, and the ground is level."""

    name: ClassVar[str] = "tipping_box"
    title: ClassVar[str] = "A tall box on a slope: rest, slide or tip"
    law: ClassVar[str] = (
        "v = 0 where tan(a) < mu and tan(a) < b / h; dv/dt = g (sin(a) - mu cos(a)) where mu < tan(a), "
        "b / h; 2/3 r w^2 = g (cos(c - a) - cos(c - a - p)) where b / h < tan(a), mu, for the slope a, "
        "friction mu, half width b, half height h, r^2 = b^2 + h^2, tan(c) = b / h and the tilt p"
    )
    source: ClassVar[str] = "balance of moments about the lower edge, and conservation of energy"
    trials: ClassVar[dict[str, Incline]] = {
        "rests": Incline(0.4, 0.8),
        "slides": Incline(0.4, 0.3),
        "tips": Incline(0.6, 1.0),
    }

    def scene(self, parameters: Incline) -> Scene:
        material = Material(friction=parameters.friction)
        angle = math.atan(parameters.tangent)
        size = (2.0 * HALF_WIDTH, DEPTH, 2.0 * HALF_HEIGHT)
        body = box("box", size, mass=1.0, pose=Pose((0.0, 0.0, HALF_HEIGHT)), material=material)
        gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
        return Scene("tipping_box", bodies=(ground(material=material), body), gravity=gravity)

    def measure(self, world: World, parameters: Incline) -> Sequence[Figure]:
        angle = math.atan(parameters.tangent)
        if parameters.tangent < min(parameters.friction, HALF_WIDTH / HALF_HEIGHT):
            motion = record(world, DURATION)
            moved = float(motion.positions("box")[-1, 0])
            return [
                Figure("displacement", moved, 0.0, "m", 0.5 * G * DURATION**2),
                Figure("tilt", float(tilts(motion.rotations("box"))[-1]), 0.0, "rad", 1.0),
            ]
        if parameters.friction < HALF_WIDTH / HALF_HEIGHT:
            world.run(SETTLING)
            motion = record(world, DURATION)
            exact = G * (math.sin(angle) - parameters.friction * math.cos(angle))
            measured = acceleration(motion.times, motion.velocities("box")[:, 0])
            tilt = tilts(motion.rotations("box"))
            return [
                Figure("acceleration", measured, exact, "m/s^2", exact),
                Figure("largest tilt", float(np.max(np.abs(tilt))), 0.0, "rad", 1.0),
            ]
        motion = record(world, DURATION)
        tilt, rates = tilts(motion.rotations("box")), motion.velocities("box")[:, 4]
        return [
            Figure(f"angular velocity at {p} rad", rate_at(p, tilt, rates), w, "rad/s", w)
            for p, w in ((p, tipping_speed(angle, p)) for p in ANGLES)
        ]


def tipping_speed(angle: float, tilt: float) -> float:
    """Return the angular velocity [rad/s] of a box on a slope that has tipped about its lower edge."""
    r, c = math.hypot(HALF_WIDTH, HALF_HEIGHT), math.atan(HALF_WIDTH / HALF_HEIGHT)
    # The moment of inertia about the edge is 4/3 m r^2.
    return math.sqrt(1.5 * G / r * (math.cos(c - angle) - math.cos(c - angle - tilt)))
