"""A handle on a frame of a robot: dragging it moves the robot by inverse kinematics."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.model import Model
from dynx.rbd.link_poses import frame_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.viewer.drawn_parts import wxyz

if TYPE_CHECKING:
    from dynx.backends import Backend

_RESTARTS_IN_A_DRAG = 0
"""Restarts of the solver while the handle moves: a restart would let the robot jump."""


class FrameHandle:
    """The handle on one frame; the frame, and what of its pose is kept, can be changed."""

    def __init__(
        self,
        scene: Any,
        model: Model,
        engine: Callable[[], Backend],
        frame: str,
        size: float,
        moved: Callable[[Floats, str], None],
    ) -> None:
        """`moved(q, message)` is called with each configuration that a drag leads to; `engine()` returns the
        backend that solves for it."""
        self._model, self._engine, self._moved = model, engine, moved
        self.frame = frame
        self._free: str | None = None
        self.q = model.neutral()
        """The configuration from which the next drag begins."""
        self._latest: Floats | None = None
        self._guard = threading.Lock()
        self._busy = threading.Lock()
        self._node = scene.add_transform_controls("/handle", scale=size, depth_test=False, visible=False)
        self._node.on_update(self._dragged)

    @property
    def free(self) -> str | None:
        """Free part of the pose: ``"rotation"``, ``"position"``, or None.

        The handle has no rings where rotation is free, and neither arrows nor squares where position is.
        """
        return self._free

    @free.setter
    def free(self, free: str | None) -> None:
        self._free = free
        self._node.disable_rotations = free == "rotation"
        self._node.disable_axes = self._node.disable_sliders = free == "position"

    @property
    def visible(self) -> bool:
        """True while the handle is shown."""
        return bool(self._node.visible)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._node.visible = shown

    def put(self, q: Floats) -> None:
        """Place the handle on the frame at a configuration (nq,)."""
        self.q = q
        T = dict(frame_poses(self._model, q))[self.frame]
        self._node.wxyz, self._node.position = wxyz(T[:3, :3]), T[:3, 3]

    def _dragged(self, event: Any) -> None:
        w, x, y, z = np.asarray(self._node.wxyz, dtype=np.float64)
        R = rotation_from_quat(np.array([x, y, z, w]))
        with self._guard:
            self._latest = np.asarray(homogeneous(R, np.asarray(self._node.position, dtype=np.float64)))
        if event.phase == "end":
            with self._busy:
                self._solve_latest()
            self.put(self.q)
        elif self._busy.acquire(blocking=False):
            # Updates that come while one is solved replace each other, so that the robot follows the hand.
            try:
                while self._solve_latest():
                    pass
            finally:
                self._busy.release()

    def _solve_latest(self) -> bool:
        with self._guard:
            target, self._latest = self._latest, None
        if target is None:
            return False
        self._solve(target)
        return True

    def _solve(self, target: Floats) -> None:
        found = self._engine().inverse_kinematics(
            target, self.frame, self.q, free=self.free, max_restarts=_RESTARTS_IN_A_DRAG
        )
        self.q = found.q
        self._moved(found.q, found.message)
