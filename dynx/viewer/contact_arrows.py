"""Contact forces as arrows."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import VERMILION


class ContactArrows:
    """An arrow for each contact, along its force, at its point; the scale is fixed, in metres a newton."""

    def __init__(self, scene: Any, metres_per_newton: float, thickness: float) -> None:
        self._scene, self._scale, self._thickness = scene, metres_per_newton, thickness
        self._node: Any = None
        self.shown = True
        """True while the arrows are shown."""

    def put(self, points: Floats, forces: Floats) -> None:
        """Show forces (m, 3) [N] at points (m, 3) [m], in world axes."""
        if not self.shown or not len(points):
            if self._node is not None:
                self._node.visible = False
            return
        ends = points + self._scale * forces
        segments = np.stack([points, ends], axis=1).astype(np.float32)
        if self._node is None:
            self._node = self._scene.add_arrows(
                "/contact_forces",
                segments,
                VERMILION,
                shaft_radius=self._thickness,
                head_radius=2.5 * self._thickness,
                head_length=4.0 * self._thickness,
            )
        else:
            self._node.points = segments
            self._node.visible = True
