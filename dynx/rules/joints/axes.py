"""The ``<axis>`` elements of joints as written: misspelled directions, and what MuJoCo reads."""

from __future__ import annotations

import math
from collections.abc import Iterator

from dynx.model.xml.source import SourceElement
from dynx.rules.case import Case
from dynx.rules.joints.elements import elements_in_joints
from dynx.rules.text.number_text import is_number

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
