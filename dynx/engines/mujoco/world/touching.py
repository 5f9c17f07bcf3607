"""Contacts and nearest points of MuJoCo in the convention of dynx: the normal goes from b to a."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.spatial.scalar import Floats
from dynx.steppers.stepper import TouchingPoint

NEAR = 1e-9
"""Distance [m] below which the direction between two points is rounding."""

NUDGE = 1e-5
"""Displacement [m] by which two shapes that just touch are separated to find their normal."""


def read_contacts(
    model: Any, data: Any, geom_collider: tuple[int, ...], *, forces: bool
) -> list[TouchingPoint]:
    """Return the contacts that `data` holds, with the forces of the last step if `forces`."""
    found = []
    force = np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        first, second = contact.geom
        # MuJoCo's normal goes from the first geom to the second, and the force acts on the second.
        frame = contact.frame.reshape(3, 3)
        normal, distance = -frame[0], float(contact.dist)
        half = 0.5 * distance * frame[0]
        along, friction = 0.0, np.zeros(3)
        if forces and contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, number, force)
            along, friction = float(force[0]), -(force[1] * frame[1] + force[2] * frame[2])
        found.append(
            TouchingPoint(
                geom_collider[first],
                geom_collider[second],
                contact.pos - half,
                contact.pos + half,
                normal,
                distance,
                along,
                friction,
            )
        )
    return found


def closest_of(
    model: Any, data: Any, a: Iterable[int], b: Iterable[int], within: float
) -> tuple[Floats, Floats, Floats, float] | None:
    """Return the nearest points of two sets of geoms on a and on b, the normal and the distance.

    Returns None if all are farther apart than `within` [m]. The positions of the geoms in `data` must be
    current.
    """
    best, pair, points, segment = within, None, np.zeros(6), np.zeros(6)
    for first in a:
        for second in b:
            distance = mujoco.mj_geomDistance(model, data, first, second, best + NEAR, segment)
            if distance <= best:
                best, pair, points = float(distance), (first, second), segment.copy()
    if pair is None:
        return None
    difference = points[:3] - points[3:]
    length = float(np.linalg.norm(difference))
    if length > NEAR:
        normal = difference / (length if best > 0.0 else -length)
    else:
        normal = _normal_by_nudging(model, data, *pair)
    return points[:3], points[3:], normal, best


def _normal_by_nudging(model: Any, data: Any, a: int, b: int) -> Floats:
    """Return the normal of two geoms that just touch, by moving one of them away from the other."""
    plane = int(mujoco.mjtGeom.mjGEOM_PLANE)
    for geom, sign in ((a, -1.0), (b, 1.0)):
        if model.geom_type[geom] == plane:
            return np.asarray(sign * data.geom_xmat[geom].reshape(3, 3)[:, 2])
    away = data.geom_xpos[a] - data.geom_xpos[b]
    length = float(np.linalg.norm(away))
    away = away / length if length > NEAR else np.array([0.0, 0.0, 1.0])
    kept, segment = data.geom_xpos[a].copy(), np.zeros(6)
    data.geom_xpos[a] += NUDGE * away
    distance = mujoco.mj_geomDistance(model, data, a, b, 1.0, segment)
    data.geom_xpos[a] = kept
    difference = segment[:3] - segment[3:]
    size = float(np.linalg.norm(difference))
    if size <= NEAR:
        return away
    return np.asarray(difference / (size if distance > 0.0 else -size))
