"""A ball that bounces several times."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from dynx.contacts.case import Case, Figure
from dynx.contacts.impacts import farthest
from dynx.contacts.motion import record
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, World, ground, sphere

RADIUS = 0.05
RESTITUTION = 0.5
HEIGHTS = tuple(0.3 + 0.007 * k for k in range(5))
"""Heights of fall [m], so that the balls touch the ground at different moments within a step."""

REBOUNDS = 3

LEAST_HEIGHT = 0.007
"""Height of a rebound relative to that of the fall below which a ball counts as at rest."""


class BouncingBall(Case):
    """Balls of restitution 0.5 that fall from about 0.3 m and bounce until they rest."""

    name: ClassVar[str] = "bouncing_ball"
    title: ClassVar[str] = "Sequence of rebounds of a ball"
    law: ClassVar[str] = (
        "h_n = e^(2n) h at intervals 2 e^n t, for the height h and the time t of the fall and restitution e"
    )
    source: ClassVar[str] = "Newton's law of restitution and conservation of energy in flight"

    def scene(self, parameters: None) -> Scene:
        material = Material(restitution=RESTITUTION)
        balls = [
            sphere(f"ball {k}", RADIUS, mass=1.0, pose=Pose((0.5 * k, 0.0, RADIUS + h)), material=material)
            for k, h in enumerate(HEIGHTS)
        ]
        return Scene("bouncing_ball", bodies=(ground(material=material), *balls))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        motion = record(world, impact_time(REBOUNDS + 1) * fall_time(max(HEIGHTS)))
        tops: list[list[float]] = [[] for _ in range(REBOUNDS)]
        ends = []
        for k, fall in enumerate(HEIGHTS):
            heights = (motion.positions(f"ball {k}")[:, 2] - RADIUS) / fall
            flights = _flights(heights)[1:]
            for n, found in enumerate(tops):
                found.append(float(heights[flights[n]].max()) if n < len(flights) else 0.0)
            ends.append(_last_time_above(motion.times / fall_time(fall), heights))
        rests_on = ("restitution",)
        figures = [
            Figure(
                f"height of rebound {n}, relative to the fall",
                farthest(found, RESTITUTION ** (2 * n)),
                RESTITUTION ** (2 * n),
                "",
                RESTITUTION ** (2 * n),
                rests_on=rests_on,
            )
            for n, found in enumerate(tops, 1)
        ]
        exact = time_of_rest()
        end = Figure(
            "time until rest, relative to the fall",
            farthest(ends, exact),
            exact,
            "",
            exact,
            rests_on=rests_on,
        )
        return [*figures, end]


def fall_time(height: float) -> float:
    """Return the time of a fall from rest [s]."""
    return math.sqrt(2.0 * height / G)


def impact_time(n: int) -> float:
    """Return the time of the n-th impact, in units of the time of the fall."""
    return 1.0 + sum(2.0 * RESTITUTION**k for k in range(1, n))


def time_of_rest() -> float:
    """Return the time, in units of that of the fall, after which the height is below
    `LEAST_HEIGHT` of the fall."""
    n = math.floor(math.log(LEAST_HEIGHT) / (2.0 * math.log(RESTITUTION)))
    top = RESTITUTION ** (2 * n)
    return impact_time(n) + RESTITUTION**n + math.sqrt(top - LEAST_HEIGHT)


def _flights(heights: Floats) -> list[slice]:
    """Return the stretches in which a ball is higher than `LEAST_HEIGHT`."""
    edges = np.flatnonzero(np.diff(heights > LEAST_HEIGHT, prepend=False, append=False))
    return [slice(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def _last_time_above(times: Floats, heights: Floats) -> float:
    """Return the time of the last crossing of `LEAST_HEIGHT`, by linear interpolation."""
    last = int(np.flatnonzero(heights > LEAST_HEIGHT)[-1])
    pair = [last + 1, last]
    return (
        float(np.interp(LEAST_HEIGHT, heights[pair], times[pair]))
        if last + 1 < len(times)
        else float(times[-1])
    )
