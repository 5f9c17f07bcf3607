"""Reader of URDF text: links, joints and frames, with a note for each ambiguity.

Visual and collision shapes, materials, transmissions, sensors and extensions of simulators do not affect
rigid-body dynamics and are skipped; meshes are not opened.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from typing import Any

import numpy as np

from dynx.errors import escaped, nearest, shown
from dynx.model.elements import (
    INFINITY,
    ZERO,
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
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.model.topology import MAX_LINKS
from dynx.model.tree import Description
from dynx.model.xml.reading import Element, read_xml
from dynx.model.xml.values import Reading, name_fault
from dynx.spatial.so3 import rotation_from_quat, rpy_from_rotation

# Reader of URDF's ``<origin>``: a translation and an orientation, as angles or as a quaternion.
#
# ``quat_xyzw`` is part of URDF from version 1.1 on, and of no file that states an older version or none. As
# in urdfdom, it excludes ``rpy`` and is scaled to length 1.


QUATERNION = "quat_xyzw"
"""Attribute of ``<origin>`` that holds a quaternion (x, y, z, w)."""

FULL_TURN = 6.29
"""Largest angle of an orientation that is written in radians: 2 pi, rounded up."""

_FIRST_VERSION = (1, 1)
_VERSION = re.compile(r"\s*([0-9]{1,9})(?:\.([0-9]{1,9}))?")


def reads_quaternions(version: str | None) -> bool:
    """Check whether `quat_xyzw` has a meaning in a robot whose attribute ``version`` is this one."""
    found = _VERSION.match(version or "")
    return found is not None and (int(found.group(1)), int(found.group(2) or 0)) >= _FIRST_VERSION


def rpy_of_quaternion(quat_xyzw: tuple[float, ...]) -> Vector:
    """Return roll, pitch and yaw [rad] of a quaternion of any length.

    Raises ValueError if its length is 0 or overflows.
    """
    norm = _length(quat_xyzw)
    if norm == 0.0 or not math.isfinite(norm):
        raise ValueError(f"the length of a quaternion is {norm}")
    R = rotation_from_quat(np.array(quat_xyzw) / norm)
    roll, pitch, yaw = (rpy_from_rotation(R) + 0.0).tolist()
    return (roll, pitch, yaw)


def read_origin(parent: Element, what: str, reading: Reading) -> Pose:
    """Return the pose in the ``<origin>`` of `parent`; missing or empty vectors are zero."""
    element = reading.only(parent, "origin")
    if element is None:
        return Pose()
    parts = {}
    for attribute in ("xyz", "rpy"):
        text = element.attributes.get(attribute)
        if text is not None and not text.strip():
            reading.note(element, f"{attribute} in <origin> of {what} is empty; it is read as zero")
        parts[attribute] = ZERO if not (text and text.strip()) else reading.vector(element, attribute, what)
    largest = max(parts["rpy"], key=abs)
    if abs(largest) > FULL_TURN:
        reading.note(
            element,
            f"rpy in <origin> of {what} holds {largest:g}, more than a full turn; URDF reads radians, in "
            f"degrees it would be {math.radians(largest):.6g}",
        )
    if QUATERNION in element.attributes:
        if reading.quaternions:
            parts["rpy"] = _read_quaternion(element, what, reading)
        else:
            reading.note(
                element,
                f"{QUATERNION} in <origin> of {what} is ignored: it is part of URDF 1.1, and <robot> "
                "states no such version",
            )
    return Pose(parts["xyz"], parts["rpy"])


def _read_quaternion(element: Element, what: str, reading: Reading) -> Vector:
    if "rpy" in element.attributes:
        raise reading.error(element, f"<origin> of {what} has both rpy and {QUATERNION}; wanted one of them")
    quaternion = reading.numbers(element, QUATERNION, what, 4)
    try:
        rpy = rpy_of_quaternion(quaternion)
    except ValueError:
        text = shown(element.attributes[QUATERNION])
        raise reading.error(
            element,
            f"{QUATERNION} in <origin> of {what} is {text}, which is no rotation; wanted x y z w of length 1",
        ) from None
    norm = _length(quaternion)
    if abs(norm - 1.0) > 1e-12:
        reading.note(
            element, f"the quaternion in <origin> of {what} has length {norm:.12g}; it was scaled to 1"
        )
    return rpy


def _length(quaternion: tuple[float, ...]) -> float:
    return math.sqrt(sum(part * part for part in quaternion))


# Reader of URDF's ``<link>``: its name and inertial. Shapes and materials do not affect dynamics.


# Elements that some engine reads for contact, display or sensing; they do not affect dynamics.
_WITHOUT_DYNAMICS = frozenset(
    [
        *("visual", "collision", "contact", "material", "surface", "sensor", "gazebo", "gravity"),
        *("kinematic", "self_collide", "self_filter", "collision_checking"),
    ]
)
_KNOWN_IN_LINK = _WITHOUT_DYNAMICS | {"inertial"}
_IN_INERTIAL = frozenset({"origin", "mass", "inertia"})
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_link(element: Element, reading: Reading) -> Link:
    """Read a link; without ``<inertial>`` it has no mass."""
    name = reading.name(element, "name", "a <link>")
    reading.ignore_unknown(element, _KNOWN_IN_LINK)
    inertial = reading.only(element, "inertial")
    return Link(name, None if inertial is None else _read_inertial(inertial, name, reading), element.line)


def _read_inertial(element: Element, link: str, reading: Reading) -> Inertial:
    what = f"link {shown(link)}"
    reading.ignore_unknown(element, _IN_INERTIAL)
    mass_element = reading.required(element, "mass", f"<inertial> of {what}")
    mass = reading.number(mass_element, "value", what)
    if mass < 0.0:
        raise reading.error(mass_element, f"the mass of {what} is {mass}; wanted at least 0")
    tensor = reading.required(element, "inertia", f"<inertial> of {what}")
    moments = {name: reading.number(tensor, name, what) for name in _MOMENTS}
    inertial = Inertial(mass, read_origin(element, what, reading), **moments, line=element.line)
    fault = inertia_fault(inertial)
    if fault is not None:
        reading.note(tensor, f"the inertia of {what} {fault}; it is used as stated")
    return inertial


def inertia_fault(inertial: Inertial) -> str | None:
    """Return why no rigid body has this inertia, or None if it is physically consistent.

    The principal moments are sums of two of three non-negative second moments of mass, so none is negative
    and none exceeds the sum of the other two (Wensing, Kim and Slotine 2018, section II).
    """
    tensor = inertial.tensor
    scale = float(np.max(np.abs(tensor)))
    if scale == 0.0:
        return None
    if inertial.mass == 0.0:
        return "is not zero although its mass is"
    small, middle, large = np.linalg.eigvalsh(tensor / scale)
    rounding = 16.0 * np.finfo(float).eps * max(abs(small), abs(large))
    if small < -rounding:
        return f"is not physical: the principal moment {small * scale:.6g} is negative"
    if small + middle < large - rounding:
        return (
            f"is not physical: the principal moment {large * scale:.6g} exceeds "
            f"the sum of the others, {small * scale:.6g} and {middle * scale:.6g}"
        )
    return None


# Reader of URDF's ``<joint>``: type, links, origin, axis, limits, dynamics and mimic.


FRAME_TAG = "dynx_frame"
"""Extension written by `write_urdf`: the joint's child is a frame, added to the parent link."""

