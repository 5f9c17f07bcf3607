"""Attributes in the text of a description: origins and sizes, misspelled names, missing numbers."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Sequence

from dynx.errors import escaped
from dynx.model.elements import Pose, Vector
from dynx.model.urdf.reader import QUATERNION, read_origin, reads_quaternions
from dynx.model.xml.reading import Element
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.values import Reading
from dynx.rules.case import Case
from dynx.rules.numbers_in_text import MOMENTS, decimal, is_number
from dynx.rules.rule import Correction, found_at

# Values of attributes of a source element, read as `dynx.load` reads them, and edits of orientations.


def number_of(element: SourceElement, attribute: str) -> float | None:
    """Return the finite number that an attribute holds; None where it is absent.

    Raises DescriptionError for any other text, as `vector_of` and `origin_of` do.
    """
    if attribute not in element.attributes:
        return None
    return Reading("<string>").number(_plain(element), attribute, "this file")


def number_or_none(element: SourceElement, attribute: str) -> float | None:
    """Return the number that an attribute holds; None where it is absent or no finite number."""
    text = element.attributes.get(attribute, "")
    return float(text) if is_number(text) else None


def vector_of(element: SourceElement, attribute: str) -> Vector | None:
    """Return the three finite numbers that an attribute holds; None where it is absent."""
    if attribute not in element.attributes:
        return None
    return Reading("<string>").vector(_plain(element), attribute, "this file")


def origin_of(parent: SourceElement) -> Pose:
    """Return the pose in the ``<origin>`` of an element; absent and empty attributes are zero."""
    origins = [_plain(child) for child in parent.all("origin")]
    reading = Reading("<string>", quaternions=quaternions_count(parent))
    return read_origin(Element(parent.tag, {}, parent.line, origins), "this file", reading)


def quaternions_count(element: SourceElement) -> bool:
    """Check whether the robot of an element states a version of URDF that has ``quat_xyzw``."""
    root = element
    while root.parent is not None:
        root = root.parent
    return reads_quaternions(root.attributes.get("version"))


def orientation_edits(source: XmlSource, origin: SourceElement, rpy: Vector) -> list[Edit]:
    """Return the edits that give an ``<origin>`` these angles, in place of a quaternion if it has one."""
    edits = [source.attribute_edit(origin, "rpy", " ".join(map(decimal, rpy)))]
    if QUATERNION in origin.attributes:
        edits.append(source.attribute_removal(origin, QUATERNION))
    return edits


def _plain(element: SourceElement) -> Element:
    return Element(element.tag, element.attributes, element.line)


# Names of elements and attributes that no reader knows, and the known names that were meant.


ATTRIBUTES = {
    "link": ("name",),
    "joint": ("name", "type"),
    "origin": ("xyz", "rpy", "quat_xyzw"),
    "mass": ("value",),
    "inertia": MOMENTS,
    "axis": ("xyz",),
    "parent": ("link",),
    "child": ("link",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction", "armature"),
    "mimic": ("joint", "multiplier", "offset"),
}
"""The attributes that readers know, by the tag of the elements that matter for dynamics."""

_CLOSE = 0.8
"""Ratio of matching letters (difflib): one letter wrong, missing or doubled in a word of five or more."""

_PARTS = {"x": "xyz", "y": "xyz", "z": "xyz", "roll": "rpy", "pitch": "rpy", "yaw": "rpy"}
"""Names of single numbers, and the attribute that holds three of them."""


def meant_name(word: str, known: Sequence[str], present: Collection[str]) -> str | None:
    """Return the known name that an unknown one stands for, if it is absent: one with the same letters in
    another order, the vector of which a part is named, or else the closest."""
    if word in known or ":" in word:
        return None
    absent = [other for other in known if other not in present]
    lower = word.lower()
    for other in absent:
        if sorted(lower) == sorted(other) or _PARTS.get(lower) == other:
            return other
    close = difflib.get_close_matches(lower, absent, n=1, cutoff=_CLOSE)
    return close[0] if close else None


def misspelled_numbers(element: SourceElement, missing: Sequence[str]) -> dict[str, str]:
    """Return, for each missing attribute whose number stands under one misspelled name, that name."""
    known = (*ATTRIBUTES.get(element.tag, ()), *missing)
    found: dict[str, list[str]] = {}
    for name, text in element.attributes.items():
        meant = meant_name(name, missing, ()) if name not in known and is_number(text) else None
        if meant is not None:
            found.setdefault(meant, []).append(name)
    return {right: wrong[0] for right, wrong in found.items() if len(wrong) == 1}


# Corrections that write missing attributes: the number of a misspelled name, or a default.


def completion(
    case: Case, element: SourceElement, message: str, missing: Sequence[str], default: str
) -> Correction:
    """Return the correction of an element that lacks attributes, of which the message says so.

    An attribute whose number stands under a misspelled name gets that number, any other the default.
    """
    meant = misspelled_numbers(element, missing)
    edits = list[Edit]()
    for right in missing:
        if right in meant:
            edits += renaming(case, element, meant[right], right)
        else:
            edits.append(case.source.attribute_edit(element, right, default))
    notes = [
        f"{right} is {element.attributes[wrong].strip()} in {escaped(wrong)}"
        for right, wrong in meant.items()
    ]
    detection = found_at(element, "; ".join([message, *notes]))
    return Correction(detection, tuple(edits), tuple(meant), whole=len(meant) == len(missing))


def positive_edit(case: Case, element: SourceElement, attribute: str, *, zero: bool) -> tuple[Edit, str]:
    """Return the edit that removes the sign of a negative number, or writes 0; also the number as written."""
    written = element.attributes[attribute].strip()
    return case.source.attribute_edit(element, attribute, "0" if zero else written[1:]), written


def renaming(case: Case, element: SourceElement, wrong: str, right: str) -> tuple[Edit, ...]:
    """Return the edits that move the text of one attribute to another."""
    return (
        case.source.attribute_removal(element, wrong),
        case.source.attribute_edit(element, right, element.attributes[wrong]),
    )
