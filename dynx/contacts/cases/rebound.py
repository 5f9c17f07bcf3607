"""Height to which a ball rebounds from the ground."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import farthest
from dynx.contacts.motion import RecordedMotion, record
from dynx.contacts.scenes import G, ball_name, balls_above
from dynx.world import Material, Scene, World, ground

RADIUS = 0.1
HEIGHTS = tuple(0.5 + 0.01 * k for k in range(5))
"""Heights of fall [m], so that the balls touch the ground at different moments within a step."""


class Rebound(ContactCase):
    """Balls dropped from about half a metre, on ground of the same restitution."""

    name: ClassVar[str] = "rebound"
    title: ClassVar[str] = "Height of a rebound"
    law: ClassVar[str] = "h' / h = e^2, for heights h before and h' after the impact and restitution e"
    source: ClassVar[str] = "Newton's law of restitution and the conservation of energy in flight"
    trials: ClassVar[dict[str, float]] = {f"restitution {e:g}": e for e in (0.0, 0.5, 0.8, 1.0)}

    def scene(self, parameters: float) -> Scene:
        material = Material(restitution=parameters)
        balls = balls_above(RADIUS, HEIGHTS, material)
        return Scene("rebound", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: float) -> Sequence[Figure]:
        fall = math.sqrt(2.0 * max(HEIGHTS) / G)
        # The highest ball reaches the top, and the lowest does not touch the ground again.
        motion = record(world, fall * (1.0 + 1.4 * parameters) + 0.05)
        ratios = [rebound_height(motion, ball_name(k)) / height for k, height in enumerate(HEIGHTS)]
        exact = parameters**2
        return [Figure("height", farthest(ratios, exact), exact, "", 1.0, rests_on=("restitution",))]


def rebound_height(motion: RecordedMotion, ball: str) -> float:
    """Return the largest height of a ball above the ground after it was lowest first [m]."""
    height = motion.positions(ball)[:, 2] - RADIUS
    rises = np.flatnonzero(np.diff(height) >= 0.0)
    lowest = int(rises[0]) if rises.size else len(height) - 1
    return max(0.0, float(np.max(height[lowest:])))
