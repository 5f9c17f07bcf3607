"""Robots as numbers, read from URDF and written to URDF, MJCF and SDF by the formats' specifications.

Nothing of dynx is used: the surveys of `dynx same` write their files with it. Poses are 4x4 matrices,
lengths in metres, angles in radians. Sources: the XML specification of URDF (wiki.ros.org/urdf/XML), the
XML reference of MuJoCo, and the specification of SDFormat 1.11.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal, cast

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Format = Literal["urdf", "mjcf", "sdf"]
MOVING = ("revolute", "continuous", "prismatic")


def rotation_from_rpy(rpy: Matrix) -> Matrix:
    """Return the rotation by roll, pitch and yaw about fixed axes x, y, z, in this order."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(R: Matrix) -> Matrix:
    """Return roll, pitch and yaw [rad]; as exact at a pitch of 90 degrees as elsewhere."""
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    yaw = np.arctan2(R[1, 0], R[0, 0])
    s, c = np.sin(yaw), np.cos(yaw)
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


def quat_wxyz(R: Matrix) -> Matrix:
    """Return the unit quaternion of a rotation, scalar first."""
    K = np.array(
        [
            [R[0, 0] + R[1, 1] + R[2, 2], 0, 0, 0],
            [R[2, 1] - R[1, 2], R[0, 0] - R[1, 1] - R[2, 2], 0, 0],
            [R[0, 2] - R[2, 0], R[1, 0] + R[0, 1], R[1, 1] - R[0, 0] - R[2, 2], 0],
            [R[1, 0] - R[0, 1], R[2, 0] + R[0, 2], R[2, 1] + R[1, 2], R[2, 2] - R[0, 0] - R[1, 1]],
        ]
    )
    quat: Matrix = np.linalg.eigh(K / 3.0)[1][:, -1]
    return quat if quat[0] >= 0.0 else -quat


def axis_angle(axis: Matrix, angle: float) -> Matrix:
    """Return the rotation by an angle [rad] about a unit axis."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: Matrix = np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K
    return R


def pose(R: Matrix | None = None, p: Matrix | None = None) -> Matrix:
    """Return a 4x4 pose."""
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = R
    if p is not None:
        T[:3, 3] = p
    return T


def inverse(T: Matrix) -> Matrix:
    """Return the inverse of a pose."""
    return pose(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


@dataclass
class Inertial:
    """Mass [kg], centre [m] and central tensor [kg m^2] in link axes; `frame` decides only their axes."""

    mass: float
    com: Matrix
    tensor: Matrix
    frame: Matrix = field(default_factory=lambda: np.eye(3))

    def moved(self, T: Matrix) -> Inertial:
        """Return the inertia in a frame in which the link's frame has the pose T."""
        R = T[:3, :3]
        return Inertial(self.mass, R @ self.com + T[:3, 3], R @ self.tensor @ R.T, R @ self.frame)


def shifted_tensor(mass: float, d: Matrix) -> Matrix:
    """Return the tensor of a point mass at d [m] about the origin."""
    tensor: Matrix = mass * (d @ d * np.eye(3) - np.outer(d, d))
    return tensor


def combined(a: Inertial | None, b: Inertial | None) -> Inertial | None:
    """Return the inertia of two bodies held together, both in one frame."""
    if a is None or b is None:
        return a or b
    mass = a.mass + b.mass
    if mass == 0.0:
        return Inertial(0.0, a.com, a.tensor + b.tensor)
    com = (a.mass * a.com + b.mass * b.com) / mass
    tensor = sum(each.tensor + shifted_tensor(each.mass, each.com - com) for each in (a, b))
    return Inertial(mass, com, cast(Matrix, tensor))


@dataclass
class Shape:
    """A box (x, y, z), sphere (radius), cylinder (radius, length) or mesh (three scales), and its pose."""

    kind: str
    size: tuple[float, ...]
    T: Matrix
    visual: bool
    file: str = ""
    filter: int = 1
    """Bits `contype` and `conaffinity` of MJCF."""


@dataclass
class Link:
    """A link with the shapes in the order of the document."""

    name: str
    inertial: Inertial | None = None
    shapes: list[Shape] = field(default_factory=list)
    compensation: float = 0.0
    """Share of its weight that MuJoCo holds (MJCF only)."""

    @property
    def is_empty(self) -> bool:
        """Whether the link only names a place."""
        own = self.inertial
        return not self.shapes and (own is None or not (own.mass or own.tensor.any()))


@dataclass
class Joint:
    """A joint: its pose in the parent at position 0 is that of the child's frame. Limits None: not stated."""

    name: str
    type: str
    parent: str
    child: str
    T: Matrix
    axis: Matrix = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    mimic: tuple[str, float, float] | None = None
    gear: float | None = None
    """Gear of a motor (MJCF only)."""
    stiffness: float = 0.0
    rest: float = 0.0
    """Position at which the spring has no force (MJCF and SDF)."""
    ref: float = 0.0
    """Position in the pose of the file (MJCF only); `T` is the pose at 0."""

    @property
    def moves(self) -> bool:
        """Whether the joint has one coordinate."""
        return self.type in MOVING

    @property
    def is_ball(self) -> bool:
        """Whether the joint turns about a point; its limit is `upper`, the largest angle."""
        return self.type == "ball"

    def motion(self, position: float) -> Matrix:
        """Return the pose of the child at a position in that at position 0."""
        if self.type == "prismatic":
            return pose(None, self.axis * position)
        return pose(axis_angle(self.axis, position)) if self.moves and position else np.eye(4)


@dataclass
class Tendon:
    """A fixed tendon: its length is the sum of coefficient times position over joints."""

    name: str
    terms: dict[str, float]
    range: tuple[float, float] | None = None
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    friction: float = 0.0


