"""Visuals and collisions of SDF: their shapes and colours, and the inertia that follows from collisions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, shown
from dynx.model.elements import Inertial, Pose
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    LinkGeometry,
    Mesh,
    Plane,
    Sphere,
    Visual,
)
from dynx.model.geometry.mesh_files import MeshNotFoundError
from dynx.model.geometry.mesh_inertia import mesh_properties
from dynx.model.geometry.solids import (
    Shape,
    SolidProperties,
    diagonal_inertia,
    inertial_of,
    solid_properties,
)
from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.model.sdf.document import NamedPart, SdfReading, find_file
from dynx.model.sdf.frames import Frames
from dynx.model.sdf.vocabulary import USED
from dynx.model.xml.reading import Element
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_of_z

DENSITY = 1000.0
"""Density of a collision where the file states none [kg/m^3]."""

_DEFAULTS = {
    "sphere": (1.0,),
    "cylinder": (1.0, 1.0),
    "capsule": (0.5, 1.0),
    "cone": (1.0, 1.0),
}
"""Radius and length [m] of shapes that state none."""


class LinkShapeReader:
    """Reads the shapes of links."""

    def __init__(self, reading: SdfReading, frames: Frames, package_dirs: Sequence[str]) -> None:
        self._reading, self._frames, self._package_dirs = reading, frames, package_dirs

    def geometry(self, link: NamedPart) -> LinkGeometry:
        """Return the shapes of a link: those that are seen, and those that collide."""
        visuals: list[Visual] = []
        collisions: list[Collision] = []
        faults: dict[str, DescriptionError] = {}
        for element in link.element.children:
            if element.tag not in ("visual", "collision"):
                continue
            what = _what(element, link)
            found = self._placed_shape(element, link, what)
            if isinstance(found, DescriptionError):
                faults.setdefault(element.tag, found)
                self._reading.note(element, f"{found.message}; shapes of that kind of the link are not read")
            elif found is not None:
                shape, origin = found
                name, line = element.attributes.get("name", ""), element.line
                if element.tag == "collision":
                    collisions.append(Collision(shape, origin, name, line))
                    continue
                try:
                    visuals.append(Visual(shape, origin, self._appearance(element, what), name, line))
                except ArgumentError as error:
                    faults.setdefault("visual", self._reading.error(element, f"{what}: {error}"))
        return LinkGeometry(
            () if "visual" in faults else tuple(visuals),
            () if "collision" in faults else tuple(collisions),
            faults.get("visual"),
            faults.get("collision"),
        )

    def inertial(self, link: NamedPart, stated: Element) -> Inertial:
        """Return the inertial that follows from the collisions of a link and their densities.

        A mass that is stated scales it. Raises UnsupportedFeatureError for a shape whose volume dynx does not
        compute.
        """
        reading = self._reading
        density = reading.scalar(stated, "density", link.what, DENSITY)
        found: list[SolidProperties] = []
        for element in link.element.all("collision"):
            what = _what(element, link)
            own = reading.scalar(element, "density", what, density)
            if own <= 0.0:
                raise reading.error(element, f"the density of {what} is {own:g}; wanted more than 0")
            solid = self._solid(element, what)
            if solid is None:
                continue
            pose = self._frames.placed(link, reading.only(element, "pose"), what)
            found.append(solid.transform(pose).of_density(own))
        if not found:
            raise reading.error(
                stated, f"the inertia of {link.what} follows from its collisions, and it has none"
            )
        inertial = inertial_of(sum(found[1:], found[0]), stated.line)
        mass = reading.scalar(stated, "mass", link.what, inertial.mass)
        scale = mass / inertial.mass
        moments = {name: scale * getattr(inertial, name) for name in USED["inertia"].split()}
        return replace(inertial, mass=mass, **moments)

    # -- parts of a shape -----------------------------------------------------------------------

    def _placed_shape(
        self, element: Element, link: NamedPart, what: str
    ) -> tuple[Shape, Pose] | DescriptionError | None:
        """Return a shape and its pose in the link, the reason why dynx has no such shape, or None without."""
        pose = self._frames.placed(link, self._reading.only(element, "pose"), what)
        shape = self._geometry_of(element, what)
        if shape is None:
            return None
        try:
            sheet = self._sheet(shape, link, what) if element.tag == "visual" else None
            found, placement = sheet or self._shape(shape, what)
        except ArgumentError as error:
            return self._reading.error(shape, f"{what}: {error}")
        except DescriptionError as error:
            return error
        return found, Pose.from_matrix(pose @ placement)

    def _geometry_of(self, element: Element, what: str) -> Element | None:
        geometry = self._reading.only(element, "geometry")
        if geometry is None:
            self._reading.note(element, f"{what} has no <geometry>, so no shape")
            return None
        known = [
            each for each in geometry.children if each.tag in USED["geometry"].split() and each.tag != "empty"
        ]
        if len(known) > 1:
            self._reading.note(known[1], f"{what} has several shapes; the first is used")
        return known[0] if known else None

    def _shape(self, element: Element, what: str) -> tuple[Shape, Floats]:
        """Return a shape and its pose (4, 4) in the element. Raises UnsupportedFeatureError for others."""
        reading, tag = self._reading, element.tag
        if tag == "box":
            return Box(self._vector(element, "size", what, 1.0)), np.eye(4)
        if tag == "sphere":
            return Sphere(*self._sizes(element, what)), np.eye(4)
        if tag == "cylinder":
            return Cylinder(*self._sizes(element, what)), np.eye(4)
        if tag == "capsule":
            return Capsule(*self._sizes(element, what)), np.eye(4)
        if tag == "ellipsoid":
            return Ellipsoid(self._vector(element, "radii", what, 1.0)), np.eye(4)
        if tag == "plane":
            for size in element.all("size"):
                reading.leave_unread(size, tag, "<size>", "a plane has no end")
            return Plane(), self._turned_to_normal(element, what)
        if tag == "mesh":
            return self._mesh(element, what), np.eye(4)
        raise reading.unsupported(element, f"{what} is <{tag}>, which is no shape of dynx")

    def _sheet(self, shape: Element, link: NamedPart, what: str) -> tuple[Shape, Floats] | None:
        """Return a visual plane with an end, such as a label, as the two triangles that Gazebo draws, and its
        pose (4, 4); None for another shape, and for a plane of a link that also collides as a plane."""
        size = self._reading.one(shape, "size", what) if shape.tag == "plane" else None
        collisions = (self._reading.only(each, "geometry") for each in link.element.all("collision"))
        if size is None or any(each is not None and each.all("plane") for each in collisions):
            return None
        x, y = (0.5 * length for length in self._reading.numbers(size, "size", what, 2))
        if min(x, y) <= 0.0:
            raise self._reading.error(
                shape, f"size of {what} is {2 * x:g} {2 * y:g}; wanted positive numbers"
            )
        points = ((-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0))
        sheet = StatedMesh(points=points, corners=((0, 1, 2), (0, 2, 3)), label="plane")
        return sheet, self._turned_to_normal(shape, what)

    def _turned_to_normal(self, plane: Element, what: str) -> Floats:
        """Return the pose (4, 4) whose z axis is the normal of a plane."""
        normal = np.array(self._vector(plane, "normal", what, 0.0, 0.0, 1.0))
        length = float(np.linalg.norm(normal))
        if length < 1e-14:
            raise self._reading.error(plane, f"the normal of {what} is zero; wanted a direction")
        return homogeneous(rotation_of_z(normal / length), np.zeros(3))

    def _mesh(self, element: Element, what: str) -> Mesh:
        reading = self._reading
        uri = reading.word(element, "uri", what)
        if uri is None:
            raise reading.error(element, f"the mesh of {what} has no <uri>")
        if element.all("submesh"):
            raise reading.unsupported(
                element, f"{what} is a part of a mesh (<submesh>), which dynx does not divide"
            )
        fault = None
        try:
            path = find_file(reading, element, uri, self._package_dirs)
        except MeshNotFoundError as error:
            path, fault = uri, reading.error(element, f"the mesh of {what} is not read: {error}")
        return Mesh(path, self._vector(element, "scale", what, 1.0), fault)

    def _solid(self, element: Element, what: str) -> SolidProperties | None:
        """Return the properties of a collision in its own frame; None for one without a shape."""
        reading = self._reading
        shape = self._geometry_of(element, what)
        if shape is None:
            return None
        try:
            if shape.tag == "cone":
                return _cone_properties(*self._sizes(shape, what))
            if shape.tag == "mesh":
                return mesh_properties(self._mesh(shape, what), "exact")
            if shape.tag in ("box", "sphere", "cylinder", "capsule", "ellipsoid"):
                return solid_properties(self._shape(shape, what)[0])
        except ArgumentError as error:
            raise reading.error(shape, f"{what}: {error}") from None
        raise reading.unsupported(
            shape, f"{what} is <{shape.tag}>, whose volume dynx does not compute, and a mass follows from it"
        )

    def _sizes(self, element: Element, what: str) -> tuple[float, ...]:
        names = ("radius", "length")
        defaults = _DEFAULTS[element.tag]
        return tuple(
            self._reading.scalar(element, name, what, default)
            for name, default in zip(names, defaults, strict=False)
        )

    def _vector(self, element: Element, tag: str, what: str, *default: float) -> tuple[float, float, float]:
        found = self._reading.one(element, tag, what)
        if found is None:
            x, y, z = default * 3 if len(default) == 1 else default
            return (x, y, z)
        return self._reading.vector(found, tag, what)

    def _appearance(self, element: Element, what: str) -> Appearance | None:
        reading = self._reading
        transparency = reading.scalar(element, "transparency", what, 0.0)
        material = reading.only(element, "material")
        found = None if material is None else reading.one(material, "diffuse", what)
        if found is None:
            return Appearance("", (1.0, 1.0, 1.0, 1.0 - transparency)) if transparency else None
        count = min(max(len(found.attributes["diffuse"].split()), 3), 4)
        red, green, blue, *alpha = reading.numbers(found, "diffuse", what, count)
        opacity = (alpha[0] if alpha else 1.0) * (1.0 - transparency)
        return Appearance("", (red, green, blue, opacity))


def _what(element: Element, link: NamedPart) -> str:
    return f"{element.tag} {shown(element.attributes.get('name', ''))} of {link.what}"


def _cone_properties(radius: float, length: float) -> SolidProperties:
    """Return the properties of a cone about z whose origin is halfway [m] between base and tip, which is
    up."""
    volume = math.pi * radius**2 * length / 3.0
    square = 3.0 / 20.0 * radius**2
    moments = volume * diagonal_inertia(square, square, 3.0 / 80.0 * length**2)
    return SolidProperties(volume, np.array([0.0, 0.0, -length / 4.0]), moments)
