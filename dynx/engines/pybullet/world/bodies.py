"""A body of a scene in Bullet."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from dynx.engines.pybullet.root_frame import BaseState
from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.objects import BulletObject
from dynx.engines.pybullet.world.shapes import ShapeFiles
from dynx.model.mechanism import Mechanism
from dynx.spatial.extended import longdouble
from dynx.spatial.inertia import inertia_about_origin
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_from_rotation
from dynx.steppers.layout import BodyLayout, Collider
from dynx.steppers.state import BodyState


class BulletBody:
    """A rigid body with shapes; its root frame in Bullet is its centre of mass with the principal axes."""

    def __init__(
        self,
        client: WorldClient,
        layout: BodyLayout,
        colliders: Mapping[int, Collider],
        files: ShapeFiles,
        folder: Path,
    ) -> None:
        inertia = inertia_about_origin(
            longdouble(layout.mass),
            longdouble(layout.center),
            longdouble(np.eye(3)),
            longdouble(layout.inertia),
        )
        mechanism = Mechanism(layout.name, not layout.fixed, longdouble(np.zeros(3)), inertia, (), (), None)
        self.object = BulletObject(client, mechanism, colliders, files, folder, {})
        self._layout = layout
        self._axes = self.object.root.axes
        self.set_state(layout.T, layout.twist)

    def set_state(self, T: Floats, twist: Floats) -> None:
        """Set pose and twist of the body frame."""
        R, lever = T[:3, :3], T[:3, :3] @ self.object.root.center
        self.object.place_base(
            BaseState(
                (T[:3, 3] + lever).tolist(),
                quat_from_rotation(R @ self._axes).tolist(),
                (twist[:3] + cross(twist[3:], lever)).tolist(),
                twist[3:].tolist(),
            )
        )

    def state(self) -> BodyState:
        """Return pose and twist of the body frame."""
        if self._layout.fixed:
            return BodyState(self._layout.T.copy(), np.zeros(6))
        return BodyState(*self.object.root.pose_and_twist(self.object.base_state()))
