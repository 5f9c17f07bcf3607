"""Places of the parts of a scene: columns along x, in which each part stands above the one before it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.model import Pose
from dynx.model.elements import Vector
from dynx.model.geometry import Plane
from dynx.spatial.scalar import Floats
from dynx.world.geometry.boxes import Corners, shape_box
from dynx.world.scene import SceneBody, SceneRobot
from dynx.world.scene.link_frames import LinkFrames

COLUMN_SPACING = 0.02
"""Distance [m] between the boxes of neighbouring columns."""


def in_columns(
    parts: Sequence[SceneRobot | SceneBody], gaps: Sequence[float], columns: int, ground: GroundHeight
) -> list[SceneRobot | SceneBody]:
    """Return the parts in `columns` columns along x, each part above the one before it in its column."""
    boxes = [_box(part) for part in parts]
    placed = []
    left = 0.0
    for column in range(columns):
        chosen = range(column, len(parts), columns)
        if not chosen:
            break
        half = max(float(np.max(np.abs(corner[:2]))) for k in chosen for corner in boxes[k])
        x, left = left + half, left + 2.0 * half + COLUMN_SPACING
        top = ground.highest(x, half)
        for k in chosen:
            lower, upper = boxes[k]
            shift = np.array([x, 0.0, top + gaps[k] - lower[2]])
            placed.append((k, _shifted(parts[k], shift)))
            top += gaps[k] + float(upper[2] - lower[2])
    return [part for _, part in sorted(placed, key=lambda found: found[0])]


@dataclass(frozen=True)
class GroundHeight:
    """Heights of a ground: a plane through the origin, or anything below z = 0."""

    normal: Vector | None

    def highest(self, x: float, half: float) -> float:
        """Return the height of the highest point within `half` of (x, 0) on both axes."""
        if self.normal is None:
            return 0.0
        a, b, c = self.normal
        return (-a * x + (abs(a) + abs(b)) * half) / c


def ground_height(earth: tuple[SceneBody, ...]) -> GroundHeight:
    if earth and isinstance(earth[0].shapes[0].shape, Plane):
        x, y, z = earth[0].pose.matrix[:3, 2].tolist()
        return GroundHeight((x, y, z))
    return GroundHeight(None)


def _box(part: SceneRobot | SceneBody) -> Corners:
    """Return the corners of the box around a part at its pose; a point where it has no shape."""
    if isinstance(part, SceneBody):
        placed = [(each.shape, part.pose.matrix @ each.origin.matrix) for each in part.shapes]
    else:
        frames, q = LinkFrames(part.model), np.array(part.q)
        placed = [
            (each.shape, frames.pose(q, link.name) @ each.origin.matrix)
            for link in part.model.links
            for each in part.model.geometry.collisions(link.name)
        ]
    if not placed:
        return np.zeros(3), np.zeros(3)
    corners = [shape_box(shape, T) for shape, T in placed]
    return np.min([c[0] for c in corners], axis=0), np.max([c[1] for c in corners], axis=0)


def _shifted(part: SceneRobot | SceneBody, shift: Floats) -> SceneRobot | SceneBody:
    if isinstance(part, SceneBody):
        return replace(part, pose=_moved(part.pose, shift))
    if not part.model.floating:
        return replace(part, model=part.model.with_base_pose(_moved(part.model.base_pose, shift)))
    assert part.q is not None
    return replace(part, q=(*(np.array(part.q[:3]) + shift).tolist(), *part.q[3:]))


def _moved(pose: Pose, shift: Floats) -> Pose:
    x, y, z = (np.array(pose.xyz) + shift).tolist()
    return replace(pose, xyz=(x, y, z))
