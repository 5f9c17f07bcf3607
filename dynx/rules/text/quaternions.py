"""The ``<origin>`` elements with a quaternion, for rules that must not use the model."""

from __future__ import annotations

import re
from collections.abc import Iterator

from dynx.model.elements import Vector
from dynx.model.urdf.origins import QUATERNION, rpy_of_quaternion
from dynx.model.xml.source import SourceElement
from dynx.rules.case import Case
from dynx.rules.text.number_text import is_number
from dynx.rules.text.numeric_attributes import NumericAttribute

_SEPARATORS = re.compile(r"[\s,;]+")


def origins_with_quaternion(case: Case) -> Iterator[SourceElement]:
    """Yield the origins of joints, inertials and shapes that have a quaternion, in document order."""
    for part in case.source.root.children:
        if part.tag in ("link", "joint"):
            for element in part.walk():
                if element.tag == "origin" and QUATERNION in element.attributes:
                    yield element


def is_plain(case: Case, origin: SourceElement) -> bool:
    """Check whether blanks alone separate the numbers of a quaternion."""
    written = NumericAttribute(origin, QUATERNION, 4).text_in(case.source)
    return all(mark == " " for mark in "".join(_SEPARATORS.findall(written)))


def quaternion_rpy(origin: SourceElement) -> Vector | None:
    """Return roll, pitch and yaw of a quaternion, whatever separates its numbers.

    None where it is not four numbers, or no rotation.
    """
    words = [word for word in _SEPARATORS.split(origin.attributes[QUATERNION]) if word]
    if len(words) != 4 or not all(map(is_number, words)):
        return None
    try:
        return rpy_of_quaternion(tuple(map(float, words)))
    except ValueError:
        return None
