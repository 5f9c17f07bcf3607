"""Writer of a robot as MJCF: each link a body, each joint at the origin of its body.

It lies among the formats of a model, below the engines, because it needs no engine: who has no MuJoCo writes
MJCF too, and what it writes is read back by the reader beside it. A world in MuJoCo has a writer of its own
(`dynx.engines.mujoco.mjcf`), which merges links and names bodies by robots; both state numbers, joints and
shapes by `dynx.model.mjcf.attributes`.

Bodies, joints and sites have the names of links, joints and frames. Fixed joints have no element; names of
theirs, limits of speed and the like are in ``<custom>`` (`dynx.model.mjcf.extension`), which dynx reads.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import DescriptionError, UnsupportedFeatureError, shown
from dynx.model.elements import IDENTITY, ZERO, Inertial, Joint, Limits, Link, Mimic, Pose
from dynx.model.geometry import (
    Appearance,
    Collision,
    ContactFilter,
    HeightField,
    LinkGeometry,
    Mesh,
    Plane,
    Visual,
)
from dynx.model.geometry.links import ShapeNumber
from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.model.mjcf.actuators import write_actuators
from dynx.model.mjcf.attributes import (
    MAX_DEPTH,
    UNLIMITED,
    attributes,
    document_text,
    joint_attributes,
    new_document,
    placement,
    primitive_attributes,
    text,
)
from dynx.model.mjcf.document import turn
from dynx.model.mjcf.equalities import EqualityWriter
from dynx.model.mjcf.extension import MIMIC, Extension
from dynx.model.mjcf.sensor_objects import SensorObjects
from dynx.model.mjcf.sensors import write_sensors
from dynx.model.mjcf.tendons import write_tendons
from dynx.model.stated_parts import Actuator
from dynx.model.tree import Tree
from dynx.model.urdf.reader import inertia_fault
from dynx.model.urdf.writer import listed, note_of_kind
from dynx.model.xml.reading import MAX_DEPTH as MAX_ELEMENT_DEPTH
from dynx.model.xml.several_files import free_name
from dynx.model.xml.values import name_fault
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

WORLD = "world"
"""MJCF's name of the body that does not move."""

MAX_LINKS_IN_A_ROW = min(MAX_DEPTH, MAX_ELEMENT_DEPTH - 4)
"""Largest number of links in a row in a document that both MuJoCo and dynx read."""

MAX_JOINTS_OF_A_BODY = 6
"""Largest number of joints of a body that MuJoCo accepts."""

MESH_SUFFIXES = (".obj", ".stl", ".msh")
"""Formats of meshes that MuJoCo reads."""

_AT_ORIGIN = {"pos": (0.0, 0.0, 0.0), "quat": (1.0, 0.0, 0.0, 0.0)}
_ROUNDING = 1e-15
"""Largest entry of a rotation that is none but for rounding."""

_SITE_SIZE = 0.005
"""Radius [m] with which viewers show a frame."""

AssetPath = Callable[[str], str]
"""Function from the path of an image to the path in the document."""

MeshPath = Callable[[Mesh], str]
"""Function from a mesh to the path in the document of a file with its triangles, before they are scaled."""


@checks_types
def write_mjcf(tree: Tree, /) -> str:
    """Return the robot as MJCF text, with comments on what the format cannot say.

    `dynx.load` of the text returns a model with the same links, joints, frames, inertias, limits and
    coefficients, to rounding. MuJoCo compiles it unless a comment says why not. Angles are in radians. Visual
    geoms are in group 2 and do not collide; collision geoms are in group 3. The actuators and sensors are
    those of the robot. Where its description leaves actuators open, a motor acts on each joint with a
    coordinate of its own; its range is the effort limit. Meshes are named by their full paths;
    ``dynx convert`` copies them.

    Raises DescriptionError for a name that MJCF cannot express and a limit that is NaN,
    UnsupportedFeatureError for a link named ``world`` that is not the root, and for too many links in a row.
    """
    return RobotWriter(tree).text()


