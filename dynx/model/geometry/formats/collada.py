"""Points and triangles of a COLLADA file, placed as its scene places them.

COLLADA 1.4.1: <unit> scales; <node>s nest, with <matrix>, <translate>, <rotate> and <scale> applied in
document order; <instance_geometry> places a mesh. Triangles have the axes of the file whatever its <up_axis>,
as in PyBullet, Pinocchio and RViz; other loaders rotate, so `collada_points` returns the points of both
readings. A file with other elements that move points (skins, <lookat>, <skew>, nodes of other files) is not
read, so that no mesh has the wrong size.

A few lines can describe a scene of any size (a node that places another twice, which places a third twice,
and so on), so MAX_NODES and MAX_POINTS bound the work.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError, shown
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
_WITH_TEXT = frozenset({"float_array", "up_axis", *_MOVING})
_SURFACES = ("triangles", "polylist", "polygons", "trifans", "tristrips")
_OF_BULLET = ("triangles", "polylist")
_DIGITS_AND_SPACES = b"0123456789 \t\r\n"
_LAYOUT = (("stride", "1"), ("offset", "0"))
"""Attributes of an <accessor> with their defaults."""


def collada_points(data: bytes, *, by_bullet: bool = False) -> Floats | None:
    """Return all points of the scene (n, 3) [m]; None where the file has elements that are not supported.

    They include those of the scene rotated so that its up axis is z. With `by_bullet` they are those that
    PyBullet loads: of triangles and lists of polygons, in the scene as it is written.
    """
    try:
        with_text = _tags(data, _WITH_TEXT | {"p"} if by_bullet else _WITH_TEXT)
        scene = _ColladaScene(read_xml(data, "<mesh>", [], with_text=with_text))
        points_of = scene.points_of_faces if by_bullet else scene.points
        found = [points_of(geometry) @ T[:3, :3].T + T[:3, 3] for geometry, T in scene.placed()]
    except (_NotSupported, DescriptionError, ValueError):
        return None
    if not found:
        return None
    points = scene.unit * np.concatenate(found)
    R = None if by_bullet else _TO_Z_UP.get(scene.up_axis)
    return points if R is None else np.concatenate([points, points @ np.array(R).T])


def collada_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of the scene; polygons are divided into fans.

    Raises ValueError, with the reason, for a file that is damaged or has elements that are not supported.
    """
    try:
        scene = _ColladaScene(
            read_xml(data, "<mesh>", [], with_text=_tags(data, _WITH_TEXT | {"p", "vcount"}))
        )
        vertices, faces, count, placed = [np.zeros((0, 3))], [np.zeros((0, 3), np.intp)], 0, 0
        for geometry, T in scene.placed():
            points = scene.points(geometry)
            # A mirrored triangle is seen from behind.
            order = -1 if np.linalg.det(T[:3, :3]) < 0.0 else 1
            for primitive in _primitives(geometry, _SURFACES):
                faces.append(_triangles(primitive, len(points))[:, ::order] + count)
                placed += len(faces[-1])
                if placed > MAX_POINTS:
                    raise _NotSupported(f"it places more than {MAX_POINTS} triangles")
            vertices.append(points @ T[:3, :3].T + T[:3, 3])
            count += len(points)
    except _NotSupported as error:
        raise ValueError(str(error)) from None
    except DescriptionError as error:
        raise ValueError(error.message) from None
    return scene.unit * np.concatenate(vertices), np.concatenate(faces)


def _tags(data: bytes, names: Iterable[str]) -> set[str]:
    """Return the tags as the file writes them, with its prefix."""
    prefix = re.search(rb"<(\w+:)COLLADA\b", data[:1000])
    before = "" if prefix is None else prefix.group(1).decode("ascii", "replace")
    return {f"{before}{name}" for name in names}


Rows = NDArray[np.intp]


class _NotSupported(Exception):
    """An unsupported element, or a scene larger than the bounds; the text gives the reason."""


class _ColladaScene:
    def __init__(self, root: Element) -> None:
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

    def placed(self) -> Iterator[tuple[Element, Floats]]:
        """Yield each placed geometry, and its pose (4, 4) in the scene, scale included."""
        for scene in _path(self._root, "library_visual_scenes", "visual_scene"):
            for node in scene.all("node"):
                yield from self._of_node(node, np.eye(4), 0)

    def _of_node(self, node: Element, T: Floats, depth: int) -> Iterator[tuple[Element, Floats]]:
        self._nodes += 1
        if depth > _DEEPEST or self._nodes > MAX_NODES:
            raise _NotSupported(f"its nodes are more than {MAX_NODES}, or nested deeper than {_DEEPEST}")
        for child in node.children:
            if child.tag in _UNREADABLE:
                raise _NotSupported(f"<{child.tag}> is not supported")
            if child.tag in _MOVING:
                T = T @ _transform(child)
        for instance in node.all("instance_geometry"):
            geometry = self._target(instance, "url")
            self._points_placed += len(self.points(geometry))
            if self._points_placed > MAX_POINTS:
                raise _NotSupported(f"it places more than {MAX_POINTS} points")
            yield geometry, T
        for instance in node.all("instance_node"):
            yield from self._of_node(self._target(instance, "url"), T, depth + 1)
        for below in node.all("node"):
            yield from self._of_node(below, T, depth + 1)

    def points(self, geometry: Element) -> Floats:
        """Return the points (n, 3) of a geometry."""
        inputs = _path(geometry, "mesh", "vertices", "input")
        sources = [each for each in inputs if each.attributes.get("semantic") == "POSITION"]
        if len(sources) != 1:
            raise _NotSupported("a geometry has no mesh with one source of positions")
        source = self._target(sources[0], "source")
        # Many geometries may share one source.
        if id(source) not in self._points_of:
            self._points_of[id(source)] = _positions(source)
        return self._points_of[id(source)]

    def points_of_faces(self, geometry: Element) -> Floats:
        """Return the points of a geometry that triangles and lists of polygons use, as PyBullet loads it."""
        # A geometry may be placed many times.
        if id(geometry) not in self._points_of:
            points = self.points(geometry)
            used = [_vertex_rows(each, len(points)) for each in _primitives(geometry, _OF_BULLET)]
            rows = np.unique(np.concatenate([np.zeros(0, np.intp), *(row for p in used for row in p)]))
            self._points_of[id(geometry)] = points[rows]
        return self._points_of[id(geometry)]

    def _target(self, element: Element, attribute: str) -> Element:
        reference = element.attributes.get(attribute, "")
        target = self._by_id.get(reference[1:])
        if not reference.startswith("#") or target is None:
            raise _NotSupported(f"<{element.tag}> leads to {shown(reference)}, which is not in the file")
        return target


