"""Geoms of MJCF: their shapes, colours, masses and inertias."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.errors import ArgumentError, DescriptionError, NotInstalledError, nearest, shown
from dynx.files.reading import read_file
from dynx.model.elements import Pose, Vector
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    HeightField,
    LinkGeometry,
    Mesh,
    Plane,
    Sphere,
    Visual,
)
from dynx.model.geometry.images import read_levels
from dynx.model.geometry.mesh_inertia import mesh_properties
from dynx.model.geometry.shapes import MAX_HEIGHTS
from dynx.model.geometry.shells import shell_properties
from dynx.model.geometry.solids import Shape, SolidProperties, solid_properties
from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.model.mjcf.document import MjcfText, stem
from dynx.model.xml.reading import Element
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat, rotation_of_z

DENSITY = 1000.0
"""Density of a geom that states neither density nor mass [kg/m^3]."""

_TYPES = ("sphere", "box", "capsule", "cylinder", "ellipsoid", "mesh", "plane", "hfield", "sdf")
_SIZES = {"sphere": 1, "box": 3, "capsule": 2, "cylinder": 2, "ellipsoid": 3}
_WITHOUT_VOLUME = ("plane", "hfield")
_ALONG_A_LINE = ("capsule", "box", "cylinder", "ellipsoid")
_SHOWN_GROUPS = (0, 1, 2)
"""Groups of geoms that MuJoCo's viewer shows unless it is told otherwise."""


@dataclass(frozen=True)
class MeshAsset:
    """A ``<mesh>``: its file, the pose of the file's axes in those of the asset, how its volume is meant."""

    mesh: Mesh
    placement: Floats
    inertia: str
    element: Element
    material: str | None


@dataclass(frozen=True)
class GeomContact:
    """With what a geom touches, and how: MuJoCo tests two geoms if `contype` of one and `conaffinity` of the
    other share a bit.

    `friction` has the coefficients of sliding [1], spinning [m] and rolling [m]; `condim` says which act: 1
    none, 3 the first, 4 the first two, 6 all.
    """

    contype: int
    conaffinity: int
    condim: int
    friction: Vector
    priority: float

    def meets(self, other: GeomContact) -> bool:
        """Check whether MuJoCo tests geoms with these parameters for contact."""
        return bool(self.contype & other.conaffinity or other.contype & self.conaffinity)

    @property
    def acting_friction(self) -> Vector:
        """The coefficients of the directions that `condim` has, and 0 for the others."""
        sliding, torsional, rolling = self.friction
        return (
            sliding if self.condim >= 3 else 0.0,
            torsional if self.condim >= 4 else 0.0,
            rolling if self.condim >= 6 else 0.0,
        )


_FRICTION = (1.0, 0.005, 0.0001)
"""Coefficients of sliding, spinning and rolling of a geom that states none."""


@dataclass(frozen=True)
class Geom:
    """A geom with its pose (4, 4) in the body, its `type`, sizes as MJCF states them, and its asset."""

    element: Element
    name: str
    type: str
    size: tuple[float, ...]
    pose: Floats
    group: int
    collides: bool
    contact: GeomContact
    asset: MeshAsset | None
    fault: str

    @property
    def what(self) -> str:
        """Name of the geom in errors."""
        return f"geom {shown(self.name)}" if self.name else "a geom without a name"


