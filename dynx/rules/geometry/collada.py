"""Points of a COLLADA file, placed as its scene places them.

COLLADA 1.4.1: <unit> scales; <node>s nest, with <matrix>, <translate>, <rotate> and <scale> applied in
document order; <instance_geometry> places a mesh. Some loaders rotate a file whose <up_axis> is not z and
some do not, so the points of both readings are returned. A file with other elements that move points (skins,
<lookat>, <skew>, nodes of other files) is not read, so that no box is too small.

A few lines can describe a scene of any size (a node that places another twice, which places a third twice,
and so on), so MAX_NODES and MAX_POINTS bound the work.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError
from dynx.model.xml.reading import Element, read_xml
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_about

MAX_NODES = 100_000
"""Largest number of nodes of a scene, counted as often as they are placed."""

MAX_POINTS = 10_000_000
"""Largest number of points of a scene, counted as often as they are placed."""

_DEEPEST = 50
_LARGEST_STRIDE = 1000
_TO_Z_UP = {
    "Y_UP": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
    "X_UP": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
}
_UNREADABLE = frozenset({"lookat", "skew", "instance_controller"})
_MOVING = frozenset({"matrix", "translate", "rotate", "scale"})
_WITH_TEXT = {"float_array", "up_axis", *_MOVING}
_LAYOUT = (("stride", "1"), ("offset", "0"))
"""Attributes of an <accessor> with their defaults."""

_NUMBER = re.compile(r"\S+")


def collada_points(data: bytes, *, by_bullet: bool = False) -> Floats | None:
    """Return all points of the scene (n, 3) [m]; None where the file has elements that are not supported.

    They include those of the scene rotated so that its up axis is z. With `by_bullet` they are those that
    PyBullet loads: of triangles and lists of polygons, in the scene as it is written.
    """
    prefix = re.search(rb"<(\w+:)COLLADA\b", data[:1000])
    names = "" if prefix is None else prefix.group(1).decode("ascii", "replace")
    try:
        with_text = {f"{names}{tag}" for tag in (*_WITH_TEXT, *(("p",) if by_bullet else ()))}
        scene = _Scene(read_xml(data, "<mesh>", [], with_text=with_text), faces_only=by_bullet)
        found = [points @ T[:3, :3].T + T[:3, 3] for points, T in scene.placed()]
    except (_NotSupported, DescriptionError, ValueError):
        return None
    if not found:
        return None
    points = scene.unit * np.concatenate(found)
    R = None if by_bullet else _TO_Z_UP.get(scene.up_axis)
    return points if R is None else np.concatenate([points, points @ np.array(R).T])


Rows = NDArray[np.intp]


class _NotSupported(Exception):
    """An unsupported element, or a scene larger than the bounds."""


class _Scene:
    def __init__(self, root: Element, *, faces_only: bool) -> None:
        self._faces_only = faces_only
        self._by_id: dict[str, Element] = {}
        for element in _all_below(root):
            element.tag = element.tag.rpartition(":")[2]
            self._by_id.setdefault(element.attributes.get("id", ""), element)
        unit, up_axis = _first(root, "asset", "unit"), _first(root, "asset", "up_axis")
        self.unit = float(unit.attributes.get("meter", "1")) if unit is not None else 1.0
        self.up_axis = ("" if up_axis is None else up_axis.text).strip() or "Y_UP"
        self._root = root
        self._nodes, self._points_placed = 0, 0
        self._points_of: dict[int, Floats] = {}

    def placed(self) -> Iterator[tuple[Floats, Floats]]:
        """Yield the points of each mesh, and its pose (4, 4) in the scene, scale included."""
        for scene in _path(self._root, "library_visual_scenes", "visual_scene"):
            for node in scene.all("node"):
                yield from self._of_node(node, np.eye(4), 0)

    def _of_node(self, node: Element, T: Floats, depth: int) -> Iterator[tuple[Floats, Floats]]:
        self._nodes += 1
        if depth > _DEEPEST or self._nodes > MAX_NODES:
            raise _NotSupported
        for child in node.children:
            if child.tag in _UNREADABLE:
                raise _NotSupported
            if child.tag in _MOVING:
                T = T @ _transform(child)
        for instance in node.all("instance_geometry"):
            points = self._points(self._target(instance, "url"))
            self._points_placed += len(points)
            if self._points_placed > MAX_POINTS:
                raise _NotSupported
            yield points, T
        for instance in node.all("instance_node"):
            yield from self._of_node(self._target(instance, "url"), T, depth + 1)
        for below in node.all("node"):
            yield from self._of_node(below, T, depth + 1)

    def _points(self, geometry: Element) -> Floats:
        inputs = _path(geometry, "mesh", "vertices", "input")
        sources = [each for each in inputs if each.attributes.get("semantic") == "POSITION"]
        if len(sources) != 1:
            raise _NotSupported
        source = self._target(sources[0], "source")
        # Many geometries may share one source.
        if id(source) not in self._points_of:
            self._points_of[id(source)] = _positions(source)
        points = self._points_of[id(source)]
        if not self._faces_only:
            return points
        # A geometry may be placed many times.
        if id(geometry) not in self._points_of:
            self._points_of[id(geometry)] = points[_rows_of_faces(geometry, len(points))]
        return self._points_of[id(geometry)]

    def _target(self, element: Element, attribute: str) -> Element:
        reference = element.attributes.get(attribute, "")
        target = self._by_id.get(reference[1:])
        if not reference.startswith("#") or target is None:
            raise _NotSupported
        return target


def _rows_of_faces(geometry: Element, count: int) -> Rows:
    """Return the numbers of the points, `count` in all, that triangles and lists of polygons use."""
    used = [np.zeros(0)]
    for kind in ("triangles", "polylist"):
        for primitive in _path(geometry, "mesh", kind):
            columns = {each.attributes.get("semantic"): each for each in primitive.all("input")}
            offsets = [int(each.attributes.get("offset", "0")) for each in primitive.all("input")]
            if "VERTEX" not in columns or min(offsets) < 0:
                raise _NotSupported
            column = int(columns["VERTEX"].attributes.get("offset", "0"))
            used += [_numbers(indices)[column :: 1 + max(offsets)] for indices in primitive.all("p")]
    rows = np.unique(np.concatenate(used).astype(np.intp))
    if rows.size and not 0 <= rows[0] <= rows[-1] < count:
        raise _NotSupported
    return rows


def _positions(source: Element) -> Floats:
    array, accessor = _first(source, "float_array"), _first(source, "technique_common", "accessor")
    if array is None or accessor is None:
        raise _NotSupported
    numbers = _numbers(array)
    stride, offset = (int(accessor.attributes.get(key, default)) for key, default in _LAYOUT)
    if not (3 <= stride <= _LARGEST_STRIDE and 0 <= offset <= len(numbers)):
        raise _NotSupported
    rows = (len(numbers) - offset) // stride
    return numbers[offset : offset + rows * stride].reshape(rows, stride)[:, :3]


def _numbers(element: Element) -> Floats:
    return np.fromiter((float(each.group()) for each in _NUMBER.finditer(element.text)), np.float64)


def _all_below(root: Element) -> Iterator[Element]:
    waiting = [root]
    while waiting:
        element = waiting.pop()
        yield element
        waiting.extend(element.children)


def _path(element: Element, *tags: str) -> list[Element]:
    found = [element]
    for tag in tags:
        found = [child for each in found for child in each.all(tag)]
    return found


def _first(element: Element, *tags: str) -> Element | None:
    return next(iter(_path(element, *tags)), None)


def _transform(element: Element) -> Floats:
    """Return the matrix (4, 4) of one element that moves points."""
    numbers = _numbers(element)
    if element.tag == "matrix":
        return numbers.reshape(4, 4)
    T = np.eye(4)
    if element.tag == "translate":
        T[:3, 3] = numbers.reshape(3)
    elif element.tag == "scale":
        T[:3, :3] = np.diag(numbers.reshape(3))
    else:
        x, y, z, angle_deg = numbers.tolist()
        axis = np.array([x, y, z])
        T[:3, :3] = rotation_about(axis / np.linalg.norm(axis), np.asarray(np.radians(angle_deg)))
    return T
