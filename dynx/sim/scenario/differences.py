"""Attributes in which two documents, or two models, differ."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

from dynx.errors import shown
from dynx.model import Model
from dynx.sim.scenario.documents import CLASS, CODE, CONTROLLER, FINGERPRINT, MODEL, NUMBERS, Document


def parts_of(document: Document) -> dict[str, Document] | None:
    """Parts of the document of an object by name, equal names for one class; None for no object."""
    if not isinstance(document, dict):
        return None
    code = {"code of the class": document[CODE]} if CODE in document else {}
    if CLASS in document:
        return {f"class {document[CLASS]}": True, **document["fields"], **code}
    if CONTROLLER in document:
        given = dict(document[CONTROLLER])
        return {f"class {given.pop(CONTROLLER)}": True, MODEL: document.get(MODEL), **given, **code}
    if FINGERPRINT in document:
        return {f"class {document[FINGERPRINT]}": True, **document.get(NUMBERS, {}), **code}
    return None


def model_difference(ours: Model, theirs: Model) -> tuple[str, str, str]:
    """Name of the first attribute in which two models differ, and its two values."""
    for name in ("name", "base", "gravity", "links", "joints", "extra_frames"):
        pair = getattr(ours, name), getattr(theirs, name)
        if pair[0] != pair[1]:
            return _innermost(name, *pair)
    return "model", shown(ours), shown(theirs)


def _innermost(name: str, ours: Any, theirs: Any) -> tuple[str, str, str]:
    """The first attribute inside two values in which they differ."""
    if is_dataclass(ours) and type(ours) is type(theirs):
        for each in fields(ours):
            pair = getattr(ours, each.name), getattr(theirs, each.name)
            if each.compare and pair[0] != pair[1]:
                return _innermost(f"{each.name} of {name}", *pair)
    if name in ("links", "joints", "extra_frames"):
        known = [[each.name for each in side] for side in (ours, theirs)]
        if known[0] != known[1]:
            mine, its = (shown(", ".join(names)) for names in known)
            return name, mine, its
        word = {"links": "link", "joints": "joint", "extra_frames": "frame"}[name]
        one, other = next(pair for pair in zip(ours, theirs, strict=True) if pair[0] != pair[1])
        return _innermost(f"{word} {shown(one.name)}", one, other)
    return name, str(ours), str(theirs)
