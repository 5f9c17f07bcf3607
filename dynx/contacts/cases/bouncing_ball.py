"""A ball that bounces several times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import rms_deviation
from dynx.contacts.motion import record
from dynx.contacts.scenes import G, ball_name, balls_above
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, World, ground

RADIUS = 0.05
RESTITUTION = 0.5
HEIGHTS = tuple(0.5 * G * (0.25 + 0.4e-3 * k) ** 2 for k in range(10))
"""Heights of fall [m], so that the balls touch the ground at different moments within a step."""

REBOUNDS = 3

MIN_HEIGHT = 0.007
"""Height relative to that of the fall below which a ball is not counted as flying."""


class BouncingBall(ContactCase):
    """Balls of restitution 0.5 that fall from about 0.3 m and bounce until they rest."""

    name: ClassVar[str] = "bouncing_ball"
    title: ClassVar[str] = "Sequence of rebounds of a ball"
    law: ClassVar[str] = (
        "h_n = e^(2n) h in flights of 2 e^n t, for the height h and the time t of the fall and restitution e"
    )
    source: ClassVar[str] = "Newton's law of restitution and conservation of energy in flight"

    def scene(self, parameters: None) -> Scene:
        material = Material(restitution=RESTITUTION)
        balls = balls_above(RADIUS, HEIGHTS, material)
        return Scene("bouncing_ball", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        motion = record(world, impact_time(REBOUNDS + 1) * fall_time(max(HEIGHTS)))
        tops: list[list[float]] = [[] for _ in range(REBOUNDS)]
        for k, fall in enumerate(HEIGHTS):
            heights = (motion.positions(ball_name(k))[:, 2] - RADIUS) / fall
            reached = rebound_heights(heights, motion.velocities(ball_name(k))[:, 2])
            for n, found in enumerate(tops):
                found.append(reached[n] if n < len(reached) else 0.0)
        figures = []
        for n, found in enumerate(tops, 1):
            exact = RESTITUTION ** (2 * n)
            # The RMS error of ten balls falls smoothly with the step, where that of a single one jumps.
            measured = exact + rms_deviation(found, exact)
            what = f"height of rebound {n}, relative to the fall"
            figures.append(Figure(what, measured, exact, "", exact, rests_on=("restitution",)))
        return figures


def fall_time(height: float) -> float:
    """Return the time of a fall from rest [s]."""
    return math.sqrt(2.0 * height / G)


def impact_time(n: int) -> float:
    """Return the time of the n-th impact, in units of the time of the fall."""
    return 1.0 + sum(2.0 * RESTITUTION**k for k in range(1, n))


def rebound_heights(heights: Floats, speeds: Floats) -> list[float]:
    """Return the largest height of each flight after an impact, of heights (n,) and upward speeds (n,).

    A flight begins where a ball that falls has begun to rise: an impact may be over within a step, so that no
    height is that of the ground.
    """
    rises = speeds > 0.0
    starts = (np.flatnonzero(~rises[:-1] & rises[1:]) + 1).tolist()
    tops = [float(heights[a:b].max()) for a, b in pairwise([*starts, len(heights)])]
    return [top for top in tops if top > MIN_HEIGHT]
