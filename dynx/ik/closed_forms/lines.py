"""Geometry of the axes of a chain: parallel axes, common points, and feet of common normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines in space: unit directions (n, 3) and a point on each (n, 3)."""

    axes: Floats
    points: Floats

    def reversed(self) -> Lines:
        """Return the lines of the inverse motion: in the opposite order and direction.

        (E_1 ... E_n)^-1 = E_n^-1 ... E_1^-1, and E_i^-1 turns by the same angle about the opposite axis.
        """
        return Lines(-self.axes[::-1], self.points[::-1])


def angle_between(a: Floats, b: Floats) -> float:
    """Return the angle [rad] between two lines along a and b, from 0 to pi/2."""
    return float(np.arctan2(np.linalg.norm(cross(a, b)), abs(a @ b)))


def along(a: Floats, b: Floats) -> Floats:
    """Return a, or -a if that is nearer to b: for directions that are to become parallel."""
    return a if a @ b >= 0.0 else -a


def common_point(lines: Lines) -> tuple[Floats, float]:
    """Return the point nearest to all lines in the least-squares sense, and its largest distance."""
    across = np.eye(3) - lines.axes[:, :, None] * lines.axes[:, None, :]
    A, b = across.sum(axis=0), (across @ lines.points[:, :, None])[..., 0].sum(axis=0)
    x = np.linalg.lstsq(A, b, rcond=1e-9)[0]
    distances = np.linalg.norm((across @ (x - lines.points)[:, :, None])[..., 0], axis=-1)
    return x, float(distances.max())


def normal_feet(a: Floats, p: Floats, b: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Return the feet, on the lines (a, p) and (b, q), of their common normal.

    For parallel lines it is the normal through p.
    """
    n = cross(a, b)
    square = float(n @ n)
    if square < 1e-18:
        return p, q + b * float(b @ (p - q))
    d = q - p
    return p + a * float(cross(d, b) @ n) / square, q + b * float(cross(d, a) @ n) / square
