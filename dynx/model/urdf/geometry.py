"""Reader of URDF's ``<visual>`` and ``<collision>``, and of the materials that visuals name."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from dynx.errors import ArgumentError, DescriptionError, escaped, nearest, shown
from dynx.model.elements import Note
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    LinkGeometry,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Visual,
)
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_above, find_mesh, reason_unknown
from dynx.model.package_search import StrPath
from dynx.model.urdf.reader import read_origin, reads_quaternions
from dynx.model.xml.reading import Element, read_xml
from dynx.model.xml.values import Reading

_OPAQUE = frozenset(["joint", "inertial", "transmission", "gazebo", "sensor", "ros2_control", "contact"])
_SHAPES = ("box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh", "plane")

Placed = TypeVar("Placed", Visual, Collision)


def urdf_geometry(
    data: str | bytes, source: str, package_dirs: Iterable[StrPath] = (), frames: Iterable[str] = ()
) -> Geometry:
    """Return the geometry of a URDF document, which is read when it is first asked for.

    `frames` are the links of the document that stand for frames, and are no links of the robot.
    """
    return Geometry(partial(read_link_shapes, data, source, tuple(map(str, package_dirs)), frozenset(frames)))


def read_link_shapes(
    data: str | bytes, source: str, package_dirs: tuple[str, ...] = (), frames: frozenset[str] = frozenset()
) -> dict[str, LinkGeometry]:
    """Read the shapes of each link, but for `frames`, of a URDF document that `read_urdf` accepts."""
    notes: list[Note] = []
    root = read_xml(data, source, notes, opaque=_OPAQUE)
    reading = Reading(source, notes, reads_quaternions(root.attributes.get("version")))
    links = _ShapeReader(root, reading, package_dirs).links()
    return {name: shapes for name, shapes in links.items() if name not in frames}


class _ShapeReader:
    def __init__(self, root: Element, reading: Reading, package_dirs: tuple[str, ...]) -> None:
        self._root = root
        self._reading = reading
        self._package_dirs = package_dirs
        self._materials: dict[str, Appearance | DescriptionError] = {}

    def links(self) -> dict[str, LinkGeometry]:
        for element in [*self._root.all("material"), *self._materials_in_links()]:
            name = element.attributes.get("name", "")
            if name and (element.all("color") or element.all("texture")):
                self._materials.setdefault(name, self._material_or_fault(element))
        return {each.attributes.get("name", ""): self._link(each) for each in self._root.all("link")}

    def _materials_in_links(self) -> Iterable[Element]:
        for link in self._root.all("link"):
            for visual in link.all("visual"):
                yield from visual.all("material")

    def _link(self, link: Element) -> LinkGeometry:
        what = f"link {shown(link.attributes.get('name', ''))}"
        visuals, visual_fault = self._placed(link, "visual", what, self._visual)
        collisions, collision_fault = self._placed(link, "collision", what, self._collision)
        return LinkGeometry(visuals, collisions, visual_fault, collision_fault)

    def _placed(
        self, link: Element, tag: str, what: str, read: Callable[[Element, str], Placed]
    ) -> tuple[tuple[Placed, ...], DescriptionError | None]:
        found = []
        for number, element in enumerate(link.all(tag)):
            placed = self._read_or_fault(element, f"<{tag}> {number + 1} of {what}", read)
            if isinstance(placed, DescriptionError):
                return (), placed
            found.append(placed)
        return tuple(found), None

    def _read_or_fault(
        self, element: Element, what: str, read: Callable[[Element, str], Placed]
    ) -> Placed | DescriptionError:
        try:
            return read(element, what)
        except DescriptionError as error:
            return error
        except ArgumentError as error:
            return self._reading.error(element, f"{what}: {error}")

    def _visual(self, element: Element, what: str) -> Visual:
        shape, origin = self._shape(element, what), read_origin(element, what, self._reading)
        name = element.attributes.get("name", "")
        return Visual(shape, origin, self._material(element), name, element.line)

    def _collision(self, element: Element, what: str) -> Collision:
        shape, origin = self._shape(element, what), read_origin(element, what, self._reading)
        return Collision(shape, origin, element.attributes.get("name", ""), element.line)

    def _shape(self, element: Element, what: str) -> Shape:
        reading = self._reading
        geometry = reading.required(element, "geometry", what)
        if not geometry.children:
            raise reading.error(
                geometry, f"<geometry> of {what} is empty; wanted one of {', '.join(_SHAPES)}"
            )
        shape = geometry.children[0]
        if shape.tag == "box":
            return Box(reading.vector(shape, "size", what))
        if shape.tag == "sphere":
            return Sphere(reading.number(shape, "radius", what))
        if shape.tag in ("cylinder", "capsule"):
            kind = Cylinder if shape.tag == "cylinder" else Capsule
            return kind(reading.number(shape, "radius", what), reading.number(shape, "length", what))
        if shape.tag == "ellipsoid":
            return Ellipsoid(reading.vector(shape, "radii", what))
        if shape.tag == "mesh":
            return self._mesh(shape, what)
        if shape.tag == "dynx_mesh":
            from dynx.model.urdf.stated_meshes import read_stated_mesh

            return read_stated_mesh(shape, what, reading)
        if shape.tag == "plane":
            return self._plane(shape, what)
        raise reading.unsupported(
            shape, f"{what} has the unknown shape <{escaped(shape.tag)}>{nearest(shape.tag, _SHAPES)}"
        )

    def _mesh(self, shape: Element, what: str) -> Mesh:
        reading = self._reading
        filename = reading.name(shape, "filename", f"<mesh> of {what}")
        scale = reading.vector(shape, "scale", what) if "scale" in shape.attributes else (1.0, 1.0, 1.0)
        try:
            path = find_mesh(filename, reading.source, self._package_dirs)
            reason = None if path else reason_unknown(filename, reading.source)
        except MeshNotFoundError as error:
            path, reason = None, str(error)
        path = path or find_above(filename, reading.source)
        if path is not None:
            return Mesh(str(path), scale)
        return Mesh(filename, scale, reading.error(shape, f"the mesh of {what} is not read: {reason}"))

    def _plane(self, shape: Element, what: str) -> Plane:
        normal = self._reading.vector(shape, "normal", what) if "normal" in shape.attributes else (0, 0, 1)
        if normal != (0.0, 0.0, 1.0):
            raise self._reading.unsupported(
                shape, f"{what} is a plane with the normal {normal}; wanted 0 0 1, rotated by <origin>"
            )
        return Plane()

    def _material(self, visual: Element) -> Appearance | None:
        elements = visual.all("material")
        if not elements:
            return None
        if elements[0].all("color") or elements[0].all("texture"):
            return self._own_material(elements[0])
        name = elements[0].attributes.get("name", "")
        known = self._materials.get(name, Appearance(name))
        if isinstance(known, DescriptionError):
            raise known
        return known

    def _image(self, filename: str) -> tuple[str, str]:
        """Return the path of an image, found as meshes are; else its name, and why it is not found."""
        source = self._reading.source
        try:
            found = find_mesh(filename, source, self._package_dirs)
        except MeshNotFoundError as error:
            return filename, str(error)
        return (filename, reason_unknown(filename, source)) if found is None else (str(found), "")

    def _material_or_fault(self, element: Element) -> Appearance | DescriptionError:
        try:
            return self._own_material(element)
        except DescriptionError as error:
            return error

    def _own_material(self, element: Element) -> Appearance:
        reading, name = self._reading, element.attributes.get("name", "")
        what = f"material {shown(name)}"
        rgba = None
        for color in element.all("color")[:1]:
            red, green, blue, opacity = reading.numbers(color, "rgba", what, 4)
            rgba = (red, green, blue, opacity)
        texture, fault = None, ""
        for each in element.all("texture")[:1]:
            texture, fault = self._image(each.attributes.get("filename", ""))
        try:
            return Appearance(name, rgba, texture, fault)
        except ArgumentError as error:
            raise reading.error(element, str(error)) from None
