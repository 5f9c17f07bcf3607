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
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.spatial.scalar import Floats
from dynx.viewer.triangles import triangles_of

if TYPE_CHECKING:
    from dynx.world import SceneBody


VIEW_DIRECTION = np.array([1.0, -1.0, 0.7]) / math.sqrt(2.49)
"""Unit vector (3,) from what is seen to the camera."""

SHARE = 0.72
"""Share of the picture that the boxes of the parts take at the start: what is seen of them then takes two
thirds."""

_INNER = (0.1, 0.9)
"""Shares of the places of parts along an axis between which those lie that a camera has to see."""

_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
"""Directions (8, 3) from the middle of a box to its corners."""

_MAX_TIMES = 60
"""Largest number of times at which the corners of a part count."""

_ROUNDING = 1e-9
"""Distance, relative to the coordinates of points, that is a rounding error."""

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
    bodies = tuple(bodies)
    boxes = _boxes(poses, bodies, robots)
    lower, upper = [], []
    for name, T in _moving(poses, bodies).items():
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


def _moving(poses: Mapping[str, Floats], bodies: Iterable[SceneBody]) -> Mapping[str, Floats]:
    """Return the poses of the parts that count."""
    # A floor may be of any size.
    floors = {body.name: body for body in bodies if body.fixed and body.name in poses}
    if not poses.keys() - floors.keys():
        floors = {name: body for name, body in floors.items() if has_plane(body)}
    return {name: T for name, T in poses.items() if name not in floors} or poses


def _boxes(
    poses: Mapping[str, Floats], bodies: Iterable[SceneBody], robots: Mapping[str, Model] | None
) -> dict[str, PartBox]:
    """Return the boxes of the parts that count, in their own frames."""
    moving = _moving(poses, bodies)
    given = {body.name: body for body in bodies if body.name in moving}
    boxes = {name: _body_box(body) for name, body in given.items() if not has_plane(body)}
    alike: dict[int, dict[str, PartBox]] = {}
    for robot, model in (robots or {}).items():
        # Many robots may have one model.
        if id(model) not in alike:
            alike[id(model)] = link_boxes(model)
        boxes |= {f"{robot}/{link}": box for link, box in alike[id(model)].items()}
    return boxes


def points_around(
    poses: Mapping[str, Floats], bodies: Iterable[SceneBody] = (), robots: Mapping[str, Model] | None = None
) -> Floats:
    """Return points (n, 3) [m] between which a motion happens: the corners of the boxes of its parts at some
    times, moved into the box of `box_around`, whose arguments these are."""
    bodies = tuple(bodies)
    low, high = box_around(poses, bodies, robots)
    found = [np.stack([low, high])] if not poses else []
    boxes = _boxes(poses, bodies, robots)
    for name, T in _moving(poses, bodies).items():
        box = boxes.get(name, _POINT)
        some = T[np.unique(np.linspace(0, len(T) - 1, min(len(T), _MAX_TIMES)).round().astype(np.intp))]
        corners = box.middle + box.half * _SIGNS
        found.append((corners @ some[:, :3, :3].swapaxes(1, 2) + some[:, None, :3, 3]).reshape(-1, 3))
    return np.clip(np.concatenate(found), low, high)


def fitted_view(
    points: Floats, across: float, upward: float, towards: Floats = VIEW_DIRECTION
) -> tuple[Floats, Floats]:
    """Return eye and target (3,) [m] of the nearest camera in a direction `towards` (3,) that sees all points
    (n, 3) [m] in the middle of its picture.

    `across` and `upward` are the tangents of half the angles that they may take. They reach the bounds of one
    of these angles, and of the other one alike on both sides."""
    right = np.array([-towards[1], towards[0], 0.0]) / math.hypot(*towards[:2])
    axes = np.stack([right, np.cross(towards, right), towards])
    x, y, z = axes @ points.T
    centre, distance = [], []
    for along, tangent in ((x, across), (y, upward)):
        # At a depth of c - z a point is seen where |along - centre| <= tangent (c - z).
        most, least = (along + tangent * z).max(), (along - tangent * z).min()
        centre.append(0.5 * (most + least))
        distance.append(0.5 * (most - least) / tangent)
    nearest = float(z.max())
    eye = np.array([*centre, max(distance)])
    if eye[2] - nearest <= _ROUNDING * float(np.abs(points).max()):
        eye[2] = nearest + _UNSIZED
    target = np.array([*centre, 0.5 * (nearest + float(z.min()))])
    return eye @ axes, target @ axes


def tile_for(low: Floats, high: Floats) -> float:
    """Return the edge of the tiles of the ground [m] below what stands in a box: a round length of about half
    its diagonal."""
    return round_length(0.5 * (float(np.linalg.norm(high - low)) or _UNSIZED))


def ground_height(low: Floats, robots: Mapping[str, Model]) -> float:
    """Return the height [m] of the ground that is added below what stands in a box with the lower corner
    `low`: at its lower end, but not above the base of a robot that is fixed."""
    fixed = any(not model.floating for model in robots.values())
    return min(float(low[2]), 0.0) if fixed else float(low[2])


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