@dataclass
class Equality:
    """A constraint between two links (connect, weld), joints or tendons.

    `second` may be empty for joints and tendons. `anchor` is a point in the first link (connect) or in the
    second (weld). A weld turns the second link in the first as `T` and holds the origin of `T` at the anchor.
    """

    name: str
    kind: str
    first: str
    second: str
    anchor: Matrix = field(default_factory=lambda: np.zeros(3))
    T: Matrix = field(default_factory=lambda: np.eye(4))
    torque_scale: float = 1.0
    polynomial: Matrix = field(default_factory=lambda: np.array([0.0, 1.0, 0.0, 0.0, 0.0]))
    active: bool = True
    time_constant: float = 0.02
    is_closed: bool = False
    """A weld that holds in the pose of the file; `T` follows from it."""

    @property
    def joins_links(self) -> bool:
        """Whether the constraint is between links."""
        return self.kind in ("connect", "weld")


@dataclass
class Keyframe:
    """Positions by joint: a number, or the rotation (3, 3) of a ball joint; the pose of a floating base."""

    name: str
    q: dict[str, float | Matrix]
    T_world_root: Matrix = field(default_factory=lambda: np.eye(4))


@dataclass
class Actuator:
    """A motor, position or velocity servo on a joint or a tendon; `gain` is kp or kv."""

    name: str
    kind: str
    target: str
    on_tendon: bool = False
    gear: float = 1.0
    gain: float = 1.0
    ctrl_range: tuple[float, float] | None = None
    force_range: tuple[float, float] | None = None


@dataclass
class Sensor:
    """A sensor of a joint or tendon: `kind` and `target` are those of MJCF."""

    name: str
    kind: str
    target: str
    on_tendon: bool = False
    cutoff: float = 0.0
    noise: float = 0.0


@dataclass
class Robot:
    """Links and joints in the order of the document, and what MJCF alone has.

    `exclusions` are pairs of links that do not touch, `contacts` pairs of shapes that do.
    """

    name: str
    links: dict[str, Link]
    joints: list[Joint]
    exclusions: list[tuple[str, str]] = field(default_factory=list)
    contacts: list[tuple[Shape, Shape]] = field(default_factory=list)
    tendons: list[Tendon] = field(default_factory=list)
    equalities: list[Equality] = field(default_factory=list)
    keyframes: list[Keyframe] = field(default_factory=list)
    actuators: list[Actuator] = field(default_factory=list)
    sensors: list[Sensor] = field(default_factory=list)

    @property
    def has_connect(self) -> bool:
        """Whether a constraint depends on the pose of the file."""
        return any(each.kind == "connect" or each.is_closed for each in self.equalities)

    def close_weld(self, weld: Equality) -> None:
        """Let a weld hold in the pose with every joint at 0."""
        poses = self.poses()
        between = inverse(poses[weld.first]) @ poses[weld.second]
        weld.T = pose(between[:3, :3], (between @ np.append(weld.anchor, 1.0))[:3])

    def is_static(self, link: str) -> bool:
        """Whether no joint but fixed ones stands between a link and the root."""
        return self.root in self.body(link)

    def is_implied(self, link: str) -> bool:
        """Whether a link is one that MJCF does not write: it stands between two joints of one body."""
        above, below = self.above(link), self.children(link)
        named = above is not None and link == f"{above.name}_link" and above.type != "fixed"
        own = self.links[link]
        return named and len(below) == 1 and own.inertial is None and not own.shapes

    def chain(self, joint: Joint) -> list[Joint]:
        """Return the joints of the body of MJCF that has a joint; a fixed joint may be the last."""
        while self.is_implied(joint.parent) and not np.any(joint.T[:3, :3] != np.eye(3)):
            above = self.above(joint.parent)
            assert above is not None
            joint = above
        found = [joint]
        while found[-1].type != "fixed" and self.is_implied(found[-1].child):
            below = self.children(found[-1].child)[0]
            if np.any(below.T[:3, :3] != np.eye(3)):
                break
            found.append(below)
        return found

    def copy(self) -> Robot:
        """Return a copy that shares nothing."""
        return copy.deepcopy(self)

    @property
    def root(self) -> str:
        """Name of the root link."""
        children = {joint.child for joint in self.joints}
        return next(name for name in self.links if name not in children)

    def joint(self, name: str) -> Joint:
        """Return a joint by name."""
        return next(joint for joint in self.joints if joint.name == name)

    def children(self, link: str) -> list[Joint]:
        """Return the joints below a link."""
        return [joint for joint in self.joints if joint.parent == link]

    def above(self, link: str) -> Joint | None:
        """Return the joint that carries a link."""
        return next((joint for joint in self.joints if joint.child == link), None)

    def below(self, joint: Joint) -> set[str]:
        """Return the names of the links that a joint carries."""
        found, names = [joint.child], {joint.child}
        while found:
            for each in self.children(found.pop()):
                found.append(each.child)
                names.add(each.child)
        return names

    def body(self, link: str) -> set[str]:
        """Return the links held together with a link by fixed joints."""
        names, found = {link}, [link]
        while found:
            here = found.pop()
            for joint in self.joints:
                if joint.type == "fixed" and here in (joint.parent, joint.child):
                    for other in (joint.parent, joint.child):
                        if other not in names:
                            names.add(other)
                            found.append(other)
        return names

    def poses(self) -> dict[str, Matrix]:
        """Return the poses of all links in the root link, every joint at 0."""
        found = {self.root: np.eye(4)}
        stack = [self.root]
        while stack:
            here = stack.pop()
            for joint in self.children(here):
                found[joint.child] = found[here] @ joint.T
                stack.append(joint.child)
        return found

    @property
    def reach(self) -> float:
        """Largest sum of joint offsets from the root [m]."""
        lengths = {self.root: 0.0}
        stack = [self.root]
        while stack:
            here = stack.pop()
            for joint in self.children(here):
                lengths[joint.child] = lengths[here] + float(np.linalg.norm(joint.T[:3, 3]))
                stack.append(joint.child)
        return max(lengths.values())

    def body_inertial(self, link: str) -> Inertial | None:
        """Return the inertia of the body of a link, in the frame of the root link."""
        poses = self.poses()
        total: Inertial | None = None
        for name in sorted(self.body(link)):
            own = self.links[name].inertial
            total = combined(total, own.moved(poses[name]) if own is not None else None)
        return total