LOCKED_TAG = "dynx_locked"
"""Extension written by `write_urdf`: the position at which a joint, written as fixed, was locked."""

SPRING_TAG = "dynx_spring"
"""Extension written by `write_urdf`: stiffness and reference of a joint's spring."""

ROBOT_TAG = "dynx_robot"
"""Extension written by `write_urdf`: base, gravity and pose of the base, where they are not the default."""

_TYPES: dict[str, JointType] = {
    "revolute": "revolute",
    "continuous": "continuous",
    "prismatic": "prismatic",
    "fixed": "fixed",
}
_READ = frozenset(["origin", "parent", "child", "axis", "limit", "dynamics", "mimic"])
_KNOWN_IN_JOINT = _READ | {"calibration", "safety_controller", "gazebo", LOCKED_TAG, FRAME_TAG, SPRING_TAG}


def read_joint(element: Element, reading: Reading, floating_is_base: bool = False) -> Joint:
    """Read a joint. With `floating_is_base`, a floating joint stands for ``base=`` and is read as fixed."""
    name = reading.name(element, "name", "a <joint>")
    what = f"joint {shown(name)}"
    reading.ignore_unknown(element, _KNOWN_IN_JOINT)
    kind = _read_type(element, what, reading, floating_is_base)
    parent, child = (
        reading.name(reading.required(element, role, what), "link", f"<{role}> of {what}")
        for role in ("parent", "child")
    )
    origin = read_origin(element, what, reading)
    locked = element.all(LOCKED_TAG)
    if kind == "fixed" and not locked:
        return Joint(name, kind, parent, child, origin, line=element.line)
    return Joint(
        name,
        kind,
        parent,
        child,
        origin,
        axis=(1.0, 0.0, 0.0) if kind == "ball" else _read_axis(element, what, reading),
        limits=_read_limits(element, kind, what, reading),
        dynamics=_read_dynamics(element, what, reading),
        mimic=None if locked else _read_mimic(element, what, reading),
        locked_at=reading.number(locked[0], "value", what) if locked else None,
        line=element.line,
    )