class RobotWriter:
    """The MJCF document of a robot, with notes on what it cannot say."""

    def __init__(
        self,
        tree: Tree,
        mesh_path: MeshPath = lambda mesh: mesh.file,
        image_path: AssetPath = lambda path: path,
    ) -> None:
        """`mesh_path` and `image_path` name the files in the document. Raises the errors of `write_mjcf`."""
        self._tree = tree
        self._mesh_path, self._image_path = mesh_path, image_path
        self.notes: list[str] = []
        """Sentences on what MJCF cannot say of the robot, each with its effect."""
        self._extension = Extension()
        self._root = root = new_document(_checked_name(tree.name))
        option = SubElement(root, "option", gravity=text(tree.gravity))
        self._filter = found = tree.contact_filter or ContactFilter({})
        flags = [
            name
            for name, enabled in (("contact", found.enabled), ("filterparent", found.filters_parents))
            if not enabled
        ]
        if flags:
            SubElement(option, "flag", dict.fromkeys(flags, "disable"))
        self._paired = {shape for pair in found.paired for shape in pair}
        self._body_names: dict[str, str] = {}
        self._pair_names: dict[ShapeNumber, str] = {}
        self._add_defaults()
        self._kinds: dict[str, list[str]] = {}
        self._assets = _Assets(SubElement(root, "asset"), mesh_path, image_path, self.notes, self._kinds)
        self._set_initial_pose()
        self._add_bodies(SubElement(root, "worldbody"))
        self._add_contacts(SubElement(root, "contact"))
        self._equality, self._actuator = SubElement(root, "equality"), SubElement(root, "actuator")
        for joint in tree.joints:
            if joint.moves and joint.mimic is not None:
                self._couple(joint)
        self._parts = SensorObjects.of(tree, self._geom_names)
        self._add_tendons(SubElement(root, "tendon"))
        self._add_equalities()
        if tree.actuators is None:
            for joint in tree.coordinate_joints:
                self._add_motor(joint)
        else:
            self._add_actuators(tree.actuators)
        self._add_sensors(SubElement(root, "sensor"))
        self._add_keyframes(SubElement(root, "keyframe"))
        self._extension.write(root)
        for empty in [
            part for part in root if len(part) == 0 and not part.attrib and part.tag != "worldbody"
        ]:
            root.remove(empty)
        self._add_notes()

    def text(self) -> str:
        """Return the document, with its notes as comments at the beginning."""
        return document_text(self._root, self.notes)

    # -- the tree -------------------------------------------------------------------------------

    def _set_initial_pose(self) -> None:
        """Choose the pose of the document, in which MuJoCo starts: that of the description.

        Joints of couplings are at 0, because the reader would round the coupling otherwise.
        """
        tree, stated = self._tree, self._tree.stated_initial
        self._base_pose = tree.base_pose
        self._references: dict[str, float] = {}
        if stated is None:
            return
        q = tree.initial_configuration
        if tree.floating:
            self._base_pose = Pose.from_matrix((q[:3], q[3:7]))
        coupled = {
            name
            for joint in tree.joints
            if joint.moves and joint.mimic is not None
            for name in (joint.name, joint.mimic.joint)
        }
        for joint in tree.coordinate_joints:
            position = 0.0 if joint.type == "ball" else float(q[tree.position_index(joint.name)])
            if position and joint.name in coupled:
                kind = "Joints of couplings are at 0 where MuJoCo starts"
                _add(self._kinds, kind, joint.name)
            elif position:
                self._references[joint.name] = position

    def _placement(self, joint: Joint) -> Pose:
        """Return the pose of the child of a joint in its parent, in the pose of the document."""
        position = self._references.get(joint.name, 0.0)
        if not position:
            return joint.origin
        axis = np.array(joint.axis)
        if joint.type == "prismatic":
            motion = homogeneous(np.eye(3), position * axis)
        else:
            motion = homogeneous(turn(axis, position), np.zeros(3))
        T = joint.origin.matrix @ motion
        off = np.abs(T[:3, :3] - np.eye(3)).max()
        if off <= _ROUNDING:
            T[:3, :3] = np.eye(3)
        return Pose.from_matrix(T)

    def _add_defaults(self) -> None:
        default = SubElement(self._root, "default")
        for name, values in (
            ("visual", {"group": "2", "contype": "0", "conaffinity": "0"}),
            ("collision", {"group": "3"}),
        ):
            SubElement(SubElement(default, "default", {"class": name}), "geom", values)

    def _add_bodies(self, world: Element) -> None:
        tree = self._tree
        above: dict[str, Joint] = {joint.child: joint for joint in tree.joints}
        bodies: dict[str, Element] = {}
        depths: dict[str, int] = {}
        frames: dict[str, list[Any]] = {}
        for frame in tree.extra_frames:
            frames.setdefault(frame.link, []).append(frame)
        self._geom_names: set[str] = set()
        compensation = {each.link: each.factor for each in tree.gravity_compensation or ()}
        self._carried = self._links_between_joints(frames)
        # Links are in depth-first order, so that the body of the parent is there, and children keep theirs.
        for link in tree.links:
            joint = above.get(link.name)
            if joint is None:
                body = self._root_body(world, link)
                depths[link.name] = 0
            else:
                if link.name == WORLD:
                    raise self._refusal(f"link {shown(WORLD)} is not the root", link)
                depths[link.name] = depths[joint.parent] + (link.name not in self._carried)
                if depths[link.name] > MAX_LINKS_IN_A_ROW:
                    raise self._refusal(
                        f"more than {MAX_LINKS_IN_A_ROW} links are in a row, and no deeper document is read",
                        link,
                    )
                if link.name in self._carried:
                    bodies[link.name] = bodies[joint.parent]
                    continue
                chain = [joint]
                while chain[0].parent in self._carried:
                    chain.insert(0, above[chain[0].parent])
                self._add_joints(_body(bodies[joint.parent], link.name, self._end(chain)), chain, link)
                body = bodies[joint.parent][-1]
            bodies[link.name] = body
            self._body_names[link.name] = WORLD if body is world else body.attrib["name"]
            if link.name in compensation:
                if body is world:
                    _add(self._kinds, "MuJoCo compensates no gravity of the world", link.name)
                else:
                    body.set("gravcomp", text(compensation[link.name]))
            if body is not world and link.inertial is not None:
                SubElement(body, "inertial", inertial_attributes(link.inertial))
            self._add_shapes(body, link)
            for frame in frames.get(link.name, ()):
                name = _checked_name(frame.name)
                site = {"name": name, "size": text(_SITE_SIZE), "group": "4"}
                SubElement(body, "site", site | _pose_attributes(frame.placement))

    def _root_body(self, world: Element, root: Link) -> Element:
        tree = self._tree
        name = root.name
        if name == WORLD:
            if not tree.floating and tree.base_pose == IDENTITY and root.inertial in (None, Inertial()):
                return world
            # MJCF's world is at the origin, fixed and without mass: the link is a body of another name.
            name = free_name(f"{WORLD}_link", {link.name for link in tree.links})
            self._extension.texts["name"][""] = WORLD
            self._note_names("The root link has another name", [WORLD], "dynx reads its own in <custom>")
        body = _body(world, name, self._base_pose)
        if not tree.floating or name != root.name:
            self._extension.texts["root"][""] = name
        if tree.floating:
            free = f"{name}_free"
            while any(joint.name == free for joint in tree.joints):
                free += "_"
            # Aligning would turn the frame to the principal axes.
            SubElement(body, "freejoint", name=free, align="false")
        return body

    def _links_between_joints(self, frames: Mapping[str, Any]) -> set[str]:
        """Return the links without mass, shapes and frames that join two joints whose axes are stated alike:
        MuJoCo accepts no such body, and both joints are of the body below."""
        tree, found = self._tree, set[str]()
        below: dict[str, list[Joint]] = {}
        for joint in tree.joints:
            below.setdefault(joint.parent, []).append(joint)
        sensed = {name for each in tree.sensors or () for kind, name in each.objects if "body" in kind}
        sensed |= {
            name for each in tree.equalities or () if each.object_type == "xbody" for name in each.objects
        }
        row: dict[str, int] = {}
        for joint in tree.joints:
            link, next_ones = tree.link(joint.child), below.get(joint.child, [])
            shapes = tree.geometry.links.get(link.name, LinkGeometry())
            row[link.name] = row[joint.parent] + 1 if joint.parent in found else 1
            if (
                joint.moves
                and joint.type != "ball"
                and link.inertial in (None, Inertial())
                and [each.moves and self._placement(each).rpy == ZERO for each in next_ones] == [True]
                and shapes == LinkGeometry()
                and not (shapes.visual_fault or shapes.collision_fault)
                and link.name not in frames
                and link.name not in sensed
                and link.name != WORLD
                and row[link.name] < MAX_JOINTS_OF_A_BODY
            ):
                found.add(link.name)
        return found

    def _add_joints(self, body: Element, chain: Sequence[Joint], link: Link) -> None:
        """Add the joints of a body, of which all but the last move links that are no bodies."""
        for number, joint in enumerate(chain):
            self._add_joint(body, joint, link)
            if joint.child == link.name:
                continue
            if joint.child != f"{joint.name}_link":
                self._extension.texts["link"][joint.name] = _checked_name(joint.child)
            point = -self._offset(chain[number + 1 :]) + 0.0
            if point.any():
                body[-1].set("pos", text(point))

    def _offset(self, chain: Iterable[Joint]) -> Floats:
        """Return the sum (3,) of the offsets of joints that follow one another without a rotation [m]."""
        return sum((np.array(self._placement(each).xyz) for each in chain), np.zeros(3))

    def _end(self, chain: Sequence[Joint]) -> Pose:
        """Return the pose of the last link of a chain in the link that carries it."""
        first = self._placement(chain[0])
        if len(chain) == 1:
            return first
        T = first.matrix
        x, y, z = (T[:3, 3] + T[:3, :3] @ self._offset(chain[1:])).tolist()
        return Pose((x, y, z), first.rpy)

    def _add_joint(self, body: Element, joint: Joint, link: Link) -> None:
        if not joint.moves:
            self._extension.texts["fixed"][link.name] = _checked_name(joint.name)
            if joint.locked_at is not None:
                self._extension.numbers["locked"][joint.name] = joint.locked_at
            return
        limits = joint.limits
        _refuse_nan(joint)
        ends = (-math.inf, math.inf)
        if joint.type == "ball":
            # Without an upper end a range of MuJoCo has no lower one.
            ends = (0.0, limits.upper) if limits.upper < math.inf else ends
        elif joint.type != "continuous":
            ends = min(limits.lower, limits.upper), max(limits.lower, limits.upper)
        given = joint_attributes(joint, ends, joint.dynamics)
        for kind, end in zip(("lower", "upper"), ends, strict=True):
            if UNLIMITED <= abs(end) < math.inf or (kind == "upper" and end == ends[0]):
                self._extension.numbers[kind][joint.name] = end
        if joint.type == "ball":
            if limits.effort != Limits().effort:
                self._extension.numbers["effort"][joint.name] = limits.effort
                _add(self._kinds, "MuJoCo limits no effort of ball joints; dynx reads it", joint.name)
        elif 0.0 < limits.effort < UNLIMITED:
            given["actuatorfrcrange"] = text((-limits.effort, limits.effort))
        elif limits.effort != Limits().effort:
            self._extension.numbers["effort"][joint.name] = limits.effort
        if limits.velocity != Limits().velocity:
            self._extension.numbers["velocity"][joint.name] = limits.velocity
        if joint.name in self._references:
            given["ref"] = text(self._references[joint.name])
        SubElement(body, "joint", {"name": _checked_name(joint.name)} | given)

    def _couple(self, joint: Joint) -> None:
        assert joint.mimic is not None
        numbers = (joint.mimic.offset, joint.mimic.multiplier, 0.0, 0.0, 0.0)
        ends = {"joint1": joint.name, "joint2": joint.mimic.joint, "polycoef": text(numbers)}
        SubElement(self._equality, "joint", {"name": f"{MIMIC}{joint.name}"} | ends)

    def _add_motor(self, joint: Joint) -> None:
        effort = joint.limits.effort
        if joint.type == "ball":
            _add(self._kinds, "A motor of MuJoCo acts about one axis, so ball joints have none", joint.name)
        elif effort > 0.0:
            given = {"ctrlrange": text((-effort, effort))} if effort < UNLIMITED else {}
            SubElement(self._actuator, "motor", {"name": joint.name, "joint": joint.name} | given)

    def _add_actuators(self, actuators: Iterable[Actuator]) -> None:
        """Add the actuators whose joint or tendon is in the document."""
        moving = {joint.name for joint in self._tree.joints if joint.moves}
        written = []
        for each in actuators:
            if each.joint in moving or each.tendon in self._parts.names["tendon"]:
                written.append(each)
            elif each.tendon:
                _add(self._kinds, "Actuators on tendons that are left out", each.name or each.tendon)
            else:
                _add(self._kinds, "Actuators on joints that do not move are left out", each.joint)
        write_actuators(self._actuator, written)

    def _add_tendons(self, section: Element) -> None:
        """Add the tendons all of whose joints move."""
        moving = {joint.name for joint in self._tree.joints if joint.moves}
        written = []
        for each in self._tree.tendons or ():
            if moving.issuperset(each.joints):
                written.append(each)
            else:
                kind = "Tendons of joints that do not move are left out"
                _add(self._kinds, kind, each.name or each.joints[0])
        write_tendons(section, written)

    def _add_equalities(self) -> None:
        """Add the equality constraints whose objects are in the document, and that its pose fulfils."""
        tree = self._tree
        tendons = {each.name: each for each in tree.tendons or ()}

        def reference(kind: str, name: str) -> float:
            terms = ((name, 1.0),) if kind == "joint" else tendons[name].terms
            return sum(factor * self._references.get(joint, 0.0) for joint, factor in terms)

        writer = EqualityWriter(self._body_names, self._poses(), reference)
        for each in tree.equalities or ():
            kind = each.object_type
            missing = [name for name in each.objects if name not in self._parts.names[kind]]
            if missing:
                what = (
                    f"Equality constraints of a {kind.removeprefix('x')} that the document lacks are left out"
                )
                _add(self._kinds, what, each.name or missing[0])
            elif not writer.write(self._equality, each):
                what = "Equality constraints that the pose of the document contradicts are left out"
                _add(self._kinds, what, each.name or each.first)

    def _poses(self) -> dict[str, Floats]:
        """Return the poses (4, 4) of the links in the world, in the pose of the document."""
        tree = self._tree
        poses = {WORLD: np.eye(4), tree.root: self._base_pose.matrix}
        for joint in tree.joints:
            poses[joint.child] = poses[joint.parent] @ self._placement(joint).matrix
        return poses

    def _add_sensors(self, section: Element) -> None:
        """Add the sensors whose objects are in the document."""
        tree, written = self._tree, []
        for each in tree.sensors or ():
            missing = self._parts.missing(each)
            if missing is None:
                written.append(each)
            else:
                kind = f"Sensors of a {missing} that the document lacks are left out"
                _add(self._kinds, kind, each.name or each.type)
        write_sensors(section, written, self._body_names)

    def _add_keyframes(self, section: Element) -> None:
        """Add the named configurations, in the order of MuJoCo's joints, which is that of the tree."""
        tree = self._tree
        for name, q in tree.configurations.items():
            numbers = [*q[:3], *_wxyz(q[3:7])] if tree.floating else []
            for joint in tree.joints:
                if not joint.moves:
                    continue
                coupling = joint.mimic or Mimic(joint.name)
                first = tree.position_index(coupling.joint)
                if joint.type == "ball":
                    numbers += _wxyz(q[first : first + 4])
                else:
                    numbers.append(coupling.multiplier * q[first] + coupling.offset)
            SubElement(section, "key", name=_checked_name(name), qpos=text(numbers))

    # -- shapes ---------------------------------------------------------------------------------

    def _add_shapes(self, body: Element, link: Link) -> None:
        shapes = self._tree.geometry.links.get(link.name, LinkGeometry())
        for kind, fault in (("visual", shapes.visual_fault), ("collision", shapes.collision_fault)):
            if fault is not None:
                self.notes.append(
                    f"The {kind} shapes of link {shown(link.name)} are left out: {fault.message}."
                )
        for visual in shapes.visuals:
            self._add_shape(body, link, visual)
        for number, collision in enumerate(shapes.collisions):
            shape = link.name, number
            bits = self._filter.bits_of(shape)
            given = {} if bits == (1, 1) else {"contype": text(bits[0]), "conaffinity": text(bits[1])}
            geom = self._add_shape(body, link, collision, given)
            if geom is not None and shape in self._paired:
                if "name" not in geom.attrib:
                    geom.set("name", free_name(collision.name or f"{link.name}_collision", self._geom_names))
                    self._geom_names.add(geom.attrib["name"])
                self._pair_names[shape] = geom.attrib["name"]

    def _add_contacts(self, section: Element) -> None:
        """Add the exclusions and the pairs of geoms of the robot's contact filter."""
        for first, second in self._filter.excluded:
            ends = self._body_names.get(first), self._body_names.get(second)
            if ends[0] is None or ends[1] is None:
                _add(self._kinds, "Exclusions of links without a body are left out", f"{first}, {second}")
            else:
                SubElement(section, "exclude", body1=ends[0], body2=ends[1])
        for one, two in self._filter.paired:
            if one in self._pair_names and two in self._pair_names:
                geoms = {"geom1": self._pair_names[one], "geom2": self._pair_names[two]}
                SubElement(section, "pair", geoms)
            else:
                _add(self._kinds, "Contact pairs of shapes that are left out", f"{one[0]}, {two[0]}")

    def _add_shape(
        self, body: Element, link: Link, placed: Visual | Collision, bits: Mapping[str, str] | None = None
    ) -> Element | None:
        """Add a shape, with these attributes of its contacts; return None for one that is left out."""
        kind = "visual" if isinstance(placed, Visual) else "collision"
        what = f"A {kind} shape of link {shown(link.name)}"
        given: dict[str, str] = {"class": kind}
        if placed.name:
            if placed.name in self._geom_names or name_fault(placed.name) is not None:
                _add(self._kinds, "Geoms have no name, because it is not that of one geom alone", placed.name)
            else:
                given = {"name": placed.name, **given}
                self._geom_names.add(placed.name)
        shape = placed.shape
        if isinstance(shape, HeightField):
            _add(self._kinds, "Height fields are left out", link.name)
            return None
        if isinstance(shape, Mesh):
            name = self._assets.mesh(shape, what)
            if name is None:
                return None
            given |= {"type": "mesh", "mesh": name}
        else:
            given |= primitive_attributes(shape)
        if isinstance(shape, Plane) and (self._tree.floating or link.name != self._tree.root):
            _add(
                self._kinds,
                "MuJoCo accepts planes only on bodies that do not move, and refuses the document",
                link.name,
            )
        if isinstance(placed, Visual) and placed.material is not None:
            given |= self._assets.material(placed.material, what)
        return SubElement(body, "geom", given | _pose_attributes(placed.origin) | dict(bits or {}))

    # -- notes ----------------------------------------------------------------------------------

    def _add_notes(self) -> None:
        extension, tree = self._extension, self._tree
        self.notes += [note_of_kind(kind, names) for kind, names in self._kinds.items()]
        kept = "dynx alone reads it in <custom>"
        if extension.numbers["velocity"]:
            self._note_names("MuJoCo has no limit of speed", extension.numbers["velocity"], kept)
        balls = {joint.name for joint in tree.ball_joints}
        without_effort = [name for name in extension.numbers["effort"] if name not in balls]
        if without_effort:
            self._note_names("MuJoCo has no effort limit of 0 or below", without_effort, kept)
        if extension.numbers["locked"]:
            self._note_names(
                "Locked joints are fixed, without their axes and limits",
                extension.numbers["locked"],
                "dynx reads their positions in <custom>",
            )
        followers = [joint.name for joint in tree.joints if joint.mimic is not None]
        if followers:
            self._note_names(
                "Equality constraints couple mimic joints, which MuJoCo obeys softly",
                followers,
                "dynx reads them as mimic joints",
            )
        if self._carried:
            self._note_names(
                "Links without mass between two joints are no bodies",
                [link.name for link in tree.links if link.name in self._carried],
                "dynx reads them",
            )
        for reason, names in _refused_inertias(tree, self._carried).items():
            self._note_names(f"MuJoCo does not compile the document: {reason}", names, "dynx reads it")

    def _note_names(self, what: str, names: Iterable[str], effect: str) -> None:
        self.notes.append(f"{what} ({listed(names)}); {effect}.")

    def _refusal(self, message: str, link: Link) -> UnsupportedFeatureError:
        return UnsupportedFeatureError(
            f"{message}, which MJCF cannot say", source=self._tree.source, line=link.line
        )