# Reading of URDF.


def _numbers(text: str | None, default: str) -> Matrix:
    return np.array([float(each) for each in (text or default).split()])


def _origin(element: ET.Element | None) -> Matrix:
    origin = element.find("origin") if element is not None else None
    if origin is None:
        return np.eye(4)
    return pose(rotation_from_rpy(_numbers(origin.get("rpy"), "0 0 0")), _numbers(origin.get("xyz"), "0 0 0"))


def read_urdf(text: str) -> Robot:
    """Return the robot of a URDF text: what its specification has, and nothing else."""
    root = ET.fromstring(text.encode())
    links = {}
    for element in root.findall("link"):
        link = Link(str(element.get("name")))
        inertial = element.find("inertial")
        if inertial is not None:
            T = _origin(inertial)
            mass, tensor = inertial.find("mass"), inertial.find("inertia")
            values = {} if tensor is None else tensor.attrib
            xx, xy, xz, yy, yz, zz = (
                float(values.get("i" + c, 0)) for c in ("xx", "xy", "xz", "yy", "yz", "zz")
            )
            R = T[:3, :3]
            own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            link.inertial = Inertial(
                float(mass.get("value", 0)) if mass is not None else 0.0, T[:3, 3], R @ own @ R.T, R
            )
        for part in element:
            geometry = part.find("geometry") if part.tag in ("visual", "collision") else None
            if geometry is None or len(geometry) == 0:
                continue
            each = geometry[0]
            size: tuple[float, ...]
            if each.tag == "box":
                size = tuple(_numbers(each.get("size"), "0 0 0").tolist())
            elif each.tag == "sphere":
                size = (float(each.get("radius", 0)),)
            elif each.tag == "cylinder":
                size = (float(each.get("radius", 0)), float(each.get("length", 0)))
            elif each.tag == "mesh":
                size = tuple(_numbers(each.get("scale"), "1 1 1").tolist())
            else:
                continue
            link.shapes.append(
                Shape(each.tag, size, _origin(part), part.tag == "visual", each.get("filename", ""))
            )
        links[link.name] = link
    joints = []
    for element in root.findall("joint"):
        axis, limit, dynamics, mimic = (element.find(tag) for tag in ("axis", "limit", "dynamics", "mimic"))
        direction = _numbers(axis.get("xyz") if axis is not None else None, "1 0 0")
        parent, child = element.find("parent"), element.find("child")
        assert parent is not None
        assert child is not None

        def value(of: ET.Element | None, name: str, default: float | None) -> float | None:
            return default if of is None or of.get(name) is None else float(str(of.get(name)))

        stated = limit is not None and element.get("type") != "continuous"
        joints.append(
            Joint(
                str(element.get("name")),
                str(element.get("type")),
                str(parent.get("link")),
                str(child.get("link")),
                _origin(element),
                direction / np.linalg.norm(direction) if np.any(direction) else np.array([1.0, 0.0, 0.0]),
                value(limit, "lower", 0.0) if stated else None,
                value(limit, "upper", 0.0) if stated else None,
                value(limit, "effort", None),
                value(limit, "velocity", None),
                value(dynamics, "damping", 0.0) or 0.0,
                value(dynamics, "friction", 0.0) or 0.0,
                mimic=None
                if mimic is None
                else (
                    str(mimic.get("joint")),
                    value(mimic, "multiplier", 1.0) or 0.0,
                    value(mimic, "offset", 0.0) or 0.0,
                ),
            )
        )
    return Robot(root.get("name", "robot"), links, joints)


# Writing.


@dataclass(frozen=True)
class Style:
    """How a text is written: freedoms of the formats that change no robot."""

    shuffle: np.random.Generator | None = None
    """Order of elements and attributes; None keeps it."""
    spelled: bool = True
    """Write values that are defaults."""
    number: Callable[[float], str] = repr
    degree: bool = False
    """Angles of MJCF, and rotations of SDF, in degrees."""
    rotation: int = 0
    """Which of the format's notations states a rotation."""
    classes: bool = False
    """Joint damping and axis of MJCF as a default class."""
    sites: bool = False
    """Links that only name a place become sites in MJCF."""
    free_joint: bool = False
    """A floating base of MJCF by `<joint type="free">`."""
    quat_scale: float = 1.0
    """Factor of quaternions in keyframes of MJCF; none is a difference."""
    names: bool = True
    """Constraints and actuators of MJCF have names."""
    child_class: bool = False
    """The default class of joints of MJCF is that of the bodies of the robot, not the main one."""
    constraint_sites: bool = False
    """Constraints of MJCF between sites, not links."""
    general: bool = False
    """Actuators of MJCF as `general`."""
    frames: bool = False
    """Bodies and shapes of MJCF inside of `frame`."""
    includes: bool = False
    """Some sections of MJCF are in other files (`split_file`)."""


def exponential(value: float) -> str:
    """Return a number with 17 digits and an exponent."""
    return f"{value:.16e}"


def _text(style: Style, values: Matrix | tuple[float, ...] | list[float]) -> str:
    return " ".join(style.number(float(each) + 0.0) for each in values)


def _shuffled(style: Style, element: ET.Element, fixed: tuple[str, ...] = ()) -> None:
    """Reorder attributes and children, those with a tag of `fixed` among themselves not."""
    if style.shuffle is None:
        return
    for each in element.iter():
        names = list(each.attrib.items())
        style.shuffle.shuffle(names)
        each.attrib.clear()
        each.attrib.update(names)
        if each.tag in fixed:
            continue
        children = list(each)
        style.shuffle.shuffle(children)
        if each.tag == "body":
            # The joints of a body move it one after the other.
            joints = iter(child for child in each if child.tag == "joint")
            children = [next(joints) if child.tag == "joint" else child for child in children]
        each[:] = children


