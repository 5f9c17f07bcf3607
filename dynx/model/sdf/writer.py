"""Writer of a robot as SDF 1.11: each link a link, each joint at the origin of the link that it moves.

It needs neither Gazebo nor Drake, and the reader beside it reads what it writes. One version is written,
1.11: the first that has ``<mimic>``, and the newest that Gazebo Harmonic reads; Drake reads it too. A link is
placed in its parent, by the numbers of the robot, so that a joint needs no pose of its own.

A fixed base is a fixed joint from ``world`` to the root link. In a ``<static>`` model of Gazebo no joint
moves at all. What SDF has no element for stands in elements of `dynx.model.sdf.extension`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from xml.etree.ElementTree import Element, SubElement

from dynx.argument_types import checks_types
from dynx.errors import DescriptionError, shown
from dynx.model.elements import IDENTITY, Inertial, Joint, Limits, Link, Pose
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
from dynx.model.geometry.solids import Shape
from dynx.model.mjcf.attributes import document_text, text
from dynx.model.sdf.document import WORLD, is_reserved
from dynx.model.sdf.extension import HOLD, LIMITS, LOCKED, NAME, NAMESPACE, ROTOR_INERTIA
from dynx.model.sdf.reader import UNLIMITED
from dynx.model.tree import STANDARD_GRAVITY, Tree
from dynx.model.urdf.reader import inertia_fault
from dynx.model.urdf.writer import listed, note_of_kind, notes_of_open_parts
from dynx.model.xml.several_files import free_name
from dynx.model.xml.values import name_fault

VERSION = "1.11"
"""Version of the format that is written."""

AssetPath = Callable[[str], str]
"""Function from the path of an image to the path in the document."""

MeshPath = Callable[[Mesh], str]
"""Function from a mesh to the path in the document of a file with its triangles, before they are scaled."""

_DELIMITER = "::"


@checks_types
def write_sdf(tree: Tree, /) -> str:
    """Return the robot as SDF text of version 1.11, with comments on what the format cannot say.

    `dynx.load` of the text returns a model with the same links, joints, frames, inertias, limits and
    coefficients, to rounding. Gazebo and Drake read it too. A robot whose gravity is not (0, 0, -9.81) stands
    in a ``<world>``, which states it. Meshes are named by their full paths; ``dynx convert`` copies them.

    Raises DescriptionError for a name that XML cannot express and a limit that is NaN.
    """
    return SdfWriter(tree).text()


class SdfWriter:
    """The SDF document of a robot, with notes on what it cannot say."""

    def __init__(
        self,
        tree: Tree,
        mesh_path: MeshPath = lambda mesh: mesh.file,
    ) -> None:
        """`mesh_path` names the files of meshes in the document. Raises the errors of `write_sdf`."""
        self._tree, self._mesh_path = tree, mesh_path
        self.notes: list[str] = []
        """Sentences on what SDF cannot say of the robot, each with its effect."""
        self._kinds: dict[str, list[str]] = {}
        self._root = Element("sdf", {"version": VERSION, "xmlns:dynx": NAMESPACE})
        # A root link ``world`` without anything of its own is the world of the format.
        self._on_world = self._is_bare_world()
        self._name_parts()
        name = _accepted(tree.name, "robot")
        self._model = SubElement(self._around(name), "model", name=name)
        _keep_name(self._model, tree.name, name)
        if tree.base_pose != IDENTITY:
            _text(self._model, "pose", (*tree.base_pose.xyz, *tree.base_pose.rpy))
        self._add_parts()
        self._add_notes()

    def text(self) -> str:
        """Return the document, with its notes as comments at the beginning."""
        return document_text(self._root, self.notes)

    def _around(self, name: str) -> Element:
        """Return the element that the model stands in: a world where gravity must be stated."""
        if self._tree.gravity == STANDARD_GRAVITY:
            return self._root
        world = SubElement(self._root, "world", name=f"{name}_world")
        _text(world, "gravity", self._tree.gravity)
        return world

    def _is_bare_world(self) -> bool:
        tree, root = self._tree, self._tree.links[0]
        shapes = tree.geometry.links.get(root.name, LinkGeometry())
        return (
            root.name == WORLD
            and not tree.floating
            and len(tree.links) > 1
            and tree.base_pose == IDENTITY
            and root.inertial in (None, Inertial())
            and not (shapes.visuals or shapes.collisions or shapes.visual_fault or shapes.collision_fault)
            and not any(frame.link == WORLD for frame in tree.extra_frames)
        )

    # -- names ----------------------------------------------------------------------------------

    def _name_parts(self) -> None:
        """Choose the names of links, frames and joints in the document, where no two are equal."""
        tree, taken = self._tree, set[str]()

        def choose(names: Iterable[str], kind: str) -> dict[str, str]:
            chosen: dict[str, str] = {}
            for name in names:
                found = _accepted(name, kind)
                if found in taken:
                    found = free_name(f"{found}_{kind}", taken)
                taken.add(found)
                chosen[name] = found
                if found != name:
                    _add(self._kinds, _RENAMED, name)
            return chosen

        # Names that can stay are not given to others.
        links = [link.name for link in tree.links]
        self._links = choose(links[1:] if self._on_world else links, "link")
        self._frames = choose([frame.name for frame in tree.extra_frames], "frame")
        self._joints = choose([joint.name for joint in tree.joints], "joint")
        self._hold = free_name("base_joint", taken)
        if self._on_world:
            self._links[WORLD] = WORLD

    # -- the tree -------------------------------------------------------------------------------

    def _add_parts(self) -> None:
        tree = self._tree
        above = {joint.child: joint for joint in tree.joints}
        for link in tree.links:
            if self._on_world and link.name == WORLD:
                continue
            name = self._links[link.name]
            element = SubElement(self._model, "link", name=name)
            _keep_name(element, link.name, name)
            joint = above.get(link.name)
            if joint is not None:
                parent = self._links[joint.parent]
                _pose(element, joint.origin, None if parent == WORLD else parent)
            self._add_inertial(element, link)
            self._add_shapes(element, link)
        if not tree.floating and not self._on_world:
            hold = SubElement(self._model, "joint", name=self._hold, type="fixed")
            SubElement(hold, "parent").text = WORLD
            SubElement(hold, "child").text = self._links[tree.root]
            SubElement(hold, HOLD)
        for joint in tree.joints:
            self._add_joint(joint)
        for frame in tree.extra_frames:
            name = self._frames[frame.name]
            element = SubElement(self._model, "frame", name=name, attached_to=self._links[frame.link])
            _keep_name(element, frame.name, name)
            _pose(element, frame.placement)

    def _add_inertial(self, element: Element, link: Link) -> None:
        # Without the element a link would have 1 kg.
        inertial = link.inertial or Inertial()
        around = SubElement(element, "inertial")
        _pose(around, inertial.origin)
        _text(around, "mass", inertial.mass)
        inertia = SubElement(around, "inertia")
        for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
            _text(inertia, name, getattr(inertial, name))
        if inertia_fault(inertial) is not None:
            _add(self._kinds, "Drake and Gazebo replace or refuse an inertia that no body has", link.name)

    def _add_joint(self, joint: Joint) -> None:
        name = self._joints[joint.name]
        kind = joint.type if joint.moves else "fixed"
        element = SubElement(self._model, "joint", name=name, type=kind)
        _keep_name(element, joint.name, name)
        SubElement(element, "parent").text = self._links[joint.parent]
        SubElement(element, "child").text = self._links[joint.child]
        if joint.locked_at is not None:
            _text(element, LOCKED, joint.locked_at)
            _add(self._kinds, _LOCKED, joint.name)
        if not joint.moves:
            return
        axis = SubElement(element, "axis")
        _text(axis, "xyz", joint.axis)
        if joint.type == "ball":
            _add(self._kinds, _BALL, joint.name)
        if joint.mimic is not None:
            mimic = SubElement(axis, "mimic", joint=self._joints[joint.mimic.joint])
            _text(mimic, "multiplier", joint.mimic.multiplier)
            _text(mimic, "offset", joint.mimic.offset)
            _text(mimic, "reference", 0.0)
        self._add_limits(axis, joint)
        dynamics = joint.dynamics
        if dynamics.damping or dynamics.friction or dynamics.stiffness:
            around = SubElement(axis, "dynamics")
            _text(around, "damping", dynamics.damping)
            _text(around, "friction", dynamics.friction)
            if dynamics.stiffness:
                _text(around, "spring_reference", dynamics.spring_reference)
                _text(around, "spring_stiffness", dynamics.stiffness)
        if dynamics.armature:
            _text(element, ROTOR_INERTIA, dynamics.armature)
            _add(self._kinds, _ARMATURE, joint.name)

    def _add_limits(self, axis: Element, joint: Joint) -> None:
        limits = joint.limits
        if any(map(math.isnan, (limits.lower, limits.upper, limits.velocity, limits.effort))):
            raise DescriptionError(f"a limit of joint {shown(joint.name)} is NaN, which SDF cannot express")
        found = {"velocity": limits.velocity, "effort": limits.effort}
        if joint.type == "ball":
            found["upper"] = limits.upper
        elif joint.type != "continuous":
            found["lower"] = min(limits.lower, limits.upper)
            found["upper"] = max(limits.lower, limits.upper)
        absent = Limits()
        stated = {name: value for name, value in found.items() if value != getattr(absent, name)}
        if not stated:
            return
        around = SubElement(axis, "limit")
        for name in ("lower", "upper", "effort", "velocity"):
            if name not in stated:
                continue
            value = stated[name]
            unread = abs(value) >= UNLIMITED or (name in ("velocity", "effort") and value < 0.0)
            # The format gives no meaning to limits of a ball joint.
            unread = unread or joint.type == "ball"
            _text(around, LIMITS[name] if unread and math.isfinite(value) else name, value)
            if unread and math.isfinite(value):
                _add(self._kinds, _LIMIT, joint.name)

    # -- shapes ---------------------------------------------------------------------------------

    def _add_shapes(self, element: Element, link: Link) -> None:
        shapes = self._tree.geometry.links.get(link.name, LinkGeometry())
        for kind, fault in (("visual", shapes.visual_fault), ("collision", shapes.collision_fault)):
            if fault is not None:
                self.notes.append(
                    f"The {kind} shapes of link {shown(link.name)} are left out: {fault.message}."
                )
        placed: tuple[Visual | Collision, ...] = (*shapes.visuals, *shapes.collisions)
        taken: dict[str, set[str]] = {"visual": set(), "collision": set()}
        for each in placed:
            self._add_shape(element, link, each, taken)

    def _add_shape(
        self, element: Element, link: Link, placed: Visual | Collision, taken: dict[str, set[str]]
    ) -> None:
        kind = "visual" if isinstance(placed, Visual) else "collision"
        if isinstance(placed.shape, HeightField):
            _add(self._kinds, "Height fields are left out, as SDF has them as images alone", link.name)
            return
        shape = self._shape(placed.shape, link, f"A {kind} shape of link {shown(link.name)}")
        if shape is None:
            return
        sound = bool(placed.name) and name_fault(placed.name) is None
        name = free_name(_accepted(placed.name, kind) if sound else kind, taken[kind])
        taken[kind].add(name)
        if placed.name and name != placed.name:
            _add(self._kinds, "Shapes have other names, as those of a link differ in SDF", placed.name)
        around = SubElement(element, kind, name=name)
        _pose(around, placed.origin)
        SubElement(around, "geometry").append(shape)
        if isinstance(placed, Visual) and placed.material is not None:
            self._add_material(around, placed.material, link)

    def _shape(self, shape: Shape, link: Link, what: str) -> Element | None:
        if isinstance(shape, Box):
            return _shape_element("box", size=shape.size)
        if isinstance(shape, Sphere):
            return _shape_element("sphere", radius=shape.radius)
        if isinstance(shape, Cylinder | Capsule):
            kind = "cylinder" if isinstance(shape, Cylinder) else "capsule"
            return _shape_element(kind, radius=shape.radius, length=shape.length)
        if isinstance(shape, Ellipsoid):
            return _shape_element("ellipsoid", radii=shape.radii)
        if isinstance(shape, Plane):
            return _shape_element("plane", normal=(0.0, 0.0, 1.0))
        if isinstance(shape, Mesh):
            return self._mesh(shape, link, what)
        raise DescriptionError(f"SDF cannot express the {type(shape).__name__} of link {shown(link.name)}")

    def _mesh(self, mesh: Mesh, link: Link, what: str) -> Element | None:
        # A mesh that was not found keeps the name that it has in the description, and is not found again.
        path = mesh.file
        if mesh.fault is not None:
            _add(self._kinds, f"Meshes are named and not copied: {mesh.fault.message}", link.name)
        else:
            try:
                path = self._mesh_path(mesh)
            except DescriptionError as error:
                self.notes.append(f"{what} is left out: {error}.")
                return None
        if not path:
            _add(self._kinds, "Meshes without a file are left out; dynx convert writes them", link.name)
            return None
        fault = name_fault(path)
        if fault is not None:
            self.notes.append(f"{what} is left out: the path of its mesh {fault}.")
            return None
        element = Element("mesh")
        SubElement(element, "uri").text = path
        if mesh.scale != (1.0, 1.0, 1.0):
            _text(element, "scale", mesh.scale)
        return element

    def _add_material(self, visual: Element, material: Appearance, link: Link) -> None:
        if material.name:
            _add(self._kinds, "Materials have no names in SDF, and each shape has its colour", material.name)
        if material.texture is not None:
            _add(self._kinds, "Images of materials are left out", link.name)
        if material.rgba is not None:
            _text(SubElement(visual, "material"), "diffuse", material.rgba)

    # -- notes ----------------------------------------------------------------------------------

    def _add_notes(self) -> None:
        tree = self._tree
        self.notes += [note_of_kind(kind, names) for kind, names in self._kinds.items()]
        self.notes += notes_of_open_parts(self._tree, "SDF")
        followers = [joint.name for joint in tree.joints if joint.mimic is not None]
        if followers:
            self.notes.append(
                f"Drake and Gazebo couple mimic joints by constraints ({listed(followers)}); dynx reads them "
                "as mimic joints."
            )
        light = [link.name for link in tree.links if not (link.inertial or Inertial()).mass]
        if self._on_world:
            light = light[1:]
        if light:
            self.notes.append(
                f"Links without mass have the mass 0 ({listed(light)}), since SDF gives 1 kg to one that "
                "states none."
            )


_RENAMED = "Parts have other names, as SDF reserves some and names no two parts alike; dynx reads their own"
_LOCKED = "Locked joints are fixed, without their axes and limits; dynx reads their positions"
_BALL = "The damping of a ball joint is in its <axis>, whose direction has no effect"
_ARMATURE = "Armature is in <drake:rotor_inertia>, which Drake and dynx read"
_LIMIT = "A limit is in an element of dynx, because SDF takes such a number for no limit"


def _accepted(name: str, kind: str) -> str:
    """Return a name that the format accepts."""
    fault = name_fault(name)
    if fault is not None:
        raise DescriptionError(f"a name that SDF cannot express: it {fault}")
    # White space at the ends is lost in the text of an element.
    found = "_".join(part for part in name.strip().split(_DELIMITER) if part) or kind
    return f"{found}_{kind}" if is_reserved(found) else found


def _keep_name(element: Element, name: str, written: str) -> None:
    if name != written:
        SubElement(element, NAME).text = name


def _add(kinds: dict[str, list[str]], kind: str, name: str) -> None:
    kinds.setdefault(kind, []).append(name)


def _text(parent: Element, tag: str, value: float | Iterable[float]) -> None:
    SubElement(parent, tag).text = text(value)


def _pose(parent: Element, pose: Pose, relative_to: str | None = None) -> None:
    if relative_to is not None:
        element = SubElement(parent, "pose", relative_to=relative_to)
    elif pose == IDENTITY:
        return
    else:
        element = SubElement(parent, "pose")
    element.text = text((*pose.xyz, *pose.rpy))


def _shape_element(tag: str, **sizes: float | Iterable[float]) -> Element:
    element = Element(tag)
    for name, value in sizes.items():
        _text(element, name, value)
    return element
