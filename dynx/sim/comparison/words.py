"""Values of scenarios, robots and scenes in words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import ARRAY, Document, in_words

DIGITS = (6, 17)
"""Significant digits of numbers; the second are all that a float has, for numbers that the first do not tell
apart."""


def words_apart(ours: Any, theirs: Any) -> tuple[str, str]:
    """Describe two parts of a robot or a scene by the fields in which they differ."""
    if ours is None or theirs is None or not hasattr(ours, "__dataclass_fields__"):
        return _told_apart(words, ours, theirs)
    names = [each.name for each in fields(ours) if each.compare]
    apart = [name for name in names if getattr(ours, name) != getattr(theirs, name)]
    pairs = [_told_apart(words, getattr(ours, name), getattr(theirs, name)) for name in apart]
    mine, its = (", ".join(map(" ".join, zip(apart, each, strict=True))) for each in zip(*pairs, strict=True))
    return mine, its


def words(value: Any, digits: int = DIGITS[0]) -> str:
    """Describe a part of a robot or a scene."""
    if value is None:
        return "none"
    if isinstance(value, float):
        return f"{value:.{digits}g}"
    if isinstance(value, tuple) and all(isinstance(x, int | float) for x in value):
        return " ".join(f"{x:.{digits}g}" for x in value)
    if hasattr(value, "__dataclass_fields__"):
        parts = ((each.name, getattr(value, each.name)) for each in fields(value) if each.compare)
        return ", ".join(f"{name} {words(part, digits)}" for name, part in parts)
    return str(value)


def documents_apart(ours: Document, theirs: Document) -> tuple[str, str]:
    """Describe two values of a part of a scenario's document."""
    return _told_apart(document_in_words, ours, theirs)


def document_in_words(document: Document, digits: int = DIGITS[0]) -> str:
    """Describe a part of a scenario's document; equal numbers of a list stand once."""
    numbers = document[ARRAY] if isinstance(document, dict) and document.keys() == {ARRAY} else document
    if isinstance(numbers, list) and len(numbers) > 1 and all(isinstance(x, float) for x in numbers):
        shown = numbers[:1] if len(set(numbers)) == 1 else numbers
        return " ".join(f"{x:.{digits}g}" for x in shown)
    return in_words(document)


def plant_in_words(plant: str | ScenePlant, integrator: str | None) -> str:
    """Describe a plant by its engine and integrator, or by what its scene has."""
    if isinstance(plant, str):
        return f"{plant}, {integrator}"
    robots, bodies = ([each.name for each in kind] for kind in (plant.scene.robots, plant.scene.bodies))
    return f"{plant} with {', '.join([*robots, *bodies])}"


def _told_apart(describe: Callable[[Any, int], str], ours: Any, theirs: Any) -> tuple[str, str]:
    """Describe two values with as few digits as tell them apart."""
    pairs = [(describe(ours, digits), describe(theirs, digits)) for digits in DIGITS]
    return next((pair for pair in pairs if pair[0] != pair[1]), pairs[-1])
