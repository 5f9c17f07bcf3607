"""Shapes at poses in the world, as tuples of floats, prepared for contacts."""

from __future__ import annotations

import copy

import numpy as np
from numpy.typing import ArrayLike

from dynx.distance.cores import Core, Hull
from dynx.distance.distance import checked_distance_pose
from dynx.distance.solids import Solid
from dynx.model import Pose
from dynx.model.elements import IDENTITY
from dynx.model.geometry import Shape
from dynx.spatial.plain import Rows, Vector3
from dynx.spatial.scalar import Floats


class PlacedSolid:
    """A shape at the pose T (4, 4) of its frame in the world: origin `p` [m] and `rows` of the rotation.

    The shape is prepared once; `move` changes only the pose. One prepared `Solid` may be at many poses.
    """

    __slots__ = ("axes", "p", "rows", "solid")

    solid: Solid
    p: Vector3
    rows: Rows
    axes: Rows
    """Columns of the rotation: the axes of the shape in the world."""

    def __init__(self, shape: Shape | Hull | Solid, T: Pose | ArrayLike = IDENTITY) -> None:
        """Raises ArgumentError for anything else than a shape, the errors of `Mesh.hull`, and those of
        invalid poses."""
        self.solid = shape if isinstance(shape, Solid) else Solid(shape, np.eye(4))
        self.move(checked_distance_pose("T", T))

    def move(self, T: Floats) -> PlacedSolid:
        """Move the shape to a pose (4, 4), which is not checked; return it."""
        (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = T.tolist()
        self.p = x, y, z
        self.rows = (a, b, c), (d, e, f), (g, h, i)
        self.axes = (a, d, g), (b, e, h), (c, f, i)
        return self

    @property
    def R(self) -> Floats:
        """Rotation matrix (3, 3)."""
        return np.array(self.rows)

    @property
    def T(self) -> Floats:
        """Pose (4, 4)."""
        T: Floats = np.eye(4)
        T[:3, :3], T[:3, 3] = self.rows, self.p
        return T


def placed_cores(a: PlacedSolid, b: PlacedSolid) -> tuple[Core, Core, Vector3]:
    """Return the cores of two bounded convex shapes at their poses, with the origin of b at zero, and the
    origin of a."""
    core_a, core_b = a.solid.core, b.solid.core
    assert core_a is not None
    assert core_b is not None
    if core_a is core_b:
        core_b = copy.copy(core_b)
    between = a.p[0] - b.p[0], a.p[1] - b.p[1], a.p[2] - b.p[2]
    return core_a.place(a.R, between), core_b.place(b.R, (0.0, 0.0, 0.0)), between
