"""URDF text that says what a model says, in the spellings that real files use."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import reduce
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.elements import INFINITY
from dynx.testing.strategies.configurations import checked_model
from dynx.testing.strategies.geometry import Strategy
from dynx.testing.strategies.models import models

Pairs = list[tuple[str, str]]

HABITS = (
    "declaration",
    "byte_order_mark",
    "windows_line_ends",
    "leading_blank_lines",
    "no_indentation",
    "comments",
    "unknown_tags",
    "undeclared_prefixes",
    "namespaces",
    "unknown_attributes",
    "reversed_attributes",
    "spaced_attributes",
    "single_quotes",
    "character_references",
    "odd_white_space",
    "odd_numbers",
    "joints_first",
    "children_reversed",
    "open_and_close",
    "empty_origins",
    "explicit_defaults",
    "missing_meshes",
    "axis_of_fixed_joint",
)
"""What untidy files do. Leading blank lines before a declaration and undeclared prefixes are not
well-formed XML, but every engine reads them."""


def urdf_text(model: Model | None = None) -> Strategy[str]:
    """URDF text of `model`, or of a random one, in any legal spelling. Shrinks to the tidy one.

    Every number is written so that it reads back as the same float, and joints keep their order, so
    ``dynx.load(text, base=model.base, gravity=model.gravity)`` gives a model equal to `model`. A
    limit that a revolute or prismatic joint does not have is written as the largest double. Raises
    ArgumentError for a model with added frames or locked joints, for which URDF has no words.
    """
    habits = st.sets(st.sampled_from(HABITS))
    if model is None:
        return st.builds(_text, models(base="fixed", from_urdf=True), habits)
    _check_expressible(checked_model(model))
    return st.builds(_text, st.just(model), habits)


def _check_expressible(model: Model) -> None:
    if model.extra_frames:
        raise ArgumentError(f"{model.name} has frames besides its links, which URDF text cannot hold")
    for joint in model.joints:
        if joint.locked_at is not None:
            raise ArgumentError(f"joint {joint.name} of {model.name} is locked, which URDF text cannot say")


@dataclass(frozen=True)
class _Element:
    """An XML element that is still to be spelled."""

    tag: str
    attributes: Pairs
    children: tuple[_Element, ...] = ()


def _text(model: Model, habits: set[str]) -> str:
    links = [_link(link, habits) for link in model.links]
    joints = [_joint(joint, habits) for joint in model.joints]
    parts = joints + links if "joints_first" in habits else links + joints
    if "unknown_tags" in habits:
        parts = [*_unknown_tags(model), *parts]
    attributes = [("name", model.name)]
    if "namespaces" in habits:
        attributes.append(("xmlns:xacro", "http://www.ros.org/wiki/xacro"))
        attributes.append(("xmlns:known", "http://example.org/known"))
        parts.append(_Element("known:thing", [("value", "1")]))
    lines = _spelled(_Element("robot", attributes, tuple(parts)), habits, 0)
    if "comments" in habits:
        decoy = '<!-- <link name="decoy"/> <joint name="decoy" type="none"/> a < b & c > d -->'
        lines = [lines[0], decoy, *lines[1:], decoy]
    if "declaration" in habits:
        lines.insert(0, '<?xml version="1.0" encoding="utf-8"?>')
    if "leading_blank_lines" in habits:
        lines = ["", "  ", *lines]
    mark = "\ufeff" if "byte_order_mark" in habits else ""
    end = "\r\n" if "windows_line_ends" in habits else "\n"
    return mark + end.join(lines) + end


def _link(link: Link, habits: set[str]) -> _Element:
    children = []
    if "missing_meshes" in habits:
        mesh = _Element("mesh", [("filename", "package://nowhere/meshes/part.stl"), ("scale", "1 1 1")])
        children.append(_Element("visual", [], (_Element("geometry", [], (mesh,)),)))
    if link.inertial is not None:
        children.append(_inertial(link.inertial, habits))
    if "undeclared_prefixes" in habits:
        children.append(_Element("drake:proximity_properties", [("drake:value", "0.1")]))
    return _Element("link", [("name", link.name)], _ordered(children, habits))


def _inertial(inertial: Inertial, habits: set[str]) -> _Element:
    moments = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = [(name, _number(getattr(inertial, name), habits)) for name in moments]
    children = [
        *_origin(inertial.origin, habits),
        _Element("mass", [("value", _number(inertial.mass, habits))]),
        _Element("inertia", values),
    ]
    return _Element("inertial", [], _ordered(children, habits))


def _joint(joint: Joint, habits: set[str]) -> _Element:
    children = [
        *_origin(joint.origin, habits),
        _Element("parent", [("link", joint.parent)]),
        _Element("child", [("link", joint.child)]),
    ]
    explicit = "explicit_defaults" in habits
    if joint.moves and (explicit or joint.axis != (1.0, 0.0, 0.0)):
        children.append(_Element("axis", [("xyz", _vector(joint.axis, habits))]))
    elif not joint.moves and "axis_of_fixed_joint" in habits:
        children.append(_Element("axis", [("xyz", "0 0 0")]))
    children += _limit(joint, habits) + _dynamics(joint, habits) + _mimic(joint, habits)
    return _Element("joint", [("name", joint.name), ("type", joint.type)], _ordered(children, habits))


def _limit(joint: Joint, habits: set[str]) -> list[_Element]:
    if joint.type not in ("revolute", "prismatic"):
        return []
    values = [(end, getattr(joint.limits, end)) for end in ("lower", "upper")]
    values = [(end, math.copysign(sys.float_info.max, x) if math.isinf(x) else x) for end, x in values]
    most = ((name, getattr(joint.limits, name)) for name in ("velocity", "effort"))
    values += [(name, x) for name, x in most if x != INFINITY]
    return [_Element("limit", [(name, _number(x, habits)) for name, x in values])]


def _dynamics(joint: Joint, habits: set[str]) -> list[_Element]:
    # URDF has no word for armature, so it is written only where there is some.
    always = ("damping", "friction") if "explicit_defaults" in habits else ()
    values = ((name, getattr(joint.dynamics, name)) for name in ("damping", "friction", "armature"))
    given = [(name, value) for name, value in values if value or name in always]
    if not joint.moves or not given:
        return []
    return [_Element("dynamics", [(name, _number(value, habits)) for name, value in given])]


def _mimic(joint: Joint, habits: set[str]) -> list[_Element]:
    if joint.mimic is None:
        return []
    attributes = [("joint", joint.mimic.joint)]
    for name, value, default in (
        ("multiplier", joint.mimic.multiplier, 1.0),
        ("offset", joint.mimic.offset, 0.0),
    ):
        if value != default or "explicit_defaults" in habits:
            attributes.append((name, _number(value, habits)))
    return [_Element("mimic", attributes)]


def _origin(pose: Pose, habits: set[str]) -> list[_Element]:
    explicit = "explicit_defaults" in habits
    vectors = (("xyz", pose.xyz), ("rpy", pose.rpy))
    given = [(name, _vector(vector, habits)) for name, vector in vectors if explicit or any(vector)]
    if not given and "empty_origins" not in habits:
        return []
    return [_Element("origin", given)]


def _unknown_tags(model: Model) -> list[_Element]:
    """Tags of other programs, with links and joints inside that are none of the robot's."""
    name = model.joints[0].name if model.joints else "none"
    actuator = _Element("actuator", [("name", "motor")], (_Element("mechanicalReduction", []),))
    inner = _Element("joint", [("name", name)], (_Element("hardwareInterface", []),))
    sensor = _Element("sensor", [("name", "eye")], (_Element("link", [("name", model.root)]),))
    return [
        _Element("transmission", [("name", "drive")], (inner, actuator)),
        _Element("gazebo", [("reference", model.root)], (sensor,)),
        _Element("material", [("name", "grey")], (_Element("color", [("rgba", "0.5 0.5 0.5 1")]),)),
    ]


