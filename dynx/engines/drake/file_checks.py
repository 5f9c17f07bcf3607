"""Checks for files that Drake must not load.

For most faults Drake raises an exception, but some fail an internal check (``DRAKE_DEMAND``). In C++ that
ends the process; pydrake raises ``SystemExit``, which also ends programs that catch ``Exception``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

from dynx.errors import EngineError, ModelError, UnusableEngineError, located, shown
from dynx.files.reading import read_file
from dynx.loaded.robot import require_file
from dynx.model import Model
from dynx.model.xml.source import SourceElement, XmlSource

MAX_LINKS = 2000
"""Largest number of links: the time to load grows with its square, and loading cannot be interrupted."""

_MOVING = ("revolute", "continuous", "prismatic")


def require_harmless(path: Path, model: Model) -> None:
    """Raise EngineError for a file on which Drake would end the process or misplace the robot."""
    require_file(path)
    if len(model.links) > MAX_LINKS:
        count = len(model.links)
        raise UnusableEngineError(f"{model.name} has {count} links; drake can load at most {MAX_LINKS}")
    _require_own_world(model)
    try:
        source = XmlSource(read_file(str(path)), str(path))
    except ModelError as error:
        raise EngineError(f"drake cannot load a file that is not XML: {error}") from error
    for message, line in _fatal_faults(source):
        raise UnusableEngineError(located(f"drake would end the process: {message}", str(path), line))


def _require_own_world(model: Model) -> None:
    """Raise EngineError if Drake would mistake a link named ``world`` for its world."""
    if "world" not in {link.name for link in model.links}:
        return
    if model.root != "world":
        raise UnusableEngineError(
            f"drake mistakes the link 'world' of {model.name} for the world itself, so the robot is attached "
            "there and not at its root"
        )
    if model.floating:
        raise UnusableEngineError(
            f"drake mistakes the link 'world' of {model.name} for the world itself, so its base cannot float"
        )


def _fatal_faults(source: XmlSource) -> Iterator[tuple[str, int]]:
    root = source.root
    if root.attributes.get("name") == "":
        yield "the robot's name is empty", root.line
    for transmission in root.all("transmission"):
        kind = transmission.first("type")
        # Drake does not check whether the element has text.
        if kind is not None and "type" not in transmission.attributes and not _begins_with_text(source, kind):
            yield "the <type> of a <transmission> has no text", kind.line
    for joint in root.all("joint"):
        if joint.attributes.get("type") not in _MOVING:
            continue
        name = shown(joint.attributes.get("name", ""))
        for limit in joint.all("limit")[:1]:
            lower, upper = _number(limit, "lower", -math.inf), _number(limit, "upper", math.inf)
            if lower > upper:
                yield f"joint {name} has lower limit {lower:g} above its upper limit {upper:g}", limit.line
            for bound in ("velocity", "drake:acceleration"):
                value = _number(limit, bound, math.inf)
                if value < 0.0:
                    yield f"joint {name} has a negative limit, {bound} {value:g}", limit.line


def _begins_with_text(source: XmlSource, element: SourceElement) -> bool:
    """Check whether an element begins with text, other than blanks and comments."""
    if element.empty:
        return False
    end = (
        element.children[0].span.start if element.children else source.data.rindex(b"</", 0, element.span.end)
    )
    inside = source.data[element.start_tag.end : end]
    return bool(re.sub(rb"<!--.*?-->", b"", inside, flags=re.DOTALL).strip())


def _number(element: SourceElement, attribute: str, default: float) -> float:
    """Return the attribute as a number; the default where it is absent or not a number."""
    try:
        value = float(element.attributes.get(attribute, default))
    except ValueError:
        return default
    return default if math.isnan(value) else value
