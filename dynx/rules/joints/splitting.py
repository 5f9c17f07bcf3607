"""A joint of several degrees of freedom split into a chain of joints with one, with light links between them.

A spherical joint becomes three rotations about x, y and z, a planar one two translations in the plane and a
rotation about its normal, a floating one three translations and three rotations. The chain reaches the same
poses; its coordinates are angles (roll, pitch, yaw of the moving axes), which are singular at a pitch of 90
degrees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dynx.model.xml.quoting import quoteattr
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.case import end_of
from dynx.rules.inertia.massless_links import least_inertial
from dynx.rules.joints.elements import UNLIMITED, axis_edit
from dynx.rules.joints.renaming import fresh_name
from dynx.rules.text.number_text import decimal, is_number

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
    lines = []
    for own, each, parent, below in zip(names[1:], rest, links, [*links[1:], child], strict=True):
        least = "\n".join(f"{source.unit}{line}" for line in least_inertial().split("\n"))
        lines.append(f"<link name={quoteattr(parent)}>\n{least}\n</link>")
        inside = [f"<parent link={quoteattr(parent)}/>", f"<child link={quoteattr(below)}/>"]
        inside.append(f'<axis xyz="{each.axis}"/>')
        if each.type == "prismatic":
            inside.append(UNLIMITED)
        body = "\n".join(f"{source.unit}{line}" for line in inside)
        lines.append(f'<joint name={quoteattr(own)} type="{each.type}">\n{body}\n</joint>')
    yield source.insertion_after(joint, "\n".join(lines))


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
