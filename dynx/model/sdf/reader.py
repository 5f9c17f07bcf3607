"""Reader of SDF: the links and joints of one robot, with a note for all that is not part of it.

Each link is a link whose frame is that of the file, and each ``<frame>`` is a frame. A joint that turns about
an axis off the origin of its child moves a link without mass, as does the first axis of a joint that has two.
The joints of SDF have no direction: one whose child is nearer to the root is turned round. No part of Gazebo
or Drake is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dynx.errors import nearest, shown
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
    Pose,
    Vector,
)
from dynx.model.geometry import Geometry
from dynx.model.package_search import StrPath
from dynx.model.sdf.document import ONE_ROBOT, WORLD, NamedPart, Scope, SdfReading, read_document
from dynx.model.sdf.extension import GEAR_RATIO, HOLD, LIMITS, LOCKED, NAME, ROTOR_INERTIA
from dynx.model.sdf.frames import Frames
from dynx.model.sdf.shapes import LinkShapeReader
from dynx.model.tree import STANDARD_GRAVITY, Base, Description
from dynx.model.urdf.reader import inertia_fault
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import free_name
from dynx.model.xml.values import name_fault
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse

DEFAULT_GRAVITY: Vector = (0.0, 0.0, -9.8)
"""Gravity of a world that states none [m/s^2]."""

UNLIMITED = 1e16
"""Position, speed or effort from which on the format means that there is no limit."""

_NO_ROTATION = np.eye(3)
_TYPES: dict[str, tuple[JointType, ...]] = {
    "revolute": ("revolute",),
    "continuous": ("continuous",),
    "prismatic": ("prismatic",),
    "fixed": (),
    "ball": ("ball",),
    "universal": ("revolute", "revolute"),
    "revolute2": ("revolute", "revolute"),
}
_REFUSED = {
    "screw": "whose turn and slide are coupled, which a Model cannot say",
    "gearbox": "which couples two joints; a <mimic> says that of two axes",
}
_AXES = ("axis", "axis2")


def read_sdf(data: str | bytes, source: str, package_dirs: Iterable[StrPath] = ()) -> Description | None:
    """Read the robot of a model or world in SDF, fixed in the world or free; None for another document.

    Raises DescriptionError for malformed content, UnsupportedFeatureError for what a `Model` cannot say; the
    message begins with the file and the line.
    """
    folders = tuple(map(str, package_dirs))
    found = read_document(data, source, folders)
    if found is None:
        return None
    top, reading = found
    return _RobotReader(top, reading, folders).read()


def axes_in_joint_frames(data: str | bytes, source: str) -> list[tuple[str, int, Floats]]:
    """Return for each axis of a document in SDF its name in the model, the line of its joint, and its
    direction (3,) of length 1 in the frame of the joint, as the ``<pose>`` of the joint places it.

    A `Joint` has it in the frame of the link that it carries. Raises the errors of `read_sdf`.
    """
    found = read_document(data, source, ())
    return [] if found is None else _RobotReader(*found, ()).axes()


@dataclass
class _Axis:
    """One axis of a joint: its name in the model, and its direction (3,) in the frame of the joint; a ball
    joint is one without a direction."""

    name: str
    type: JointType
    direction: Floats
    element: Element


@dataclass
class _Connection:
    """What joins two links, of which None is the world; without a `joint` they are rigidly joined."""

    parent: NamedPart | None
    child: NamedPart
    joint: NamedPart | None


class _RobotReader:
    def __init__(self, top: Scope, reading: SdfReading, package_dirs: tuple[str, ...]) -> None:
        self._top, self._reading = top, reading
        self._frames = Frames(reading)
        self._shapes = LinkShapeReader(reading, self._frames, package_dirs)
        self._links: list[Link] = []
        self._joints: list[Joint] = []
        self._prefixes: dict[int, str] = {id(top): ""}
        self._parts = list(top.walk())
        self._own_names: dict[int, str] = {}
        self._name_scopes()
        self._taken = {self._name(part) for part in self._parts if part.kind == "link"} | {WORLD}
        self._joint_names: set[str] = set()
        for part in self._parts:
            if part.kind == "joint":
                self._joint_names |= {name for name, _ in self._axis_names(part)} | {self._name(part)}

    def read(self) -> Description:
        reading = self._reading
        links = [part for part in self._parts if part.kind == "link"]
        for scope in {id(each): each for each in (self._top, *(part.scope for part in self._parts))}.values():
            if scope.element.attributes.get("canonical_link"):
                # It need not matter to any pose, and its name is to be right.
                self._frames.link_of(scope)
        connections = list(self._connections())
        held = self._take_hold(connections)
        components = self._components(links, connections)
        root = self._root(components, connections)
        if held is not None and root is not held.child:
            raise reading.error(
                held.child.element, f"{held.child.what} is held by <{HOLD}> and is not the root"
            )
        base: Base = "fixed" if root is None or held is not None else "floating"
        inside = {id(part) for part in components[0 if root is None else id(root)]}
        if root is None:
            self._links.append(Link(WORLD, Inertial(), self._top.element.line))
        read = [part for part in links if id(part) in inside]
        for part in read:
            self._links.append(Link(self._name(part), self._inertial(part), part.element.line))
        self._join(root, [each for each in connections if id(each.child) in inside])
        geometry = Geometry({self._name(part): self._shapes.geometry(part) for part in read})
        base_pose = IDENTITY
        if root is not None and held is not None:
            base_pose = _pose(self._frames.between(None, root))
        elif root is not None:
            self._note_start(root)
        frames = self._frames_of({id(part) for part in read}, root)
        gravity = self._gravity(read)
        reading.note_unread()
        return Description(
            self._robot_name(),
            self._links,
            self._joints,
            frames,
            reading.notes,
            geometry,
            base=base,
            gravity=gravity,
            base_pose=base_pose,
        )

    def axes(self) -> list[tuple[str, int, Floats]]:
        """Return what `axes_in_joint_frames` does."""
        joints = [part for part in self._parts if part.kind == "joint" and _kind(part) in _TYPES]
        return [
            (axis.name, joint.element.line, axis.direction)
            for joint in joints
            for axis in self._axes(joint)
            if axis.type != "ball"
        ]

    # -- names ----------------------------------------------------------------------------------

    def _name_scopes(self) -> None:
        """Choose what stands before the names in each model: the models around, but for the robot's own."""
        top = self._top
        moving = [each for each in top.content if isinstance(each, Scope) and not each.static]
        robot = moving[0] if top.is_world and len(moving) == 1 else None
        if top.is_world and robot is None:
            alone = [each for each in top.content if isinstance(each, Scope)]
            robot = alone[0] if len(alone) == 1 else None
        waiting = [top]
        while waiting:
            scope = waiting.pop()
            for each in scope.content:
                if isinstance(each, Scope):
                    own = "" if each.merged or each is robot else f"{each.name}::"
                    self._prefixes[id(each)] = self._prefixes[id(scope)] + own
                    waiting.append(each)
        self._robot = robot

    def _name(self, part: NamedPart) -> str:
        if id(part) not in self._own_names:
            own = self._own_name(part)
            self._own_names[id(part)] = self._prefixes[id(part.scope)] + own
        return self._own_names[id(part)]

    def _own_name(self, part: NamedPart | Scope) -> str:
        """Return the name of a part, which may be one that the format does not accept."""
        name = self._reading.word(part.element, NAME, part.what) or part.name
        fault = name_fault(name)
        if fault is not None:
            raise self._reading.error(part.element, f"the name of {part.what} {fault}")
        return name

    def _robot_name(self) -> str:
        top = self._top if self._robot is None else self._robot
        return top.name if top.is_world else self._own_name(top)

    # -- which links are the robot ----------------------------------------------------------------

    def _connections(self) -> Iterator[_Connection]:
        """Yield what joins links: joints that may move, and the links of static models to the world."""
        fixed = {id(part) for part in self._parts if part.kind == "link" and _is_static(part.scope)}
        held: list[NamedPart] = []
        for part in self._parts:
            if part.kind == "link":
                if id(part) in fixed:
                    yield _Connection(None, part, None)
            elif part.kind == "joint":
                self._require_type(part)
                parent, child = self._frames.ends(part)
                if child is None:
                    raise self._reading.error(
                        part.element, f"the child of {part.what} is the world; wanted a link"
                    )
                if parent is child:
                    raise self._reading.error(part.element, f"{part.what} joins {child.what} to itself")
                if id(child) in fixed and (parent is None or id(parent) in fixed):
                    held.append(part)
                else:
                    yield _Connection(parent, child, part)
        if held:
            more = f" and {len(held) - 1} others" if len(held) > 1 else ""
            self._reading.note(held[0].element, f"{held[0].what}{more} cannot move: the model is static")

    def _take_hold(self, connections: list[_Connection]) -> _Connection | None:
        """Take out the joint that holds the root of a fixed base in the world, if one is marked as such."""
        marked = [each for each in connections if each.joint is not None and each.joint.element.all(HOLD)]
        for each in marked:
            assert each.joint is not None
            what, element = each.joint.what, each.joint.element
            if each.parent is not None or _kind(each.joint) != "fixed":
                raise self._reading.error(
                    element, f"{what} has <{HOLD}>; wanted it in a fixed joint whose parent is the world"
                )
            if sum(other.parent is None for other in connections) > 1:
                raise self._reading.error(
                    element, f"{what} has <{HOLD}>, and the world holds another link, too; wanted one"
                )
            connections.remove(each)
        return marked[0] if marked else None

    def _components(
        self, links: list[NamedPart], connections: list[_Connection]
    ) -> dict[int, list[NamedPart]]:
        """Return the links that hang together, by the identity of their first; 0 for those on the world."""
        leader = {id(part): id(part) for part in links} | {0: 0}

        def find(key: int) -> int:
            while leader[key] != key:
                leader[key] = leader[leader[key]]
                key = leader[key]
            return key

        for each in connections:
            ends = [find(0 if part is None else id(part)) for part in (each.parent, each.child)]
            if ends[0] == ends[1] and each.joint is not None:
                raise self._reading.unsupported(
                    each.joint.element, f"{each.joint.what} closes a loop, which a Model cannot say"
                )
            if ends[0] == ends[1]:
                raise self._reading.unsupported(
                    each.child.element, f"{each.child.what} of a static model closes a loop"
                )
            # The world leads those that are joined to it.
            low, high = (ends[0], ends[1]) if ends[0] == 0 else (ends[1], ends[0])
            leader[high] = low
        found: dict[int, list[NamedPart]] = {0: []}
        for part in links:
            found.setdefault(find(id(part)), []).append(part)
        return {key if key == 0 else id(parts[0]): parts for key, parts in found.items()}

    def _root(
        self, components: dict[int, list[NamedPart]], connections: list[_Connection]
    ) -> NamedPart | None:
        """Return the root link of a robot that moves freely; None for one that is fixed in the world."""
        reading, top = self._reading, self._top
        free = {key: parts for key, parts in components.items() if key != 0}
        if not free and not components[0]:
            raise reading.error(top.element, f"{top.what} has no link; a Model has one at least")
        on_world = {id(part) for part in components[0]}
        moves = any(
            each.joint is not None and id(each.child) in on_world and _kind(each.joint) != "fixed"
            for each in connections
        )
        models = [each for each in top.content if isinstance(each, Scope) and not each.static]
        joined = any(isinstance(each, NamedPart) and each.kind == "joint" for each in top.content)
        apart = top.is_world and len(models) > 1 and not joined
        if apart or len(free) + moves > 1:
            several = models if apart else [part for parts in free.values() for part in parts[:1]]
            names = ", ".join(shown(each.name) for each in several[:5])
            count = len(several) + (0 if apart else moves)
            raise reading.unsupported(
                several[-1].element,
                f"{top.what} holds {count} robots or bodies that move apart from one another ({names}); "
                f"{ONE_ROBOT}",
            )
        if not free:
            return None
        if components[0]:
            count = len(components[0])
            reading.note(
                components[0][0].element,
                "the robot moves freely; what is fixed in the world is no part of it: "
                f"{count} link{'' if count == 1 else 's'}",
            )
        (parts,) = free.values()
        children = {id(each.child) for each in connections}
        # Without a loop some link is no child; of several, joints lead to the others the other way round.
        root = next(part for part in parts if id(part) not in children)
        components[id(root)] = parts
        return root

    # -- joints ---------------------------------------------------------------------------------

    def _join(self, root: NamedPart | None, connections: list[_Connection]) -> None:
        """Add the joints, each from the link that is nearer to the root."""
        depth = {0 if root is None else id(root): 0}
        around: dict[int, list[_Connection]] = {}
        for each in connections:
            for part in (each.parent, each.child):
                around.setdefault(0 if part is None else id(part), []).append(each)
        waiting = list(depth)
        while waiting:
            key = waiting.pop()
            for each in around.get(key, ()):
                for part in (each.parent, each.child):
                    other = 0 if part is None else id(part)
                    if other not in depth:
                        depth[other] = depth[key] + 1
                        waiting.append(other)
        for each in connections:
            near_child = depth[0 if each.parent is None else id(each.parent)] > depth[id(each.child)]
            if each.joint is None:
                name = free_name(f"{self._name(each.child)}_fixed", self._joint_names)
                self._joint_names.add(name)
                pose = _pose(self._frames.between(None, each.child))
                self._joints.append(
                    Joint(name, "fixed", WORLD, self._name(each.child), pose, line=each.child.element.line)
                )
            else:
                self._add_joint(each, each.joint, turned=near_child)

    def _add_joint(self, connection: _Connection, joint: NamedPart, *, turned: bool) -> None:
        """Add a joint as a chain: each axis but the last moves a link without mass, and so does the last if
        it turns about a point off the origin of the link that it carries."""
        frames, name = self._frames, self._name(joint)
        parent, child = connection.parent, connection.child
        at = frames.between(parent, child)
        place = frames.between(child, joint)  # of the joint, in the link that it carries
        axes = self._axes(joint)
        first, last = (WORLD if parent is None else self._name(parent)), self._name(child)
        if turned:
            first, last = last, first
            at, place = inverse(at), at @ place
            axes = [replace(each, direction=-each.direction) for each in reversed(axes)]
            self._reading.note(
                joint.element,
                f"{joint.what} is read from its child to its parent, which is farther from the root",
            )
        line = joint.element.line
        if not axes:
            locked = self._reading.one(joint.element, LOCKED, joint.what)
            locked_at = None if locked is None else self._reading.number(locked, LOCKED, joint.what)
            self._joints.append(Joint(name, "fixed", first, last, _pose(at), locked_at=locked_at, line=line))
            return
        R, point = place[:3, :3], place[:3, 3]
        above = first
        for number, each in enumerate(axes):
            direction = R @ each.direction if (R != _NO_ROTATION).any() else each.direction
            # A slide has no place, but a joint of another type would have the one that the file states.
            turns = each.type in ("revolute", "continuous")
            final = number == len(axes) - 1
            off = bool((np.cross(point, direction) if turns else point).any())
            # All axes of one joint meet in its origin.
            chained = not final or off or (len(axes) > 1 and bool(point.any()))
            below = (
                free_name(f"{name}_link" if len(axes) == 1 else f"{each.name}_link", self._taken)
                if chained
                else last
            )
            origin = at if number == 0 else np.eye(4)
            if number == 0 and chained:
                origin = at @ homogeneous(_NO_ROTATION, point)
            if chained:
                self._taken.add(below)
                self._links.append(Link(below, Inertial(), line))
            self._append(each, above, below, _pose(origin), direction, joint)
            above = below
        if above != last:
            fixed = free_name(f"{name}_fixed", self._joint_names)
            self._joint_names.add(fixed)
            pose = _pose(homogeneous(_NO_ROTATION, -point))
            self._joints.append(Joint(fixed, "fixed", above, last, pose, line=line))

    def _append(
        self, axis: _Axis, parent: str, child: str, origin: Pose, direction: Floats, joint: NamedPart
    ) -> None:
        what = f"joint {shown(axis.name)}"
        limits = self._limits(axis.element, what, ball=axis.type == "ball")
        endless = limits.lower == -INFINITY and limits.upper == INFINITY
        kind = axis.type
        if kind == "continuous" or (kind == "revolute" and endless):
            kind, limits = "continuous", replace(limits, lower=-INFINITY, upper=INFINITY)
        length = 1.0 if kind == "ball" else np.linalg.norm(direction)
        x, y, z = (direction / length + 0.0).tolist()
        self._joints.append(
            Joint(
                axis.name,
                kind,
                parent,
                child,
                origin,
                axis=(x, y, z),
                limits=limits,
                dynamics=self._dynamics(axis.element, joint, what),
                mimic=self._mimic(axis.element, joint, what),
                line=joint.element.line,
            )
        )

    def _require_type(self, joint: NamedPart) -> None:
        kind = _kind(joint)
        if kind in _TYPES:
            return
        if kind in _REFUSED:
            raise self._reading.unsupported(
                joint.element, f"{joint.what} is a {kind} joint, {_REFUSED[kind]}"
            )
        if not kind:
            raise self._reading.error(
                joint.element, f"{joint.what} has no type; wanted one of {', '.join(_TYPES)}"
            )
        raise self._reading.error(
            joint.element,
            f"{joint.what} has the unknown type {shown(kind)}{nearest(kind, [*_TYPES, *_REFUSED])}",
        )

    def _axis_names(self, joint: NamedPart) -> list[tuple[str, str]]:
        """Return the name in the model of each axis of a joint, and the tag of its element."""
        name, count = self._name(joint), len(_TYPES.get(_kind(joint), ()))
        return [(name if count == 1 else f"{name}_{tag}", tag) for tag in _AXES[:count]]

    def _axes(self, joint: NamedPart) -> list[_Axis]:
        reading, axes = self._reading, []
        for (name, tag), kind in zip(self._axis_names(joint), _TYPES[_kind(joint)], strict=True):
            element = reading.only(joint.element, tag)
            if kind == "ball":
                # The format has no axis for it; damping and limits stand in one that a file may have.
                axes.append(_Axis(name, kind, np.zeros(3), element or joint.element))
                continue
            if element is None:
                raise reading.error(joint.element, f"{joint.what} is {_kind(joint)} and has no <{tag}>")
            direction = self._frames.axis(joint, element, joint.what)
            axes.append(_Axis(name, kind, direction, element))
        for tag in _AXES[len(axes) :]:
            if joint.element.all(tag):
                reading.note(
                    joint.element.all(tag)[0], f"{joint.what} is {_kind(joint)}; its <{tag}> is not used"
                )
        return axes

    def _limits(self, axis: Element, what: str, *, ball: bool = False) -> Limits:
        """Read limits; of a ball joint those in elements of dynx alone, because others have no meaning."""
        reading = self._reading
        limit = reading.only(axis, "limit")
        if limit is None:
            return Limits()
        own = {
            name: reading.scalar(limit, tag, what, INFINITY) for name, tag in LIMITS.items() if limit.all(tag)
        }
        if ball:
            for tag in ("lower", "upper", "velocity", "effort"):
                if limit.all(tag):
                    reading.note(limit, f"<{tag}> of {what} is not used: it has no meaning for a ball joint")
            return Limits(0.0, own.pop("upper", INFINITY), **own)
        lower = own.get("lower", self._limit(limit, "lower", what, -INFINITY))
        upper = own.get("upper", self._limit(limit, "upper", what, INFINITY))
        if lower > upper:
            raise reading.error(limit, f"{what} has lower limit {lower:g} above upper limit {upper:g}")
        most = {}
        for tag in ("velocity", "effort"):
            value = self._limit(limit, tag, what, INFINITY)
            most[tag] = own.get(tag, INFINITY if value < 0.0 else value)
        return Limits(lower, upper, **most)

    def _limit(self, limit: Element, tag: str, what: str, default: float) -> float:
        found = self._reading.one(limit, tag, what)
        if found is None:
            return default
        word = found.attributes[tag].lower().lstrip("+")
        if word.lstrip("-") in ("inf", "infinity"):
            return -INFINITY if word.startswith("-") else INFINITY
        value = self._reading.number(found, tag, what, bound=INFINITY)
        return value if abs(value) < UNLIMITED else float(np.copysign(INFINITY, value))

    def _dynamics(self, axis: Element, joint: NamedPart, what: str) -> JointDynamics:
        reading = self._reading
        dynamics = reading.only(axis, "dynamics")
        armature = self._armature(joint)
        if dynamics is None:
            return JointDynamics(armature=armature)
        values = {each: reading.scalar(dynamics, each, what, 0.0) for each in ("damping", "friction")}
        for each, value in values.items():
            if value < 0.0:
                reading.note(dynamics, f"the {each} of {what} is negative, so the joint gains energy")
        stiffness = reading.scalar(dynamics, "spring_stiffness", what, 0.0)
        if stiffness < 0.0:
            reading.note(
                dynamics, f"the spring_stiffness of {what} is negative, so the spring pushes the joint away"
            )
        reference = reading.scalar(dynamics, "spring_reference", what, 0.0)
        if stiffness and joint.element.attributes.get("type") == "ball":
            reading.note(dynamics, f"the spring of {what} is not read: a ball joint has no spring in dynx")
            stiffness = 0.0
        return JointDynamics(**values, armature=armature, stiffness=stiffness, spring_reference=reference)

    def _armature(self, joint: NamedPart) -> float:
        """Return the armature that Drake's elements give to a joint of one axis; others have no motor."""
        reading, what = self._reading, joint.what
        inertia, ratio = (
            reading.scalar(joint.element, tag, what, default)
            for tag, default in ((ROTOR_INERTIA, 0.0), (GEAR_RATIO, 1.0))
        )
        if inertia < 0.0:
            raise reading.error(
                joint.element, f"<{ROTOR_INERTIA}> of {what} is {inertia:g}; wanted at least 0"
            )
        if inertia and len(_TYPES[_kind(joint)]) > 1:
            reading.note(joint.element, f"<{ROTOR_INERTIA}> of {what} is not used: it has two axes")
            return 0.0
        return inertia * ratio * ratio

    def _mimic(self, axis: Element, joint: NamedPart, what: str) -> Mimic | None:
        """Return the coupling of an axis: its position is multiplier (leader - reference) + offset."""
        reading = self._reading
        mimic = reading.only(axis, "mimic")
        if mimic is None:
            return None
        leader = self._frames.named(joint.scope, reading.attribute(mimic, "joint", what), mimic, what)
        if not (isinstance(leader, NamedPart) and leader.kind == "joint"):
            raise reading.error(mimic, f"{what} mimics {shown(leader.name)}, which is no joint")
        tag = reading.choice(mimic, "axis", f"<mimic> of {what}", _AXES, "axis")
        names = {each: name for name, each in self._axis_names(leader)}
        if tag not in names:
            raise reading.error(mimic, f"{what} mimics <{tag}> of {leader.what}, which has none")
        multiplier, offset, reference = (
            reading.scalar(mimic, each, what, default)
            for each, default in (("multiplier", 1.0), ("offset", 0.0), ("reference", 0.0))
        )
        return Mimic(names[tag], multiplier, offset - multiplier * reference)

    # -- the rest -------------------------------------------------------------------------------

    def _inertial(self, link: NamedPart) -> Inertial:
        """Return the inertial of a link: 1 kg and 1 kg m^2 where the file states none."""
        reading, what = self._reading, link.what
        element = reading.only(link.element, "inertial")
        if element is None:
            reading.note(link.element, f"{what} has no <inertial>; the format gives it 1 kg and 1 kg m^2")
            return Inertial(1.0, IDENTITY, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0, line=link.element.line)
        if reading.flag(element, "auto", f"<inertial> of {what}", default=False):
            if element.all("inertia") or element.all("pose"):
                reading.note(
                    element, f"the inertia of {what} follows from its collisions; what is stated is not used"
                )
            return self._shapes.inertial(link, element)
        if element.all("density"):
            reading.note(element, f"the density of {what} is not used without auto")
        mass = reading.scalar(element, "mass", what, 1.0)
        if mass < 0.0:
            raise reading.error(element, f"the mass of {what} is {mass:g}; wanted at least 0")
        pose = reading.only(element, "pose")
        if pose is not None and pose.attributes.get("relative_to"):
            raise reading.error(
                pose, f"<pose> in <inertial> of {what} has relative_to; it is stated in the link"
            )
        inertia = reading.only(element, "inertia") or Element("inertia", {}, element.line)
        xx, xy, xz, yy, yz, zz = (
            reading.scalar(inertia, name, what, 1.0 if name[1] == name[2] else 0.0)
            for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        )
        origin = _pose(self._frames.placed(link, pose, what))
        found = Inertial(mass, origin, xx, xy, xz, yy, yz, zz, line=element.line)
        fault = inertia_fault(found)
        if fault is not None:
            reading.note(element, f"the inertia of {what} {fault}; it is used as stated")
        return found

    def _frames_of(self, inside: set[int], root: NamedPart | None) -> list[Frame]:
        """Return the ``<frame>`` elements that move with a link that was read, or stand in its world."""
        taken, frames = {link.name for link in self._links}, []
        for part in self._parts:
            if part.kind != "frame":
                continue
            link = self._frames.link_of(part)
            if (link is None and root is not None) or (link is not None and id(link) not in inside):
                self._reading.note(part.element, f"{part.what} is not on the robot; it is not read")
                continue
            name = self._name(part)
            free = name if name not in taken else free_name(f"{name}_frame", taken)
            if free != name:
                self._reading.note(
                    part.element, f"{part.what} has the name of a link; its frame is {shown(free)}"
                )
            taken.add(free)
            on = WORLD if link is None else self._name(link)
            frames.append(Frame(free, on, _pose(self._frames.between(link, part))))
        return frames

    def _gravity(self, links: list[NamedPart]) -> Vector:
        reading, top = self._reading, self._top
        weightless = [
            part for part in links if not reading.truth(part.element, "gravity", part.what, default=True)
        ]
        if weightless and len(weightless) == len(links):
            reading.note(weightless[0].element, "<gravity> of every link is false; the model has none")
            return (0.0, 0.0, 0.0)
        if weightless:
            reading.note(
                weightless[0].element,
                f"<gravity> of {weightless[0].what} is false, of {len(weightless)} links of {len(links)}; "
                "gravity acts on them nevertheless",
            )
        if not top.is_world:
            return STANDARD_GRAVITY
        holders = [top.element, *top.element.all("physics")] if top.version < (1, 6) else [top.element]
        for holder in holders:
            found = reading.one(holder, "gravity", top.what)
            if found is not None:
                return reading.vector(found, "gravity", top.what)
        return DEFAULT_GRAVITY

    def _note_start(self, root: NamedPart) -> None:
        pose = _pose(self._frames.between(None, root))
        if pose != IDENTITY:
            numbers = " ".join(f"{x:g}" for x in (*pose.xyz, *pose.rpy))
            self._reading.note(
                root.element,
                f"{root.what} is placed at {numbers} (x y z [m], roll pitch yaw [rad]); "
                "neutral() puts it at the origin",
            )


def _kind(joint: NamedPart) -> str:
    return joint.element.attributes.get("type", "")


def _is_static(scope: Scope | None) -> bool:
    while scope is not None:
        if scope.static:
            return True
        scope = scope.parent
    return False


def _pose(T: Floats) -> Pose:
    return Pose.from_matrix(T) if (np.eye(4) != T).any() else IDENTITY