def _finished(root: ET.Element) -> str:
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def write_urdf(robot: Robot, style: Style | None = None) -> str:
    """Return the robot as URDF."""
    style = style or Style()
    root = ET.Element("robot", name=robot.name)

    def origin(parent: ET.Element, T: Matrix, extra: Matrix | None = None) -> None:
        R = T[:3, :3] if extra is None else extra
        values = {}
        if style.spelled or np.any(T[:3, 3]):
            values["xyz"] = _text(style, T[:3, 3])
        if style.spelled or np.any(np.eye(3) != R):
            values["rpy"] = _text(style, rpy_from_rotation(R))
        if values:
            ET.SubElement(parent, "origin", values)

    for link in robot.links.values():
        element = ET.SubElement(root, "link", name=link.name)
        if link.inertial is not None:
            inertial = ET.SubElement(element, "inertial")
            own = link.inertial
            origin(inertial, pose(own.frame, own.com))
            ET.SubElement(inertial, "mass", value=style.number(float(own.mass)))
            own_tensor = own.frame.T @ own.tensor @ own.frame
            ET.SubElement(
                inertial,
                "inertia",
                {
                    "i" + "xyz"[i] + "xyz"[j]: style.number(float(own_tensor[i, j]))
                    for i in range(3)
                    for j in range(i, 3)
                },
            )
        for shape in link.shapes:
            part = ET.SubElement(element, "visual" if shape.visual else "collision")
            origin(part, shape.T)
            geometry = ET.SubElement(part, "geometry")
            if shape.kind == "mesh":
                values = {"filename": shape.file}
                if style.spelled or shape.size != (1.0, 1.0, 1.0):
                    values["scale"] = _text(style, shape.size)
            elif shape.kind == "box":
                values = {"size": _text(style, shape.size)}
            else:
                names = ("radius", "length")
                values = {n: style.number(float(v)) for n, v in zip(names, shape.size, strict=False)}
            ET.SubElement(geometry, shape.kind, values)
    for joint in robot.joints:
        if joint.is_ball:
            raise ValueError("URDF has no ball joint")
        element = ET.SubElement(root, "joint", name=joint.name, type=joint.type)
        origin(element, joint.T)
        ET.SubElement(element, "parent", link=joint.parent)
        ET.SubElement(element, "child", link=joint.child)
        if not joint.moves:
            continue
        if style.spelled or np.any(joint.axis != [1.0, 0.0, 0.0]):
            ET.SubElement(element, "axis", xyz=_text(style, joint.axis))
        limits = {
            name: style.number(float(value))
            for name, value, default in (
                ("lower", joint.lower, 0.0),
                ("upper", joint.upper, 0.0),
                ("effort", joint.effort, None),
                ("velocity", joint.velocity, None),
            )
            if value is not None and (style.spelled or value != default)
        }
        if limits or (joint.lower is not None and joint.type != "continuous"):
            ET.SubElement(element, "limit", limits)
        if style.spelled or joint.damping or joint.friction:
            dynamics = {
                n: style.number(float(v))
                for n, v in (("damping", joint.damping), ("friction", joint.friction))
                if style.spelled or v
            }
            ET.SubElement(element, "dynamics", dynamics)
        if joint.mimic is not None:
            leader, multiplier, offset = joint.mimic
            mimic = ET.SubElement(element, "mimic", joint=leader)
            if style.spelled or multiplier != 1.0:
                mimic.set("multiplier", style.number(float(multiplier)))
            if style.spelled or offset != 0.0:
                mimic.set("offset", style.number(float(offset)))
    _shuffled(style, root)
    return _finished(root)


