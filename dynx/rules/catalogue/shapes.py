"""Shapes of visuals and collisions, and the files of their meshes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from dynx.errors import DescriptionError
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, found_by_bullet
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import Case, Correction, Detection, EditingRule, Rule, correction, measured_on
from dynx.rules.attributes import number_of, vector_of
from dynx.rules.geometry import (
    BULLET_ONLY,
    GREY,
    KNOWN,
    geometry_elements,
    has_shape,
    lacks_file,
    shapes_in,
    visual_faults,
    visual_textures,
)
from dynx.rules.numbers_in_text import decimal


class UnknownCollisionShape(EditingRule):
    """DX417 unknown-collision-shape: A collision has a shape that not every engine knows.

    The shapes of URDF are box, sphere, cylinder and mesh (and capsule in later versions). ``<plane>`` and
    ``<cdf>`` are extensions of PyBullet.

    - MuJoCo 4.0 refuses the file. (Even for a collision the message is "visual geometry specification not
      found".)
    - Pinocchio 4.1 drops the shape with a line on stderr. Drake 1.51 prints a warning or ignores the shape.
    - PyBullet 3.2.7 reads the shape.

    If a link states its inertia, its dynamics does not depend on shapes. But MuJoCo refuses the file.

    What to do: if you need the shape in other engines, write it as a box or a mesh. ``dynx doctor --fix``
    removes the ``<collision>``. ``--choose DX417=keep`` keeps it; MuJoCo then refuses the file.
    """

    stage = "reading"
    advice = "Write the shape as a box, sphere, cylinder or mesh."
    engines = measured_on("mujoco")
    choices = {
        "remove": "remove collisions of a shape that not every engine knows",
        "keep": "keep such collisions; MuJoCo then refuses the file",
    }
    changed = "removed collisions of unknown shape"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield collisions whose first geometry contains such a shape and no other."""
        for collision in case.elements("link", "collision"):
            shapes = shapes_in(collision)
            if BULLET_ONLY.intersection(shapes) and not KNOWN.intersection(shapes):
                named = ", ".join(f"<{shape}>" for shape in shapes)
                message = f"the geometry of <collision> is {named}"
                yield correction(collision, message, case.source.removal(collision))


class ShapeWithoutGeometry(EditingRule):
    """DX424 shape-without-geometry: A visual or collision has no geometry, or a geometry that no engine
    supports.

    Examples are ``<collision/>``, ``<visual><geometry/></visual>``, and a ``<geometry>`` with an element of
    another format. Usually a template was not filled in, or an exporter had no shape.

    - PyBullet 3.2.7 refuses the file ("Cannot load URDF file").
    - MuJoCo 4.0 refuses such a collision ("geometry specification not found"), and ignores such a visual.
    - Pinocchio 4.1 drops the shape with a line on stderr. Drake 1.51 prints a warning or ignores the shape.

    If a link states its inertia, its dynamics does not depend on shapes. But some engines refuse the file.
    For the shapes ``<plane>`` and ``<cdf>``, which only PyBullet reads, see DX417.

    What to do: remove the element, or write its geometry. ``dynx doctor --fix`` removes the element.
    ``--choose DX424=keep`` keeps it; engines then refuse the file.
    """

    stage = "reading"
    advice = "Remove the element, or write its geometry."
    engines = measured_on("pybullet", "mujoco")
    choices = {
        "remove": "remove visuals and collisions without a geometry that an engine supports",
        "keep": "keep such elements; engines then refuse the file",
    }
    changed = "removed visuals and collisions without geometry"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield visuals and collisions of links without a known shape."""
        for link in case.source.root.all("link"):
            for shape in link.children:
                if shape.tag in ("visual", "collision") and not has_shape(shape):
                    found = ", ".join(f"<{tag}>" for tag in shapes_in(shape)) or "nothing"
                    message = f"the geometry of <{shape.tag}> is {found}"
                    yield correction(shape, message, case.source.removal(shape))


_SIZES_OF_SHAPES: Mapping[str, tuple[str, ...]] = {
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}
"""The attributes that every engine requires, by shape."""

_KNOWN_SHAPES = (*_SIZES_OF_SHAPES, "mesh")

_LEAST_SIZE = 1e-6
"""Size [m] in place of zero: too small for anyone to see, and large beside the rounding of contacts."""


class CollisionShapeWithoutSize(EditingRule):
    """DX425 collision-shape-without-size: A size of a collision shape is zero, negative or missing, or a mesh
    has no file.

    Exporters and templates write ``<box size="0 0 0"/>``, ``<sphere radius="0"/>`` or ``<mesh filename=""/>``
    for a link that has no shape. Or the thickness of a plate is zero.

    - MuJoCo 4.0 refuses the file if a size of a box, sphere, cylinder or capsule is not positive ("size 0
      must be positive in geom"). It accepts any positive size, however small. It also refuses a missing
      attribute ("required attribute missing").
    - PyBullet 3.2.7 accepts sizes of zero and negative sizes. If the attribute is missing, it refuses the
      file ("Cannot load URDF file").
    - MuJoCo and PyBullet refuse a ``<mesh>`` without ``filename``, or with an empty ``filename``.
    - Drake 1.51 reads shapes only into a scene graph. If a size of a collision or visual shape is then not
      positive, Drake raises ``SystemExit``, which ends the program. Drake accepts a sphere of radius zero.
    - Pinocchio 4.1 reads no shapes into a model.

    If a link states its inertia, its dynamics does not depend on shapes. But some engines refuse the file.

    What to do: remove the shape, or write its size. ``dynx doctor --fix`` removes the sign of a negative
    size. If a size is zero or missing, it removes the ``<collision>``. ``--choose DX425=thicken`` writes 1e-6
    m for each size of zero instead, so a plate keeps its contacts. It still removes a shape if a size or the
    file is missing. ``--choose DX425=keep`` keeps the file; MuJoCo then refuses it.
    """

    stage = "reading"
    advice = "Remove the shape, or write its size or file."
    engines = measured_on("mujoco", "pybullet")
    choices = {
        "remove": "remove collisions without size",
        "thicken": "write 1e-6 m for sizes of zero; remove a collision only if a size is missing",
        "keep": "keep such collisions; engines that need a size then refuse the file",
    }
    changed = "removed collision shapes without size or file, or gave them a size"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the collisions whose first known shape has such a size."""
        for collision in case.elements("link", "collision"):
            geometry = collision.first("geometry")
            children = () if geometry is None else geometry.children
            shape = next((each for each in children if each.tag in _KNOWN_SHAPES), None)
            if shape is not None and (fault := _size_fault(shape)):
                yield correction(shape, f"<{shape.tag}> {fault}", *self._edits(case, collision, shape))

    def _edits(self, case: Case, collision: SourceElement, shape: SourceElement) -> tuple[Edit, ...]:
        sizes = {name: _sizes_in(shape, name) for name in _SIZES_OF_SHAPES.get(shape.tag, ())}
        found = [size for size in sizes.values() if size is not None]
        is_lacking = not sizes or None in sizes.values()
        if is_lacking or (self.chosen(case) == "remove" and any(0.0 in size for size in found)):
            return (case.source.removal(collision),)
        return tuple(
            case.source.attribute_edit(
                shape, name, " ".join(decimal(abs(each) or _LEAST_SIZE) for each in found)
            )
            for name, found in sizes.items()
            if found is not None and min(found) <= 0.0
        )


def _size_fault(shape: SourceElement) -> str | None:
    """Describe the fault of a shape's sizes; None also for text that is no number, which has other rules."""
    if shape.tag == "mesh":
        return "names no file" if lacks_file(shape) else None
    for name in _SIZES_OF_SHAPES[shape.tag]:
        if name not in shape.attributes:
            return f"has no {name}"
        found = _sizes_in(shape, name)
        if found is not None and min(found) <= 0.0:
            return f'has {name}="{shape.attributes[name]}"'
    return None


def _sizes_in(shape: SourceElement, name: str) -> tuple[float, ...] | None:
    """Return the sizes [m] in an attribute; None where it is absent or holds anything but finite numbers."""
    try:
        if name == "size":
            return vector_of(shape, name)
        number = number_of(shape, name)
    except DescriptionError:
        return None
    return None if number is None else (number,)


class VisualIncomplete(EditingRule):
    """DX428 visual-incomplete: A visual lacks a size, a mesh file, or the name or colour of its material.

    The dynamics does not depend on visuals. But some engines refuse the file. Of each visual, engines read
    the first shape and the first material.

    - PyBullet 3.2.7 refuses the file ("Cannot load URDF file") for a ``<box>`` without ``size``, a
      ``<sphere>`` without ``radius``, and a ``<cylinder>`` or ``<capsule>`` without ``radius`` or ``length``.
      It also refuses a ``<mesh>`` without ``filename`` or with an empty one, and a ``<material>`` without
      ``name``.
    - MuJoCo 4.0 refuses a ``<color>`` whose ``rgba`` is missing or not four numbers ("attribute 'rgba' does
      not have enough data"), and a ``<material>`` with neither name nor colour.
    - Pinocchio 4.1 and Drake 1.51 load the robot, because they read no visuals into a model without geometry.

    Three other rules are similar: DX425 (a collision without its size), DX427 (a material directly in
    ``<robot>``) and DX411 (a second material).

    What to do: complete the visual. ``dynx doctor --fix`` removes a visual with an incomplete shape, and
    gives an incomplete material a name or a grey colour. ``--choose DX428=keep`` keeps the file as it is;
    engines then refuse it.
    """

    stage = "reading"
    advice = "Write the size, the file, or the name and colour that the visual lacks."
    engines = measured_on("pybullet", "mujoco")
    choices = {
        "complete": "remove visuals with an incomplete shape, and complete their materials",
        "keep": "keep such visuals; engines then refuse the file",
    }
    changed = "removed incomplete visuals, and completed the materials of visuals"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the faults of each visual of a link."""
        for visual in case.elements("link", "visual"):
            faults = list(visual_faults(visual))
            # A visual is removed once, whatever else is wrong in it.
            whole = [each for each, _ in faults if each.tag not in ("material", "color")]
            for element, message in faults:
                edits = () if whole and element not in whole else (_completion(case, visual, element),)
                yield correction(element, message, *edits)


def _completion(case: Case, visual: SourceElement, element: SourceElement) -> Edit:
    if element.tag == "material":
        return case.source.attribute_edit(element, "name", f"visual_in_line_{visual.line}")
    if element.tag == "color":
        return case.source.replacement(element, GREY)
    return case.source.removal(visual)


class MeshNotFound(Rule):
    """DX516 mesh-not-found: The file of a mesh, or of the texture of a visual, is not where the robot file
    says.

    The rule reports a missing file only if dynx knows where it should be. dynx knows this for a path relative
    to the robot file, a ``file://`` path, and a path in a package that dynx found. dynx looks for packages in
    the folders above the robot file, in ROS_PACKAGE_PATH and in AMENT_PREFIX_PATH. On a case-sensitive file
    system ``Base.STL`` is not ``base.stl``. dynx does not examine paths that leave the package or repository
    of the robot file.

    - PyBullet 3.2.7 refuses the robot file ("Cannot load URDF file") if a mesh in ``<visual>`` or
      ``<collision>`` is missing. It searches for every path, even ``/meshes/a.stl``, in the folder of the
      robot file and in each folder above. It also searches folders of its own (``setAdditionalSearchPath``).
      So it may find meshes that other engines do not find. The message of this rule names the file that
      PyBullet finds in the package or repository.
    - Drake 1.51 refuses the robot file only with a scene graph. It then also needs the textures in
      ``<visual>``.
    - MuJoCo 4.0 refuses the robot file if a mesh in ``<collision>`` is missing. It ignores visual shapes.
    - Pinocchio's ``buildModelFromUrdf`` reads no mesh. Its ``buildGeomFromUrdf`` raises an error.

    For a missing texture in a material directly in ``<robot>``, see DX426. The dynamics does not depend on
    shapes, and dynx reads the file without them.

    dynx does not know which file the author meant, so no edit removes the cause. The message gives the
    nearest name.
    """

    kind = "practice"
    advice = "Put the file there, or correct the path (capital letters matter)."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first reference to each missing file."""
        seen = {""}
        for name, link in case.links.items():
            shapes = [each for each in geometry_elements(link) if each.tag == "mesh"]
            for element in (*shapes, *visual_textures(link)):
                filename = element.attributes.get("filename", "")
                if filename in seen:
                    continue
                seen.add(filename)
                try:
                    find_mesh(filename, case.source.source)
                except MeshNotFoundError as error:
                    where = found_by_bullet(filename, case.source.source)
                    yield Detection(name, None, element.line, f"{error}{where}")
