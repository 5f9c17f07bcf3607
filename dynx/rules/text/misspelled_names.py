"""Names of elements and attributes that no reader knows, and the known names that were meant."""

import difflib
from collections.abc import Collection, Sequence

from dynx.model.xml.source import SourceElement
from dynx.rules.text.number_text import is_number
from dynx.rules.text.numeric_attributes import MOMENTS

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