def write_mjcf(robot: Robot, floating: bool, style: Style | None = None) -> str:
    """Return the robot as MJCF; ValueError for what the format or this writer lacks: mimics, meshes."""
    style = style or Style()
    for each in robot.equalities:
        if each.is_closed:
            robot.close_weld(each)
    if any(joint.mimic is not None for joint in robot.joints):
        raise ValueError("a mimic is no joint of MJCF")
    if any(joint.type not in (*MOVING, "fixed", "ball") for joint in robot.joints):
        raise ValueError("a planar or floating joint")
    root = ET.Element("mujoco", model=robot.name)
    compiler = ET.SubElement(root, "compiler", inertiafromgeom="false")
    unit = 180.0 / np.pi if style.degree else 1.0
    if not style.degree:
        compiler.set("angle", "radian")
    elif style.spelled:
        compiler.set("angle", "degree")
    if style.rotation == 1:
        compiler.set("eulerseq", "XYZ")
    common = Counter(joint.damping for joint in robot.joints if joint.moves).most_common(1)
    damping, axis = (common[0][0], np.array([0.0, 1.0, 0.0])) if common and style.classes else (0.0, None)
    if axis is not None:
        default = ET.SubElement(root, "default")
        if style.child_class:
            default = ET.SubElement(default, "default", {"class": "usual"})
        ET.SubElement(default, "joint", damping=style.number(float(damping)), axis="0 1 0")
        ET.SubElement(
            ET.SubElement(default, "default", {"class": "seen"}),
            "geom",
            contype="0",
            conaffinity="0",
            group="1",
        )
    world = ET.SubElement(root, "worldbody")
    shapes = [shape for pair in robot.contacts for shape in pair]
    contact_names = {id(shape): f"shape_{i}" for i, shape in enumerate(shapes)}

    def place(element: ET.Element, T: Matrix) -> None:
        if style.spelled or np.any(T[:3, 3]):
            element.set("pos", _text(style, T[:3, 3]))
        R = T[:3, :3]
        if not style.spelled and np.all(np.eye(3) == R):
            return
        if style.rotation == 1:
            element.set("euler", _text(style, unit * rpy_from_rotation(R)))
        elif style.rotation == 2:
            quat = quat_wxyz(R)
            norm = float(np.linalg.norm(quat[1:]))
            direction = quat[1:] / norm if norm > 0.0 else np.array([0.0, 0.0, 1.0])
            element.set(
                "axisangle", _text(style, [*direction, unit * 2.0 * float(np.arctan2(norm, quat[0]))])
            )
        elif style.rotation == 3:
            element.set("xyaxes", _text(style, [*R[:, 0], *R[:, 1]]))
        else:
            element.set("quat", _text(style, quat_wxyz(R)))

    def framed(body: ET.Element, tag: str, T: Matrix) -> ET.Element:
        """Add a child at a pose, which a frame around it may state in part."""
        if style.frames:
            body = ET.SubElement(body, "frame")
            T_frame = pose(axis_angle(np.array([0.6, 0.0, 0.8]), 1.0), np.array([0.1, -0.2, 0.3]))
            place(body, T_frame)
            T = inverse(T_frame) @ T
        child = ET.SubElement(body, tag)
        place(child, T)
        return child

    poses = robot.poses()

    def add_constraint_sites(body: ET.Element, link: str) -> None:
        """Add the sites of the constraints of a link."""
        for each in robot.equalities:
            if each.joins_links and each.first == link:
                at = each.T if each.kind == "weld" else pose(None, each.anchor)
                place(ET.SubElement(body, "site", name=f"{each.name}_first"), at)
            if each.joins_links and each.second == link:
                at = pose(None, each.anchor)
                if each.kind == "connect":
                    # The points coincide in the pose of the file.
                    at = inverse(poses[each.second]) @ poses[each.first] @ at
                place(ET.SubElement(body, "site", name=f"{each.name}_second"), at)

    def fill(body: ET.Element, link: Link) -> None:
        if link.compensation:
            body.set("gravcomp", style.number(float(link.compensation)))
        if style.constraint_sites:
            add_constraint_sites(body, link.name)
        if link.inertial is not None and (link.inertial.mass or np.any(link.inertial.tensor)):
            own = link.inertial
            inertial = ET.SubElement(body, "inertial", mass=style.number(float(own.mass)))
            if not np.any(own.tensor):
                # MuJoCo takes zeros as principal moments alone.
                inertial.set("pos", _text(style, own.com))
                inertial.set("diaginertia", _text(style, np.zeros(3)))
            elif style.rotation in (0, 3):
                values, vectors = np.linalg.eigh(own.tensor)
                if np.linalg.det(vectors) < 0.0:
                    vectors[:, 0] *= -1.0
                inertial.set("pos", _text(style, own.com))
                inertial.set("quat", _text(style, quat_wxyz(vectors)))
                inertial.set("diaginertia", _text(style, values))
            else:
                own_tensor = own.tensor
                inertial.set("pos", _text(style, own.com))
                inertial.set(
                    "fullinertia",
                    _text(
                        style,
                        [
                            own_tensor[0, 0],
                            own_tensor[1, 1],
                            own_tensor[2, 2],
                            own_tensor[0, 1],
                            own_tensor[0, 2],
                            own_tensor[1, 2],
                        ],
                    ),
                )
        for shape in link.shapes:
            geom = framed(body, "geom", shape.T)
            geom.set("type", shape.kind)
            if id(shape) in contact_names:
                geom.set("name", contact_names[id(shape)])
            size = list(shape.size)
            if shape.kind == "box":
                size = [each / 2.0 for each in size]
            elif shape.kind == "cylinder":
                size[1] /= 2.0
            elif shape.kind == "mesh":
                raise ValueError("a mesh")
            geom.set("size", _text(style, size))
            if shape.visual and axis is not None:
                geom.set("class", "seen")
            elif shape.visual:
                geom.attrib.update(contype="0", conaffinity="0", group="1")
            else:
                geom.set("group", "3")
                if shape.filter != 1:
                    geom.attrib.update(contype=str(shape.filter), conaffinity=str(shape.filter))

    def descend(body: ET.Element, name: str) -> None:
        for joint in robot.children(name):
            link = robot.links[joint.child]
            if style.sites and link.is_empty and joint.type == "fixed" and not robot.children(link.name):
                site = ET.SubElement(body, "site", name=link.name)
                place(site, joint.T)
                continue
            chain = robot.chain(joint)
            link, T = robot.links[chain[-1].child], np.eye(4)
            elements = []
            for each in reversed(chain):
                T = each.motion(each.ref) @ T
                if each.type != "fixed":
                    elements.append(joint_element(each, inverse(T)))
                T = each.T @ T
            inner = framed(body, "body", T)
            inner.set("name", link.name)
            inner.extend(reversed(elements))
            fill(inner, link)
            descend(inner, link.name)

    def joint_element(joint: Joint, T: Matrix) -> ET.Element:
        """Return the element of a joint at a pose in its body."""
        element = ET.Element("joint", name=joint.name)
        if joint.is_ball:
            element.set("type", "ball")
            if np.any(T[:3, :3] != np.eye(3)):
                raise ValueError("a ball joint whose frame is turned in its body")
        elif joint.type == "prismatic":
            element.set("type", "slide")
        elif style.spelled:
            element.set("type", "hinge")
        if np.any(T[:3, 3]):
            element.set("pos", _text(style, T[:3, 3]))
        own_axis = T[:3, :3] @ joint.axis
        is_default = np.array_equal(own_axis, [0.0, 0.0, 1.0] if axis is None else axis)
        if joint.moves and (style.spelled or not is_default):
            element.set("axis", _text(style, own_axis))
        factor = 1.0 if joint.type == "prismatic" else unit
        if joint.is_ball and joint.upper is not None:
            element.set("range", _text(style, [0.0, factor * joint.upper]))
        elif joint.moves and joint.lower is not None and joint.upper is not None:
            if joint.lower >= joint.upper:
                raise ValueError("a range that is empty")
            element.set("range", _text(style, [factor * joint.lower, factor * joint.upper]))
        if style.spelled:
            element.set("limited", "true" if "range" in element.attrib else "false")
        if joint.damping != damping or style.spelled:
            element.set("damping", style.number(float(joint.damping)))
        if joint.friction or style.spelled:
            element.set("frictionloss", style.number(float(joint.friction)))
        if joint.armature or style.spelled:
            element.set("armature", style.number(float(joint.armature)))
        if joint.stiffness and joint.moves:
            element.set("stiffness", style.number(float(joint.stiffness)))
            if joint.rest or style.spelled:
                element.set("springref", style.number(factor * float(joint.rest)))
        if joint.ref:
            element.set("ref", style.number(factor * float(joint.ref)))
        if joint.effort and joint.moves:
            element.set("actuatorfrcrange", _text(style, [-joint.effort, joint.effort]))
        if joint.velocity is not None:
            raise ValueError("a limit of velocity")
        return element

    top = robot.links[robot.root]
    if top.name == "world":
        if floating or (top.inertial is not None and top.inertial.mass):
            raise ValueError("a link world that moves, or has mass")
        fill(world, Link("world", None, top.shapes))
        descend(world, "world")
    else:
        body = ET.SubElement(world, "body", name=top.name)
        if floating and style.free_joint:
            # A default class would give this element damping, but not `freejoint`.
            ET.SubElement(body, "joint", type="free", damping="0", limited="false")
        elif floating:
            ET.SubElement(body, "freejoint")
        fill(body, top)
        descend(body, top.name)
    if robot.exclusions or robot.contacts:
        contact = ET.SubElement(root, "contact")
        for first, second in robot.exclusions:
            ET.SubElement(contact, "exclude", body1=first, body2=second)
        for pair in robot.contacts:
            geoms = [contact_names[id(shape)] for shape in pair]
            ET.SubElement(contact, "pair", geom1=geoms[0], geom2=geoms[1])
    if axis is not None and style.child_class:
        for body in (*world.findall("body"), *world.findall("frame/body")):
            body.set("childclass", "usual")
    _write_couplings(root, robot, style)
    _write_sensors(root, robot, style)
    _shuffled(style, root)
    _write_keyframes(root, robot, floating, style)
    return _finished(root)


