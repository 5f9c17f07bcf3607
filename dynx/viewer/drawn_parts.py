"""Nodes of the page by the names of parts, placed by poses in the world with few messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation

_STILL = 1e-12
"""Change of a pose below which it is not sent [m, and entries of a rotation]."""

Quaternion = tuple[float, float, float, float]


class DrawnParts:
    """Nodes of the page by the names of parts, below one root.

    The node of a part may lie below that of another. A revolute joint then changes only the rotation of one
    node, and what is fixed to a part moves with it, so that a page gets far fewer messages than for poses in
    the world.
    """

    def __init__(self, root: Any, parts: dict[str, Any], above: Mapping[str, str]) -> None:
        """`above` names the part below whose node that of a part lies; the others lie below the root."""
        self._root = root
        self.parts = parts
        """The node of each part."""
        self._number = {name: k for k, name in enumerate(parts)}
        # The last row is the world.
        self._above = np.array([self._number[above[n]] if n in above else -1 for n in parts], dtype=np.intp)
        self._poses = np.tile(np.eye(4), (len(parts) + 1, 1, 1))
        self._sent = np.full((len(parts), 3, 4), np.nan)
        self._placed: list[Callable[[Mapping[str, Floats]], None]] = []

    def on_placed(self, placed: Callable[[Mapping[str, Floats]], None]) -> None:
        """Call `placed(poses)` whenever parts were placed."""
        self._placed.append(placed)

    def pose(self, name: str) -> Floats:
        """Return the pose (4, 4) in the world at which a part was placed last."""
        return np.array(self._poses[self._number[name]])

    def place(self, poses: Mapping[str, Floats]) -> None:
        """Place parts at the poses (4, 4) in the world given."""
        for name, T in poses.items():
            self._poses[self._number[name]] = T
        here, above = self._poses[:-1], self._poses[self._above]
        inverse = np.swapaxes(above[:, :3, :3], 1, 2)
        seen = inverse @ here[:, :3]
        seen[:, :, 3:] -= inverse @ above[:, :3, 3:]
        still = np.abs(seen - self._sent).max(axis=(1, 2), initial=0.0) <= _STILL
        moved = np.flatnonzero(~still)
        self._sent[moved] = seen[moved]
        nodes = list(self.parts.values())
        turns = np.roll(quat_from_rotation(seen[moved, :, :3]), 1, axis=-1).tolist()
        for k, turn, origin in zip(moved.tolist(), turns, seen[moved, :, 3].tolist(), strict=True):
            nodes[k].wxyz, nodes[k].position = tuple(turn), tuple(origin)
        for placed in self._placed:
            placed(poses)

    def remove(self) -> None:
        """Remove all parts from the page."""
        self._root.remove()

    @property
    def visible(self) -> bool:
        """True while the parts are shown."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._root.visible = shown


def wxyz(R: Floats) -> Quaternion:
    """Return the unit quaternion (w, x, y, z) of a rotation (3, 3), as viser writes it."""
    x, y, z, w = quat_from_rotation(R).tolist()
    return (w, x, y, z)