def _ordered(children: list[_Element], habits: set[str]) -> tuple[_Element, ...]:
    return tuple(reversed(children)) if "children_reversed" in habits else tuple(children)


def _vector(vector: tuple[float, ...], habits: set[str]) -> str:
    numbers = [_number(x, habits) for x in vector]
    if "odd_white_space" in habits:
        return " \t" + numbers[0] + "  " + "\n\t ".join(numbers[1:]) + " "
    return " ".join(numbers)


def _number(x: float, habits: set[str]) -> str:
    """`x` in digits that read back as the same float."""
    plain = repr(x)
    if "odd_numbers" not in habits:
        return plain
    unsigned = plain.removeprefix("-")
    if "e" in unsigned:
        odd = unsigned.upper()
    elif unsigned.startswith("0.") and len(unsigned) > 3:
        odd = unsigned[1:]
    else:
        odd = unsigned.removesuffix("0") if unsigned.endswith(".0") else unsigned + "00e+00"
    return ("-" if plain.startswith("-") else "+") + odd


def _spelled(element: _Element, habits: set[str], depth: int) -> list[str]:
    """The element's lines of text."""
    indent = "" if "no_indentation" in habits else "  " * depth
    attributes = list(element.attributes)
    if "unknown_attributes" in habits and depth > 0:
        attributes.append(("note", "ignored"))
    if "reversed_attributes" in habits:
        attributes.reverse()
    equals, gap = (" = ", "\n    ") if "spaced_attributes" in habits else ("=", " ")
    words = reduce(
        lambda text, pair: f"{text}{gap}{pair[0]}{equals}{_quoted(pair[1], habits)}", attributes, element.tag
    )
    if not element.children:
        closed = f"></{element.tag}>" if "open_and_close" in habits else "/>"
        return [f"{indent}<{words}{closed}"]
    inner = [line for child in element.children for line in _spelled(child, habits, depth + 1)]
    if "comments" in habits:
        inner.append(f"{indent}<!-- end of {element.tag} -->")
    return [f"{indent}<{words}>", *inner, f"{indent}</{element.tag}>"]


def _quoted(value: str, habits: set[str]) -> str:
    """The value as an attribute; saxutils would turn line ends into references, so it gets none."""
    escaped = quoteattr(value.replace("\n", "\0").replace("\t", "\1"))[1:-1]
    escaped = escaped.replace("\0", "\n").replace("\1", "\t")
    if "character_references" in habits and escaped[:1].isalpha():
        escaped = f"&#{ord(escaped[0])};{escaped[1:]}"
    return f"'{escaped}'" if "single_quotes" in habits else f'"{escaped}"'