class GeomReader:
    """Reads geoms of one document, with the meshes and materials that they name."""

    def __init__(self, document: MjcfText, paired: frozenset[str] = frozenset()) -> None:
        """`paired` are the geoms that collide whatever their `contype` and `conaffinity`."""
        self._document, self._reading, self._paired = document, document.reading, paired
        self._materials: dict[str, Element] = {}
        self._textures: dict[str, Element] = {}
        self._meshes: dict[str, Element] = {}
        self._assets: dict[str, MeshAsset] = {}
        self._fields: dict[str, Element] = {}
        self._height_fields: dict[str, HeightField] = {}
        self._points = 0
        for element in document.sections("asset"):
            if element.tag == "material":
                self._materials[element.attributes.get("name", "")] = document.resolved(element, None)
            elif element.tag == "texture":
                given = element.attributes
                self._textures[given.get("name") or stem(given.get("file", ""))] = element
            elif element.tag == "hfield":
                field = element.attributes.get("name") or stem(element.attributes.get("file", ""))
                self._fields[field] = element
            elif element.tag == "mesh":
                resolved = document.resolved(element, None)
                name = element.attributes.get("name")
                if name is None:
                    name = stem(element.attributes.get("file", ""))
                self._meshes[name] = resolved

    def geom(self, element: Element, childclass: str | None, outer: Floats) -> Geom:
        """Read a geom whose pose is stated in a frame of pose `outer` (4, 4) in the body."""
        reading = self._reading
        element = self._document.resolved(element, childclass)
        name = element.attributes.get("name", "")
        what = f"geom {shown(name)}" if name else "a geom"
        kind = reading.choice(element, "type", what, _TYPES, "sphere")
        asset, fault = None, ""
        if "mesh" in element.attributes:
            asset = self._asset(element, what)
            if kind in _WITHOUT_VOLUME:
                raise reading.error(element, f"{what} is a {kind} and names a mesh, to which none is fitted")
        elif kind == "mesh":
            raise reading.error(element, f'{what} is a mesh and names none; wanted mesh="..."')
        if kind == "sdf":
            fault = f"{what} is a signed distance field of a plug-in, which dynx does not read"
        size, pose = self._placed(element, kind, what, fitted=asset is not None)
        groups = reading.numbers(element, "group", what, 1) if "group" in element.attributes else (0.0,)
        contact = self._contact(element, what)
        collides = bool(contact.contype or contact.conaffinity) or name in self._paired
        return Geom(element, name, kind, size, outer @ pose, int(groups[0]), collides, contact, asset, fault)

    def pose_of_site(self, element: Element, what: str) -> Floats:
        """Return the pose (4, 4) of a site, which ``fromto`` may state."""
        if "fromto" not in element.attributes:
            return self._document.pose(element, what)
        return self._between(element, what)[0]

    def properties(self, geom: Geom) -> SolidProperties | None:
        """Return the properties of a geom in the axes of its body, with its mass [kg] for the volume; None
        for one without mass.

        Raises UnsupportedFeatureError for a shape whose volume dynx does not compute.
        """
        reading, element = self._reading, geom.element
        density = reading.number_or(element, "density", geom.what, DENSITY)
        mass = reading.number(element, "mass", geom.what) if "mass" in element.attributes else None
        for word, value in (("mass", mass), ("density", density)):
            if value is not None and value < 0.0:
                raise reading.error(element, f"{word} of {geom.what} is {value:g}; wanted at least 0")
        if geom.type in _WITHOUT_VOLUME or mass == 0.0 or (mass is None and density == 0.0):
            return None
        if geom.fault:
            raise reading.unsupported(element, f"{geom.fault}, and the mass of its body follows from it")
        geom = self._fitted(geom)
        shell = reading.flag(element, "shellinertia", geom.what, default=False)
        solid = self._solid(geom, shell)
        if solid.volume <= 0.0:
            raise reading.error(
                element, f"{geom.what} has no volume, and the mass of its body follows from it"
            )
        solid = solid.transform(geom.pose)
        return solid.of_density(density if mass is None else mass / solid.volume)

    def geometry(self, geoms: Sequence[Geom]) -> LinkGeometry:
        """Return the shapes of a link: those that are shown, and those that collide."""
        visuals: list[Visual] = []
        collisions: list[Collision] = []
        faults: dict[str, DescriptionError] = {}
        for geom in geoms:
            shown_, line = geom.group in _SHOWN_GROUPS, geom.element.line
            try:
                shape, pose = self._shape(self._fitted(geom))
                origin = Pose.from_matrix(pose)
                if shown_:
                    visuals.append(Visual(shape, origin, self._appearance(geom), geom.name, line))
                if geom.collides:
                    collisions.append(Collision(shape, origin, geom.name, line))
            except DescriptionError as error:
                found = error
            except ArgumentError as error:
                found = self._reading.error(geom.element, f"{geom.what}: {error}")
            else:
                continue
            faults |= {kind: found for kind, has in (("v", shown_), ("c", geom.collides)) if has}
        return LinkGeometry(
            () if "v" in faults else tuple(visuals),
            () if "c" in faults else tuple(collisions),
            faults.get("v"),
            faults.get("c"),
        )

    # -- parts of a geom ------------------------------------------------------------------------

    def _contact(self, element: Element, what: str) -> GeomContact:
        reading = self._reading
        contype, conaffinity = (
            int(reading.number_or(element, each, what, 1.0)) for each in ("contype", "conaffinity")
        )
        friction = _FRICTION
        if "friction" in element.attributes:
            given = reading.some_numbers(element, "friction", what, 1, 3)
            first, second, third = (*given, *_FRICTION[len(given) :])
            friction = (first, second, third)
        condim = int(reading.number_or(element, "condim", what, 3.0))
        return GeomContact(
            contype, conaffinity, condim, friction, reading.number_or(element, "priority", what, 0.0)
        )

    def _placed(
        self, element: Element, kind: str, what: str, *, fitted: bool
    ) -> tuple[tuple[float, ...], Floats]:
        """Return the sizes of a geom and its pose (4, 4), of which ``fromto`` states a part."""
        reading = self._reading
        count = 0 if fitted else _SIZES.get(kind, 0)
        pose = None
        if "fromto" in element.attributes and not fitted:
            if kind not in _ALONG_A_LINE:
                raise reading.error(element, f"{what} is a {kind} and has fromto")
            pose, length = self._between(element, what)
            (radius,) = self._sizes(element, kind, what, 1)
            size: tuple[float, ...] = (radius, length / 2.0) if count == 2 else (radius, radius, length / 2.0)
        else:
            size = self._sizes(element, kind, what, count)
        return size, self._document.pose(element, what) if pose is None else pose

    def _between(self, element: Element, what: str) -> tuple[Floats, float]:
        """Return the pose (4, 4) in the middle of the two points of ``fromto``, with z along them, and their
        distance."""
        ends = np.array(self._reading.numbers(element, "fromto", what, 6))
        along = ends[3:] - ends[:3]
        length = float(np.linalg.norm(along))
        if length < 1e-14:
            raise self._reading.error(element, f"the two points of fromto of {what} are one")
        return homogeneous(rotation_of_z(along / length), (ends[:3] + ends[3:]) / 2.0), length

    def _sizes(self, element: Element, kind: str, what: str, count: int) -> tuple[float, ...]:
        reading = self._reading
        if not count:
            return ()
        if "size" not in element.attributes:
            raise reading.error(element, f"{what} is a {kind} and has no size; wanted {count} of them")
        size = reading.some_numbers(element, "size", what, count, 3)[:count]
        if not all(value > 0.0 for value in size):
            raise reading.error(
                element, f"size of {what} is {shown(element.attributes['size'])}; wanted more than 0"
            )
        return size

    def _fitted(self, geom: Geom) -> Geom:
        """Return a primitive that is fitted to a mesh with its sizes and pose; another geom as it is.

        It has the box of the mesh's inertia, or with ``fitaabb`` the one around the mesh along its principal
        axes, z along the longest extent (MuJoCo, XML reference, geom, mesh).
        """
        if geom.asset is None or geom.type in ("mesh", "sdf"):
            return geom
        asset, element = geom.asset, geom.element
        solid = self._of_mesh(asset, asset.inertia, geom.what)
        moments, axes = np.linalg.eigh(solid.inertia)
        axes = axes[:, ::-1] * np.sign(np.linalg.det(axes[:, ::-1]))
        frame = homogeneous(axes, solid.center)
        if self._document.compiler_of(element).fit_bounding_box:
            inner = (asset.mesh.triangles[0] - solid.center) @ axes
            low, high = inner.min(axis=0), inner.max(axis=0)
            x, y, z = (high - low) / 2.0
            frame = frame @ homogeneous(np.eye(3), (high + low) / 2.0)
            radius, length = max(x, y), z - max(x, y) if geom.type == "capsule" else z
            whole = max(x, y, z)
        else:
            x, y, z = np.sqrt(6.0 * np.maximum(moments.sum() - 2.0 * moments[::-1], 0.0) / solid.volume) / 2.0
            radius, whole = (x + y) / 2.0, (x + y + z) / 3.0
            length = max(0.0, z - radius / 2.0) if geom.type == "capsule" else z
        scale = self._reading.number_or(element, "fitscale", geom.what, 1.0)
        sizes = {"sphere": (whole,), "capsule": (radius, length), "cylinder": (radius, length)}
        size = tuple(scale * float(each) for each in sizes.get(geom.type, (x, y, z)))
        if not all(value >= 0.0 for value in size):
            raise self._reading.error(element, f"{geom.what} is fitted to a mesh, and has the size {size}")
        return replace(geom, size=size, pose=geom.pose @ asset.placement @ frame, asset=None)

    def _of_mesh(self, asset: MeshAsset, kind: str, what: str) -> SolidProperties:
        """Return the properties of a mesh in the axes of its file."""
        try:
            return mesh_properties(asset.mesh, kind)
        except ArgumentError as error:
            raise self._reading.error(asset.element, f"the mesh of {what}: {error}") from None

    def _solid(self, geom: Geom, shell: bool) -> SolidProperties:
        shape, pose = self._shape(geom)
        if geom.asset is None:
            return shell_properties(shape) if shell else solid_properties(shape)
        kind = "shell" if shell else geom.asset.inertia
        return self._of_mesh(geom.asset, kind, geom.what).transform(inverse(geom.pose) @ pose)

    def _shape(self, geom: Geom) -> tuple[Shape, Floats]:
        """Return the shape of a geom and its pose in the body. Raises UnsupportedFeatureError."""
        size = geom.size
        if geom.fault:
            raise self._reading.unsupported(geom.element, geom.fault)
        if geom.asset is not None:
            return geom.asset.mesh, geom.pose @ geom.asset.placement
        if geom.type == "sphere":
            return Sphere(size[0]), geom.pose
        if geom.type == "box":
            return Box((2.0 * size[0], 2.0 * size[1], 2.0 * size[2])), geom.pose
        if geom.type == "capsule":
            # One that is fitted to a flat mesh has no length.
            return Capsule(size[0], 2.0 * size[1]) if size[1] else Sphere(size[0]), geom.pose
        if geom.type == "cylinder":
            return Cylinder(size[0], 2.0 * size[1]), geom.pose
        if geom.type == "ellipsoid":
            return Ellipsoid((size[0], size[1], size[2])), geom.pose
        if geom.type == "plane":
            return Plane(), geom.pose
        if geom.type == "hfield":
            return self._height_field(geom), geom.pose
        raise self._reading.unsupported(
            geom.element, f"{geom.what} is of type {geom.type}, which is no shape of dynx"
        )

    def _height_field(self, geom: Geom) -> HeightField:
        """Return the shape of a geom of type ``hfield``, whose heights MuJoCo scales to 0 to 1."""
        reading = self._reading
        name = reading.attribute(geom.element, "hfield", geom.what)
        if name not in self._fields:
            raise reading.error(
                geom.element, f"{geom.what} names the height field {shown(name)}{nearest(name, self._fields)}"
            )
        if name not in self._height_fields:
            self._height_fields[name] = self._read_height_field(name)
        return self._height_fields[name]

    def _read_height_field(self, name: str) -> HeightField:
        reading = self._reading
        element, what = self._fields[name], f"height field {shown(name)}"
        size_x, size_y, height, _ = reading.numbers(element, "size", what, 4)
        if "file" in element.attributes:
            heights = self._heights_of_file(element, what)
            self._require_few_heights(element, what, heights.size)
        else:
            rows, columns = (self._whole(element, each, what) for each in ("nrow", "ncol"))
            self._require_few_heights(element, what, rows * columns)
            heights = np.zeros((rows, columns))
            if "elevation" in element.attributes:
                count = rows * columns
                stated = reading.some_numbers(element, "elevation", what, count, count)
                # The first row of the text is that of the largest y.
                heights = np.array(stated).reshape(rows, columns)[::-1]
        self._points += heights.size
        heights = heights - heights.min()
        if heights.max() > 0.0:
            heights = heights / heights.max()
        return HeightField(tuple(map(tuple, (height * heights).tolist())), (2.0 * size_x, 2.0 * size_y))

    def _require_few_heights(self, element: Element, what: str, count: int) -> None:
        """Raise DescriptionError for more points than MAX_HEIGHTS in all height fields that are used."""
        if self._points + count > MAX_HEIGHTS:
            raise self._reading.error(
                element, f"the model has more than {MAX_HEIGHTS} heights; {what} has {count} of them"
            )

    def _whole(self, element: Element, attribute: str, what: str) -> int:
        value = self._reading.number(element, attribute, what)
        if value != int(value) or not 2 <= value <= MAX_HEIGHTS:
            raise self._reading.error(
                element, f"{attribute} of {what} is {value:g}; wanted a whole number from 2 to {MAX_HEIGHTS}"
            )
        return int(value)

    def _heights_of_file(self, element: Element, what: str) -> Floats:
        """Return the heights (rows, columns) of a file in MuJoCo's own format: two counts, and floats."""
        filename = element.attributes["file"]
        path, reason = self._document.find(element, self._document.compiler_of(element).mesh_folder, filename)
        if reason:
            raise self._reading.error(element, f"{what} is not read: {reason}")
        if filename.lower().endswith(".png"):
            return self._heights_of_image(element, path, what)
        data = read_file(path)
        rows, columns = np.frombuffer(data[:8], "<i4").tolist() if len(data) >= 8 else (0, 0)
        if min(rows, columns) < 2 or len(data) != 8 + 4 * rows * columns:
            raise self._reading.error(
                element, f"the file {shown(filename)} of {what} is no height field in MuJoCo's own format"
            )
        heights = np.frombuffer(data[8:], "<f4").astype(np.float64).reshape(rows, columns)
        if not np.isfinite(heights).all():
            raise self._reading.error(element, f"the file {shown(filename)} of {what} has heights of NaN")
        return heights

    def _heights_of_image(self, element: Element, path: str, what: str) -> Floats:
        """Return the heights (rows, columns) of an image, whose upper row is that of the largest y."""
        try:
            return np.array(read_levels(read_file(path))[::-1], dtype=np.float64)
        except NotInstalledError as error:
            raise self._reading.unsupported(element, f"{what} is an image: {error}") from None
        except ValueError as error:
            raise self._reading.error(element, f"the image of {what}: {error}") from None

    def _appearance(self, geom: Geom) -> Appearance | None:
        """Return the colour of a geom: its own, else that of its material, else that of its mesh's."""
        reading, element = self._reading, geom.element
        name = element.attributes.get("material") or (geom.asset.material if geom.asset else None)
        if "rgba" in element.attributes:
            red, green, blue, opacity = reading.numbers(element, "rgba", geom.what, 4)
            return Appearance(name or "", (red, green, blue, opacity))
        if name is None:
            return None
        if name not in self._materials:
            raise reading.error(
                element,
                f"{geom.what} names the material {shown(name)}, which no <asset> has"
                f"{nearest(name, self._materials)}",
            )
        material = self._materials[name]
        texture, reason = self._image(material)
        if "rgba" not in material.attributes:
            # With an image it has the colours of that.
            return Appearance(name, None if texture else (1.0, 1.0, 1.0, 1.0), texture, reason)
        red, green, blue, opacity = reading.numbers(material, "rgba", f"material {shown(name)}", 4)
        return Appearance(name, (red, green, blue, opacity), texture, reason)

    def _image(self, material: Element) -> tuple[str | None, str]:
        """Return the path of the image of a material, and why it is not read; None for one without."""
        name = material.attributes.get("texture")
        element = None if name is None else self._textures.get(name)
        if element is None or "file" not in element.attributes:
            return None, ""
        return self._document.find(
            element, self._document.compiler_of(element).texture_folder, element.attributes["file"]
        )

    def _asset(self, element: Element, what: str) -> MeshAsset:
        name = element.attributes["mesh"]
        if name not in self._meshes:
            raise self._reading.error(
                element,
                f"{what} names the mesh {shown(name)}, which no <asset> has{nearest(name, self._meshes)}",
            )
        if name not in self._assets:
            self._assets[name] = self._read_mesh(self._meshes[name], f"mesh {shown(name)}")
        return self._assets[name]

    def _read_mesh(self, element: Element, what: str) -> MeshAsset:
        reading, given = self._reading, element.attributes
        scale = reading.vector(element, "scale", what) if "scale" in given else (1.0, 1.0, 1.0)
        inertia = reading.choice(element, "inertia", what, ("convex", "exact", "legacy", "shell"), "legacy")
        shift = np.array(reading.vector(element, "refpos", what) if "refpos" in given else (0.0, 0.0, 0.0))
        R = np.eye(3)
        if "refquat" in given:
            w, x, y, z = np.array(reading.numbers(element, "refquat", what, 4))
            R = np.asarray(
                rotation_from_quat(np.array([x, y, z, w]) / math.sqrt(w * w + x * x + y * y + z * z))
            )
        # MuJoCo shifts what the file holds, turns it and scales it. `Mesh` scales first: where that comes to
        # the same, the rest is the pose of the file's axes.
        placement = homogeneous(R.T, -np.array(scale) * (R.T @ shift))
        fault: DescriptionError | None = None
        if (np.eye(3) != R).any() and len(set(scale)) > 1:
            fault = reading.unsupported(
                element,
                f"{what} has refquat and a scale that differs along the axes, which dynx does not read",
            )
        if "vertex" in given and "file" not in given:
            # What `Mesh` cannot say of a file is done to the vertices.
            mesh = self._stated_mesh(element, what, scale, (shift, R) if fault is not None else None)
            placement = np.eye(4) if fault is not None else placement
            return MeshAsset(mesh, placement, inertia, element, given.get("material"))
        path = what
        if "file" not in given:
            why = "made by the compiler" if "builtin" in given else "has no file and no vertices"
            fault = reading.unsupported(element, f"{what} {'is ' if 'builtin' in given else ''}{why}")
        else:
            path, reason = self._document.find(
                element, self._document.compiler_of(element).mesh_folder, given["file"]
            )
            fault = reading.error(element, f"{what} is not read: {reason}") if reason else fault
        return MeshAsset(Mesh(path, scale, fault), placement, inertia, element, given.get("material"))

    def _stated_mesh(
        self, element: Element, what: str, scale: Vector, moved: tuple[Floats, Floats] | None
    ) -> StatedMesh:
        """Return a mesh that ``vertex`` and ``face`` state; without faces it is the hull of its vertices.

        They are first `moved` back by a shift (3,), and turned back by a rotation (3, 3).
        """
        reading, given = self._reading, element.attributes
        counts = {name: len(given.get(name, "").split()) for name in ("vertex", "face")}
        for name, count in counts.items():
            if count % 3 or (name == "vertex" and count < 12):
                least = "; wanted those of at least four" if name == "vertex" else ""
                raise reading.error(
                    element, f"{name} of {what} has {count} numbers; wanted three of each{least}"
                )
        points = np.array(reading.numbers(element, "vertex", what, counts["vertex"])).reshape(-1, 3)
        if moved is not None:
            points = (points - moved[0]) @ moved[1]
        corners = np.empty((0, 3))
        if counts["face"]:
            corners = np.array(reading.numbers(element, "face", what, counts["face"])).reshape(-1, 3)
        label = given.get("name") or "mesh"
        if not (corners == np.rint(corners)).all():
            raise reading.error(element, f"face of {what} has a number that is not whole")
        try:
            return StatedMesh(
                scale=scale,
                points=tuple((x, y, z) for x, y, z in points.tolist()),
                corners=tuple((a, b, c) for a, b, c in corners.astype(np.intp).tolist()),
                label=label,
            )
        except ArgumentError as error:
            raise reading.error(element, f"{what}: {error}") from None
