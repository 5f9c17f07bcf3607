"""A ball that spins on the spot, and is stopped by torsional friction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import acceleration, record
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, ground, sphere

RADIUS = 0.1
COEFFICIENT = 0.01
"""Torsional friction [m]: moment per normal force."""

SPIN = 5.0
"""Angular velocity at the start [rad/s]."""


class SpinDown(ContactCase):
    """A homogeneous ball with a vertical axis of rotation."""

    name: ClassVar[str] = "spin_down"
    title: ClassVar[str] = "Spin of a ball under torsional friction"
    law: ClassVar[str] = "2/5 m r^2 dw/dt = -c m g until w = 0, for radius r and torsional friction c"
    source: ClassVar[str] = "Coulomb's law for the moment about the normal, and Euler's equation"

    def scene(self, parameters: None) -> Scene:
        material = Material(torsional_friction=COEFFICIENT)
        twist = (0.0, 0.0, 0.0, 0.0, 0.0, SPIN)
        ball = sphere("ball", RADIUS, mass=1.0, pose=Pose((0.0, 0.0, RADIUS)), twist=twist, material=material)
        return Scene("spin_down", bodies=(ground(material=material), ball))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        exact = COEFFICIENT * G / (0.4 * RADIUS**2)
        stop = SPIN / exact
        world.run(0.2 * stop)
        spinning = record(world, 0.6 * stop)
        slowing = -acceleration(spinning.times, spinning.velocities("ball")[:, 5])
        world.run(0.3 * stop)
        left = float(world.state.bodies["ball"].twist[5])
        rests_on = ("torsional_friction",)
        return [
            Figure("angular deceleration", slowing, exact, "rad/s^2", exact, rests_on=rests_on),
            Figure("spin after the stop", left, 0.0, "rad/s", SPIN, rests_on=rests_on),
        ]