def _read_type(element: Element, what: str, reading: Reading, floating_is_base: bool) -> JointType:
    kind = element.attributes.get("type")
    if kind is None:
        raise reading.error(element, f"{what} has no type; wanted one of {', '.join(_TYPES)}")
    if kind in _TYPES:
        return _TYPES[kind]
    from dynx.model.urdf.other_joint_types import read_other_type

    return read_other_type(element, kind, what, reading, floating_is_base, _TYPES)


def _read_axis(element: Element, what: str, reading: Reading) -> Vector:
    axis = reading.only(element, "axis")
    if axis is None:
        return (1.0, 0.0, 0.0)
    # A direction is scaled, so that any length will do.
    x, y, z = reading.vector(axis, "xyz", what, bound=INFINITY)
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        raise reading.error(axis, f"the axis of {what} is zero; wanted a direction")
    norm = math.hypot(x, y, z)
    if abs(norm - 1.0) <= 1e-15:
        return (x, y, z)
    if abs(norm - 1.0) > 1e-12:
        reading.note(axis, f"the axis of {what} has length {norm:.12g}; it was scaled to 1")
    # Scaled in two steps, so that neither a huge nor a tiny axis over- or underflows.
    x, y, z = x / largest, y / largest, z / largest
    norm = math.hypot(x, y, z)
    return (x / norm, y / norm, z / norm)


def _read_limits(element: Element, kind: JointType, what: str, reading: Reading) -> Limits:
    limit = reading.only(element, "limit")
    if limit is None:
        if kind in ("revolute", "prismatic"):
            unit = "rad" if kind == "revolute" else "m"
            or_else = ', or type="continuous"' if kind == "revolute" else ""
            raise reading.error(
                element,
                f"{what} is {kind} and has no <limit>; wanted "
                f'<limit lower="..." upper="..."/> in {unit}{or_else}',
            )
        return Limits()
    most = {}
    for attribute in ("velocity", "effort"):
        most[attribute] = _limit(limit, attribute, what, reading, INFINITY)
        if attribute not in limit.attributes:
            reading.note(limit, f"{what} has no {attribute} limit; it is read as unlimited")
        elif most[attribute] < 0.0:
            reading.note(limit, f"the {attribute} limit of {what} is negative")
    if kind == "ball":
        from dynx.model.urdf.other_joint_types import note_swings

        note_swings(limit, what, reading)
        return Limits(**most)
    if kind == "continuous":
        if "lower" in limit.attributes or "upper" in limit.attributes:
            reading.note(limit, f"{what} is continuous; its lower and upper limits were ignored")
        return Limits(**most)
    lower, upper = (_limit(limit, end, what, reading, 0.0) for end in ("lower", "upper"))
    if lower == upper and math.isinf(lower):
        raise reading.error(limit, f"both limits of {what} are {lower}, so that it has no position")
    missing = [end for end in ("lower", "upper") if end not in limit.attributes]
    if missing:
        reading.note(limit, f"{what} has no {' and no '.join(missing)} limit; URDF defines it as 0")
    if lower > upper:
        reading.note(limit, f"{what} has lower limit {lower} above upper limit {upper}; they are exchanged")
    return Limits(lower, upper, **most)


