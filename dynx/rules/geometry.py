"""Shapes of links as rules see them: extents, meshes that engines can read, boxes, textures, faults."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, DynxError, shown
from dynx.files.reading import read_file
from dynx.model import Link
from dynx.model.geometry.formats.collada import collada_points
from dynx.model.geometry.formats.facets import STL_FACET, STL_HEAD, STL_VERTEX
from dynx.model.geometry.hulls import convex_hull
from dynx.model.geometry.mesh_files import (
    MeshNotFoundError,
    find_by_bullet,
    find_mesh,
    found_by_bullet,
    reason_unknown,
)
from dynx.model.geometry.solids import polyhedron_properties
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.attributes import number_of, origin_of, vector_of
from dynx.rules.case import Case
from dynx.rules.inertia import RigidGroup, rigid_groups
from dynx.rules.numbers_in_text import is_number
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse

# Bounds of a body in space, as the convex hull of balls.


@dataclass(frozen=True, eq=False)
class Extent:
    """The convex hull of balls: centres `points` (n, 3) [m] with `radii` (n,) [m], in some frame.

    It may be larger than the body, never smaller: no point outside belongs to the body.
    """

    points: Floats
    radii: Floats

    @classmethod
    def of_points(cls, points: Iterable[Iterable[float]], radius: float = 0.0) -> Extent:
        """Return the balls of one radius about the points."""
        array = np.array(list(points), dtype=np.float64).reshape(-1, 3)
        return cls(array, np.full(len(array), radius))

    @classmethod
    def union(cls, parts: Iterable[Extent]) -> Extent:
        """Return the union of the parts, which must be in one frame."""
        found = list(parts)
        return cls(
            np.concatenate([np.zeros((0, 3)), *(part.points for part in found)]),
            np.concatenate([np.zeros(0), *(part.radii for part in found)]),
        )

    @property
    def empty(self) -> bool:
        """True if there is no shape at all."""
        return len(self.points) == 0

    def transform(self, T: Floats) -> Extent:
        """Return the region in frame A, where T (4, 4) is the pose of this frame in A."""
        return Extent(self.points @ T[:3, :3].T + T[:3, 3], self.radii)

    def box(self) -> tuple[Floats, Floats]:
        """Return the lowest and highest corner, (3,) each, of the bounding box along the frame's axes."""
        radii = self.radii[:, None]
        return (self.points - radii).min(axis=0), (self.points + radii).max(axis=0)

    def diagonal(self) -> float:
        """Return the length of the diagonal of `box` [m]."""
        low, high = self.box()
        return float(np.linalg.norm(high - low))

    def range_along(self, directions: Floats) -> tuple[Floats, Floats]:
        """Return the least and the greatest coordinate (n,) [m] along each unit vector (n, 3)."""
        along, radii = self.points @ directions.T, self.radii[:, None]
        return (along - radii).min(axis=0), (along + radii).max(axis=0)

    def reach_from_axis(self, origin: Floats, direction: Floats) -> float:
        """Return the largest distance [m] of a point of the region from the line through `origin` (3,) along
        the unit vector `direction` (3,). Distance from a line is convex, so it is largest on a ball."""
        offset = self.points - origin
        across = offset - np.outer(offset @ direction, direction)
        return float(np.max(np.linalg.norm(across, axis=1) + self.radii))


# The shapes that engines know, as the children of ``<geometry>``.


KNOWN = frozenset(["box", "sphere", "cylinder", "capsule", "mesh"])
"""Shapes that every engine knows."""

BULLET_ONLY = frozenset(["plane", "cdf"])
"""Extensions of PyBullet."""


def shapes_in(shape: SourceElement) -> list[str]:
    """Return the tags in the first ``<geometry>`` of a ``<visual>`` or ``<collision>``."""
    geometry = shape.first("geometry")
    return [] if geometry is None else [child.tag for child in geometry.children]


def has_shape(shape: SourceElement) -> bool:
    """Check whether a ``<visual>`` or ``<collision>`` has a shape that PyBullet knows."""
    return any(tag in KNOWN or tag in BULLET_ONLY for tag in shapes_in(shape))


# Bounding boxes of meshes in STL, OBJ and COLLADA files, of which only the vertices are read.


