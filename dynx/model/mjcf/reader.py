"""Reader of MJCF: the tree of bodies as links and joints, with a note for all that is not part of it.

Each body is a link whose frame is the body's, and each site with a name is a frame. A joint of a body that
has several, or that lies off the body's origin, moves a link without mass. Positions are those of MuJoCo: `q`
equals `qpos` but for the quaternions of free and ball joints, which MuJoCo writes w, x, y, z. MuJoCo
expresses the linear part of the base's velocity in the world, dynx in the base. No part of MuJoCo is needed.

`read_mjcf` returns the one robot of a file, `read_trees` each tree of bodies by itself, of which a scene is
made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from dynx.errors import escaped, nearest, shown
from dynx.model.elements import (
    IDENTITY,
    INFINITY,
    Frame,
    Inertial,
    Joint,
    JointDynamics,
    JointType,
    Limits,
    Link,
    Mimic,
    Note,
    Pose,
    Vector,
)
from dynx.model.geometry import Geometry, LinkGeometry
from dynx.model.geometry.links import ContactFilter
from dynx.model.geometry.solids import inertial_of
from dynx.model.mjcf.actuators import read_actuators
from dynx.model.mjcf.attributes import UNLIMITED
from dynx.model.mjcf.contacts import read_contacts
from dynx.model.mjcf.document import MjcfText, turn
from dynx.model.mjcf.equalities import EqualityObjects, is_mimic, read_equalities
from dynx.model.mjcf.expansion import read_document
from dynx.model.mjcf.extension import Extension
from dynx.model.mjcf.keyframes import NOT_OF_A_POSITION, TreeCoordinates, read_keyframes, tree_states
from dynx.model.mjcf.sensor_objects import SensorObjects
from dynx.model.mjcf.sensors import read_sensors, require_objects
from dynx.model.mjcf.shapes import Geom, GeomReader
from dynx.model.mjcf.tendons import read_tendons
from dynx.model.mjcf.vocabulary import commas_in_numbers, unknown_parts, unused_attributes
from dynx.model.package_search import StrPath
from dynx.model.stated_parts import (
    Actuator,
    NamedConfiguration,
    StatedEquality,
    StatedGravityCompensation,
    StatedSensor,
    StatedTendon,
)
from dynx.model.topology import MAX_LINKS
from dynx.model.tree import Base, Description
from dynx.model.urdf.reader import inertia_fault
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import file_of_line, free_name
from dynx.model.xml.values import name_fault
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

WORLD = "world"
"""Name of the root link of a robot that is fixed in the world."""

_NO_ROTATION = np.eye(3)

_REFUSED = {
    "composite": "which makes bodies",
    "flexcomp": "which makes a soft body",
}
_NOT_READ = {
    "light": None,
    "camera": None,
    "plugin": "the forces of a plug-in do not act",
}
_IN_BODY = (
    "body",
    "joint",
    "freejoint",
    "geom",
    "site",
    "inertial",
    "frame",
    "replicate",
    *_NOT_READ,
    *_REFUSED,
)
_NOT_READ_OF_BODIES = {"gravcomp": "weight is not compensated", "mocap": "it is fixed"}
_NOT_IN_TREE = {
    "actuator": "dynx does not compute them",
    "sensor": "no sensor is read",
    "tendon": "no tendon pulls",
    "equality": "the loops that they close stay open, and joints that they couple move freely",
    "contact": "no pair is excluded from contact or added to it",
    "deformable": "no soft body is read",
    "keyframe": "no configuration of it is read",
    "extension": "no plug-in is used",
}
_OF_SCENES = ("actuator", "contact", "equality", "keyframe", "tendon")
"""Sections that a scene reads."""
_OF_ONE_ROBOT = ("actuator", "contact", "equality", "keyframe", "sensor", "tendon")
"""Sections that are read of one robot, as data."""
_IN_ROOT = frozenset(
    ["compiler", "option", "size", "statistic", "visual", "default", "asset", "worldbody", "custom"]
)
_JOINT_TYPES: dict[str, JointType] = {"hinge": "revolute", "slide": "prismatic", "ball": "ball"}


def read_mjcf(data: str | bytes, source: str, package_dirs: Iterable[StrPath] = ()) -> Description | None:
    """Read a model in MJCF, which is one robot, fixed in the world or free; None for another document.

    Raises DescriptionError for malformed content, UnsupportedFeatureError for what a `Model` cannot say; the
    message begins with the file and the line.
    """
    document = read_document(data, source, package_dirs)
    return None if document is None else _TreeReader(document).read()


@dataclass(frozen=True)
class MjcfBody:
    """A body as it stands in a tree: the name of its parent (None for the world), its pose in the world
    (4, 4) before any joint moves, its geoms, whether it has joints, and whether it is a mocap body."""

    name: str
    parent: str | None
    T_world_body: Floats
    geoms: tuple[Geom, ...]
    jointed: bool
    mocap: bool
    element: Element


@dataclass(frozen=True)
class MjcfTree:
    """A body of the world and all bodies below it, as one robot.

    Without a joint of its own, the first body is the root link, with a fixed base at its pose or a floating
    one. Otherwise the root link is `WORLD`.
    """

    description: Description
    bodies: tuple[MjcfBody, ...]
    free: bool
    positions: tuple[tuple[str, float], ...]
    """Joints in the order of MuJoCo, each with its position in the pose of the file; a free one apart."""
    aligned: bool = False
    """Whether MuJoCo moves the frame of the free body to its centre of mass and principal axes."""

    @property
    def first(self) -> MjcfBody:
        """The body below which all others are."""
        return self.bodies[0]

    @property
    def coordinates(self) -> TreeCoordinates:
        """The joints in the order of MuJoCo."""
        T_world_free = self.first.T_world_body if self.free else None
        return _coordinates(T_world_free, self.positions, self.description.joints)


@dataclass(frozen=True)
class MjcfSite:
    """A site: the name of its body, None for the world, and its pose there (4, 4)."""

    body: str | None
    T_body_site: Floats


@dataclass(frozen=True)
class MjcfTrees:
    """The trees of bodies of a file, the geoms of its world, and its sites by name."""

    document: MjcfText
    geoms: GeomReader
    name: str | None
    gravity: Vector
    trees: tuple[MjcfTree, ...]
    world: tuple[Geom, ...]
    sites: dict[str, MjcfSite]


def read_trees(data: str | bytes, source: str, package_dirs: Iterable[StrPath] = ()) -> MjcfTrees | None:
    """Read the trees of a model in MJCF one by one; None for another document.

    Equality constraints, contacts and keyframes are left to the caller, without a note. Raises the errors of
    `read_mjcf`, but for several robots.
    """
    document = read_document(data, source, package_dirs)
    if document is None:
        return None
    return _TreeReader(document).read_trees()


@dataclass
class _BodyContent:
    """Joints, geoms, sites and bodies of a body and of the frames in it, with poses in the body."""

    element: Element
    name: str
    joints: list[tuple[Element, Floats]] = field(default_factory=list)
    geoms: list[Geom] = field(default_factory=list)
    sites: list[tuple[Element, Floats]] = field(default_factory=list)
    bodies: list[tuple[Element, Floats, str | None]] = field(default_factory=list)
    inertials: list[Element] = field(default_factory=list)


class _NamedSite(NamedTuple):
    name: str
    link: str
    pose: Floats
    element: Element


@dataclass
class _TreeParts:
    """What is read of one tree, or of all trees of one robot."""

    links: list[Link] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    geometry: dict[str, LinkGeometry] = field(default_factory=dict)
    sites: list[_NamedSite] = field(default_factory=list)
    bodies: list[MjcfBody] = field(default_factory=list)
    positions: list[tuple[str, float]] = field(default_factory=list)
    aligned: bool = False


class _TreeReader:
    def __init__(self, document: MjcfText) -> None:
        self._document, self._reading = document, document.reading
        self._contacts = read_contacts(document)
        self._geoms = GeomReader(document, self._contacts.paired_geoms)
        self._colliding: dict[str, list[Geom]] = {}
        self._link_of: dict[str, str] = {WORLD: WORLD}
        self._parts = _TreeParts()
        self._held: dict[str, list[tuple[str, Element]]] = {}
        self._poses: dict[str, Floats] = {WORLD: np.eye(4)}
        self._count = 0
        self._extension = Extension.read(document.sections("custom"), document.reading)
        self._base_pose = IDENTITY
        self._root_name: str | None = None
        self._mass_apart = 0.0
        # Names that are made up keep clear of those that stand further down.
        self._taken = _names(document.root, "body")
        self._joint_names = _names(document.root, "joint")
        self._bodies_read: set[str] = set()
        self._spring_references: dict[str, float] = {}
        self._compensation: list[StatedGravityCompensation] = []
        self._joints_read: set[str] = set()

    def read(self) -> Description:
        root = self._document.root
        self._note_sections(
            root, {tag: effect for tag, effect in _NOT_IN_TREE.items() if tag not in _OF_ONE_ROBOT}
        )
        world = self._world(root)
        base = self._read_world(world)
        name = self._name(root)
        self._read_mimics()
        self._require_joints_of_motors(root)
        self._scale(self._total_mass_scale(root, self._parts.links))
        tendons = self._read_tendons(self._parts.joints)
        actuators, contact_filter = self._read_actuators(self._parts.joints, tendons), self._contact_filter()
        configurations = self._read_configurations(base)
        self._note_compensation()
        self._note_vocabulary(root)
        self._note_counts(root)
        self._document.options.note(self._reading, scene=False)
        content = self._description(name, base, self._document.options.gravity, self._reading.notes)
        content = replace(content, actuators=actuators, tendons=tendons)
        return replace(
            content,
            contact_filter=contact_filter,
            configurations=configurations,
            sensors=self._read_sensors(content),
            equalities=self._read_equalities(tendons, content.frames),
            gravity_compensation=tuple(self._compensation),
            initial=self._initial_configuration(base),
        )

    def read_trees(self) -> MjcfTrees:
        root = self._document.root
        self._note_sections(root, {tag: _NOT_IN_TREE[tag] for tag in _NOT_IN_TREE if tag not in _OF_SCENES})
        world, name, gravity = self._world(root), self._name(root), self._document.options.gravity
        self._document.options.note(self._reading, scene=True)
        trees: list[tuple[_TreeParts, bool]] = []
        self._add_sites(world)
        sites = self._parts.sites
        for entry in world.bodies:
            parts = self._parts = _TreeParts()
            free = self._has_free_joint(entry)
            above = WORLD if not free and _has_own_joint(entry[0]) else None
            if above is not None:
                parts.links.append(Link(WORLD, Inertial(), world.element.line))
                self._taken.add(WORLD)
            self._read_body(entry, above)
            trees.append((parts, free))
            sites = [*sites, *parts.sites]
        scale = self._total_mass_scale(root, [link for parts, _ in trees for link in parts.links])
        self._require_joints_of_motors(root)
        driven = self._read_drives([parts.joints for parts, _ in trees])
        found = []
        for (parts, free), (tendons, actuators) in zip(trees, driven, strict=True):
            self._parts = parts
            self._scale(scale)
            first = parts.bodies[0]
            description = self._description(first.name, "floating" if free else "fixed", gravity, [])
            description = replace(description, actuators=actuators, tendons=tendons)
            if not free and not first.jointed:
                description = replace(description, base_pose=Pose.from_matrix(first.T_world_body))
            positions = tuple(parts.positions)
            found.append(MjcfTree(description, tuple(parts.bodies), free, positions, parts.aligned))
        require_objects(self._document)
        self._note_vocabulary(root)
        self._note_counts(root)
        return MjcfTrees(
            self._document,
            self._geoms,
            name,
            gravity,
            tuple(found),
            tuple(world.geoms),
            {each.name: MjcfSite(None if each.link == WORLD else each.link, each.pose) for each in sites},
        )

    def _world(self, root: Element) -> _BodyContent:
        trees = root.all("worldbody")
        world = _BodyContent(trees[0] if trees else root, WORLD)
        for tree in trees:
            self._collect(world, tree, None, np.eye(4))
        if world.joints:
            raise self._reading.error(world.joints[0][0], "the world has a joint; wanted it in a <body>")
        return world

    def _name(self, root: Element) -> str | None:
        name = root.attributes.get("model", "")
        fault = name_fault(name) if name else None
        if fault is not None:
            raise self._reading.error(root, f"the name of the model {fault}")
        return name or None

    def _description(self, name: str | None, base: Base, gravity: Vector, notes: list[Note]) -> Description:
        """Return what was read since the tree began."""
        parts = self._parts
        geometry = Geometry(parts.geometry)
        return Description(
            name,
            parts.links,
            parts.joints,
            self._frames(),
            notes,
            geometry,
            base=base,
            gravity=gravity,
            base_pose=self._base_pose,
        )

    # -- the world ------------------------------------------------------------------------------

    def _read_world(self, world: _BodyContent) -> Base:
        """Read the bodies of the world; return the base of the robot that they are."""
        free = [entry for entry in world.bodies if self._has_free_joint(entry)]
        if not free and self._is_stated_root(world):
            self._base_pose = Pose.from_matrix(world.bodies[0][1])
            self._root_name = self._extension.texts["name"].get("")
            self._read_body(world.bodies[0], None)
            return "fixed"
        if not free:
            self._parts.links.append(Link(WORLD, Inertial(), world.element.line))
            self._taken.add(WORLD)
            self._bodies_read.add(WORLD)
            self._add_contents(world)
            for entry in world.bodies:
                self._read_body(entry, WORLD)
            return "fixed"
        others = [entry for entry in world.bodies if not any(entry is each for each in free)]
        moving = [*free, *(entry for entry in others if _has_joint_below(entry[0]))]
        if len(moving) > 1:
            known = _numbered_names(self._document.root)
            names = ", ".join(shown(known[id(each[0])]) for each in moving[:5])
            names += f" and {len(moving) - 5} more" if len(moving) > 5 else ""
            raise self._reading.unsupported(
                moving[1][0],
                f"the model holds {len(moving)} robots or bodies that move apart from one another ({names}); "
                "a Model is one robot. dynx.world.read_scene(file) reads all of them as a scene, and a "
                "robot alone needs a file of its own",
            )
        self._check(others)
        left_out = len(others) + len(world.geoms) + len(world.sites)
        if left_out:
            self._reading.note(
                world.element,
                f"the robot moves freely; what is fixed in the world is no part of it: "
                f"{_counted(left_out, 'element')}",
            )
        if free[0][0].attributes.get("name") == self._extension.texts["root"].get(""):
            self._root_name = self._extension.texts["name"].get("")
        self._read_body(free[0], None)
        return "floating"

    def _check(self, bodies: list[tuple[Element, Floats, str | None]]) -> None:
        """Refuse faults of bodies that are no part of the robot, and elements of theirs that would move."""
        waiting = list(bodies)
        while waiting:
            body = self._body(waiting.pop())
            waiting += body.bodies
            inertial = self._inertial(body) if self._document.compiler.total_mass > 0.0 else None
            self._mass_apart += 0.0 if inertial is None else inertial.mass

    def _is_stated_root(self, world: _BodyContent) -> bool:
        """Check whether the one body of the world is the root link that dynx stated in ``<custom>``."""
        if len(world.bodies) != 1 or world.geoms or world.sites:
            return False
        body = world.bodies[0][0]
        stated = self._extension.texts["root"].get("")
        return stated is not None and body.attributes.get("name") == stated and not self._jointed(body)

    def _jointed(self, body: Element) -> bool:
        """Check whether a body has joints of its own."""
        waiting = [body]
        while waiting:
            for child in waiting.pop().children:
                if child.tag in ("joint", "freejoint"):
                    return True
                waiting += [child] if child.tag == "frame" else []
        return False

    def _has_free_joint(self, entry: tuple[Element, Floats, str | None]) -> bool:
        waiting = [(entry[0], entry[0].attributes.get("childclass", entry[2]))]
        while waiting:
            inside, childclass = waiting.pop()
            for child in inside.children:
                if child.tag == "frame":
                    waiting.append((child, child.attributes.get("childclass", childclass)))
                elif self._is_free(child, childclass):
                    return True
        return False

    def _is_free(self, element: Element, childclass: str | None) -> bool:
        is_joint = element.tag in ("joint", "freejoint")
        return is_joint and self._joint_type(self._document.resolved(element, childclass)) == "free"

    # -- bodies ---------------------------------------------------------------------------------

    def _read_body(self, entry: tuple[Element, Floats, str | None], parent: str | None) -> None:
        """Read a body and those below it, depth first; without a parent it is the root."""
        waiting = [(entry, parent)]
        while waiting:
            entry, above = waiting.pop()
            body = self._body(entry)
            if len(self._parts.links) >= MAX_LINKS:
                raise self._reading.error(body.element, f"the robot has more than {MAX_LINKS} links")
            body.name = self._body_name(body.element)
            if above is None and self._root_name is not None:
                body.name = self._root_name
            if above is None and len(body.joints) > 1:
                raise self._reading.error(
                    body.joints[1][0],
                    f"body {shown(body.name)} moves freely and has another joint; wanted one",
                )
            if above is not None:
                self._join(body, above, entry[1])
            elif body.joints and not body.bodies:
                self._note_alignment(body)
            inertial = self._inertial(body)
            if body.joints and inertial is not None and inertial.mass == 0.0 and not body.bodies:
                self._reading.note(
                    body.element, f"body {shown(body.name)} has no mass, but its joints move it"
                )
            self._parts.links.append(Link(body.name, inertial, body.element.line))
            self._add_contents(body)
            self._record(body, above, entry[1])
            waiting += [(each, body.name) for each in reversed(body.bodies)]

    def _note_alignment(self, body: _BodyContent) -> None:
        joint = body.joints[0][0]
        by_file = "true" if self._document.compiler_of(joint).align_free else "false"
        align = self._reading.choice(joint, "align", "a free joint", ("auto", "true", "false"), "auto")
        if (by_file if align == "auto" else align) == "true":
            self._parts.aligned = True
            self._reading.note(
                joint,
                f"align: the frame of body {shown(body.name)} is that of the file; MuJoCo moves it to the "
                "centre of mass and the principal axes, and its qpos states the pose of that frame",
            )

    def _record(self, body: _BodyContent, parent: str | None, placement: Floats) -> None:
        pose = self._poses[body.name] = self._poses[parent or WORLD] @ placement
        above = None if parent == WORLD else parent
        mocap = body.element.attributes.get("mocap", "false") == "true"
        jointed = bool(body.joints)
        self._parts.bodies.append(
            MjcfBody(body.name, above, pose, tuple(body.geoms), jointed, mocap, body.element)
        )

    def _body(self, entry: tuple[Element, Floats, str | None]) -> _BodyContent:
        element, _, childclass = entry
        body = _BodyContent(element, element.attributes.get("name", ""))
        self._collect(body, element, element.attributes.get("childclass", childclass), np.eye(4))
        return body

    def _collect(self, body: _BodyContent, inside: Element, childclass: str | None, outer: Floats) -> None:
        """Add what stands in a body or in a frame of pose `outer` in the body."""
        document, reading = self._document, self._reading
        for element in inside.children:
            tag = element.tag
            if tag == "frame":
                pose = outer @ document.pose(element, "a <frame>")
                self._collect(body, element, element.attributes.get("childclass", childclass), pose)
            elif tag == "body":
                what = f"body {shown(element.attributes.get('name', ''))}"
                body.bodies.append((element, outer @ document.pose(element, what), childclass))
            elif tag == "geom":
                body.geoms.append(self._geoms.geom(element, childclass, outer))
            elif tag == "site":
                body.sites.append((document.resolved(element, childclass), outer))
            elif tag == "joint":
                joint = document.resolved(element, childclass)
                self._note_dynamics_of_free(joint)
                body.joints.append((joint, outer))
            elif tag == "freejoint":
                body.joints.append((element, outer))
            elif tag == "inertial":
                if inside.tag == "frame":
                    raise reading.error(
                        element, "a <frame> has an <inertial>; wanted it in the <body> itself"
                    )
                body.inertials.append(element)
            elif tag in _REFUSED:
                raise reading.unsupported(element, f"dynx does not read <{tag}>, {_REFUSED[tag]}")
            elif tag not in _NOT_READ:
                raise reading.error(
                    element,
                    f"<{inside.tag}> has the unknown element <{escaped(tag)}>{nearest(tag, _IN_BODY)}",
                )
            elif _NOT_READ[tag] is not None:
                reading.note(element, f"<{tag}> is not read: {_NOT_READ[tag]}")

    def _add_contents(self, body: _BodyContent) -> None:
        self._parts.geometry[body.name] = self._geoms.geometry(body.geoms)
        self._colliding[body.name] = [geom for geom in body.geoms if geom.collides]
        self._link_of[body.element.attributes.get("name", "")] = body.name
        self._add_sites(body)
        factor = self._reading.number_or(body.element, "gravcomp", f"body {shown(body.name)}", 0.0)
        if factor:
            self._compensation.append(StatedGravityCompensation(body.name, factor, body.element.line))
        for attribute in _NOT_READ_OF_BODIES:
            if body.element.attributes.get(attribute, "0") not in ("0", "false"):
                self._held.setdefault(attribute, []).append((f"body {shown(body.name)}", body.element))

    def _add_sites(self, body: _BodyContent) -> None:
        for site, outer in body.sites:
            name = site.attributes.get("name")
            if name is not None:
                pose = self._geoms.pose_of_site(site, f"site {shown(name)}")
                self._parts.sites.append(_NamedSite(name, body.name, outer @ pose, site))

    def _body_name(self, element: Element) -> str:
        """Return the name of a body; one without a name has its number, as MuJoCo counts bodies."""
        self._count += 1
        name = element.attributes.get("name")
        if name is None:
            name = free_name(f"body_{self._count}", self._taken)
        else:
            fault = name_fault(name)
            if fault is not None:
                raise self._reading.error(element, f"the name of a body {fault}")
            if name in self._bodies_read:
                raise self._reading.error(element, f"two bodies have the name {shown(name)}")
        self._taken.add(name)
        self._bodies_read.add(name)
        return name

    # -- joints ---------------------------------------------------------------------------------

    def _note_dynamics_of_free(self, joint: Element) -> None:
        """Note that the damping, friction, armature and spring of a free joint do not act."""
        names = ("damping", "frictionloss", "armature", "stiffness")
        stated = [name for name in names if joint.attributes.get(name, "0").strip("0. ")]
        if stated and self._joint_type(joint) == "free":
            self._reading.note(
                joint, f"{', '.join(stated)} of the free joint do not act: a floating base has none in dynx"
            )

    def _join(self, body: _BodyContent, parent: str, placement: Floats) -> None:
        """Add the joints between a body and its parent, in which the body is at `placement` (4, 4).

        A joint turns the body about a point of the body's frame, or slides it; joints of one body act one
        after the other (MuJoCo, Computation, Kinematics).
        """
        at = placement  # pose of the body's frame in that of the last link, which each joint leaves behind
        last = parent
        for number, (element, outer) in enumerate(body.joints):
            name = self._joint_name(element, body, number)
            what = f"joint {shown(name)}"
            kind = self._joint_type(element)
            if kind == "free":
                raise self._reading.error(element, f"{what} is free; its body is not directly in the world")
            before = [self._joint_type(each) for each, _ in body.joints[:number]]
            if kind != "slide" and "ball" in before:
                raise self._reading.error(
                    element, f"{what} turns the body {shown(body.name)}, which a ball joint turns already"
                )
            point, axis = self._point_and_axis(element, outer, kind, what)
            reference = self._position(element, "ref", kind, what)
            self._parts.positions.append((name, reference))
            origin = at @ homogeneous(_NO_ROTATION, point)
            if kind == "hinge":
                origin = origin @ homogeneous(turn(axis, -reference), np.zeros(3))
            elif kind == "slide":
                origin = origin @ homogeneous(_NO_ROTATION, -reference * axis)
            final = number == len(body.joints) - 1 and not point.any()
            child = body.name
            if not final:
                own = self._extension.texts["link"].get(name)
                child = own or free_name(f"{name}_link", self._taken)
                self._taken.add(child)
                self._parts.links.append(Link(child, Inertial(), element.line))
            x, y, z = axis.tolist()
            limits, limited = self._limits(element, name, kind, what)
            self._parts.joints.append(
                Joint(
                    name,
                    "continuous" if kind == "hinge" and not limited else _JOINT_TYPES[kind],
                    last,
                    child,
                    Pose.from_matrix(origin),
                    axis=(x, y, z),
                    limits=limits,
                    dynamics=self._dynamics(element, name, kind),
                    line=element.line,
                )
            )
            last, at = child, homogeneous(_NO_ROTATION, -point)
        if last != body.name:
            stated = self._extension.texts["fixed"].get(body.name, f"{body.name}_fixed")
            name = free_name(stated, self._joint_names)
            self._joint_names.add(name)
            pose = Pose.from_matrix(at) if (at != np.eye(4)).any() else IDENTITY
            locked_at = self._extension.numbers["locked"].get(name)
            self._parts.joints.append(
                Joint(name, "fixed", last, body.name, pose, locked_at=locked_at, line=body.element.line)
            )

    def _joint_name(self, element: Element, body: _BodyContent, number: int) -> str:
        name = element.attributes.get("name")
        if name is None:
            suffix = "" if len(body.joints) == 1 else f"_{number + 1}"
            name = free_name(f"{body.name}_joint{suffix}", self._joint_names)
        else:
            fault = name_fault(name)
            if fault is not None:
                raise self._reading.error(element, f"the name of a joint {fault}")
            if name in self._joints_read:
                raise self._reading.error(element, f"two joints have the name {shown(name)}")
        self._joint_names.add(name)
        self._joints_read.add(name)
        return name

    def _joint_type(self, element: Element) -> str:
        if element.tag == "freejoint":
            return "free"
        return self._reading.choice(element, "type", "a joint", ("hinge", "slide", "ball", "free"), "hinge")

    def _point_and_axis(self, element: Element, outer: Floats, kind: str, what: str) -> tuple[Floats, Floats]:
        reading, given = self._reading, element.attributes
        point = np.array(reading.vector(element, "pos", what) if "pos" in given else (0.0, 0.0, 0.0))
        axis = np.array(reading.vector(element, "axis", what) if "axis" in given else (0.0, 0.0, 1.0))
        length = float(np.linalg.norm(axis))
        if kind == "ball":
            axis, length = np.array((0.0, 0.0, 1.0)), 1.0
        elif length < 1e-14:
            raise reading.error(element, f"the axis of {what} is zero; wanted a direction")
        if (outer != np.eye(4)).any():
            point, axis = outer[:3, :3] @ point + outer[:3, 3], outer[:3, :3] @ axis
        return point, axis if abs(length - 1.0) <= 1e-15 else axis / length

    def _position(self, element: Element, attribute: str, kind: str, what: str) -> float:
        value = self._reading.number_or(element, attribute, what, 0.0)
        return self._document.compiler_of(element).radians(value) if kind == "hinge" else value

    def _limits(self, element: Element, name: str, kind: str, what: str) -> tuple[Limits, bool]:
        reading, limits = self._reading, Limits()
        limited = self._document.is_limited(element, "limited", "range", what)
        if limited:
            ends = reading.numbers(element, "range", what, 2)
            lower, upper = map(self._document.compiler_of(element).radians, ends) if kind != "slide" else ends
            if kind == "ball" and lower:
                raise reading.error(
                    element,
                    f"range of {what} is {shown(element.attributes['range'])}; wanted 0 and the largest "
                    "angle of a ball joint",
                )
            if lower >= upper:
                raise reading.error(
                    element,
                    f"range of {what} is {shown(element.attributes['range'])}; wanted a first number below "
                    "the second",
                )
            # MuJoCo has no larger numbers, and writers state an absent limit beside another one so.
            lower = lower if lower > -UNLIMITED else -INFINITY
            upper = upper if upper < UNLIMITED else INFINITY
            limits, limited = Limits(lower, upper), not lower == -upper == -INFINITY
        if kind == "ball":
            if "actuatorfrcrange" in element.attributes:
                reading.note(
                    element, f"actuatorfrcrange of {what} is not read: MuJoCo has none for a ball joint"
                )
        elif self._document.is_limited(element, "actuatorfrclimited", "actuatorfrcrange", what):
            low, high = reading.numbers(element, "actuatorfrcrange", what, 2)
            if low == -high and high > 0.0:
                limits = replace(limits, effort=high)
            else:
                reading.note(
                    element, f"actuatorfrcrange of {what} is not symmetric; its effort is read as unlimited"
                )
        stated = self._extension.numbers
        lower, upper = (stated[end].get(name, getattr(limits, end)) for end in ("lower", "upper"))
        limited = limited or name in stated["lower"] or name in stated["upper"]
        return replace(
            limits,
            lower=lower,
            upper=upper,
            velocity=stated["velocity"].get(name, limits.velocity),
            effort=stated["effort"].get(name, limits.effort),
        ), limited

    def _read_mimics(self) -> None:
        """Let joints follow others where dynx wrote the equality constraint that couples them."""
        reading, mimics, references = self._reading, dict[str, Mimic](), dict(self._parts.positions)
        if self._document.options.disabled("equality") is not None:
            return
        for element in self._document.sections("equality"):
            if not is_mimic(element):
                continue
            what = f"equality {shown(element.attributes['name'])}"
            joint, driver = (reading.name(element, f"joint{k}", what) for k in (1, 2))
            constant, multiplier, *rest = reading.numbers(element, "polycoef", what, 5)
            known = [each.name for each in self._parts.joints]
            for name in (joint, driver):
                if name not in known:
                    raise reading.error(element, f"{what} couples {shown(name)}{nearest(name, known)}")
            if any(rest):
                raise reading.error(element, f"{what} has a polynomial; wanted polycoef with three zeros")
            # Positions are relative to those in the pose of the file.
            shift = references.get(joint, 0.0) - multiplier * references.get(driver, 0.0)
            mimics[joint] = Mimic(driver, multiplier, constant + shift if shift else constant)
        self._parts.joints = [replace(each, mimic=mimics.get(each.name)) for each in self._parts.joints]

    def _require_joints_of_motors(self, root: Element) -> None:
        """Raise DescriptionError for an actuator on a joint that the file has not, as MuJoCo does."""
        known = set[str]()
        for tree in root.all("worldbody"):
            known |= _names(tree, "joint") | _names(tree, "freejoint")
        for element in self._document.sections("actuator"):
            for attribute in ("joint", "jointinparent"):
                name = element.attributes.get(attribute)
                if name is not None and name not in known:
                    raise self._reading.error(
                        element,
                        f"<{escaped(element.tag)}> acts on the joint {shown(name)}, which no body has"
                        f"{nearest(name, known)}",
                    )

    def _read_actuators(
        self, joints: Iterable[Joint], tendons: Iterable[StatedTendon]
    ) -> tuple[Actuator, ...]:
        """Return the actuators on these joints and tendons, with notes on all of them."""
        if self._document.options.disabled("actuation") is not None:
            return ()
        named = {each.name: each for each in joints}
        taken, left = read_actuators(self._document, named, {each.name for each in tendons if each.name})
        effect = "model.actuator_forces(ctrl, q, v) computes their torques, which World.step takes"
        self._note_data("actuator", effect, taken, left, _NOT_IN_TREE["actuator"])
        return taken

    def _read_tendons(self, joints: Iterable[Joint]) -> tuple[StatedTendon, ...]:
        """Return the fixed tendons of these joints, with notes on all of them: none pulls."""
        named = {each.name: each for each in joints}
        taken, left = read_tendons(self._document, named, self._spring_references)
        self._note_data("tendon", "no tendon pulls in dynx", taken, left)
        return taken

    def _read_drives(
        self, trees: Sequence[Sequence[Joint]]
    ) -> list[tuple[tuple[StatedTendon, ...], tuple[Actuator, ...]]]:
        """Return the fixed tendons and the actuators of each tree, which is given by its joints."""
        joints = [joint for own in trees for joint in own]
        tree_of = {joint.name: number for number, own in enumerate(trees) for joint in own}
        tendons: dict[int, list[StatedTendon]] = {number: [] for number in range(len(trees))}
        for each in self._read_tendons(joints):
            several = {tree_of[name] for name in each.joints}
            if len(several) > 1:
                text = f"not read: tendon {shown(each.name)}, which has joints of several robots"
                self._reading.notes.append(_note_on_line(text, each.line))
            else:
                tendons[several.pop()].append(each)
        tree_of_tendon = {each.name: number for number, own in tendons.items() for each in own}
        actuators: dict[int, list[Actuator]] = {number: [] for number in tendons}
        for drive in self._read_actuators(joints, [each for own in tendons.values() for each in own]):
            number = tree_of_tendon[drive.tendon] if drive.tendon else tree_of[drive.joint]
            actuators[number].append(drive)
        return [(tuple(tendons[number]), tuple(actuators[number])) for number in tendons]

    def _read_equalities(
        self, tendons: Iterable[StatedTendon], frames: Iterable[Frame]
    ) -> tuple[StatedEquality, ...]:
        """Return the equality constraints of the robot, with notes on all of them: none acts."""
        if self._document.options.disabled("equality") is not None:
            return ()
        joints = {each.name: each for each in self._parts.joints}
        positions = {name: start for name, start in self._parts.positions if joints[name].type != "ball"}
        sites = (each.name for each in self._parts.sites)
        parts = EqualityObjects(
            self._link_of,
            dict(zip(sites, (each.name for each in frames), strict=True)),
            positions,
            {each.name: sum(factor * positions[joint] for joint, factor in each.terms) for each in tendons},
            self._poses,
        )
        taken, left = read_equalities(self._document, parts, joints.keys() - positions.keys())
        self._note_data("equality", _NOT_IN_TREE["equality"], taken, left)
        return taken

    def _initial_configuration(self, base: Base) -> NamedConfiguration:
        """Return `qpos0`."""
        (state,) = tree_states(self._document, [self._coordinates(base)])
        return state.configuration("")

    def _note_compensation(self) -> None:
        self._held.pop("gravcomp", None)
        if self._compensation:
            first = self._compensation[0]
            more = f" and of {_counted(len(self._compensation) - 1, 'other body')}"
            text = f"gravcomp of body {shown(first.link)}{more if len(self._compensation) > 1 else ''}"
            text += ": model.gravity_compensation has it as data, and weight is not compensated in dynx"
            self._reading.notes.append(_note_on_line(text, first.line))

    def _note_data(
        self,
        tag: str,
        effect: str,
        taken: Sequence[Actuator | StatedTendon | StatedEquality],
        left: Sequence[tuple[Element, str]],
        effect_of_left: str | None = None,
    ) -> None:
        """Add notes on the elements of a section that the model has as data, and on those left out."""
        held = {"actuator": "actuators", "tendon": "tendons", "equality": "equalities"}[tag]
        if taken:
            count = _counted(len(taken), "element")
            text = f"{count} of <{tag}>: model.{held} has them as data, and {effect}"
            self._reading.notes.append(_note_on_line(text, taken[0].line))
        if left:
            (element, reason), count = left[0], _counted(len(left), "element")
            names = [shown(each.attributes["name"]) for each, _ in left if each.attributes.get("name")]
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            called = f" ({', '.join(names[:3])}{more})" if names else ""
            text = f"not read: {count} of <{tag}>{called}; {effect_of_left or effect}"
            self._reading.note(element, f"{text} (the first is left out because {reason})")

    def _read_sensors(self, content: Description) -> tuple[StatedSensor, ...]:
        """Return the sensors of the robot, with a note on those that are left out."""
        frames = (each.name for each in content.frames)
        sites = dict(zip((each.name for each in self._parts.sites), frames, strict=True))
        taken, left = read_sensors(self._document, SensorObjects.of(content), self._link_of, sites)
        if left:
            element, reason = left[0]
            self._reading.note(
                element,
                f"not read: {_counted(len(left), 'element')} of <sensor> (the first is left out because "
                f"{reason})",
            )
        return taken

    def _read_configurations(self, base: Base) -> tuple[NamedConfiguration, ...]:
        """Return the keyframes of the robot, with a note on what they state besides its positions."""
        keyframes, parts = read_keyframes(self._document), self._parts
        if keyframes and parts.aligned:
            self._reading.note(
                next(iter(keyframes.values())),
                f"not read: {_counted(len(keyframes), 'element')} of <keyframe>, which state the pose of the "
                "principal axes",
            )
            return ()
        coordinates, found = self._coordinates(base), []
        for name, key in keyframes.items():
            (state,) = tree_states(self._document, [coordinates], key, name)
            found.append(state.configuration(name, key.line))
        others = [
            (each, key) for key in keyframes.values() for each in NOT_OF_A_POSITION if each in key.attributes
        ]
        if others:
            self._reading.note(
                others[0][1],
                f"not read of <keyframe>: {', '.join(dict.fromkeys(each for each, _ in others))}; "
                "model.configurations has positions alone",
            )
        return tuple(found)

    def _coordinates(self, base: Base) -> TreeCoordinates:
        parts = self._parts
        T_world_free = parts.bodies[0].T_world_body if base == "floating" else None
        return _coordinates(T_world_free, parts.positions, parts.joints)

    def _contact_filter(self) -> ContactFilter:
        """Return which shapes may touch, with a note on what is no part of the robot."""
        found, left = self._contacts.of_robot(self._link_of, self._colliding)
        if left:
            self._reading.note(
                left[0],
                f"not read: {_counted(len(left), 'element')} of <contact>, which name a body or geom that "
                "the robot has not, or that touches nothing",
            )
        if self._contacts.parameters is not None:
            self._reading.note(self._contacts.parameters, "parameters of <pair> are not read")
        return found

    def _dynamics(self, element: Element, name: str, kind: str) -> JointDynamics:
        reading, given, what = self._reading, element.attributes, f"joint {shown(name)}"
        coefficients = {}
        for attribute in ("damping", "stiffness"):
            numbers = reading.some_numbers(element, attribute, what, 1, 3) if attribute in given else (0.0,)
            if any(numbers[1:]):
                reading.note(
                    element, f"{attribute} of {what} is a polynomial; its terms beyond the first are not read"
                )
            coefficients[attribute] = numbers[0]
        if "springdamper" in given and all(
            x > 0.0 for x in reading.numbers(element, "springdamper", what, 2)
        ):
            reading.note(element, f"springdamper of {what} is not read: it has no spring and no damping")
            coefficients = dict.fromkeys(coefficients, 0.0)
        options = self._document.options
        stiffness = coefficients["stiffness"] if options.disabled("spring") is None else 0.0
        if stiffness and kind == "ball":
            reading.note(element, f"stiffness of {what} is not read: a ball joint has no spring in dynx")
            stiffness = 0.0
        if stiffness and reading.number_or(element, "springyield", what, 0.0):
            reading.note(element, f"springyield of {what} is not read: its spring is elastic")
        friction = reading.number_or(element, "frictionloss", what, 0.0)
        for loss, value in (("damping", coefficients["damping"]), ("frictionloss", friction)):
            if value < 0.0:
                reading.note(element, f"the {loss} of {what} is negative, so the joint gains energy")
        if stiffness < 0.0:
            reading.note(element, f"the stiffness of {what} is negative, so the spring pushes the joint away")
        reference = self._spring_references[name] = self._position(element, "springref", kind, what)
        return JointDynamics(
            stiffness=stiffness,
            spring_reference=reference,
            damping=coefficients["damping"] if options.disabled("damper") is None else 0.0,
            friction=friction if options.disabled("frictionloss") is None else 0.0,
            armature=reading.number_or(element, "armature", what, 0.0),
        )

    # -- inertias -------------------------------------------------------------------------------

    def _inertial(self, body: _BodyContent) -> Inertial | None:
        compiler = self._document.compiler_of(body.element)
        if len(body.inertials) > 1:
            raise self._reading.error(body.inertials[1], f"body {shown(body.name)} has two <inertial>")
        inertial = None
        if body.inertials and compiler.inertia_from_geom != "true":
            inertial = self._stated(body.inertials[0], f"body {shown(body.name)}")
        elif compiler.inertia_from_geom != "false":
            inertial = self._from_geoms(body)
        return self._bounded(inertial, body)

    def _stated(self, element: Element, what: str) -> Inertial:
        reading = self._reading
        mass = reading.number(element, "mass", what)
        if mass < 0.0:
            raise reading.error(element, f"the mass of {what} is {mass:g}; wanted at least 0")
        reading.vector(element, "pos", what)
        given = [each for each in ("diaginertia", "fullinertia") if each in element.attributes]
        if len(given) != 1:
            raise reading.error(element, f"<inertial> of {what} wants one of diaginertia and fullinertia")
        pose = self._document.pose(element, f"<inertial> of {what}")
        moments: tuple[float, ...]
        if given == ["fullinertia"]:
            if (pose[:3, :3] != _NO_ROTATION).any():
                raise reading.error(element, f"<inertial> of {what} has fullinertia and an orientation")
            moments = reading.numbers(element, "fullinertia", what, 6)
        else:
            moments = (*reading.vector(element, "diaginertia", what), 0.0, 0.0, 0.0)
        xx, yy, zz, xy, xz, yz = moments
        return Inertial(mass, Pose.from_matrix(pose), xx, xy, xz, yy, yz, zz, line=element.line)

    def _from_geoms(self, body: _BodyContent) -> Inertial | None:
        """Add the masses of the geoms of a body."""
        low, high = self._document.compiler_of(body.element).inertia_groups
        found = [
            each
            for geom in body.geoms
            if low <= geom.group <= high and (each := self._geoms.properties(geom)) is not None
        ]
        if not found:
            return None
        return inertial_of(sum(found[1:], found[0]), body.element.line)

    def _bounded(self, inertial: Inertial | None, body: _BodyContent) -> Inertial | None:
        """Apply ``balanceinertia``, ``boundmass`` and ``boundinertia``."""
        compiler = self._document.compiler_of(body.element)
        if inertial is None and not (compiler.bound_mass or compiler.bound_inertia):
            return None
        found = inertial or Inertial(line=body.element.line)
        # The bounds come first: what exceeds the sum of the others may not do so afterwards.
        bounded = replace(found, mass=max(found.mass, compiler.bound_mass))
        if compiler.bound_inertia:
            moments, axes = np.linalg.eigh(found.tensor)
            bounded = _with_moments(bounded, np.maximum(moments, compiler.bound_inertia), axes)
        fault = inertia_fault(bounded)
        if compiler.balance_inertia and fault is not None and "exceeds" in fault:
            moments, axes = np.linalg.eigh(bounded.tensor)
            return _with_moments(bounded, np.full(3, moments.mean()), axes)
        if fault is not None:
            self._reading.note(
                body.element, f"the inertia of body {shown(body.name)} {fault}; it is used as stated"
            )
        return bounded

    def _total_mass_scale(self, root: Element, links: Iterable[Link]) -> float:
        """Return the factor of all masses that ``settotalmass`` demands."""
        total = self._document.compiler.total_mass
        if total <= 0.0:
            return 1.0
        masses = (link.inertial.mass for link in links if link.inertial is not None)
        mass = sum(masses, start=self._mass_apart)
        if mass <= 0.0:
            raise self._reading.error(root, "settotalmass is given and no body has a mass")
        return total / mass

    def _scale(self, scale: float) -> None:
        if scale == 1.0:
            return
        self._parts.links = [
            link if link.inertial is None else replace(link, inertial=_scaled(link.inertial, scale))
            for link in self._parts.links
        ]

    # -- the rest -------------------------------------------------------------------------------

    def _frames(self) -> list[Frame]:
        taken, frames, sites = {link.name for link in self._parts.links}, [], set[str]()
        for name, link, pose, element in self._parts.sites:
            fault = name_fault(name)
            if fault is not None:
                raise self._reading.error(element, f"the name of a site {fault}")
            if name in sites:
                raise self._reading.error(element, f"two sites have the name {shown(name)}")
            sites.add(name)
            free = name if name not in taken else free_name(f"{name}_site", taken)
            if free != name:
                self._reading.note(
                    element, f"the site {shown(name)} has the name of a body; its frame is {shown(free)}"
                )
            taken.add(free)
            frames.append(Frame(free, link, Pose.from_matrix(pose)))
        return frames

    def _note_sections(self, root: Element, not_read: Mapping[str, str]) -> None:
        reading = self._reading
        for tag, effect in not_read.items():
            elements = [each for section in root.all(tag) for each in section.children if not is_mimic(each)]
            if elements:
                reading.note(
                    elements[0], f"not read: {_counted(len(elements), 'element')} of <{tag}>; {effect}"
                )
        reading.ignore_unknown(root, _IN_ROOT | set(_NOT_IN_TREE))
        reading.note_ignored()

    def _note_vocabulary(self, root: Element) -> None:
        """Add notes on attributes without an effect in dynx, and on what is misspelt."""
        for element, text in (*unused_attributes(root), *unknown_parts(root), *commas_in_numbers(root)):
            self._reading.note(element, text)

    def _note_counts(self, root: Element) -> None:
        for kind, ((what, element), *others) in self._held.items():
            more = f" and of {_counted(len(others), 'other body')}" if others else ""
            effect = _NOT_READ_OF_BODIES[kind]
            self._reading.note(element, f"{kind} of {what}{more} is not read: {effect}")
        self._reading.note_ignored()


def _note_on_line(message: str, line: int | None) -> Note:
    """Return a note that names the file of an included line."""
    file = file_of_line(line)
    return Note(message if file is None else f"{file}: {message}", line)


def _coordinates(
    T_world_free: Floats | None, positions: Iterable[tuple[str, float]], joints: Iterable[Joint]
) -> TreeCoordinates:
    balls = {joint.name for joint in joints if joint.type == "ball"}
    return TreeCoordinates(
        T_world_free,
        tuple((name, (0.0, 0.0, 0.0, 1.0) if name in balls else (start,)) for name, start in positions),
    )


def _counted(count: int, noun: str) -> str:
    return (
        f"{count} {noun}"
        if count == 1
        else f"{count} {noun.removesuffix('y')}{'ies' if noun[-1] == 'y' else 's'}"
    )


def _has_own_joint(element: Element) -> bool:
    """Check whether a body has a joint, itself or in a frame."""
    return any(
        child.tag in ("joint", "freejoint") or (child.tag == "frame" and _has_own_joint(child))
        for child in element.children
    )


def _has_joint_below(element: Element) -> bool:
    waiting = [element]
    while waiting:
        each = waiting.pop()
        if each.tag in ("joint", "freejoint"):
            return True
        waiting += each.children
    return False


def _names(root: Element, tag: str) -> set[str]:
    """Return the names of all elements of a tag."""
    names, waiting = set(), [root]
    while waiting:
        element = waiting.pop()
        waiting += element.children
        if element.tag == tag and "name" in element.attributes:
            names.add(element.attributes["name"])
    return names


def _numbered_names(root: Element) -> dict[int, str]:
    """Return the name of each body by the identity of its element; MuJoCo counts those without one."""
    names: dict[int, str] = {}
    waiting = list(reversed(root.all("worldbody")))
    while waiting:
        element = waiting.pop()
        if element.tag == "body":
            names[id(element)] = element.attributes.get("name", f"body_{len(names) + 1}")
        waiting += reversed(element.children)
    return names


def _with_moments(inertial: Inertial, moments: Floats, axes: Floats) -> Inertial:
    """Return an inertia with these principal moments about the columns of `axes`."""
    xx, xy, xz, yy, yz, zz = (axes @ np.diag(moments) @ axes.T)[np.triu_indices(3)].tolist()
    return replace(inertial, ixx=xx, ixy=xy, ixz=xz, iyy=yy, iyz=yz, izz=zz)


def _scaled(inertial: Inertial, scale: float) -> Inertial:
    moments = {name: scale * getattr(inertial, name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    return replace(inertial, mass=scale * inertial.mass, **moments)
