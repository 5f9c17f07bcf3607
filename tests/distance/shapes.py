"""Random shapes, and the distance of a point from a shape by textbook formulas."""

from __future__ import annotations

import mpmath
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
    """Return the signed distance of a point from an ellipsoid about the origin, in 50 digits.

    The nearest point of the surface is r^2 p / (t + r^2) with the largest t for which it is on the surface:
    D. Eberly, "Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid" (2013).
    """
    with mpmath.workdps(50):
        squares, point = [mpmath.mpf(r) ** 2 for r in radii.tolist()], [mpmath.mpf(x) for x in p.tolist()]
        least = min(squares)
        pairs = [(s, x) for s, x in zip(squares, point, strict=True) if s > least or x]
        # Where the point is on the plane across the shortest axes, t may be at the end of its range.
        at_end = all(s > least for s, _ in pairs)
        if at_end and sum(s * x * x / (s - least) ** 2 for s, x in pairs) < 1:
            inside = sum(x * x * least**2 / (s - least) ** 2 for s, x in pairs)
            height = least * (1 - sum(s * x * x / (s - least) ** 2 for s, x in pairs))
            return -float(mpmath.sqrt(inside + height))
        low, high = -least, mpmath.norm(point) * mpmath.sqrt(max(squares)) + least
        for _ in range(220):
            t = (low + high) / 2
            above = sum(s * x * x / (t + s) ** 2 for s, x in pairs) > 1
            low, high = (t, high) if above else (low, t)
        distance = mpmath.norm([high * x / (high + s) for s, x in pairs])
        return float(mpmath.sign(high) * distance)