def _limit(limit: Element, attribute: str, what: str, reading: Reading, default: float) -> float:
    value = reading.number_or(limit, attribute, what, default, bound=INFINITY)
    if abs(value) < MAX_MAGNITUDE or math.isinf(value):
        return value
    # The largest double is the usual way to write "no limit": every engine can read it, unlike infinity.
    if abs(value) < sys.float_info.max:
        reading.note(limit, f"the {attribute} limit of {what} is {value:g}; it is read as unlimited")
    return math.copysign(INFINITY, value)


def _read_dynamics(element: Element, what: str, reading: Reading) -> JointDynamics:
    values = {}
    for spring in element.all(SPRING_TAG):
        values["stiffness"] = reading.number(spring, "stiffness", what)
        values["spring_reference"] = reading.number_or(spring, "reference", what, 0.0)
    dynamics = reading.only(element, "dynamics")
    if dynamics is None:
        return JointDynamics(**values)
    for attribute in ("damping", "friction", "armature"):
        values[attribute] = reading.number_or(dynamics, attribute, what, 0.0)
        if values[attribute] < 0.0:
            reading.note(dynamics, f"the {attribute} of {what} is negative, so the joint gains energy")
    return JointDynamics(**values)


def _read_mimic(element: Element, what: str, reading: Reading) -> Mimic | None:
    mimic = reading.only(element, "mimic")
    if mimic is None:
        return None
    return Mimic(
        reading.name(mimic, "joint", f"<mimic> of {what}"),
        reading.number_or(mimic, "multiplier", what, 1.0),
        reading.number_or(mimic, "offset", what, 0.0),
    )


_OPAQUE = frozenset(
    ["visual", "collision", "contact", "material", "transmission", "gazebo", "sensor", "ros2_control"]
)
_SRDF = frozenset(["group", "group_state", "disable_collisions", "virtual_joint"])
"""Elements of SRDF, whose root is named as that of URDF."""

_KNOWN = _OPAQUE | {"link", "joint", "plugin", "static", ROBOT_TAG}


def read_urdf(data: str | bytes, source: str) -> Description:
    """Read a URDF document, except for the shapes of its links (`urdf_geometry`).

    Raises DescriptionError for malformed content, UnsupportedFeatureError for a feature that dynx does not
    support; the message begins with `source` and the line.
    """
    notes: list[Note] = []
    max_counts = {"link": MAX_LINKS, "joint": MAX_LINKS}
    root = read_xml(data, source, notes, opaque=_OPAQUE, max_counts=max_counts)
    reading = Reading(source, notes, reads_quaternions(root.attributes.get("version")))
    _require_robot(root, reading)
    reading.ignore_unknown(root, _KNOWN)
    link_elements, joint_elements = root.all("link"), root.all("joint")
    links = [read_link(element, reading) for element in link_elements]
    base_joint = _floating_base_joint(joint_elements, links)
    frames, joints = [], []
    for element in joint_elements:
        joint = read_joint(element, reading, floating_is_base=element is base_joint)
        if joint.type == "fixed" and element.all(FRAME_TAG):
            frames.append(Frame(joint.child, joint.parent, joint.origin))
        else:
            joints.append(joint)
    names = {frame.name for frame in frames}
    for element, link in zip(link_elements, links, strict=True):
        if link.name in names:
            _require_bare(element, link, reading)
    links = [link for link in links if link.name not in names]
    reading.note_ignored()
    return Description(
        _robot_name(root, reading),
        links,
        joints,
        frames,
        notes,
        unread=_unread_part(root),
        **_read_settings(root, reading),
    )