Box = tuple[tuple[float, float, float], tuple[float, float, float]]

# Each line is matched in time proportional to its length: a pattern must not run across lines, nor start
# again within a run of blanks.
_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)


def mesh_box(path: Path, *, by_bullet: bool = False) -> Box | None:
    """Return the lowest and highest corner of a mesh in its own frame, unscaled; None if it is unreadable.

    Programs differ on the up axis of COLLADA; the box contains the mesh as each of them places it. With
    `by_bullet` it is the box of PyBullet, which ignores that axis and points without a face, and cannot read
    STL in text form. Time and memory are proportional to the size of the file; a file above MAX_BYTES of
    `dynx.files` is unreadable.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return _box(path, by_bullet, status.st_mtime_ns, status.st_size)


def mesh_hull(path: Path) -> Floats | None:
    """Return the vertices (n, 3) of the convex hull of a mesh in its own frame, unscaled.

    They are the corners of its box where its points are on one line; None if it is unreadable.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return _hull(path, status.st_mtime_ns, status.st_size)


def is_mesh_format(path: Path) -> bool:
    """Check whether the suffix of a file is that of a format that `mesh_box` reads."""
    return path.suffix.lower() in _READERS


# Cached, because detection runs again after every remedy, and remedies change no mesh.
@lru_cache(maxsize=4096)
def _box(path: Path, by_bullet: bool, changed: int, size: int) -> Box | None:
    points = _points(path, by_bullet)
    if points is None:
        return None
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


@lru_cache(maxsize=1024)
def _hull(path: Path, changed: int, size: int) -> Floats | None:
    points = _points(path, by_bullet=False)
    if points is None:
        return None
    try:
        return convex_hull(points)[0]
    except ArgumentError:
        return np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))


def _points(path: Path, by_bullet: bool) -> Floats | None:
    """Return the vertices of a mesh file; None if it is unreadable."""
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        return None
    try:
        with np.errstate(all="ignore"):
            points = reader(read_file(str(path)), by_bullet)
    except (DynxError, ValueError):
        return None
    return points if points is not None and len(points) and np.isfinite(points).all() else None


def _stl_points(data: bytes, by_bullet: bool) -> Floats | None:
    """Return the corners of the facets. A binary file is known by its length, since some begin with "solid"
    too."""
    if len(data) >= STL_HEAD:
        count = int.from_bytes(data[80:84], "little")
        if len(data) == STL_HEAD + STL_FACET.itemsize * count:
            corners = np.frombuffer(data, STL_FACET, count, STL_HEAD)["corners"]
            return corners.reshape(-1, 3).astype(np.float64)
    is_text = data.lstrip()[:5].lower() == b"solid" and not by_bullet
    return _vertices(STL_VERTEX, data) if is_text else None


def _obj_points(data: bytes, by_bullet: bool) -> Floats | None:
    return _vertices(_OBJ_VERTEX, data)


def _collada_points(data: bytes, by_bullet: bool) -> Floats | None:
    return collada_points(data, by_bullet=by_bullet)


_READERS = {".stl": _stl_points, ".obj": _obj_points, ".dae": _collada_points}


def _vertices(pattern: re.Pattern[bytes], data: bytes) -> Floats:
    """Read the three numbers of every line that matches; a carriage return ends a line as well."""
    lines = data.replace(b"\r", b"\n")
    found = (float(number) for match in pattern.finditer(lines) for number in match.groups())
    return np.fromiter(found, np.float64).reshape(-1, 3)


# ``<visual>`` and ``<collision>`` of a link as an `Extent` in the link frame.


_SIDES = 32
"""Number of sides of the prism about a cylinder; it is too large by 0.5 % of the radius."""


def link_extent(link: SourceElement, source: str) -> Extent | None:
    """Return the extent of all shapes of a link, in the link frame; None where a size is unknown.

    `source` is the path of the description, relative to which meshes are searched.
    """
    parts = []
    for shape in (child for child in link.children if child.tag in ("visual", "collision")):
        extent = _shape_extent(shape, source)
        if extent is None:
            return None
        parts.append(extent)
    return Extent.union(parts)


