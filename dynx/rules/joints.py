"""Joints and transmissions in the text of a description: elements, axes, new names, splitting of a joint."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.rules.attributes import number_or_none
from dynx.rules.case import Case, end_of
from dynx.rules.inertia import least_inertial
from dynx.rules.numbers_in_text import LARGEST, decimal, is_number

# The ``<joint>`` elements of a document, for rules that must not use the model.


SINGLE = ("revolute", "continuous", "prismatic")
"""Types of joints with one coordinate."""

UNLIMITED = f'<limit lower="-{LARGEST}" upper="{LARGEST}" effort="{LARGEST}" velocity="{LARGEST}"/>'
"""A limit that no joint reaches, in numbers that every engine reads."""


def joints_of_type(case: Case, types: Collection[str]) -> Iterator[SourceElement]:
    """Yield the joints of these types, in document order."""
    for joint in case.source.root.all("joint"):
        if joint.attributes.get("type") in types:
            yield joint


def elements_in_joints(
    case: Case, tag: str, types: Collection[str] | None = None
) -> Iterator[tuple[SourceElement, SourceElement]]:
    """Yield each joint of these types (default: of any) that has such an element, with the first of them."""
    for joint in case.source.root.all("joint"):
        element = joint.first(tag)
        if element is not None and (types is None or joint.attributes.get("type") in types):
            yield joint, element


def specifies_base(case: Case, joint: SourceElement) -> bool:
    """Check whether a floating joint carries the robot on an empty root, which may be so in a file that dynx
    refuses for another reason."""
    parent = end_of(joint, "parent")
    ends = [(end_of(each, "parent"), end_of(each, "child")) for each in case.source.root.all("joint")]
    carried = [child for above, child in ends if above == parent]
    is_root = parent in case.links and all(child != parent for _, child in ends)
    return case.readable or (is_root and len(carried) == 1 and _is_empty(case.links[parent]))


def axis_edit(source: XmlSource, joint: SourceElement, xyz: str) -> Edit:
    """Return the edit that sets the axis of a joint, whether it has one or not."""
    axis = joint.first("axis")
    if axis is None:
        return source.insertion(joint, f'<axis xyz="{xyz}"/>')
    return source.attribute_edit(axis, "xyz", xyz)


def _is_empty(link: SourceElement) -> bool:
    inertial = link.first("inertial")
    mass = None if inertial is None else inertial.first("mass")
    return inertial is None or (mass is not None and number_or_none(mass, "value") == 0.0)


# The ``<axis>`` elements of joints as written: misspelled directions, and what MuJoCo reads.


_DIRECTION = "xyz"


def misspelled_axes(case: Case) -> Iterator[tuple[SourceElement, SourceElement, str]]:
    """Yield joint, ``<axis>`` without ``xyz`` and the name of its attribute that holds three numbers."""
    for joint, axis in elements_in_joints(case, "axis"):
        written = misspelled_direction(axis)
        if written is not None:
            yield joint, axis, written


def misspelled_direction(axis: SourceElement) -> str | None:
    """Return the attribute of an ``<axis>`` without ``xyz`` that holds the direction; None without one.

    It has the letters of ``xyz`` in another order or case, or three numbers that are not all zero.
    """
    if _DIRECTION in axis.attributes:
        return None
    for name, text in axis.attributes.items():
        words = text.split()
        if words and sorted(name.lower()) == sorted(_DIRECTION):
            return name
        if len(words) == 3 and all(map(is_number, words)) and any(float(word) for word in words):
            return name
    return None


def mujoco_reads(axis: SourceElement) -> bool:
    """Check whether MuJoCo reads the ``xyz`` of an ``<axis>``, as it does on joints of every type.

    It reads three numbers as C does, the words for infinity and NaN included, with any white space around.
    """
    words = axis.attributes.get(_DIRECTION, "").split()
    return len(words) == 3 and all(map(_reads_word, words))


def _reads_word(word: str) -> bool:
    try:
        value = float.fromhex(word) if "x" in word.lower() else float(word)
    except (ValueError, OverflowError):
        return False
    overflows = math.isinf(value) and "inf" not in word.lower()
    return not overflows and "_" not in word and word.isascii()


# Edits that rename a link or a joint wherever a document names it.


def fresh_name(wanted: str, taken: Collection[str]) -> str:
    """Return the name `wanted`, with a number appended where it is taken."""
    name, number = wanted, 1
    while name in taken:
        number += 1
        name = f"{wanted}_{number}"
    return name


def link_rename(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Return the edits that rename a link in its element, in joints and in Gazebo references."""
    edits = []
    for element in source.root.walk():
        if element.tag == "link" and element.parent is source.root:
            edits += _rename(source, element, "name", old, new)
        elif element.tag in ("parent", "child"):
            edits += _rename(source, element, "link", old, new)
        elif element.tag == "gazebo":
            edits += _rename(source, element, "reference", old, new)
    return edits


def joint_rename(source: XmlSource, old: str, new: str) -> list[Edit]:
    """Return the edits that rename a joint in its element, mimics, transmissions and Gazebo references."""
    links = {link.attributes.get("name") for link in source.root.all("link")}
    edits = []
    for element in source.root.walk():
        if element.tag == "joint" and element.parent is not None:
            edits += _rename(source, element, "name", old, new)
        elif element.tag == "mimic":
            edits += _rename(source, element, "joint", old, new)
        elif element.tag == "gazebo" and old not in links:
            edits += _rename(source, element, "reference", old, new)
    return edits


def _rename(source: XmlSource, element: SourceElement, name: str, old: str, new: str) -> list[Edit]:
    return [source.attribute_edit(element, name, new)] if element.attributes.get(name) == old else []


# The ``<transmission>`` elements of which Drake makes actuators.


