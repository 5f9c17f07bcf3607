"""Restitution of two different materials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import ClassVar, NamedTuple

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import CONTACT_DELAYS, farthest
from dynx.contacts.scenes import ball_name, balls_above
from dynx.model import Pose
from dynx.world import Material, Scene, World, box

RADIUS = 0.05
SPEED = 1.0
"""Speed of the balls towards the slab [m/s]."""

HEIGHTS = tuple(0.1 + delay * SPEED for delay in CONTACT_DELAYS)
"""Heights of the lowest points at the start [m]."""

DURATION = 0.25
"""Time [s] by which every ball has met the slab."""


class RestitutionPair(NamedTuple):
    """Restitution of the slab and of the balls."""

    slab: float
    ball: float


class RestitutionPairs(ContactCase):
    """Balls that meet a slab of another material, without gravity, for pairs of four materials."""

    name: ClassVar[str] = "restitution_pairs"
    title: ClassVar[str] = "Restitution of two materials"
    law: ClassVar[str] = (
        "v' = -sqrt(e_a e_b) v, for speeds v before and v' after the impact and the restitution of each"
    )
    source: ClassVar[str] = (
        "Newton's law of restitution, with dynx's rule for two materials: the geometric mean"
    )
    trials: ClassVar[dict[str, RestitutionPair]] = {
        f"{a:g} and {b:g}": RestitutionPair(a, b)
        for a, b in combinations_with_replacement((0.0, 0.25, 0.5, 1.0), 2)
    }

    def scene(self, parameters: RestitutionPair) -> Scene:
        slab = Material(friction=0.0, restitution=parameters.slab)
        ball = Material(friction=0.0, restitution=parameters.ball)
        twist = (0.0, 0.0, -SPEED, 0.0, 0.0, 0.0)
        balls = balls_above(RADIUS, HEIGHTS, ball, spacing=(0.2, 0.0), twist=twist)
        ground = box("slab", (2.0, 1.0, 0.2), pose=Pose((0.4, 0.0, -0.1)), material=slab)
        return Scene("restitution_pairs", bodies=(ground, *balls), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: RestitutionPair) -> Sequence[Figure]:
        world.run(DURATION)
        speeds = [float(world.state.bodies[ball_name(k)].twist[2]) / SPEED for k in range(len(HEIGHTS))]
        exact = math.sqrt(parameters.slab * parameters.ball)
        rests_on = ("restitution",) if exact else ()
        return [Figure("restitution", farthest(speeds, exact), exact, "", 1.0, rests_on=rests_on)]
