"""Reader of URDF text: links, joints and frames, with a note for each ambiguity.

Visual and collision shapes, materials, transmissions, sensors and extensions of simulators do not affect
rigid-body dynamics and are skipped; meshes are not opened.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

from dynx.errors import escaped, nearest
from dynx.model.elements import Frame, Joint, Link, Note
from dynx.model.topology import MAX_LINKS
from dynx.model.urdf.elements import FRAME_TAG, read_joint, read_link, reads_quaternions
from dynx.model.urdf.values import Reading, name_fault
from dynx.model.xml.reading import Element, read_xml

_OPAQUE = frozenset(
    ["visual", "collision", "contact", "material", "transmission", "gazebo", "sensor", "ros2_control"]
)
_SRDF = frozenset(["group", "group_state", "disable_collisions", "virtual_joint"])
"""Elements of SRDF, whose root is named as that of URDF."""

_KNOWN = _OPAQUE | {"link", "joint", "plugin", "static"}


@dataclass(frozen=True)
class UrdfContent:
    """Content of a document: parts in document order, not yet checked to form a tree."""

    name: str | None
    links: list[Link]
    joints: list[Joint]
    frames: list[Frame]
    notes: list[Note]
    unread: Note | None
    """The first ignored element that may hold links or joints; it explains why the parts form no tree."""


def read_urdf(data: str | bytes, source: str) -> UrdfContent:
    """Read a URDF document.

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
    links = [link for link in links if link.name not in names]
    reading.note_ignored()
    return UrdfContent(_robot_name(root, reading), links, joints, frames, notes, _unread_part(root))


def _require_robot(root: Element, reading: Reading) -> None:
    if root.tag != "robot":
        other = {"sdf": " (SDF is not read)", "mujoco": " (MJCF is not read)"}.get(root.tag, "")
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