def _hoist(style: Style, root: ET.Element, elements: list[ET.Element], tag: str, own: set[str]) -> None:
    """Move values that all elements state into a default class: the main one, or one that they name.

    Actuators name one, for a class has the same values for each kind of them.
    """
    if not style.classes or not elements:
        return
    default = root.find("default")
    if default is None:
        default = ET.SubElement(root, "default")
    if style.rotation % 2 or tag not in ("tendon", "equality"):
        default = ET.SubElement(default, "default", {"class": f"usual_{tag}"})
        for each in elements:
            each.set("class", f"usual_{tag}")
    shared = ET.SubElement(default, "general" if elements[0].tag == "general" else tag)
    for name in set.intersection(*(set(each.attrib) for each in elements)) - own - {"name", "class"}:
        value = elements[0].attrib[name]
        shared.set(name, value)
        for each in elements:
            if each.attrib[name] == value:
                del each.attrib[name]


def _write_couplings(root: ET.Element, robot: Robot, style: Style) -> None:
    """Write tendons, equality constraints and actuators."""
    number = style.number
    refs = {joint.name: joint.ref for joint in robot.joints}
    lengths = {each.name: sum(c * refs[joint] for joint, c in each.terms.items()) for each in robot.tendons}
    rests = {joint.name: joint.rest if joint.stiffness else 0.0 for joint in robot.joints}
    lengths_of_springs = {
        each.name: sum(c * rests[joint] for joint, c in each.terms.items()) for each in robot.tendons
    }
    section = ET.SubElement(root, "tendon") if robot.tendons else root
    elements = []
    for tendon in robot.tendons:
        element = ET.SubElement(section, "fixed", name=tendon.name)
        if tendon.range is not None:
            element.set("range", _text(style, tendon.range))
        element.set("limited", "false" if tendon.range is None else "true")
        for name, value in (
            ("stiffness", tendon.stiffness),
            ("springlength", tendon.rest),
            ("damping", tendon.damping),
            ("frictionloss", tendon.friction),
        ):
            if name == "springlength" and value == lengths_of_springs[tendon.name] and not style.spelled:
                continue  # the spring has no force where those of the joints have none
            element.set(name, number(float(value)))
        for joint, coefficient in tendon.terms.items():
            ET.SubElement(element, "joint", joint=joint, coef=number(float(coefficient)))
        elements.append(element)
    _hoist(style, root, elements, "tendon", set())
    section = ET.SubElement(root, "equality") if robot.equalities else root
    elements = []
    for each in robot.equalities:
        element = ET.SubElement(section, each.kind, name=each.name)
        elements.append(element)
        element.set("active", "true" if each.active else "false")
        element.set("solref", f"{number(float(each.time_constant))} 1")
        if each.joins_links and style.constraint_sites:
            element.attrib.update(site1=f"{each.name}_first", site2=f"{each.name}_second")
            if each.kind == "weld":
                element.set("torquescale", number(float(each.torque_scale)))
            continue
        if each.joins_links:
            element.attrib.update(body1=each.first, body2=each.second, anchor=_text(style, each.anchor))
            if each.kind == "weld":
                element.set("torquescale", number(float(each.torque_scale)))
                if style.spelled or not each.is_closed:
                    element.set("relpose", _text(style, [*each.T[:3, 3], *quat_wxyz(each.T[:3, :3])]))
            continue
        zero = refs if each.kind == "joint" else lengths
        element.set(f"{each.kind}1", each.first)
        # The polynomial of MJCF is one of displacements from the pose of the file.
        polynomial = np.polynomial.Polynomial(each.polynomial)
        if each.second:
            element.set(f"{each.kind}2", each.second)
            if zero[each.second]:
                polynomial = polynomial(np.polynomial.Polynomial([zero[each.second], 1.0]))
        values = np.zeros(5)
        values[: len(polynomial.coef)] = polynomial.coef
        values[0] -= zero[each.first]
        element.set("polycoef", _text(style, values))
    _hoist(style, root, elements, "equality", {"anchor", "relpose", "torquescale", "polycoef"} | _ENDS)
    motors = [
        Actuator("motor_" + joint.name, "motor", joint.name, gear=joint.gear)
        for joint in robot.joints
        if joint.gear is not None
    ]
    section = ET.SubElement(root, "actuator") if motors or robot.actuators else root
    for kind in ("motor", "position", "velocity"):
        elements = []
        for actuator in (*motors, *robot.actuators):
            if actuator.kind != kind:
                continue
            tag = "general" if style.general else kind
            element = ET.SubElement(section, tag, name=actuator.name, gear=number(float(actuator.gear)))
            element.set("tendon" if actuator.on_tendon else "joint", actuator.target)
            if style.general and kind != "motor":
                gains = [0.0, -actuator.gain, 0.0] if kind == "position" else [0.0, 0.0, -actuator.gain]
                element.attrib.update(gainprm=number(float(actuator.gain)), biastype="affine")
                element.set("biasprm", _text(style, gains))
            elif kind != "motor":
                element.set("kp" if kind == "position" else "kv", number(float(actuator.gain)))
            for name, limits in (("ctrl", actuator.ctrl_range), ("force", actuator.force_range)):
                element.set(f"{name}limited", "false" if limits is None else "true")
                if limits is not None:
                    element.set(f"{name}range", _text(style, limits))
            elements.append(element)
        _hoist(style, root, elements, kind, {"joint", "tendon"})


