"""Values of scenarios, robots and scenes in words."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from dynx.sim.scenario.documents import ARRAY, Document, in_words


def words_apart(ours: Any, theirs: Any) -> tuple[str, str]:
    """Describe two parts of a robot or a scene by the fields in which they differ."""
    if ours is None or theirs is None or not hasattr(ours, "__dataclass_fields__"):
        mine, its = ("none" if each is None else words(each) for each in (ours, theirs))
        return mine, its
    names = [each.name for each in fields(ours) if each.compare]
    apart = [name for name in names if getattr(ours, name) != getattr(theirs, name)]
    mine, its = (
        ", ".join(f"{name} {words(getattr(each, name))}" for name in apart) for each in (ours, theirs)
    )
    return mine, its


def words(value: Any) -> str:
    """Describe a part of a robot or a scene."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, tuple) and all(isinstance(x, float) for x in value):
        return " ".join(f"{x:.6g}" for x in value)
    if hasattr(value, "__dataclass_fields__"):
        parts = ((each.name, getattr(value, each.name)) for each in fields(value) if each.compare)
        return ", ".join(f"{name} {words(part)}" for name, part in parts)
    return str(value)


def document_in_words(document: Document) -> str:
    """Describe a part of a scenario's document; equal numbers of a list stand once."""
    numbers = document[ARRAY] if isinstance(document, dict) and document.keys() == {ARRAY} else document
    if isinstance(numbers, list) and len(numbers) > 1 and all(isinstance(x, float) for x in numbers):
        return f"{numbers[0]:.6g}" if len(set(numbers)) == 1 else " ".join(f"{x:.6g}" for x in numbers)
    return in_words(document)
