"""Overlaps of parts that may touch, from which engines push them apart, often violently."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dynx.steppers.layout import Collider
from dynx.steppers.stepper import Stepper
from dynx.world.geometry.boxes import shape_box

MIN_DEPTH = 1e-3
"""Depth [m] from which two parts count as overlapping: at rest, parts sink into one another by less."""

MIN_DEPTH_SHARE = 0.05
"""Depth from which two smaller parts do, relative to the shortest edge of the smaller one's box."""


class Overlap(NamedTuple):
    """Two parts that overlap, and by how much at their deepest contact [m]."""

    a: str
    b: str
    depth: float


def overlaps_of(engine: Stepper) -> tuple[Overlap, ...]:
    """Return the parts that may touch and overlap at the present state, the deepest first."""
    deepest: dict[tuple[int, int], float] = {}
    for point in engine.contacts():
        pair = min(point.a, point.b), max(point.a, point.b)
        deepest[pair] = max(deepest.get(pair, 0.0), -point.distance)
    colliders = engine.layout.colliders
    found = [
        Overlap(colliders[a].name, colliders[b].name, depth)
        for (a, b), depth in deepest.items()
        if depth > min(MIN_DEPTH, MIN_DEPTH_SHARE * min(_shortest_edge(colliders[k]) for k in (a, b)))
    ]
    return tuple(sorted(found, key=lambda overlap: -overlap.depth))


def _shortest_edge(collider: Collider) -> float:
    """Return the shortest edge of the boxes around the shapes [m]."""
    boxes = (shape_box(each.shape, each.T) for each in collider.shapes)
    return min(float(np.min(upper - lower)) for lower, upper in boxes)