def _write_sensors(root: ET.Element, robot: Robot, style: Style) -> None:
    section = ET.SubElement(root, "sensor") if robot.sensors else root
    for sensor in robot.sensors:
        element = ET.SubElement(section, sensor.kind, name=sensor.name)
        element.set("tendon" if sensor.on_tendon else "joint", sensor.target)
        for name, value in (("cutoff", sensor.cutoff), ("noise", sensor.noise)):
            if value or style.spelled:
                element.set(name, style.number(float(value)))


_ENDS = {f"{kind}{i}" for kind in ("body", "site", "joint", "tendon") for i in (1, 2)}
"""Attributes of a constraint that name what it couples."""


def _write_keyframes(root: ET.Element, robot: Robot, floating: bool, style: Style) -> None:
    """Write keyframes, in the order that the joints of the document have."""
    if not robot.keyframes:
        return
    known = {joint.name for joint in robot.joints}
    world = root.find("worldbody")
    assert world is not None
    # The joints of a body come before those of the bodies in it, wherever the document has them.
    order, bodies = [], [world]
    while bodies:
        body = bodies.pop()
        order += [name for each in body.findall("joint") if (name := each.get("name", "")) in known]
        inside = [[each] if each.tag == "body" else each.findall("body") for each in body]
        bodies += [each for found in reversed(inside) for each in reversed(found)]
    section = ET.SubElement(root, "keyframe")
    for key in robot.keyframes:
        values: list[float] = []
        if floating:
            values += [*key.T_world_root[:3, 3], *style.quat_scale * quat_wxyz(key.T_world_root[:3, :3])]
        for name in order:
            q = key.q[name]
            values += [q] if isinstance(q, float) else [*style.quat_scale * quat_wxyz(q)]
        ET.SubElement(section, "key", name=key.name, qpos=_text(style, values))
    if style.shuffle is not None:
        keys = list(section)
        style.shuffle.shuffle(keys)
        section[:] = keys


def split_file(text: str) -> tuple[str, dict[str, str]]:
    """Return MJCF with every second section, and the contents of every second body, in files of their own."""
    root = ET.fromstring(text)
    parts: dict[str, str] = {}

    def move_out(parent: ET.Element, children: list[ET.Element]) -> None:
        name = f"part_{len(parts)}.xml"
        at = list(parent).index(children[0])
        part = ET.Element("mujocoinclude")
        part.extend(children)
        for child in children:
            parent.remove(child)
        parent.insert(at, ET.Element("include", file=name))
        ET.indent(part)
        parts[name] = ET.tostring(part, encoding="unicode") + "\n"

    bodies = [body for body in root.iter("body") if len(body) > 1]
    for body in bodies[:2]:
        move_out(body, list(body)[1:])
    for section in [each for each in root if each.tag in ("default", "tendon", "keyframe", "equality")][::2]:
        move_out(root, [section])
    return _finished(root), parts


