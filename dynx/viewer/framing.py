"""What the camera sees at the start: the box around a motion or a state, and where it fits in the picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.geometry import HeightField, Plane, Shape
from dynx.model.geometry.links import link_shapes
from dynx.spatial.scalar import Floats
from dynx.viewer.triangles import triangles_of

if TYPE_CHECKING:
    from dynx.world.scene import SceneBody


VIEW_DIRECTION = np.array([1.0, -1.0, 0.7]) / math.sqrt(2.49)
"""Unit vector (3,) from what is seen to the camera."""

_INNER = (0.1, 0.9)
"""Shares of the places of parts along an axis between which those lie that a camera has to see."""

_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""Directions (8, 3) from the middle of a box to its corners."""

_UNSIZED = 0.5
"""Distance of the camera from a point [m]."""


class PartBox(NamedTuple):
    """A box along the axes of a part that holds its shapes."""

    middle: Floats
    """Place (3,) in the frame of the part [m]."""
    half: Floats
    """Half of its edges (3,) [m]."""


_POINT = PartBox(np.zeros(3), np.zeros(3))


def box_around(
    poses: Mapping[str, Floats], bodies: Iterable[SceneBody] = (), robots: Mapping[str, Model] | None = None
) -> tuple[Floats, Floats]:
    """Return the lower and the upper corner (3,) [m] of a box in which most of a motion happens.

    `poses` (n, 4, 4) are those of parts at n times; a part counts with its shapes if it is one of `bodies`
    or a link of `robots` (as ``robot/link``), and otherwise with its origin. The box holds all parts at the
    start, and along each axis all of their later places but the outer tenth at each end: a ball that rolls
    away does not make everything else small. Bodies that are fixed do not count where others are, and where
    all are fixed, planes do not.
    """
    if not poses:
        return np.zeros(3), np.zeros(3)
    given = {body.name: body for body in bodies if body.name in poses}
    # A floor may be of any size.
    floors = {name for name, body in given.items() if body.fixed}
    if not poses.keys() - floors:
        floors = {name for name in floors if has_plane(given[name])}
    poses = {name: T for name, T in poses.items() if name not in floors} or poses
    boxes = {name: _body_box(given[name]) for name in poses if name in given and name not in floors}
    for robot, model in (robots or {}).items():
        boxes |= {f"{robot}/{link}": box for link, box in link_boxes(model).items()}
    lower, upper = [], []
    for name, T in poses.items():
        box = boxes.get(name, _POINT)
        middle = T[:, :3, :3] @ box.middle + T[:, :3, 3]
        half = np.abs(T[:, :3, :3]) @ box.half
        lower.append(middle - half)
        upper.append(middle + half)
    least, most = np.array(lower), np.array(upper)
    low, high = np.quantile(least, _INNER[0], axis=(0, 1)), np.quantile(most, _INNER[1], axis=(0, 1))
    return np.minimum(least[:, 0].min(axis=0), low), np.maximum(most[:, 0].max(axis=0), high)


def link_boxes(model: Model) -> dict[str, PartBox]:
    """Return the box around the shapes by which each link is drawn; links without shapes have none."""
    boxes = {}
    for link in model.links:
        corners = [_corners(shape, T) for shape, _, T in link_shapes(model.geometry, link.name)]
        if corners:
            boxes[link.name] = _box(np.concatenate(corners))
    return boxes


def has_ground(bodies: Iterable[SceneBody]) -> bool:
    """Check whether a body is a ground: a plane or a height field."""
    return any(isinstance(placed.shape, Plane | HeightField) for body in bodies for placed in body.shapes)


def has_plane(body: SceneBody) -> bool:
    """Check whether a body has a shape without an end."""
    return any(isinstance(placed.shape, Plane) for placed in body.shapes)


def fitting_distance(low: Floats, high: Floats, across: float, upward: float) -> float:
    """Return the least distance [m] from the middle of a box at which a camera in the `VIEW_DIRECTION` sees
    all of its corners; `across` and `upward` are the tangents of half the angles that the box may take."""
    right = np.array([-VIEW_DIRECTION[1], VIEW_DIRECTION[0], 0.0]) / math.hypot(*VIEW_DIRECTION[:2])
    corners = 0.5 * (high - low) * _SIGNS
    nearer = corners @ VIEW_DIRECTION
    beside = np.abs(corners @ right) / across
    above = np.abs(corners @ np.cross(VIEW_DIRECTION, right)) / upward
    return float((nearer + np.maximum(beside, above)).max()) or _UNSIZED


def round_length(length: float) -> float:
    """Return the largest length of 1, 2 or 5 times a power of ten that is not greater [m]."""
    power = 10.0 ** math.floor(math.log10(length))
    return power * max(digit for digit in (1.0, 2.0, 5.0) if digit * power <= length or digit == 1.0)


def _body_box(body: SceneBody) -> PartBox:
    """Return the box around the shapes of a body; a point where one cannot be read."""
    try:
        return _box(np.concatenate([_corners(shape, T) for shape, _, T in body.drawn_shapes()]))
    except DynxError:
        return _POINT


def _corners(shape: Shape, T: Floats) -> Floats:
    """Return the corners (8, 3) of the box around a shape at the pose T (4, 4)."""
    middle, half = _shape_box(shape)
    placed: Floats = (middle + half * _SIGNS) @ T[:3, :3].T + T[:3, 3]
    return placed


@lru_cache(maxsize=256)
def _shape_box(shape: Shape) -> PartBox:
    return _box(triangles_of(shape).vertices.astype(np.float64))


def _box(points: Floats) -> PartBox:
    """Return the box around points (n, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    return PartBox(0.5 * (low + high), 0.5 * (high - low))