def _primitives(geometry: Element, kinds: Iterable[str]) -> Iterator[Element]:
    for kind in kinds:
        yield from _path(geometry, "mesh", kind)


def _vertex_rows(primitive: Element, count: int) -> list[Rows]:
    """Return the numbers of the points, `count` in all, in each list of a primitive."""
    columns = {each.attributes.get("semantic"): each for each in primitive.all("input")}
    offsets = [int(each.attributes.get("offset", "0")) for each in primitive.all("input")]
    if "VERTEX" not in columns or min(offsets) < 0:
        raise _NotSupported(f"<{primitive.tag}> has no input of vertices")
    column = int(columns["VERTEX"].attributes.get("offset", "0"))
    lists = [_whole_numbers(indices)[column :: 1 + max(offsets)] for indices in primitive.all("p")]
    for rows in lists:
        if not ((rows >= 0) & (rows < count) & (rows == np.floor(rows))).all():
            raise _NotSupported(
                f"<{primitive.tag}> names a point that is not among the {count} of its source"
            )
    return [rows.astype(np.intp) for rows in lists]


def _triangles(primitive: Element, count: int) -> Rows:
    """Return the triangles (m, 3) of a primitive over `count` points."""
    if primitive.all("ph"):
        raise _NotSupported("polygons with holes are not supported")
    lists = _vertex_rows(primitive, count)
    rows = np.concatenate([np.zeros(0, np.intp), *lists])
    if primitive.tag == "triangles":
        corners = np.full(len(rows) // 3, 3)
    elif primitive.tag == "polylist":
        numbers = [_whole_numbers(each) for each in primitive.all("vcount")]
        given = np.concatenate([np.zeros(0, np.int64), *numbers])
        # A number too large for what counts the corners would come out as another.
        if not ((given >= 0) & (given <= len(rows)) & (given == np.floor(given))).all():
            raise _NotSupported(
                f"<{primitive.tag}> has a polygon whose number of corners is none of 0 to {len(rows)}"
            )
        corners = given.astype(np.intp)
    else:
        corners = np.array([len(each) for each in lists], np.intp)
    if corners.sum() != len(rows):
        raise _NotSupported(f"<{primitive.tag}> has {len(rows)} corners, not {corners.sum()}")
    fans = np.maximum(corners - 2, 0)
    first = np.repeat(np.cumsum(corners) - corners, fans)
    within = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    if primitive.tag != "tristrips":
        corner = np.stack([first, first + within + 1, first + within + 2], axis=-1)
    else:
        odd = within % 2
        corner = first[:, None] + np.stack([within, within + 1 + odd, within + 2 - odd], axis=-1)
    return np.asarray(rows[corner], np.intp)


def _positions(source: Element) -> Floats:
    array, accessor = _first(source, "float_array"), _first(source, "technique_common", "accessor")
    if array is None or accessor is None:
        raise _NotSupported("a source of positions has no array or no accessor")
    numbers = _numbers(array)
    stride, offset = (int(accessor.attributes.get(key, default)) for key, default in _LAYOUT)
    if not (3 <= stride <= _LARGEST_STRIDE and 0 <= offset <= len(numbers)):
        raise _NotSupported(f"an accessor has the stride {stride} and the offset {offset}")
    rows = (len(numbers) - offset) // stride
    return numbers[offset : offset + rows * stride].reshape(rows, stride)[:, :3]


def _numbers(element: Element) -> Floats:
    return np.fromiter(map(float, element.text.split()), np.float64)


def _whole_numbers(element: Element) -> Floats | NDArray[np.int64]:
    """Return the numbers of a list that should hold only whole ones, of which most of a file consists."""
    text = element.text.encode()
    # NumPy reads them ten times faster than Python, but not every version says where it stopped to read, and
    # it reads a number where there is none.
    if text.strip() and not text.translate(None, _DIGITS_AND_SPACES):
        return np.fromstring(text, np.int64, sep=" ")
    return _numbers(element)


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
