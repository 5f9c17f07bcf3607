"""Which parts of a scene may collide."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dynx.model import Model
from dynx.world.scene.bodies import SceneBody
from dynx.world.scene.robots import SceneRobot, split_name


class CollisionFilter:
    """The pairs of parts (bodies, ``robot/link``) that collide where they touch."""

    def __init__(
        self,
        robots: Iterable[SceneRobot],
        bodies: Iterable[SceneBody],
        ignored: Iterable[tuple[frozenset[str], ...]],
    ) -> None:
        """`ignored` are pairs of sets: no part of the first collides with one of the second."""
        self._robots = {robot.name: robot for robot in robots}
        self._merged = {name: merged_links(robot.model) for name, robot in self._robots.items()}
        self._joined = {
            name: _joined(robot.model, self._merged[name]) for name, robot in self._robots.items()
        }
        self._fixed_bodies = {body.name for body in bodies if body.fixed}
        self._ignored = list(dict.fromkeys(ignored))
        self._first: dict[str, set[int]] = {}
        self._second: dict[str, set[int]] = {}
        for k, pair in enumerate(self._ignored):
            for numbers, part in zip((self._first, self._second), pair, strict=True):
                for name in part:
                    numbers.setdefault(name, set()).add(k)

    def is_fixed(self, part: str) -> bool:
        """Check whether a part is fixed in the world."""
        owner, link = split_name(part)
        if link is None:
            return owner in self._fixed_bodies
        model, merged = self._robots[owner].model, self._merged[owner]
        return not model.floating and merged[link] == merged[model.root]

    def may_collide(self, a: str, b: str) -> bool:
        """Check whether two parts collide where they touch."""
        if a == b or (self.is_fixed(a) and self.is_fixed(b)):
            return False
        none: set[int] = set()
        for one, two in ((a, b), (b, a)):
            if not self._first.get(one, none).isdisjoint(self._second.get(two, none)):
                return False
        (robot, link_a), (other, link_b) = split_name(a), split_name(b)
        if robot != other or link_a is None or link_b is None:
            return True
        merged = self._merged[robot]
        pair = frozenset([merged[link_a], merged[link_b]])
        return self._robots[robot].self_collision and len(pair) == 2 and pair not in self._joined[robot]

    def pairs(self, names: Sequence[str]) -> NDArray[np.bool_]:
        """Return which of the parts named may collide with which (n, n), as `may_collide` says of two."""
        fixed = np.array([self.is_fixed(name) for name in names], dtype=bool)
        found: NDArray[np.bool_] = ~(fixed[:, None] & fixed)
        number = {name: k for k, name in enumerate(names)}
        for one, two in self._ignored:
            firsts, seconds = ([number[name] for name in part if name in number] for part in (one, two))
            for k in firsts:
                found[k, seconds] = found[seconds, k] = False
        parts_of: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            parts_of.setdefault(split_name(name)[0], []).append(k)
        for parts in parts_of.values():
            for i, j in product(parts, parts):
                found[i, j] = self.may_collide(names[i], names[j])
        return found


def merged_links(model: Model) -> dict[str, str]:
    """Return, for each link, the link at the head of those that fixed joints connect rigidly to it."""
    head = {model.root: model.root}
    for joint in model.joints:
        head[joint.child] = joint.child if joint.moves else head[joint.parent]
    return head


def _joined(model: Model, merged: dict[str, str]) -> set[frozenset[str]]:
    """Return the pairs of heads that a moving joint connects."""
    return {frozenset([merged[joint.parent], joint.child]) for joint in model.joints if joint.moves}