def write_sdf(robot: Robot, floating: bool, style: Style | None = None) -> str:
    """Return the robot as SDF 1.11; ValueError for what the format, or this writer, cannot say."""
    style = style or Style()
    root = ET.Element("sdf", version="1.11")
    model = ET.SubElement(root, "model", name=robot.name)
    poses = robot.poses()
    top = robot.root
    if {joint.name for joint in robot.joints} & set(robot.links):
        raise ValueError("a joint with the name of a link")
    if top == "world" and floating:
        raise ValueError("a link world that moves")

    def place(parent: ET.Element, T: Matrix, relative_to: str = "") -> None:
        # A link without pose stands at the origin of the model, whatever carries its joint.
        if not style.spelled and not relative_to and np.all(np.eye(4) == T):
            return
        element = ET.SubElement(parent, "pose")
        if relative_to:
            element.set("relative_to", relative_to)
        if style.rotation % 2:
            element.set("rotation_format", "quat_xyzw")
            quat = quat_wxyz(T[:3, :3])
            element.text = _text(style, [*T[:3, 3], *quat[1:], quat[0]])
        else:
            rpy = rpy_from_rotation(T[:3, :3])
            if style.degree:
                element.set("degrees", "true")
                rpy = np.degrees(rpy)
            element.text = _text(style, [*T[:3, 3], *rpy])

    def value(parent: ET.Element, name: str, number: float) -> None:
        ET.SubElement(parent, name).text = style.number(float(number))

    frames = set()
    for name, link in robot.links.items():
        above = robot.above(name)
        if name == "world":
            if not link.is_empty:
                raise ValueError("a link world with mass or shapes")
            continue
        if robot.is_implied(name) and robot.children(name)[0].type == "fixed":
            continue  # the joint has a pose in the link that follows
        if above is not None and robot.is_implied(above.parent) and above.type == "fixed":
            between = robot.above(above.parent)
            assert between is not None
            above = Joint("", "fixed", between.parent, name, between.T @ above.T)
        if link.is_empty:
            if above is None or above.type != "fixed" or robot.children(name) or above.parent in ("world",):
                raise ValueError("a link without mass that carries others")
            if robot.links[above.parent].is_empty:
                raise ValueError("a frame on a link without mass")
            frame = ET.SubElement(model, "frame", name=name, attached_to=above.parent)
            place(frame, above.T, above.parent if style.spelled else "")
            frames.add(name)
            continue
        element = ET.SubElement(model, "link", name=name)
        if style.rotation >= 2 and above is not None and above.parent != "world":
            place(element, above.T, above.parent)
        else:
            place(element, poses[name])
        own = link.inertial
        if own is None or own.mass <= 0.0:
            raise ValueError("a link without mass")
        inertial = ET.SubElement(element, "inertial")
        place(inertial, pose(own.frame, own.com))
        value(inertial, "mass", own.mass)
        own_tensor = own.frame.T @ own.tensor @ own.frame
        tensor = ET.SubElement(inertial, "inertia")
        for i in range(3):
            for j in range(i, 3):
                value(tensor, "i" + "xyz"[i] + "xyz"[j], own_tensor[i, j])
        for number, shape in enumerate(link.shapes):
            kind = "visual" if shape.visual else "collision"
            part = ET.SubElement(element, kind, name=f"{kind}_{number}")
            place(part, shape.T)
            geometry = ET.SubElement(ET.SubElement(part, "geometry"), shape.kind)
            if shape.kind == "box":
                ET.SubElement(geometry, "size").text = _text(style, shape.size)
            elif shape.kind == "mesh":
                raise ValueError("a mesh")
            else:
                for label, size in zip(("radius", "length"), shape.size, strict=False):
                    value(geometry, label, size)
    if top != "world" and not floating:
        element = ET.SubElement(model, "joint", name="held", type="fixed")
        ET.SubElement(element, "parent").text = "world"
        ET.SubElement(element, "child").text = top
    for joint in robot.joints:
        if joint.child in frames:
            continue
        if joint.type not in (*MOVING, "fixed", "ball"):
            raise ValueError("a planar or floating joint")
        if joint.type == "fixed" and robot.is_implied(joint.parent):
            continue
        element = ET.SubElement(model, "joint", name=joint.name, type=joint.type)
        ET.SubElement(element, "parent").text = joint.parent
        if joint.type != "fixed" and robot.is_implied(joint.child):
            held = robot.children(joint.child)[0]
            ET.SubElement(element, "child").text = held.child
            place(element, inverse(held.T), held.child if style.spelled else "")
        else:
            ET.SubElement(element, "child").text = joint.child
        if not joint.moves:
            continue
        axis = ET.SubElement(element, "axis")
        xyz = ET.SubElement(axis, "xyz")
        xyz.text = _text(style, joint.axis)
        if style.rotation >= 2:
            xyz.set("expressed_in", "__model__")
            xyz.text = _text(style, poses[joint.child][:3, :3] @ joint.axis)
        limit = ET.SubElement(axis, "limit")
        if joint.lower is not None and joint.upper is not None:
            value(limit, "lower", joint.lower)
            value(limit, "upper", joint.upper)
        if joint.effort is not None:
            value(limit, "effort", joint.effort)
        if joint.velocity is not None:
            value(limit, "velocity", joint.velocity)
        if style.spelled or joint.damping or joint.friction or joint.stiffness:
            dynamics = ET.SubElement(axis, "dynamics")
            value(dynamics, "damping", joint.damping)
            value(dynamics, "friction", joint.friction)
            value(dynamics, "spring_stiffness", joint.stiffness)
            value(dynamics, "spring_reference", joint.rest)
        if joint.mimic is not None:
            leader, multiplier, offset = joint.mimic
            mimic = ET.SubElement(axis, "mimic", joint=leader)
            value(mimic, "multiplier", multiplier)
            value(mimic, "offset", offset)
            value(mimic, "reference", 0.0)
    _shuffled(style, root)
    return _finished(root)


def write(robot: Robot, to: Format, floating: bool, style: Style | None = None) -> str:
    """Return the robot in a format; ValueError for what it cannot say."""
    if to == "urdf":
        return write_urdf(robot, style)
    return (write_mjcf if to == "mjcf" else write_sdf)(robot, floating, style)


def lines(robot: Robot) -> dict[str, Matrix]:
    """Return direction and moment of joint axes at position 0, in the root link.

    A slide has no moment; a ball joint has its centre instead.
    """
    poses = robot.poses()
    found = {}
    for joint in robot.joints:
        if joint.moves:
            T = poses[joint.child]
            direction = T[:3, :3] @ joint.axis
            moment = np.zeros(3) if joint.type == "prismatic" else np.cross(T[:3, 3], direction)
            found[joint.name] = np.concatenate([direction, moment])
        elif joint.is_ball:
            found[joint.name] = np.concatenate([np.zeros(3), poses[joint.child][:3, 3]])
    return found


def depth_first(robot: Robot) -> Iterator[Joint]:
    """Yield joints from the root outwards."""
    stack = robot.children(robot.root)[::-1]
    while stack:
        joint = stack.pop()
        yield joint
        stack.extend(robot.children(joint.child)[::-1])