_SIMPLE = "SimpleTransmission"


def type_of(case: Case, transmission: SourceElement) -> str | None:
    """Return the type, which is an attribute or an element; None where there is neither, or no text
    in the element."""
    element = transmission.first("type")
    if "type" in transmission.attributes:
        return transmission.attributes["type"]
    return None if element is None else text_in(case.source, element) or None


def transmissions_drake_reads(case: Case) -> Iterator[SourceElement]:
    """Yield transmissions of the one type that Drake reads, with any prefix, and those without a type."""
    for transmission in case.source.root.all("transmission"):
        kind = type_of(case, transmission)
        if kind is None or _SIMPLE in kind:
            yield transmission


def moves_by_actuator(case: Case, transmission: SourceElement) -> bool:
    """Check whether Drake makes an actuator: not for a fixed joint, nor for an effort limit of 0."""
    named = transmission.first("joint")
    joint = None if named is None else case.joints.get(named.attributes.get("name", ""))
    if joint is None or joint.attributes.get("type") == "fixed":
        return False
    limit = joint.first("limit")
    return limit is None or number_or_none(limit, "effort") != 0.0


# A joint of several degrees of freedom split into a chain of joints with one, with light links between them.
#
# A spherical joint becomes three rotations about x, y and z, a planar one two translations in the plane and a
# rotation about its normal, a floating one three translations and three rotations. The chain reaches the same
# poses; its coordinates are angles (roll, pitch, yaw of the moving axes), which are singular at a pitch of 90
# degrees.


TYPES = ("spherical", "ball", "planar", "floating")

_X, _Y, _Z = "1 0 0", "0 1 0", "0 0 1"


@dataclass(frozen=True)
class Freedom:
    """One joint of the chain: the suffix of its name, its type and its axis as text."""

    suffix: str
    type: str
    axis: str


def freedoms(joint: SourceElement) -> list[Freedom]:
    """Return the chain for a joint of one of `TYPES`."""
    kind = joint.attributes["type"]
    slides = [
        Freedom(f"slide_{name}", "prismatic", axis) for name, axis in zip("xyz", (_X, _Y, _Z), strict=True)
    ]
    turns = [
        Freedom(f"turn_{name}", "continuous", axis) for name, axis in zip("xyz", (_X, _Y, _Z), strict=True)
    ]
    if kind == "planar":
        first, second, normal = _plane(joint)
        return [
            Freedom("slide_1", "prismatic", first),
            Freedom("slide_2", "prismatic", second),
            Freedom("turn", "continuous", normal),
        ]
    return slides + turns if kind == "floating" else turns


def joint_split(source: XmlSource, joint: SourceElement) -> Iterator[Edit]:
    """Yield the edits that replace the joint by the chain."""
    first, *rest = freedoms(joint)
    taken = {part.attributes.get("name", "") for part in source.root.children}
    name, child = joint.attributes["name"], end_of(joint, "child")
    names = [fresh_name(f"{name}_{each.suffix}", taken) for each in (first, *rest)]
    links = [fresh_name(f"{own}_link", taken) for own in names[:-1]]
    yield source.attribute_edit(joint, "name", names[0])
    yield source.attribute_edit(joint, "type", first.type)
    yield axis_edit(source, joint, first.axis)
    child_element = joint.first("child")
    if child_element is not None:
        yield source.attribute_edit(child_element, "link", links[0])
    limit = joint.first("limit")
    if limit is not None and first.type == "prismatic":
        yield source.replacement(limit, UNLIMITED)
    elif limit is not None:
        yield source.removal(limit)
    elif first.type == "prismatic":
        yield source.insertion(joint, UNLIMITED)
    dynamics = joint.first("dynamics")
    loss = "" if dynamics is None else _start_tag(dynamics)
    lines = []
    for own, each, parent, below in zip(names[1:], rest, links, [*links[1:], child], strict=True):
        least = "\n".join(f"  {line}" for line in least_inertial().split("\n"))
        lines.append(f"<link name={quoteattr(parent)}>\n{least}\n</link>")
        inside = [f"<parent link={quoteattr(parent)}/>", f"<child link={quoteattr(below)}/>"]
        inside.append(f'<axis xyz="{each.axis}"/>')
        if each.type == "prismatic":
            inside.append(UNLIMITED)
        if loss:
            inside.append(loss)
        body = "\n".join(f"  {line}" for line in inside)
        lines.append(f'<joint name={quoteattr(own)} type="{each.type}">\n{body}\n</joint>')
    yield source.insertion_after(joint, "\n".join(lines))


def _start_tag(element: SourceElement) -> str:
    """Return an element with its attributes alone, in one line."""
    pairs = (f" {name}={quoteattr(value)}" for name, value in element.attributes.items())
    return f"<{element.tag}{''.join(pairs)}/>"


def _plane(joint: SourceElement) -> tuple[str, str, str]:
    """Return two unit vectors in the plane and its unit normal, right-handed; the axis is the normal."""
    axis = joint.first("axis")
    words = [] if axis is None else axis.attributes.get("xyz", "").split()
    normal = np.array([1.0, 0.0, 0.0])
    if len(words) == 3 and all(map(is_number, words)) and any(float(word) for word in words):
        normal = np.array([float(word) for word in words])
        normal /= np.linalg.norm(normal)
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    along = np.cross(across, normal)
    first, second, third = (" ".join(map(decimal, vector)) for vector in (along, across, normal))
    return first, second, third


# Text between the tags of an element.


def text_in(source: XmlSource, element: SourceElement) -> str:
    """Return the text of an element that holds no other; empty for any other element."""
    if element.empty or element.children:
        return ""
    inside = source.data[element.start_tag.end : element.span.end]
    return inside.decode("utf-8").rpartition("</")[0].strip()
