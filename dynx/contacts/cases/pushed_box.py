"""A box under a horizontal push: it stays, slides or tips."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, rate_at, record, tilts
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import ExternalForce, Material, Scene, World, box, ground

HALF = 0.1
"""Half the edge of the cube [m], whose mass is 1 kg."""

SETTLING = 0.1
"""Time [s] after which the cube slides steadily."""

DURATION = 0.5
TILT = 0.3
"""Angle [rad] at which the angular velocity of a cube that tips is measured."""


class BoxPush(NamedTuple):
    """A horizontal force on a cube, and the friction of cube and ground."""

    force: float
    """Force [N]."""
    height: float
    """Height [m] of the point of the cube at which it acts."""
    friction: float


class PushedBox(ContactCase):
    """A cube on level ground, pushed at half its height or at the top."""

    name: ClassVar[str] = "pushed_box"
    title: ClassVar[str] = "A box under a push: stay, slide or tip"
    law: ClassVar[str] = (
        "v = 0 where F < mu m g and F z < m g b; m dv/dt = F - mu m g where F exceeds mu m g alone; "
        "4/3 m b^2 w^2 = F x - m g y where F z exceeds m g b alone, for a push F at the height z, half the "
        "edge b, friction mu, and the displacements x of its point and y of the centre"
    )
    source: ClassVar[str] = (
        "Coulomb's law, balance of moments about the edge, and the theorem of work and energy"
    )
    trials: ClassVar[dict[str, BoxPush]] = {
        "stays": BoxPush(4.0, HALF, 0.5),
        "slides": BoxPush(6.0, HALF, 0.5),
        "tips": BoxPush(7.0, 2.0 * HALF, 1.0),
    }

    def scene(self, parameters: BoxPush) -> Scene:
        material = Material(friction=parameters.friction)
        size = (2.0 * HALF,) * 3
        body = box("box", size, mass=1.0, pose=Pose((0.0, 0.0, HALF)), material=material)
        return Scene("pushed_box", bodies=(ground(material=material), body))

    def measure(self, world: World, parameters: BoxPush) -> Sequence[Figure]:
        force = (parameters.force, 0.0, 0.0, 0.0, 0.0, 0.0)
        push = ExternalForce("box", force, point=(0.0, 0.0, parameters.height - HALF))
        if parameters.force * parameters.height > G * HALF:
            motion = record(world, DURATION, forces=[push])
            tilt, rates = tilts(motion.rotations("box")), motion.velocities("box")[:, 4]
            exact = tipping_speed(parameters.force, TILT)
            measured = rate_at(TILT, tilt, rates)
            return [Figure(f"angular velocity at {TILT} rad", measured, exact, "rad/s", exact)]
        world.run(SETTLING, forces=[push])
        motion = record(world, DURATION, forces=[push])
        exact = max(0.0, parameters.force - parameters.friction * G)
        measured = acceleration(motion.times, motion.velocities("box")[:, 0])
        return [Figure("acceleration", measured, exact, "m/s^2", parameters.force)]


def tipping_speed(force: float, tilt: float) -> float:
    """Return the angular velocity [rad/s] of a cube of 1 kg that a constant force at the middle of its top
    has tipped about an edge."""
    c, s = math.cos(tilt), math.sin(tilt)
    # From the edge, the point of the force is at (-b, 2 b) at the start, and the centre at (-b, b).
    x = HALF * (1.0 - c + 2.0 * s)
    y = HALF * (c + s - 1.0)
    return math.sqrt((force * x - G * y) / (4.0 / 3.0)) / HALF
