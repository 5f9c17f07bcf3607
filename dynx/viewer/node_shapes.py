"""Nodes of the page as surfaces and words of a picture: marks, arrows, lines and text beside the parts."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from dynx.model.geometry import Cylinder, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.steppers.camera import Camera, DrawnShape, DrawnTriangles
from dynx.viewer.library import nodes_by_path
from dynx.viewer.page import Page

_SIDES = 16
"""Number of sides of arrows."""

_DOT = 3.0
"""Radius of the smallest dot [pixels]."""

_PARTS = re.compile(r"/(motion|second|robot|world)(/.*)?/(visual|shape|stick)\d+$|/(handle|spring|ground)\b")
"""Paths of what a picture draws otherwise, or leaves out: shapes of parts, handles and the ground."""

_AXES = ((0.90, 0.05, 0.05), (0.05, 0.65, 0.05), (0.05, 0.20, 0.95))
"""Colours of the x, y and z axes of frames."""

_AXES_LEGEND = "x red, y green, z blue"

_LEGENDS = {
    "/inertia_ellipsoid": "ellipsoids: inertia of the links",
    "/inertia_box": "boxes: inertia of the links",
    "/center": "balls: centres of mass",
}
"""What marks mean, by the ends of their paths."""

Colour = tuple[float, float, float, float]


class Words(NamedTuple):
    """Text beside a point (3,) in the world."""

    text: str
    point: Floats
    colour: str | None = None
    """Colour as CSS writes it; without one the text has a border, as names of parts."""
    size: float | None = None
    """Size of the letters [pixels]."""


class NodeShapes(NamedTuple):
    """Shapes and texts in a picture for the nodes of a page."""

    shapes: tuple[DrawnShape, ...] = ()
    words: tuple[Words, ...] = ()
    axes: tuple[DrawnShape, ...] = ()
    """Axes of frames, which are seen through the parts in which they lie."""
    legends: tuple[str, ...] = ()
    """What marks and their colours mean, for the caption."""


def node_shapes(page: Page, camera: Camera, *, collisions: bool = False) -> NodeShapes:
    """Return what is seen on a page beside the visual shapes of parts, for a picture of a camera.

    `collisions` are the collision shapes that are seen at the same time as visual shapes.
    """
    nodes = nodes_by_path(page.server)
    poses: dict[str, Floats | None] = {"": np.eye(4)}

    def pose_of(path: str) -> Floats | None:
        """Return the pose (4, 4) of a node in the world; None for one that is not seen."""
        if path not in poses:
            above = pose_of(path.rpartition("/")[0])
            node = nodes.get(path)
            if above is None or node is None:
                poses[path] = above
            elif not node.visible:
                poses[path] = None
            else:
                w, x, y, z = np.asarray(node.wxyz, dtype=np.float64)
                R = rotation_from_quat(np.array([x, y, z, w]))
                poses[path] = above @ np.asarray(homogeneous(R, np.asarray(node.position, dtype=np.float64)))
        return poses[path]

    shapes: list[DrawnShape] = []
    words: list[Words] = []
    axes: list[DrawnShape] = []
    legends: dict[str, None] = {}
    for path, node in nodes.items():
        if _PARTS.search(path) or ("/collision" in path and not collisions):
            continue
        T = pose_of(path)
        if T is None:
            continue
        if isinstance(getattr(node, "text", None), str):
            words.append(Words(node.text, T[:3, 3]))
        else:
            (axes if hasattr(node, "axes_length") else shapes).extend(_surfaces(node, T, camera))
            legends.update((legend, None) for end, legend in _LEGENDS.items() if path.endswith(end))
    if axes:
        legends[_AXES_LEGEND] = None
    return NodeShapes(tuple(shapes), tuple(words), tuple(axes), tuple(legends))


def _surfaces(node: Any, T: Floats, camera: Camera) -> Iterator[DrawnShape]:
    """Yield the surfaces of a node at the pose T (4, 4); none for a kind that has none, such as a light."""

    def drawn(shape: Any, colour: Colour, pose: Floats = T) -> DrawnShape:
        return DrawnShape(0, shape, colour, pose, painted=False)

    if hasattr(node, "shaft_radius"):
        for ends, colour in zip(node.points, _colours(node.colors, len(node.points)), strict=True):
            yield drawn(arrow(ends, node.shaft_radius, node.head_radius, node.head_length), colour)
    elif hasattr(node, "vertices"):
        opacity = 1.0 if node.opacity is None else float(node.opacity)
        vertices = np.asarray(node.vertices, dtype=np.float64) * np.asarray(node.scale)
        red, green, blue = _rgb(node.color)
        faces = np.asarray(node.faces, dtype=np.intp)
        yield drawn(DrawnTriangles(vertices, faces), (red, green, blue, opacity))
    elif hasattr(node, "thickness"):
        # `thickness` is the width of lines, in metres or in pixels.
        for ends, colour in zip(node.points, _colours(node.colors, len(node.points)), strict=True):
            radius = 0.5 * float(node.thickness)
            if node.thickness_units == "screen":
                radius *= _pixel_at(T[:3, :3] @ np.mean(ends, axis=0) + T[:3, 3], camera)
            yield drawn(arrow(ends, radius, 0.0, 0.0), colour)
    elif hasattr(node, "point_size"):
        for point, colour in zip(node.points, _colours(node.colors, len(node.points)), strict=True):
            place = T @ np.asarray(homogeneous(np.eye(3), np.asarray(point, dtype=np.float64)))
            radius = max(0.5 * float(node.point_size), _DOT * _pixel_at(place[:3, 3], camera))
            yield drawn(Sphere(radius), colour, place)
    elif hasattr(node, "subdivisions"):
        yield drawn(Sphere(float(node.radius)), (*_rgb(node.color), 1.0))
    elif hasattr(node, "axes_length") and node.show_axes:
        length, radius = float(node.axes_length), float(node.axes_radius)
        for k, axis in enumerate(np.eye(3)):
            R = np.roll(np.eye(3), (k - 2) % 3, axis=0)
            pose = T @ np.asarray(homogeneous(R, 0.5 * length * axis))
            yield drawn(Cylinder(radius, length), (*_AXES[k], 1.0), pose)


def _pixel_at(point: Floats, camera: Camera) -> float:
    """Return the extent of a pixel [m] at a point (3,) in the world."""
    T = camera.pose.matrix
    return abs(float(T[:3, 2] @ (point - T[:3, 3]))) / camera.focal_length


def _rgb(colour: Any) -> tuple[float, float, float]:
    red, green, blue = (np.asarray(colour, dtype=np.float64) / 255.0).tolist()
    return red, green, blue


def _colours(colours: Any, count: int) -> list[Colour]:
    """Return the colours of `count` arrows, lines or points; those of the ends of a line are their mean."""
    given = np.asarray(colours, dtype=np.float64) / 255.0
    if given.ndim == 3:
        given = given.mean(axis=1)
    return [(*each, 1.0) for each in np.broadcast_to(given, (count, 3)).tolist()]


def arrow(ends: Floats, shaft: float, head: float, length: float) -> DrawnTriangles:
    """Return an arrow between its ends (2, 3) [m], with the radii of its shaft and its head, and the length
    of the head [m]; a shaft alone for a head without length."""
    tail, tip = np.asarray(ends, dtype=np.float64)
    whole = float(np.linalg.norm(tip - tail))
    along = (tip - tail) / whole if whole > 0.0 else np.array([0.0, 0.0, 1.0])
    across = np.linalg.svd(along[None])[2][1:]
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    ring = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    # A short arrow is a short head.
    neck = max(whole - length, 0.0) if length > 0.0 else whole
    vertices = [tail[None], tail + shaft * ring, tail + neck * along + shaft * ring]
    if length > 0.0:
        vertices.append(tail + neck * along + head * ring)
    rings = len(vertices) - 1
    vertices.append(tip[None])
    k, following = np.arange(_SIDES), np.roll(np.arange(_SIDES), -1)
    faces = [np.stack([np.zeros(_SIDES, np.intp), 1 + following, 1 + k], axis=1)]
    for each in range(rings - 1):
        low, high = 1 + each * _SIDES, 1 + (each + 1) * _SIDES
        faces.append(np.stack([low + k, low + following, high + k], axis=1))
        faces.append(np.stack([low + following, high + following, high + k], axis=1))
    last, end = 1 + (rings - 1) * _SIDES, 1 + rings * _SIDES
    faces.append(np.stack([last + k, last + following, np.full(_SIDES, end)], axis=1))
    return DrawnTriangles(np.concatenate(vertices), np.concatenate(faces).astype(np.intp))
