"""Quantities of a robot as shapes: gravity torques on the joints, the ellipsoid of manipulability."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.model import Model
from dynx.model.geometry import Sphere
from dynx.rbd.link_poses import frame_poses, link_poses
from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, VERMILION
from dynx.viewer.drawn_parts import wxyz
from dynx.viewer.drawn_robot import size_of
from dynx.viewer.surfaces.triangles import triangles_of

if TYPE_CHECKING:
    from dynx.backends import Backend

_LONGEST = 0.25
"""Length of the longest bar and of the longest half axis, as a share of the robot's size."""


class GravityTorques:
    """A bar along the axis of each joint: its gravity torque, relative to the effort limit.

    Joints without a limit are relative to the largest gravity torque of these. A bar points along the axis
    for a positive torque.
    """

    def __init__(self, scene: Any, model: Model, engine: Callable[[], Backend]) -> None:
        self._model, self._engine, self._scene = model, engine, scene
        self._size = size_of(model)
        self._bars: Any = None
        self.shown = False
        """True while the bars are shown."""

    def move(self, q: Floats) -> None:
        """Show the torques at a configuration (nq,), if they are shown."""
        if self._bars is not None:
            self._bars.visible = self.shown
        if not self.shown:
            return
        points = self._points(q).astype(np.float32)
        if self._bars is None:
            thin = 0.012 * self._size
            self._bars = self._scene.add_arrows(
                "/gravity_torques",
                points,
                VERMILION,
                shaft_radius=thin,
                head_radius=2.0 * thin,
                head_length=3.0 * thin,
            )
        else:
            self._bars.points = points

    def _points(self, q: Floats) -> Floats:
        model = self._model
        tau = self._engine().gravity_torque(q)[model.nv - len(model.joint_names) :]
        limit = model.effort_limit[model.nv - len(model.joint_names) :]
        unlimited = ~(np.isfinite(limit) & (limit > 0.0))
        largest = float(np.abs(tau[unlimited]).max(initial=0.0)) or 1.0
        share = np.clip(tau / np.where(unlimited, largest, np.where(limit > 0.0, limit, 1.0)), -1.0, 1.0)
        poses = dict(link_poses(model, q))
        points = []
        for k, joint in enumerate(model.coordinate_joints):
            T = poses[joint.child]
            axis = np.asarray(joint.axis, dtype=np.float64)
            along = T[:3, :3] @ (axis / np.linalg.norm(axis))
            points.append([T[:3, 3], T[:3, 3] + _LONGEST * self._size * share[k] * along])
        return np.array(points, dtype=np.float64).reshape(-1, 2, 3)


class Manipulability:
    """The ellipsoid of the velocities that unit joint speeds give a frame (Yoshikawa 1985), to scale.

    Half its axes are the singular values of the linear rows of the Jacobian; the longest is drawn with the
    same length always, so that the shape tells how far a singular configuration is.
    """

    def __init__(self, scene: Any, model: Model, engine: Callable[[], Backend]) -> None:
        self._model, self._engine, self._scene = model, engine, scene
        self._size = size_of(model)
        self._node: Any = None
        self.shown = False
        """True while the ellipsoid is shown."""

    def move(self, q: Floats, frame: str) -> None:
        """Show the ellipsoid of a frame at a configuration (nq,), if it is shown."""
        if self._node is not None:
            self._node.visible = self.shown
        if not self.shown:
            return
        J = self._engine().jacobian(q, frame)[:3, self._model.nv - len(self._model.joint_names) :]
        U, values, _ = np.linalg.svd(J)
        half = np.zeros(3)
        half[: len(values)] = values
        longest = float(half.max())
        half = half / longest if longest > 0.0 else half
        if np.linalg.det(U) < 0.0:
            U[:, 2] *= -1.0
        if self._node is None:
            unit = triangles_of(Sphere(1.0))
            self._node = self._scene.add_mesh_simple(
                "/manipulability", unit.vertices, unit.faces, color=BLUE, opacity=0.35, cast_shadow=False
            )
        self._node.scale = tuple((_LONGEST * self._size * np.maximum(half, 0.01)).tolist())
        self._node.wxyz = wxyz(U)
        self._node.position = dict(frame_poses(self._model, q))[frame][:3, 3]
