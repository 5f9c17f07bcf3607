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
from urllib.parse import unquote, urlsplit

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError, shown
from dynx.model.geometry.formats.surface import MAX_TRIANGLES, FileMaterial, FileSurface, ImageFile
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
_OF_LOOK = frozenset({"color", "float", "init_from", "ref", "source", "wrap_s", "wrap_t"})
_SHADINGS = ("phong", "lambert", "blinn", "constant")
_SURFACES = ("triangles", "polylist", "polygons", "trifans", "tristrips")
_OF_BULLET = ("triangles", "polylist")
_DIGITS_AND_SPACES = b"0123456789 \t\r\n"
_LAYOUT = (("stride", "1"), ("offset", "0"))
"""Attributes of an <accessor> with their defaults."""

Rows = NDArray[np.intp]


def collada_points(data: bytes, *, by_bullet: bool = False) -> Floats | None:
    """Return all points of the scene (n, 3) [m]; None where the file has elements that are not supported.

    They include those of the scene rotated so that its up axis is z. With `by_bullet` they are those that
    PyBullet loads: of triangles and lists of polygons, in the scene as it is written.
    """
    try:
        with_text = _tags(data, _WITH_TEXT | {"p"} if by_bullet else _WITH_TEXT)
        scene = _ColladaScene(read_xml(data, "<mesh>", [], with_text=with_text))
        points_of = scene.points_of_faces if by_bullet else scene.points
        found = [points_of(geometry) @ T[:3, :3].T + T[:3, 3] for _, geometry, T in scene.placed()]
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
    found = _surface(data, drawn=False)
    return found.vertices, found.faces


def collada_surface(data: bytes) -> FileSurface:
    """Return the triangles of the scene with their normals, images and colours.

    A material gives the diffuse colour or image of its effect. Colours of corners (COLOR) come before those
    of materials, images before both. Materials are opaque: writers disagree about <transparent>. Raises
    ValueError, with the reason, for a file that is damaged or has elements that are not supported.
    """
    return _surface(data, drawn=True)


def _surface(data: bytes, *, drawn: bool) -> FileSurface:
    """Return the triangles; what they look like is read if they are to be `drawn`."""
    tags = _tags(data, _WITH_TEXT | {"p", "vcount"} | (_OF_LOOK if drawn else set()))
    parts, most = list[_Part](), MAX_TRIANGLES if drawn else MAX_POINTS
    try:
        scene = _ColladaScene(read_xml(data, "<mesh>", [], with_text=tags))
        vertices, count, placed = [np.zeros((0, 3))], 0, 0
        for instance, geometry, T in scene.placed():
            points = scene.points(geometry)
            for primitive in _primitives(geometry, _SURFACES):
                lists = _vertex_rows(primitive, len(points))
                corner, rows = _fans(primitive, lists), np.concatenate([np.zeros(0, np.intp), *lists])
                # A mirrored triangle is seen from behind.
                corner = corner[:, ::-1] if np.linalg.det(T[:3, :3]) < 0.0 else corner
                part = _Part(rows[corner] + count)
                placed += len(part.faces)
                if placed > most:
                    raise _NotSupported(f"it places more than {most} triangles")
                if drawn:
                    part.add_look(scene, instance, geometry, primitive, corner, rows[corner], T[:3, :3])
                parts.append(part)
            vertices.append(points @ T[:3, :3].T + T[:3, 3])
            count += len(points)
    except _NotSupported as error:
        raise ValueError(str(error)) from None
    except DescriptionError as error:
        raise ValueError(error.message) from None
    faces = np.concatenate([np.zeros((0, 3), np.intp), *(part.faces for part in parts)])
    if not drawn or not parts:
        return FileSurface(scene.unit * np.concatenate(vertices), faces)
    materials = tuple(dict.fromkeys(part.material for part in parts))
    return FileSurface(
        scene.unit * np.concatenate(vertices),
        faces,
        _joined([part.normals for part in parts], faces, 3),
        _joined([part.uv for part in parts], faces, 2),
        _joined([part.colours for part in parts], faces, 3),
        materials,
        np.repeat([materials.index(part.material) for part in parts], [len(part.faces) for part in parts]),
        tuple(dict.fromkeys(note for part in parts for note in part.notes)),
    )


class _Part:
    """The triangles of one primitive, and what they look like."""

    def __init__(self, faces: Rows) -> None:
        self.faces = faces
        self.material = FileMaterial()
        self.normals: Floats | Rows = faces
        self.uv: Floats | Rows = faces
        self.colours: Floats | Rows = faces
        self.notes: list[str] = []

    def add_look(
        self,
        scene: _ColladaScene,
        instance: Element,
        geometry: Element,
        primitive: Element,
        corner: Rows,
        rows: Rows,
        M: Floats,
    ) -> None:
        """Read materials, normals, places in the image, and colours, of corners by their numbers (m, 3) in
        the lists of the primitive, and at their points (m, 3)."""
        self.material, channel = scene.material(instance, primitive, self.notes)
        for semantic, wanted, width in (("NORMAL", None, 3), ("TEXCOORD", channel, 2), ("COLOR", None, 3)):
            try:
                found = scene.values(geometry, primitive, semantic, wanted, width, corner, rows)
            except (_NotSupported, ValueError) as error:
                self.notes.append(f"{semantic} is not read: {error}")
                continue
            if found is None:
                continue
            if semantic == "NORMAL":
                with np.errstate(all="ignore"):
                    self.normals = found @ np.linalg.pinv(M)
            elif semantic == "TEXCOORD":
                self.uv = found
            else:
                self.colours = np.clip(found, 0.0, 1.0)