def geometry_elements(link: SourceElement) -> Iterator[SourceElement]:
    """Yield the shape elements (``<box>``, ``<mesh>``, ...) of a link, in document order."""
    for shape in link.children:
        if shape.tag in ("visual", "collision"):
            for geometry in shape.all("geometry"):
                yield from geometry.children


def _shape_extent(shape: SourceElement, source: str) -> Extent | None:
    geometry = shape.first("geometry")
    if geometry is None or not geometry.children:
        return Extent.of_points([])
    try:
        extent = _in_own_frame(geometry.children[0], source)
        return None if extent is None else extent.transform(origin_of(shape).matrix)
    except DescriptionError:
        return None


def _in_own_frame(element: SourceElement, source: str) -> Extent | None:
    if element.tag == "mesh":
        return _mesh(element, source)
    if element.tag == "box":
        size = vector_of(element, "size")
        return None if size is None else _box_of_corners(np.array(size) / -2.0, np.array(size) / 2.0)
    radius = number_of(element, "radius")
    if element.tag == "sphere" and radius is not None:
        return Extent.of_points([(0.0, 0.0, 0.0)], abs(radius))
    length = number_of(element, "length")
    if radius is None or length is None:
        return None
    if element.tag == "capsule":
        return Extent.of_points([(0.0, 0.0, -length / 2.0), (0.0, 0.0, length / 2.0)], abs(radius))
    return _cylinder(abs(radius), length) if element.tag == "cylinder" else None


def _cylinder(radius: float, length: float) -> Extent:
    outside = radius / math.cos(math.pi / _SIDES)
    # Sides, not edges, face the axes of the frame: the box along them is that of the cylinder.
    angles = [2.0 * math.pi * (k + 0.5) / _SIDES for k in range(_SIDES)]
    rim = [(outside * math.cos(angle), outside * math.sin(angle)) for angle in angles]
    return Extent.of_points((x, y, z) for x, y in rim for z in (-length / 2.0, length / 2.0))


def _mesh(element: SourceElement, source: str) -> Extent | None:
    try:
        path = find_mesh(element.attributes.get("filename", ""), source)
    except MeshNotFoundError:
        return None
    vertices = None if path is None else mesh_hull(path)
    if vertices is None:
        return None
    return Extent.of_points(vertices * np.array(vector_of(element, "scale") or (1.0, 1.0, 1.0)))


def _box_of_corners(low: Floats, high: Floats) -> Extent:
    return Extent.of_points(product(*zip(low.tolist(), high.tolist(), strict=True)))


# Extents of rigid groups: the shapes over which the mass of a link may be spread.


def body_extents(case: Case) -> Iterator[tuple[RigidGroup, Extent]]:
    """Yield each rigid group with mass, and the extent of all its shapes in the frame of its head.

    A group is left out where it has no shape, only shapes of size zero, or a shape of unknown size (a missing
    mesh).
    """
    for group in dict.fromkeys(rigid_groups(case).values()):
        if not any(case.model.inertial(name).mass > 0.0 for name in group.links):
            continue
        extent = _group_extent(case, group)
        if extent is not None and not extent.empty and extent.diagonal() > 0.0:
            yield group, extent


def largest_volume(case: Case, group: RigidGroup) -> float:
    """Return the largest volume [m^3] of a single shape of the group; a mesh counts as its convex hull."""
    shapes = (shape for name in group.links for shape in geometry_elements(case.links[name]))
    return max((_volume(shape, case.source.source) for shape in shapes), default=0.0)


def _volume(element: SourceElement, source: str) -> float:
    if element.tag == "mesh":
        extent = _mesh(element, source)
        try:
            return 0.0 if extent is None else polyhedron_properties(*convex_hull(extent.points)).volume
        except ArgumentError:
            return 0.0  # A line.
    if element.tag == "box":
        return abs(math.prod(vector_of(element, "size") or (0.0,)))
    radius, length = (abs(number_of(element, name) or 0.0) for name in ("radius", "length"))
    ball, tube = 4.0 / 3.0 * math.pi * radius**3, math.pi * radius**2 * length
    return {"sphere": ball, "cylinder": tube, "capsule": ball + tube}.get(element.tag, 0.0)


