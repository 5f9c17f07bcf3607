"""Nearest points of two shapes as Drake computes them."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats


def closest_of_pair(query: Any, a: Any, b: Any) -> tuple[Floats, Floats, Floats, float]:
    """Return the nearest points of two geometries of Drake, the normal from b to a, and the distance."""
    found = query.ComputeSignedDistancePairClosestPoints(a, b)
    point_a = query.GetPoseInWorld(found.id_A).multiply(found.p_ACa)
    point_b = query.GetPoseInWorld(found.id_B).multiply(found.p_BCb)
    normal = np.array(found.nhat_BA_W)
    if found.id_A != a:
        point_a, point_b, normal = point_b, point_a, -normal
    return np.array(point_a), np.array(point_b), normal, float(found.distance)