class _Assets:
    """Meshes, materials and images of a document, each of them once."""

    def __init__(
        self,
        section: Element,
        mesh_path: MeshPath,
        image_path: AssetPath,
        notes: list[str],
        kinds: dict[str, list[str]],
    ) -> None:
        self._section, self._notes, self._kinds = section, notes, kinds
        self._mesh_path, self._image_path = mesh_path, image_path
        self._meshes: dict[Mesh, str | None] = {}
        self._materials: dict[str, Appearance] = {}
        self._images: dict[str, str] = {}
        self._names: set[str] = set()

    def mesh(self, mesh: Mesh, what: str) -> str | None:
        """Return the name of the asset of a mesh; None for one without a file that can be named."""
        if mesh not in self._meshes:
            self._meshes[mesh] = self._add_mesh(mesh, what)
        return self._meshes[mesh]

    def _add_mesh(self, mesh: Mesh, what: str) -> str | None:
        if mesh.fault is not None:
            self._notes.append(f"{what} is left out: {mesh.fault.message}.")
            return None
        try:
            path = self._mesh_path(mesh)
        except DescriptionError as error:
            self._notes.append(f"{what} is left out: {error}.")
            return None
        if not path:
            return self._add_stated(mesh)
        fault = name_fault(path)
        if fault is not None:
            self._notes.append(f"{what} is left out: the path of its mesh {fault}.")
            return None
        suffix = PurePath(path).suffix.lower()
        if suffix not in MESH_SUFFIXES:
            kind = f"MuJoCo does not read meshes in {shown(suffix)}, which dynx convert writes as OBJ"
            _add(self._kinds, kind, PurePath(path).name)
        name = self._new_name(PurePath(path).stem)
        given = {"name": name, "file": path}
        if mesh.scale != (1.0, 1.0, 1.0):
            given["scale"] = text(mesh.scale)
        # The moments of a shell need no volume, so that a flat mesh is accepted too.
        SubElement(self._section, "mesh", given | {"inertia": "shell"})
        return name

    def _add_stated(self, mesh: Mesh) -> str:
        """Add a mesh that the description states by its vertices."""
        assert isinstance(mesh, StatedMesh)
        name = self._new_name(mesh.label)
        given = {"name": name, "vertex": text(np.array(mesh.points).ravel())}
        if mesh.corners:
            given["face"] = " ".join(str(number) for corners in mesh.corners for number in corners)
        if mesh.scale != (1.0, 1.0, 1.0):
            given["scale"] = text(mesh.scale)
        SubElement(self._section, "mesh", given | {"inertia": "shell"})
        return name

    def material(self, material: Appearance, what: str) -> dict[str, str]:
        """Return the attributes of a geom with an appearance."""
        rgba = None if material.rgba is None else text(material.rgba)
        if material.name and name_fault(material.name) is None:
            known = self._materials.get(material.name)
            if known is None and (material.rgba is not None or material.texture is not None):
                known = self._materials[material.name] = material
                given = {"name": material.name} | ({} if rgba is None else {"rgba": rgba})
                if material.fault:
                    self._notes.append(f"{what} has an image that is left out: {material.fault}.")
                elif material.texture is not None and self._image(material.texture, what):
                    given["texture"] = self._images[material.texture]
                SubElement(self._section, "material", given)
            if known == material:
                return {"material": material.name}
        if rgba is None:
            _add(self._kinds, "Materials without a colour are left out", material.name)
            return {}
        return {"rgba": rgba}

    def _image(self, path: str, what: str) -> bool:
        """Add an image that MuJoCo reads; return whether it does."""
        if path not in self._images:
            try:
                named = self._image_path(path)
            except DescriptionError as error:
                self._notes.append(f"The image of {what[:1].lower()}{what[1:]} is left out: {error}.")
                return False
            if not named.lower().endswith(".png") or name_fault(named) is not None:
                _add(self._kinds, "Images that are no PNG are left out", named)
                return False
            name = self._images[path] = self._new_name(PurePath(named).stem)
            SubElement(self._section, "texture", {"name": name, "type": "2d", "file": named})
        return True

    def _new_name(self, stem: str) -> str:
        name, number = stem, 2
        while name in self._names:
            name, number = f"{stem}_{number}", number + 1
        self._names.add(name)
        return name