def group_extents(case: Case) -> Iterator[tuple[Link, Extent]]:
    """Yield each link with mass, and the extent of all shapes of its rigid group, in its link frame.

    Descriptions often put the shape of a part in one link and its mass in another on a fixed joint, so every
    shape of the group counts.
    """
    groups = rigid_groups(case)
    known = {group.head: extent for group, extent in body_extents(case)}
    for link in case.model.links:
        if link.inertial is None or link.inertial.mass == 0.0:
            continue
        group = groups[link.name]
        extent = known.get(group.head)
        if extent is not None:
            yield link, extent.transform(inverse(_pose(group, link.name)))


def _group_extent(case: Case, group: RigidGroup) -> Extent | None:
    """Return the extent of all shapes of the group in the frame of its head; None where a size is unknown."""
    parts = []
    for name in group.links:
        extent = link_extent(case.links[name], case.source.source)
        if extent is None:
            return None
        parts.append(extent.transform(_pose(group, name)))
    return Extent.union(parts)


def _pose(group: RigidGroup, link: str) -> Floats:
    """Return T_head_link (4, 4)."""
    R, p = group.poses[link]
    return homogeneous(R.astype(np.float64), p.astype(np.float64))


# Collision meshes of a link as PyBullet measures them: by their bounding boxes.


MESH_TAGS = frozenset({"mesh", "sdf_mesh", "convex"})
"""Elements of shapes that are read from a file."""


def collision_meshes(link: SourceElement) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield each collision shape of a link that is a mesh of a file, and the element of its mesh."""
    for collision in link.all("collision"):
        mesh = next((element for element in collision.walk() if element.tag in MESH_TAGS), None)
        if mesh is not None and not lacks_file(mesh):
            yield collision, mesh


def lacks_file(mesh: SourceElement) -> bool:
    """Check whether a mesh names no file."""
    return not mesh.attributes.get("filename", "").strip()


def bullet_box(filename: str, source: str) -> tuple[Box, str] | None:
    """Return the box of a mesh that the description `source` names, and the suffix of its file; None for one
    that dynx does not find, or that dynx or PyBullet does not read."""
    try:
        path = find_mesh(filename, source)
    except MeshNotFoundError:
        path = None
    path = path or find_by_bullet(filename, source)
    box = None if path is None else mesh_box(path, by_bullet=True)
    return None if path is None or box is None else (box, path.suffix.lower())


# Textures of the materials of a robot: which of them Drake finds when it parses the file.


GREY = '<color rgba="0.5 0.5 0.5 1"/>'
"""Colour in place of a texture."""


def robot_textures(source: XmlSource) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield the ``<material>`` elements directly in the robot that name a texture, each with its texture."""
    for material in source.root.all("material"):
        texture = material.first("texture")
        if texture is not None and texture.attributes.get("filename"):
            yield material, texture


def visual_textures(link: SourceElement) -> Iterator[SourceElement]:
    """Yield the ``<texture>`` elements in the materials of the visuals of a link."""
    for visual in link.all("visual"):
        for material in visual.all("material"):
            yield from material.all("texture")


def missing_texture(texture: SourceElement, source: str) -> str | None:
    """Return the reason why Drake does not find a texture of the description `source` (a path), or None.

    None also where that cannot be known: a relative path in a text that was read from no file.
    """
    filename = texture.attributes["filename"]
    if filename.startswith("package://"):
        package = filename.removeprefix("package://").partition("/")[0]
        return f"Drake does not know the package {shown(package)} of the texture {shown(filename, 200)}"
    if filename.startswith("file://"):
        path = unquote(urlsplit(filename).path)
        return None if os.path.isfile(path) else f"no texture {shown(filename, 200)}"
    if "://" in filename:
        return f"Drake cannot read the texture {shown(filename, 200)} from there"
    here = os.path.isfile(os.path.join(os.path.dirname(source), filename))
    return None if here or not os.path.isfile(source) else f"no texture {shown(filename, 200)}"


def texture_replacements(source: XmlSource) -> Iterator[Edit]:
    """Replace each texture of the robot that exists by a colour: a copy of the file elsewhere loads alike."""
    for material, texture in robot_textures(source):
        if missing_texture(texture, source.source) is None:
            has_color = material.first("color") is not None
            yield source.removal(texture) if has_color else source.replacement(texture, GREY)


