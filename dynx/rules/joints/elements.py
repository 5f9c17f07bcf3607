"""The ``<joint>`` elements of a document, for rules that must not use the model."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.case import Case, end_of
from dynx.rules.text.attributes import number_or_none
from dynx.rules.text.number_text import LARGEST

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