def _add(kinds: dict[str, list[str]], kind: str, name: str) -> None:
    kinds.setdefault(kind, []).append(name)


def _body(parent: Element, name: str, pose: Pose) -> Element:
    return SubElement(parent, "body", {"name": _checked_name(name)} | _pose_attributes(pose))


def _pose_attributes(pose: Pose) -> dict[str, str]:
    if pose == IDENTITY:
        return {}
    given = placement(pose.matrix[:3, :3], pose.matrix[:3, 3])
    absent = attributes(_AT_ORIGIN)
    return {name: value for name, value in given.items() if value != absent[name]}


def inertial_attributes(inertial: Inertial) -> dict[str, str]:
    """Return mass, centre and moments: principal ones with their axes, else the tensor in the link's axes."""
    T = inertial.origin.matrix
    tensor, R = inertial.tensor, T[:3, :3]
    given = attributes({"mass": inertial.mass, "pos": T[:3, 3]})
    if not (inertial.ixy or inertial.ixz or inertial.iyz):
        pose = _pose_attributes(inertial.origin)
        turned = {"quat": pose["quat"]} if "quat" in pose else {}
        return given | turned | {"diaginertia": text(np.diag(tensor))}
    if (np.eye(3) != R).any():
        tensor = R @ tensor @ R.T
    return given | {"fullinertia": text([*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]])}