def _read_settings(root: Element, reading: Reading) -> dict[str, Any]:
    """Return base, gravity and pose of the base, as far as the extension of dynx states them."""
    element = reading.only(root, ROBOT_TAG)
    if element is None:
        return {}
    what, settings = f"<{ROBOT_TAG}>", dict[str, Any]()
    if "base" in element.attributes:
        base = settings["base"] = element.attributes["base"]
        if base not in ("fixed", "floating"):
            raise reading.error(element, f"base of {what} is {shown(base)}; wanted fixed or floating")
    if "gravity" in element.attributes:
        settings["gravity"] = reading.vector(element, "gravity", what)
    if element.all("origin"):
        settings["base_pose"] = read_origin(element, what, reading)
    return settings


def _require_bare(element: Element, link: Link, reading: Reading) -> None:
    """Refuse mass and shapes of a link that is read as a frame. An inertial of zeros says what a frame is."""
    massless = link.inertial is None or not (link.inertial.mass or link.inertial.tensor.any())
    refused = ("visual", "collision") if massless else ("inertial", "visual", "collision")
    for child in element.children:
        if child.tag in refused:
            raise reading.error(
                child,
                f"link {shown(link.name)} has <{child.tag}>, but its joint has <{FRAME_TAG}>, which makes it "
                "a frame; remove one of the two",
            )


def _require_robot(root: Element, reading: Reading) -> None:
    if root.tag != "robot":
        from dynx.model.other_formats import BY_ROOT

        kind = BY_ROOT.get(root.tag)
        other = "" if kind is None else f"; this file is {kind}"
        raise reading.error(root, f"the root element is <{escaped(root.tag)}>; wanted <robot>{other}")
    tags = {child.tag for child in root.children}
    if tags & _SRDF and "link" not in tags:
        raise reading.error(
            root, "this is an SRDF file, which has groups of joints and no robot; wanted a URDF file"
        )


def _unread_part(root: Element) -> Note | None:
    for child in root.children:
        if child.tag.startswith("xacro:"):
            message = (
                f"<{escaped(child.tag)}> is xacro that was not expanded; expand the file, or load it "
                "under its name in .xacro with the extra 'xacro' installed"
            )
            return Note(message, child.line)
        if child.tag.lower() in ("link", "joint") and child.tag not in ("link", "joint"):
            message = f"unknown element <{child.tag}>{nearest(child.tag, ['link', 'joint'])}"
            return Note(message, child.line)
    return None


def _robot_name(root: Element, reading: Reading) -> str | None:
    name = root.attributes.get("name", "")
    fault = name_fault(name)
    if fault is None:
        return name
    if name:
        raise reading.error(root, f"the name of the robot {fault}")
    reading.note(root, "the robot has no name; it is named after its file")
    return None


def _floating_base_joint(joints: list[Element], links: list[Link]) -> Element | None:
    """Return the floating joint between an empty root link and the rest of the robot, or None.

    Such a pair expresses that the base moves freely. The empty link has no body, so reading the joint as
    fixed loses nothing and leaves the choice to ``base=``.
    """
    ends = []
    for joint in joints:
        parents, children = joint.all("parent"), joint.all("child")
        if parents and children:
            ends.append((joint, parents[0].attributes.get("link"), children[0].attributes.get("link")))
    below = {child for _, _, child in ends}
    child_count = Counter(parent for _, parent, _ in ends)
    empty = {link.name for link in links if link.inertial is None or link.inertial.mass == 0.0}
    for joint, parent, _ in ends:
        if joint.attributes.get("type") != "floating" or parent in below or parent not in empty:
            continue
        if child_count[parent] == 1:
            return joint
    return None
