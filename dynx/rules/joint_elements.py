"""What the ``<joint>`` elements of a document say, for rules that must not ask for the model."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dynx.model.xml_source import Edit, SourceElement, XmlSource
from dynx.rules.case import Case
from dynx.rules.number_text import LARGEST, is_number

SINGLE = ("revolute", "continuous", "prismatic")
"""Types of joints with one coordinate."""

UNLIMITED = f'<limit lower="-{LARGEST}" upper="{LARGEST}" effort="{LARGEST}" velocity="{LARGEST}"/>'
"""A limit that no joint reaches, in numbers that every engine reads."""


def joints_of_type(case: Case, types: Collection[str]) -> Iterator[SourceElement]:
    """The joints of these types, in document order."""
    for joint in case.source.root.all("joint"):
        if joint.attributes.get("type") in types:
            yield joint


def number_in(element: SourceElement, attribute: str) -> float | None:
    """The number an attribute holds; None where it is absent or no number."""
    text = element.attributes.get(attribute, "")
    return float(text) if is_number(text) else None


def putting_axis(source: XmlSource, joint: SourceElement, xyz: str) -> Edit:
    """Give a joint that axis, whether it has one or not."""
    axis = joint.first("axis")
    if axis is None:
        return source.inserting(joint, f'<axis xyz="{xyz}"/>')
    return source.setting(axis, "xyz", xyz)