def _refused_inertias(tree: Tree, carried_links: Collection[str]) -> dict[str, list[str]]:
    """Return the links of which MuJoCo refuses the inertia, by the reason, but for those without a body."""
    found: dict[str, list[str]] = {}
    carried: dict[str, bool] = {}
    above = {joint.child: joint for joint in tree.joints}
    for link in reversed(tree.links):
        inertial, joint = link.inertial, above.get(link.name)
        if inertial is not None:
            fault = inertia_fault(inertial)
            if fault is not None and inertial.mass:
                found.setdefault("an inertia is not physical", []).append(link.name)
        has = carried.get(link.name, False) or (inertial is not None and inertial.mass > 0.0)
        moves = tree.floating if joint is None else joint.moves
        if moves and not has and link.name not in carried_links:
            found.setdefault("a body moves without mass", []).append(link.name)
        if joint is not None and not joint.moves:
            carried[joint.parent] = carried.get(joint.parent, False) or has
    return {reason: names[::-1] for reason, names in found.items()}


def _refuse_nan(joint: Joint) -> None:
    limits = joint.limits
    for value in (limits.lower, limits.upper, limits.velocity, limits.effort):
        if math.isnan(value):
            raise DescriptionError(f"a limit of joint {shown(joint.name)} is NaN, which MJCF cannot express")


def _wxyz(quat_xyzw: Floats) -> list[float]:
    x, y, z, w = quat_xyzw.tolist()
    return [w, x, y, z]


def _checked_name(name: str) -> str:
    fault = name_fault(name)
    if fault is not None:
        raise DescriptionError(f"a name that MJCF cannot express: it {fault}")
    return name
