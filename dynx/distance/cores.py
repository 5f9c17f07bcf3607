"""Convex shapes as a core and a radius: every shape is the set of points at most `radius` from its core.

A ball is a point with a radius, a capsule a segment with one; boxes, cylinders,
ellipsoids and hulls have radius 0. The
distance of two shapes is that of their cores less both radii, also where the shapes overlap and their cores
do not, so that rounded surfaces need no approximation.

A core is known by its support function h(n) = max {n . x : x in core} and a point where it is attained.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Mesh, Sphere
from dynx.model.numbers import MAX_MAGNITUDE, checked_array
from dynx.spatial.plain import Vector3
from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of `points` (n, 3) [m], for which no file is needed."""

    points: Floats

    def __post_init__(self) -> None:
        points = checked_array("points", self.points, 3)
        if points.ndim != 2 or not len(points):
            raise ShapeError(f"points of a hull have shape {points.shape}; wanted (n, 3)")
        if np.abs(points).max() >= MAX_MAGNITUDE:
            raise ArgumentError(f"points of a hull reach {np.abs(points).max()}; wanted less than 1e60")
        object.__setattr__(self, "points", np.array(points, dtype=np.float64))


ConvexShape = Box | Sphere | Cylinder | Capsule | Ellipsoid | Mesh | Hull
"""Bounded convex shapes; a mesh stands for its convex hull."""


IDENTITY: Floats = np.eye(3)
IDENTITY.flags.writeable = False


class Core(ABC):
    """The core of a shape at a pose, whose origin is `p` and whose axes are the columns of `R`."""

    def __init__(self, radius: float, extent: float) -> None:
        self.radius = radius
        self.extent = extent
        """Bound on the distance of the points of the core from its origin."""
        self.p: Vector3 = (0.0, 0.0, 0.0)
        self.R = IDENTITY

    def place(self, R: Floats, p: Vector3) -> Core:
        """Move the core to the pose (R, p); return it."""
        self.p, self.R = p, R
        return self

    @abstractmethod
    def support(self, n: Vector3) -> Vector3:
        """Return a point of the core that is farthest along n, of any length above zero."""

    @abstractmethod
    def supports(self, n: Floats) -> Floats:
        """Return the support points (m, 3) along directions (m, 3)."""


class PointCore(Core):
    """The centre of a ball."""

    def support(self, n: Vector3) -> Vector3:
        return self.p

    def supports(self, n: Floats) -> Floats:
        return np.tile(self.p, (len(n), 1))


class SegmentCore(Core):
    """The axis of a capsule."""

    def __init__(self, radius: float, half: float) -> None:
        super().__init__(radius, half)
        self.half = half

    def place(self, R: Floats, p: Vector3) -> Core:
        super().place(R, p)
        x, y, z = (self.half * R[:, 2]).tolist()
        self._axis: Vector3 = (x, y, z)
        return self

    def support(self, n: Vector3) -> Vector3:
        (x, y, z), (ax, ay, az) = self.p, self._axis
        if n[0] * ax + n[1] * ay + n[2] * az > 0.0:
            return x + ax, y + ay, z + az
        return x - ax, y - ay, z - az

    def supports(self, n: Floats) -> Floats:
        axis = np.array(self._axis)
        return np.asarray(self.p + np.where(n @ axis > 0.0, 1.0, -1.0)[:, None] * axis)


class BoxCore(Core):
    """A box."""

    def __init__(self, halves: Floats) -> None:
        super().__init__(0.0, math.hypot(*halves.tolist()))
        self._halves = halves
        self.halves: list[float] = halves.tolist()

    def place(self, R: Floats, p: Vector3) -> Core:
        super().place(R, p)
        self._edges: list[list[float]] = (R * self._halves).T.tolist()
        return self

    def support(self, n: Vector3) -> Vector3:
        a, b, c = n
        x, y, z = self.p
        for ex, ey, ez in self._edges:
            if a * ex + b * ey + c * ez > 0.0:
                x, y, z = x + ex, y + ey, z + ez
            else:
                x, y, z = x - ex, y - ey, z - ez
        return x, y, z

    def supports(self, n: Floats) -> Floats:
        edges = np.array(self._edges)
        return np.asarray(self.p + np.where(n @ edges.T > 0.0, 1.0, -1.0) @ edges)