def _joined(values: list[Floats | Rows], faces: Rows, width: int) -> Floats | None:
    """Return the values (m, 3, `width`) of all triangles, NaN for those of parts that have none, whose
    triangles stand in the list instead; None where no part has any."""
    if not any(each.ndim == 3 for each in values):
        return None
    none = [np.full((len(each), 3, width), np.nan) if each.ndim == 2 else each for each in values]
    return np.concatenate(none)


def _tags(data: bytes, names: Iterable[str]) -> set[str]:
    """Return the tags as the file writes them, with its prefix."""
    prefix = re.search(rb"<(\w+:)COLLADA\b", data[:1000])
    before = "" if prefix is None else prefix.group(1).decode("ascii", "replace")
    return {f"{before}{name}" for name in names}


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
        self._values: dict[tuple[int, int], Floats] = {}

    def placed(self) -> Iterator[tuple[Element, Element, Floats]]:
        """Yield each <instance_geometry>, its geometry, and its pose (4, 4) in the scene, scale included."""
        for scene in _path(self._root, "library_visual_scenes", "visual_scene"):
            for node in scene.all("node"):
                yield from self._of_node(node, np.eye(4), 0)

    def _of_node(self, node: Element, T: Floats, depth: int) -> Iterator[tuple[Element, Element, Floats]]:
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
            yield instance, geometry, T
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
        return self._values_of(source, 3)

    def _values_of(self, source: Element, width: int) -> Floats:
        # Many geometries may share one source.
        if (id(source), width) not in self._values:
            self._values[id(source), width] = _source_values(source, width)
        return self._values[id(source), width]

    def values(
        self,
        geometry: Element,
        primitive: Element,
        semantic: str,
        number: str | None,
        width: int,
        corner: Rows,
        points: Rows,
    ) -> Floats | None:
        """Return the values (m, 3, `width`) of an input, of those with a set the one of this `number`, at
        corners by their numbers (m, 3) in the lists of a primitive and the points (m, 3) there; None without
        such an input."""
        inputs = [each for each in primitive.all("input") if each.attributes.get("semantic") == semantic]
        chosen = [each for each in inputs if each.attributes.get("set", "0") == number] or inputs
        if chosen:
            values = self._values_of(self._target(chosen[0], "source"), width)
            column = int(chosen[0].attributes.get("offset", "0"))
            lists = _rows_of(primitive, column, len(values))
            rows = np.concatenate([np.zeros(0, np.intp), *lists])[corner]
        else:
            of_vertices = _path(geometry, "mesh", "vertices", "input")
            inputs = [each for each in of_vertices if each.attributes.get("semantic") == semantic]
            if not inputs:
                return None
            values, rows = self._values_of(self._target(inputs[0], "source"), width), points
            if rows.size and rows.max() >= len(values):
                raise _NotSupported(f"it has {len(values)} values for more points")
        found = values[rows]
        return found if np.isfinite(found).all() else None

    def material(
        self, instance: Element, primitive: Element, notes: list[str]
    ) -> tuple[FileMaterial, str | None]:
        """Return the material of a primitive of a placed geometry, and the set of places in its image."""
        symbol = primitive.attributes.get("material")
        for bound in _path(instance, "bind_material", "technique_common", "instance_material"):
            material = self._by_id.get(bound.attributes.get("target", "")[1:])
            if bound.attributes.get("symbol") != symbol or material is None:
                continue
            used = _first(material, "instance_effect")
            effect = None if used is None else self._by_id.get(used.attributes.get("url", "")[1:])
            for diffuse in (
                found
                for shading in _SHADINGS
                if effect is not None
                for found in _path(
                    effect,
                    "profile_COMMON",
                    "technique",
                    shading,
                    "diffuse" if shading != "constant" else "emission",
                )
            ):
                texture, color = _first(diffuse, "texture"), _first(diffuse, "color")
                if texture is not None and effect is not None:
                    image = self._image(effect, texture.attributes.get("texture", ""))
                    if image is None:
                        notes.append(f"image {shown(texture.attributes.get('texture', ''))} is not defined")
                    return FileMaterial(None, image), _set_of(bound, texture.attributes.get("texcoord", ""))
                rgb = np.zeros(0) if color is None else _numbers(color)[:3]
                if len(rgb) == 3 and np.isfinite(rgb).all():
                    red, green, blue = np.clip(rgb, 0.0, 1.0).tolist()
                    return FileMaterial((red, green, blue, 1.0)), None
        return FileMaterial(), None

    def _image(self, effect: Element, name: str) -> ImageFile | None:
        """Return the image of a sampler, or of that name; None for one that is not defined."""
        given = {each.attributes.get("sid"): each for each in _path(effect, "profile_COMMON", "newparam")}
        sampler = _first(given.get(name, effect), "sampler2D")
        wraps = (True, True)
        if sampler is not None:
            u, v = (_text(_first(sampler, wrap)) for wrap in ("wrap_s", "wrap_t"))
            wraps = (u not in ("CLAMP", "BORDER"), v not in ("CLAMP", "BORDER"))
            surface = given.get(_text(_first(sampler, "source")), effect)
            of_image = _first(sampler, "instance_image")
            name = _text(_first(surface, "surface", "init_from"))
            if of_image is not None:
                name = of_image.attributes.get("url", "")[1:]
        image = self._by_id.get(name)
        if image is None or image.tag != "image":
            return None
        from_file = _first(image, "init_from")
        inside = None if from_file is None else _first(from_file, "ref")
        path = _text(from_file if inside is None else inside)
        path = unquote(urlsplit(path).path if path.startswith("file:") else path).replace("\\", "/")
        return ImageFile(path, None, wraps) if path else None

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
    if "VERTEX" not in columns:
        raise _NotSupported(f"<{primitive.tag}> has no input of vertices")
    return _rows_of(primitive, int(columns["VERTEX"].attributes.get("offset", "0")), count)


