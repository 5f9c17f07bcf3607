"""Collision filters of a scene as MuJoCo's masks and excluded pairs.

MuJoCo tests a pair of geoms if the type of one and the affinity of the other share a bit, unless their bodies
are an excluded pair. A set of colliders that never touch each other, such as the links of a robot, shares a
bit of its own that is missing in its affinity; the other pairs that may not touch are excluded one by one.
"""

from __future__ import annotations

from itertools import groupby

import numpy as np

from dynx.steppers.layout import Layout

BITS = 31
"""Bits of a mask; a signed integer of 32 has no more."""

ALL = 2**BITS - 1

Mask = tuple[int, int]
"""MuJoCo's contype and conaffinity."""


def collision_masks(layout: Layout) -> list[Mask]:
    """Return the masks of every collider. Bit 0 is that of colliders which may touch others of their set."""
    masks = [(1, ALL)] * len(layout.colliders)
    bit = 1
    for robot, numbers in _by_robot(layout):
        apart = robot is not None and not layout.collides[np.ix_(numbers, numbers)].any()
        if apart and len(numbers) > 1 and bit < BITS:
            for number in numbers:
                masks[number] = (1 << bit, ALL ^ (1 << bit))
            bit += 1
    return masks


def pairs_to_exclude(layout: Layout, masks: list[Mask]) -> list[tuple[int, int]]:
    """Return the pairs of colliders that must not touch and that neither masks nor MuJoCo's own rules filter:
    it tests no bodies that are rigidly connected, or both fixed."""
    pairs = []
    fixed = [layout.is_fixed(collider.owner) for collider in layout.colliders]
    for a, b in np.argwhere(np.triu(~layout.collides, 1)).tolist():
        tested = masks[a][0] & masks[b][1] or masks[b][0] & masks[a][1]
        connected = layout.colliders[a].owner == layout.colliders[b].owner
        if tested and not connected and not (fixed[a] and fixed[b]):
            pairs.append((a, b))
    return pairs


def _by_robot(layout: Layout) -> list[tuple[int | None, list[int]]]:
    numbers = range(len(layout.colliders))
    groups = groupby(numbers, key=lambda number: layout.colliders[number].owner.robot)
    return [(robot, list(group)) for robot, group in groups]
