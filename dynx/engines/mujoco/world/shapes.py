"""Shapes of a scene as MuJoCo's geoms; meshes as the convex hulls that dynx has computed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.tree import quat_wxyz
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.geometry.mjcf import MIN_HEIGHT_RANGE
from dynx.spatial.scalar import Floats

FIELD_GROUP = 5
"""MuJoCo's geom group of height fields, which `mj_ray` can leave out; others are in group 0."""


class ShapeBuilder:
    """Adds shapes to a specification; equal meshes and height fields become one asset."""

    def __init__(self, spec: Any) -> None:
        self._spec = spec
        self._assets: dict[Any, str] = {}

    def add(self, body: Any, shape: Shape, T: Floats, name: str, options: Mapping[str, Any]) -> None:
        """Add a shape at the pose T (4, 4) to MuJoCo's body; `options` are those of every geom of the
        collider."""
        position = np.array(T[:3, 3])
        kinds = mujoco.mjtGeom
        given = dict(options, name=name, quat=quat_wxyz(T[:3, :3]))
        if isinstance(shape, Box):
            given |= {"type": kinds.mjGEOM_BOX, "size": 0.5 * np.array(shape.size)}
        elif isinstance(shape, Sphere):
            given |= {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
        elif isinstance(shape, Cylinder):
            given |= {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        elif isinstance(shape, Capsule):
            given |= {"type": kinds.mjGEOM_CAPSULE, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        elif isinstance(shape, Plane):
            given |= {"type": kinds.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0]}
        elif isinstance(shape, HeightField):
            lowest = min(min(row) for row in shape.heights)
            position = position + T[:3, 2] * lowest
            given |= {"type": kinds.mjGEOM_HFIELD, "hfieldname": self._field(shape), "group": FIELD_GROUP}
        else:
            given |= {"type": kinds.mjGEOM_MESH, "meshname": self._hull(shape)}
        body.add_geom(pos=position, **given)

    def _field(self, shape: HeightField) -> str:
        if shape not in self._assets:
            heights = np.array(shape.heights)
            span = max(float(np.ptp(heights)), MIN_HEIGHT_RANGE)
            rows, columns = heights.shape
            name = self._assets[shape] = str(len(self._assets))
            self._spec.add_hfield(
                name=name,
                nrow=rows,
                ncol=columns,
                size=[0.5 * shape.size[0], 0.5 * shape.size[1], span, shape.DEPTH],
                userdata=(heights - heights.min()).ravel(),
            )
        return self._assets[shape]

    def _hull(self, shape: Mesh) -> str:
        if shape not in self._assets:
            name = self._assets[shape] = str(len(self._assets))
            mesh = self._spec.add_mesh(name=name, uservert=shape.hull[0].ravel())
            # The moments of a shell need no volume, so that a tiny mesh is accepted too.
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return self._assets[shape]
