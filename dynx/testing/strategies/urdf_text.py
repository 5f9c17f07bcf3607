"""URDF text of a model, in the spellings that real files use."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from xml.sax.saxutils import escape

from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.elements import INFINITY
from dynx.model.urdf.reader import SPRING_TAG
from dynx.testing.strategies.configurations import checked_model
from dynx.testing.strategies.geometry import Strategy
from dynx.testing.strategies.models import models

Pairs = list[tuple[str, str]]

SPELLINGS = (
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
"""Deviations of real files from the plainest text. Leading blank lines before a declaration and undeclared
prefixes are not well-formed XML, but every engine reads them."""


def urdf_text(model: Model | None = None) -> Strategy[str]:
    """Draw URDF text of `model`, or of a random one, in any legal spelling. Shrinks to the plainest one.

    Every number is written so that it reads back as the same float, and joints keep their order, so
    ``dynx.load(text, base=model.base, gravity=model.gravity, base_pose=model.base_pose)`` gives a model equal
    to `model`. A limit that a revolute or prismatic joint does not have is written as the largest double.
    Raises ArgumentError for a model with added frames or locked joints, which URDF cannot express.
    """
    spellings = st.sets(st.sampled_from(SPELLINGS))
    if model is None:
        return st.builds(_text, models(base="fixed", from_urdf=True), spellings)
    _check_expressible(checked_model(model))
    return st.builds(_text, st.just(model), spellings)


def _check_expressible(model: Model) -> None:
    if model.extra_frames:
        raise ArgumentError(f"{model.name} has frames besides its links, which URDF text cannot express")
    for joint in model.joints:
        if joint.locked_at is not None:
            raise ArgumentError(f"joint {joint.name} of {model.name} is locked, which URDF cannot express")


@dataclass(frozen=True)
class _SpelledElement:
    """An XML element before it is written as text."""

    tag: str
    attributes: Pairs
    children: tuple[_SpelledElement, ...] = ()


def _text(model: Model, spellings: set[str]) -> str:
    links = [_link(link, spellings) for link in model.links]
    joints = [_joint(joint, spellings) for joint in model.joints]
    parts = joints + links if "joints_first" in spellings else links + joints
    if "unknown_tags" in spellings:
        parts = [*_unknown_tags(model), *parts]
    attributes = [("name", model.name)]
    if "namespaces" in spellings:
        attributes.append(("xmlns:xacro", "http://www.ros.org/wiki/xacro"))
        attributes.append(("xmlns:known", "http://example.org/known"))
        parts.append(_SpelledElement("known:thing", [("value", "1")]))
    lines = _lines_of(_SpelledElement("robot", attributes, tuple(parts)), spellings, 0)
    if "comments" in spellings:
        decoy = '<!-- <link name="decoy"/> <joint name="decoy" type="none"/> a < b & c > d -->'
        lines = [lines[0], decoy, *lines[1:], decoy]
    if "declaration" in spellings:
        lines.insert(0, '<?xml version="1.0" encoding="utf-8"?>')
    if "leading_blank_lines" in spellings:
        lines = ["", "  ", *lines]
    mark = "\ufeff" if "byte_order_mark" in spellings else ""
    end = "\r\n" if "windows_line_ends" in spellings else "\n"
    return mark + end.join(lines) + end


def _link(link: Link, spellings: set[str]) -> _SpelledElement:
    children = []
    if "missing_meshes" in spellings:
        mesh = _SpelledElement(
            "mesh", [("filename", "package://nowhere/meshes/part.stl"), ("scale", "1 1 1")]
        )
        children.append(_SpelledElement("visual", [], (_SpelledElement("geometry", [], (mesh,)),)))
    if link.inertial is not None:
        children.append(_inertial(link.inertial, spellings))
    if "undeclared_prefixes" in spellings:
        children.append(_SpelledElement("drake:proximity_properties", [("drake:value", "0.1")]))
    return _SpelledElement("link", [("name", link.name)], _ordered(children, spellings))


def _inertial(inertial: Inertial, spellings: set[str]) -> _SpelledElement:
    moments = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = [(name, _number(getattr(inertial, name), spellings)) for name in moments]
    children = [
        *_origin(inertial.origin, spellings),
        _SpelledElement("mass", [("value", _number(inertial.mass, spellings))]),
        _SpelledElement("inertia", values),
    ]
    return _SpelledElement("inertial", [], _ordered(children, spellings))


def _joint(joint: Joint, spellings: set[str]) -> _SpelledElement:
    children = [
        *_origin(joint.origin, spellings),
        _SpelledElement("parent", [("link", joint.parent)]),
        _SpelledElement("child", [("link", joint.child)]),
    ]
    explicit = "explicit_defaults" in spellings
    if joint.moves and (explicit or joint.axis != (1.0, 0.0, 0.0)):
        children.append(_SpelledElement("axis", [("xyz", _vector(joint.axis, spellings))]))
    elif not joint.moves and "axis_of_fixed_joint" in spellings:
        children.append(_SpelledElement("axis", [("xyz", "0 0 0")]))
    children += _limit(joint, spellings) + _dynamics(joint, spellings) + _mimic(joint, spellings)
    return _SpelledElement(
        "joint", [("name", joint.name), ("type", joint.type)], _ordered(children, spellings)
    )


def _limit(joint: Joint, spellings: set[str]) -> list[_SpelledElement]:
    if joint.type not in ("revolute", "prismatic"):
        return []
    values = [(end, getattr(joint.limits, end)) for end in ("lower", "upper")]
    values = [(end, math.copysign(sys.float_info.max, x) if math.isinf(x) else x) for end, x in values]
    most = ((name, getattr(joint.limits, name)) for name in ("velocity", "effort"))
    values += [(name, x) for name, x in most if x != INFINITY]
    return [_SpelledElement("limit", [(name, _number(x, spellings)) for name, x in values])]


def _dynamics(joint: Joint, spellings: set[str]) -> list[_SpelledElement]:
    # URDF has no armature and no springs, so these extensions are written only for a joint that has one.
    always = ("damping", "friction") if "explicit_defaults" in spellings else ()
    values = ((name, getattr(joint.dynamics, name)) for name in ("damping", "friction", "armature"))
    given = [(name, value) for name, value in values if value or name in always]
    found = []
    if joint.moves and given:
        found += [_SpelledElement("dynamics", [(name, _number(value, spellings)) for name, value in given])]
    if joint.moves and joint.dynamics.stiffness:
        spring = (("stiffness", joint.dynamics.stiffness), ("reference", joint.dynamics.spring_reference))
        found += [_SpelledElement(SPRING_TAG, [(name, _number(value, spellings)) for name, value in spring])]
    return found


def _mimic(joint: Joint, spellings: set[str]) -> list[_SpelledElement]:
    if joint.mimic is None:
        return []
    attributes = [("joint", joint.mimic.joint)]
    for name, value, default in (
        ("multiplier", joint.mimic.multiplier, 1.0),
        ("offset", joint.mimic.offset, 0.0),
    ):
        if value != default or "explicit_defaults" in spellings:
            attributes.append((name, _number(value, spellings)))
    return [_SpelledElement("mimic", attributes)]


def _origin(pose: Pose, spellings: set[str]) -> list[_SpelledElement]:
    explicit = "explicit_defaults" in spellings
    vectors = (("xyz", pose.xyz), ("rpy", pose.rpy))
    given = [(name, _vector(vector, spellings)) for name, vector in vectors if explicit or any(vector)]
    if not given and "empty_origins" not in spellings:
        return []
    return [_SpelledElement("origin", given)]


def _unknown_tags(model: Model) -> list[_SpelledElement]:
    """Make tags of other programs, with inner links and joints that do not belong to the robot."""
    name = model.joints[0].name if model.joints else "none"
    actuator = _SpelledElement("actuator", [("name", "motor")], (_SpelledElement("mechanicalReduction", []),))
    inner = _SpelledElement("joint", [("name", name)], (_SpelledElement("hardwareInterface", []),))
    sensor = _SpelledElement("sensor", [("name", "eye")], (_SpelledElement("link", [("name", model.root)]),))
    return [
        _SpelledElement("transmission", [("name", "drive")], (inner, actuator)),
        _SpelledElement("gazebo", [("reference", model.root)], (sensor,)),
        _SpelledElement(
            "material", [("name", "grey")], (_SpelledElement("color", [("rgba", "0.5 0.5 0.5 1")]),)
        ),
    ]


def _ordered(children: list[_SpelledElement], spellings: set[str]) -> tuple[_SpelledElement, ...]:
    return tuple(reversed(children)) if "children_reversed" in spellings else tuple(children)


def _vector(vector: tuple[float, ...], spellings: set[str]) -> str:
    numbers = [_number(x, spellings) for x in vector]
    if "odd_white_space" in spellings:
        return " \t" + numbers[0] + "  " + "\n\t ".join(numbers[1:]) + " "
    return " ".join(numbers)


def _number(x: float, spellings: set[str]) -> str:
    """Write `x` in digits that read back as the same float."""
    plain = repr(x)
    if "odd_numbers" not in spellings:
        return plain
    unsigned = plain.removeprefix("-")
    if "e" in unsigned:
        odd = unsigned.upper()
    elif unsigned.startswith("0.") and len(unsigned) > 3:
        odd = unsigned[1:]
    else:
        odd = unsigned.removesuffix("0") if unsigned.endswith(".0") else unsigned + "00e+00"
    return ("-" if plain.startswith("-") else "+") + odd


def _lines_of(element: _SpelledElement, spellings: set[str], depth: int) -> list[str]:
    """Write the lines of an element."""
    indent = "" if "no_indentation" in spellings else "  " * depth
    attributes = list(element.attributes)
    if "unknown_attributes" in spellings and depth > 0:
        attributes.append(("note", "ignored"))
    if "reversed_attributes" in spellings:
        attributes.reverse()
    equals, gap = (" = ", "\n    ") if "spaced_attributes" in spellings else ("=", " ")
    pairs = [f"{name}{equals}{_quoted(value, spellings)}" for name, value in attributes]
    words = gap.join([element.tag, *pairs])
    if not element.children:
        closed = f"></{element.tag}>" if "open_and_close" in spellings else "/>"
        return [f"{indent}<{words}{closed}"]
    inner = [line for child in element.children for line in _lines_of(child, spellings, depth + 1)]
    if "comments" in spellings:
        inner.append(f"{indent}<!-- end of {element.tag} -->")
    return [f"{indent}<{words}>", *inner, f"{indent}</{element.tag}>"]


def _quoted(value: str, spellings: set[str]) -> str:
    """Quote a value as an attribute; its line ends stay as they are."""
    escaped = escape(value, {'"': "&quot;", "'": "&apos;"})
    if "character_references" in spellings and escaped[:1].isalpha():
        escaped = f"&#{ord(escaped[0])};{escaped[1:]}"
    return f"'{escaped}'" if "single_quotes" in spellings else f'"{escaped}"'