def _rows_of(primitive: Element, column: int, count: int) -> list[Rows]:
    """Return the numbers of the values, `count` in all, in a column of each list of a primitive."""
    offsets = [int(each.attributes.get("offset", "0")) for each in primitive.all("input")]
    if min(offsets) < 0:
        raise _NotSupported(f"<{primitive.tag}> has no input of vertices")
    lists = [_whole_numbers(indices)[column :: 1 + max(offsets)] for indices in primitive.all("p")]
    for rows in lists:
        if not ((rows >= 0) & (rows < count) & (rows == np.floor(rows))).all():
            raise _NotSupported(
                f"<{primitive.tag}> names a point that is not among the {count} of its source"
            )
    return [rows.astype(np.intp) for rows in lists]


def _fans(primitive: Element, lists: list[Rows]) -> Rows:
    """Return the corners of the triangles (m, 3) of a primitive, as numbers in its lists of points, which
    are one after another."""
    if primitive.all("ph"):
        raise _NotSupported("polygons with holes are not supported")
    total = sum(map(len, lists))
    if primitive.tag == "triangles":
        corners = np.full(total // 3, 3)
    elif primitive.tag == "polylist":
        numbers = [_whole_numbers(each) for each in primitive.all("vcount")]
        given = np.concatenate([np.zeros(0, np.int64), *numbers])
        # A number too large for what counts the corners would come out as another.
        if not ((given >= 0) & (given <= total) & (given == np.floor(given))).all():
            raise _NotSupported(
                f"<{primitive.tag}> has a polygon whose number of corners is none of 0 to {total}"
            )
        corners = given.astype(np.intp)
    else:
        corners = np.array([len(each) for each in lists], np.intp)
    if corners.sum() != total:
        raise _NotSupported(f"<{primitive.tag}> has {total} corners, not {corners.sum()}")
    fans = np.maximum(corners - 2, 0)
    first = np.repeat(np.cumsum(corners) - corners, fans)
    within = np.arange(fans.sum()) - np.repeat(np.cumsum(fans) - fans, fans)
    if primitive.tag != "tristrips":
        return np.stack([first, first + within + 1, first + within + 2], axis=-1).astype(np.intp)
    odd = within % 2
    strip: Rows = first[:, None] + np.stack([within, within + 1 + odd, within + 2 - odd], axis=-1)
    return strip


def _set_of(bound: Element, channel: str) -> str | None:
    """Return the set of places in an image that a material binds to a channel; None for the first."""
    for each in bound.all("bind_vertex_input"):
        if each.attributes.get("semantic") == channel:
            return each.attributes.get("input_set", "0")
    return None


def _source_values(source: Element, width: int) -> Floats:
    array, accessor = _first(source, "float_array"), _first(source, "technique_common", "accessor")
    if array is None or accessor is None:
        raise _NotSupported("a source has no array or no accessor")
    numbers = _numbers(array)
    stride, offset = (int(accessor.attributes.get(key, default)) for key, default in _LAYOUT)
    if not (width <= stride <= _LARGEST_STRIDE and 0 <= offset <= len(numbers)):
        raise _NotSupported(f"an accessor has the stride {stride} and the offset {offset}")
    rows = (len(numbers) - offset) // stride
    return numbers[offset : offset + rows * stride].reshape(rows, stride)[:, :width]


def _text(element: Element | None) -> str:
    return "" if element is None else element.text.strip()


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