class CylinderCore(Core):
    """A cylinder: the sum of a disc and a segment along its axis."""

    def __init__(self, radius: float, half: float) -> None:
        super().__init__(0.0, math.hypot(radius, half))
        self.rim_radius, self.half = radius, half

    def place(self, R: Floats, p: Vector3) -> Core:
        super().place(R, p)
        (self._x, self._y, self._z) = ((e[0], e[1], e[2]) for e in R.T.tolist())
        return self

    def support(self, n: Vector3) -> Vector3:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self._x, self._y, self._z
        u = n[0] * ax + n[1] * ay + n[2] * az
        v = n[0] * bx + n[1] * by + n[2] * bz
        across = math.hypot(u, v)
        scale = self.rim_radius / across if across > 0.0 else 0.0
        u, v = u * scale, v * scale
        w = self.half if n[0] * cx + n[1] * cy + n[2] * cz > 0.0 else -self.half
        x, y, z = self.p
        return x + (u * ax + v * bx + w * cx), y + (u * ay + v * by + w * cy), z + (u * az + v * bz + w * cz)

    def supports(self, n: Floats) -> Floats:
        local = n @ self.R
        across = np.hypot(local[:, 0], local[:, 1])
        points = np.empty_like(local)
        points[:, :2] = local[:, :2] * (self.rim_radius / np.where(across > 0.0, across, np.inf))[:, None]
        points[:, 2] = np.where(local[:, 2] > 0.0, self.half, -self.half)
        return np.asarray(self.p + points @ self.R.T)


class EllipsoidCore(Core):
    """An ellipsoid."""

    def __init__(self, radii: Floats) -> None:
        super().__init__(0.0, float(radii.max()))
        self.radii = radii

    def place(self, R: Floats, p: Vector3) -> Core:
        super().place(R, p)
        self._scaled = R * self.radii
        self._axes: list[list[float]] = self._scaled.T.tolist()
        return self

    def support(self, n: Vector3) -> Vector3:
        """Return the point of the ellipsoid, the image of the unit ball, that is farthest along n."""
        a, b, c = n
        weights = [a * x + b * y + c * z for x, y, z in self._axes]
        length = math.hypot(*weights)
        x, y, z = self.p
        if length > 0.0:
            for weight, (ex, ey, ez) in zip(weights, self._axes, strict=True):
                share = weight / length
                x, y, z = x + share * ex, y + share * ey, z + share * ez
        return x, y, z

    def supports(self, n: Floats) -> Floats:
        weights = n @ self._scaled
        lengths = np.linalg.norm(weights, axis=1, keepdims=True)
        return np.asarray(self.p + weights / np.where(lengths > 0.0, lengths, np.inf) @ self._scaled.T)


def _core_of_ellipsoid(shape: Ellipsoid) -> Core:
    """Return the core of an ellipsoid; one with equal half axes is a ball, of any depth in closed form."""
    if len(set(shape.radii)) == 1:
        return PointCore(shape.radii[0], 0.0)
    return EllipsoidCore(np.array(shape.radii))


class HullCore(Core):
    """The convex hull of points."""

    def __init__(self, vertices: Floats) -> None:
        super().__init__(0.0, float(np.linalg.norm(vertices, axis=1).max()))
        self.vertices = np.ascontiguousarray(vertices)

    def place(self, R: Floats, p: Vector3) -> Core:
        super().place(R, p)
        self._rows = tuple((r[0], r[1], r[2]) for r in R.tolist())
        return self

    def support(self, n: Vector3) -> Vector3:
        a, b, c = self._rows
        local = np.array(
            (
                n[0] * a[0] + n[1] * b[0] + n[2] * c[0],
                n[0] * a[1] + n[1] * b[1] + n[2] * c[1],
                n[0] * a[2] + n[1] * b[2] + n[2] * c[2],
            )
        )
        u, v, w = self.vertices[self.vertices.dot(local).argmax()].tolist()
        x, y, z = self.p
        return (
            x + (u * a[0] + v * a[1] + w * a[2]),
            y + (u * b[0] + v * b[1] + w * b[2]),
            z + (u * c[0] + v * c[1] + w * c[2]),
        )

    def supports(self, n: Floats) -> Floats:
        # In blocks, because a hull of 100,000 vertices along 100 directions is 80 MB.
        block = max(1, 2_000_000 // len(self.vertices))
        local = n @ self.R
        parts = [np.argmax(local[k : k + block] @ self.vertices.T, axis=1) for k in range(0, len(n), block)]
        return np.asarray(self.p + self.vertices[np.concatenate(parts)] @ self.R.T)


def core_of(shape: object, name: str = "a shape") -> Core:
    """Return the core of a bounded convex shape, to be placed at a pose.

    Raises ArgumentError for anything that is not a bounded convex shape, and the errors of `Mesh.hull`.
    """
    if isinstance(shape, Sphere):
        return PointCore(shape.radius, 0.0)
    if isinstance(shape, Capsule):
        return SegmentCore(shape.radius, 0.5 * shape.length)
    if isinstance(shape, Box):
        return BoxCore(0.5 * np.array(shape.size))
    if isinstance(shape, Cylinder):
        return CylinderCore(shape.radius, 0.5 * shape.length)
    if isinstance(shape, Ellipsoid):
        return _core_of_ellipsoid(shape)
    if isinstance(shape, Mesh):
        return HullCore(shape.hull[0])
    if isinstance(shape, Hull):
        return HullCore(shape.points)
    raise ArgumentError(
        f"{name} is {shown(shape)}; wanted a Box, Sphere, Cylinder, Capsule, Ellipsoid, Mesh, Hull or Plane"
    )
