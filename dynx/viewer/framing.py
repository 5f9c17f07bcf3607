"""What the camera sees at the start: the box around a motion or a state, and whether there is a ground."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from dynx.errors import DynxError
from dynx.model.geometry import HeightField, Plane
from dynx.spatial.scalar import Floats
from dynx.viewer.surfaces.triangles import triangles_of
from dynx.world.scene import SceneBody

_INNER = (0.1, 0.9)
"""Shares of the places of parts along an axis between which those lie that a camera has to see."""


def box_around(poses: Mapping[str, Floats], bodies: Iterable[SceneBody] = ()) -> tuple[Floats, Floats]:
    """Return the lower and the upper corner (3,) [m] of a box in which most of a motion happens.

    `poses` (n, 4, 4) are those of parts at n times, and `bodies` the parts whose shapes count; of the links
    of robots the origins do. The box holds all parts at the start, and along each axis all of their later
    places but the outer tenth at each end: a ball that rolls away does not make everything else small. Bodies
    that are fixed do not count where others are.
    """
    if not poses:
        return np.zeros(3), np.zeros(3)
    given = {body.name: body for body in bodies if body.name in poses}
    # A floor may be of any size.
    poses = {name: T for name, T in poses.items() if name not in given or not given[name].fixed} or poses
    radii = {name: _radius(given[name]) for name in poses if name in given and not given[name].fixed}
    lower, upper = (
        np.array([T[:, :3, 3] + sign * radii.get(name, 0.0) for name, T in poses.items()])
        for sign in (-1.0, 1.0)
    )
    low, high = np.quantile(lower, _INNER[0], axis=(0, 1)), np.quantile(upper, _INNER[1], axis=(0, 1))
    return np.minimum(lower[:, 0].min(axis=0), low), np.maximum(upper[:, 0].max(axis=0), high)


def has_ground(bodies: Iterable[SceneBody]) -> bool:
    """Check whether a body is a ground: a plane or a height field."""
    return any(isinstance(placed.shape, Plane | HeightField) for body in bodies for placed in body.shapes)


def _radius(body: SceneBody) -> float:
    """Return the radius of the ball around the origin of a body that holds its shapes [m]."""
    largest = 0.0
    for placed in body.shapes:
        try:
            vertices = triangles_of(placed.shape).vertices
        except DynxError:
            continue
        T = placed.origin.matrix
        largest = max(largest, float(np.linalg.norm(vertices @ T[:3, :3].T + T[:3, 3], axis=1).max()))
    return largest