# Faults of visuals for which an engine refuses a file, although no visual changes the dynamics.


_REQUIRED = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "mesh": ("filename",),
}
"""The attributes without which PyBullet refuses a shape."""


def visual_faults(visual: SourceElement) -> Iterator[tuple[SourceElement, str]]:
    """Yield the faults of the first shape and the first material of a visual: the element, and a message."""
    geometry = visual.first("geometry")
    for shape in [] if geometry is None else geometry.children[:1]:
        missing = [name for name in _REQUIRED.get(shape.tag, ()) if name not in shape.attributes]
        # An empty size is read as zero, an empty file name as no file.
        if missing or shape.attributes.get("filename") == "":
            yield shape, f"<{shape.tag}> of a visual has no {' and no '.join(missing) or 'filename'}"
    for material in visual.all("material")[:1]:
        color = material.first("color")
        rgba = "" if color is None else color.attributes.get("rgba", "")
        words = rgba.split()
        if "name" not in material.attributes:
            yield material, "the <material> of a visual has no name"
        if color is not None and not (len(words) == 4 and all(map(is_number, words))):
            yield color, f"the colour of a visual is {shown(rgba) if rgba else 'missing'}, not four numbers"


def may_be_refused(visual: SourceElement) -> bool:
    """Check whether an engine may refuse a visual that has a shape (a second material: DX411)."""
    return len(visual.all("material")) > 1 or next(visual_faults(visual), None) is not None


# Meshes that dynx does not read, so that no rule compares a mass or an inertia with their size.


def links_in(source: XmlSource) -> list[SourceElement]:
    """List the ``<link>`` elements of a robot in URDF, or of all models in SDF, in document order."""
    return [each for each in source.root.walk() if each.tag == "link" and _holds_links(each.parent)]


def _holds_links(element: SourceElement | None) -> bool:
    return element is not None and (element.parent is None or element.tag == "model")


def file_of_mesh(source: XmlSource, mesh: SourceElement) -> str:
    """Return the file that a ``<mesh>`` names: its attribute ``filename``, or ``<uri>`` in SDF."""
    uri = mesh.first("uri")
    return mesh.attributes.get("filename", "") if uri is None else source.text_in(uri)


def named_meshes(source: XmlSource) -> Iterator[tuple[SourceElement, SourceElement, str]]:
    """Yield the first ``<mesh>`` of each file that a description in URDF or SDF names, after its ``<link>``
    and before the file."""
    seen = {""}
    for link in links_in(source):
        for element in geometry_elements(link):
            file = file_of_mesh(source, element) if element.tag == "mesh" else ""
            if file not in seen:
                seen.add(file)
                yield link, element, file


def parts_with_meshes(source: XmlSource) -> dict[str, set[str]]:
    """Return the parts of links, ``visual`` or ``collision``, in which each mesh file is named."""
    parts: dict[str, set[str]] = {}
    for part in (part for link in links_in(source) for part in link.children):
        for mesh in (each for each in part.walk() if each.tag == "mesh"):
            parts.setdefault(file_of_mesh(source, mesh), set()).add(part.tag)
    return parts


def is_found(filename: str, source: str) -> bool:
    """Check whether a mesh of the description `source` (a path) is found, readable or not."""
    try:
        return find_mesh(filename, source) is not None
    except MeshNotFoundError:
        return False


def is_found_above(filename: str, source: str) -> bool:
    """Check whether an engine finds a mesh that searches the folders above the description `source`."""
    return find_by_bullet(filename, source) is not None


def reason_unread(filename: str, source: str) -> str | None:
    """Return the reason why a mesh of the description `source` (a path) is not read; None if it is."""
    try:
        path = find_mesh(filename, source)
    except MeshNotFoundError as error:
        return f"{error}{found_by_bullet(filename, source)}"
    if path is None:
        return f"{reason_unknown(filename, source)}{found_by_bullet(filename, source)}"
    if mesh_box(path) is not None:
        return None
    if not is_mesh_format(path):
        return f"dynx reads STL, OBJ and COLLADA, and no {path.suffix or 'file without a suffix'}"
    return f"no points can be read in the {path.suffix} file"
