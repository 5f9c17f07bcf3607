"""Random shapes, and the distance of a point from a shape by textbook formulas."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from dynx.distance import ConvexShape, Hull
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

KINDS = ("Box", "Sphere", "Cylinder", "Capsule", "Ellipsoid", "Hull")


def sizes(least: float = 0.1, most: float = 1.0) -> st.SearchStrategy[float]:
    """Draw a size, half of them round."""
    return st.sampled_from([least, most]) | st.floats(least, most)


def shapes(least: float = 0.1, most: float = 1.0) -> st.SearchStrategy[ConvexShape]:
    """Draw a bounded convex shape of any kind."""
    size = sizes(least, most)
    return st.one_of(
        st.builds(Sphere, size),
        st.builds(lambda *edges: Box(edges), size, size, size),
        st.builds(Capsule, size, size),
        st.builds(Cylinder, size, size),
        st.builds(lambda *radii: Ellipsoid(radii), size, size, size),
        st.builds(hull, st.integers(4, 40), st.integers(0, 2**32 - 1), st.tuples(size, size, size)),
    )


def hull(count: int, seed: int, size: tuple[float, float, float]) -> Hull:
    """Return the hull of random points of a box."""
    return Hull(np.random.default_rng(seed).uniform(-0.5, 0.5, (count, 3)) * size)


def random_shape(rng: np.random.Generator, kind: str, low: float = -1.0, high: float = 0.0) -> ConvexShape:
    """Return a shape of a kind with sizes from 10^low to 10^high."""
    a, b, c = (10.0 ** rng.uniform(low, high, 3)).tolist()
    if kind == "Hull":
        return hull(int(rng.integers(4, 60)), int(rng.integers(2**32)), (a, b, c))
    made: dict[str, ConvexShape] = {
        "Box": Box((a, b, c)),
        "Sphere": Sphere(a),
        "Cylinder": Cylinder(a, b),
        "Capsule": Capsule(a, b),
        "Ellipsoid": Ellipsoid((a, b, c)),
    }
    return made[kind]


def random_pose(rng: np.random.Generator, reach: float) -> Floats:
    """Return a pose (4, 4) with a normally distributed position and any attitude."""
    quat = rng.normal(size=4)
    return homogeneous(rotation_from_quat(quat / np.linalg.norm(quat)), reach * rng.normal(size=3))


def point_distance(shape: ConvexShape, T: Floats, point: Floats) -> float:
    """Return the signed distance of a point from a ball, box, cylinder, capsule or ellipsoid."""
    p = T[:3, :3].T @ (point - T[:3, 3])
    if isinstance(shape, Sphere):
        return float(np.linalg.norm(p)) - shape.radius
    if isinstance(shape, Capsule):
        along = np.clip(p[2], -0.5 * shape.length, 0.5 * shape.length)
        return float(np.linalg.norm(p - [0.0, 0.0, along])) - shape.radius
    if isinstance(shape, Ellipsoid):
        return _from_ellipsoid(np.array(shape.radii), p)
    if isinstance(shape, Box):
        beyond = np.abs(p) - 0.5 * np.array(shape.size)
    else:
        assert isinstance(shape, Cylinder)
        beyond = np.array([np.hypot(p[0], p[1]) - shape.radius, abs(p[2]) - 0.5 * shape.length])
    outside = float(np.linalg.norm(np.maximum(beyond, 0.0)))
    return outside if outside > 0.0 else float(beyond.max())


def _from_ellipsoid(radii: Floats, p: Floats) -> float:
    """Return the signed distance of a point from an ellipsoid about the origin.

    The nearest point of the surface is r^2 p / (t + r^2) with the largest t for which it is on the surface:
    D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid" (2013).
    """
    squares, least = radii**2, float(radii.min() ** 2)

    def above(t: float) -> float:
        return float(np.sum((radii * p / (t + squares)) ** 2)) - 1.0

    low, high = -least * (1.0 - 1e-15), float(np.linalg.norm(radii) * np.linalg.norm(p)) + least
    if above(low) < 0.0:
        # The point is on the symmetry plane of the shortest axis, along which the nearest one lies.
        rest = squares > least
        nearest = np.where(rest, squares * p / np.where(rest, squares - least, 1.0), 0.0)
        height = np.sqrt(max(0.0, least * (1.0 - np.sum((nearest / radii) ** 2))))
        nearest[int(np.argmin(radii))] = height
        return -float(np.linalg.norm(nearest - p))
    for _ in range(200):
        t = 0.5 * (low + high)
        low, high = (t, high) if above(t) > 0.0 else (low, t)
    t = 0.5 * (low + high)
    distance = float(np.linalg.norm(t * p / (t + squares)))
    return distance if t > 0.0 else -distance
