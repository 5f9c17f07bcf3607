"""Files that Drake must not be asked to load, found before it is.

Drake answers most faults with an exception, but some trip an internal check (``DRAKE_DEMAND``). In C++
that ends the process; pydrake makes ``SystemExit`` of it, so a program ends that catches ``Exception``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

from dynx.errors import EngineError, ModelError, located, shown
from dynx.files.reading import read_file
from dynx.loaded.opening import require_file
from dynx.model import Model
from dynx.model.xml.source import SourceElement, XmlSource

MAX_LINKS = 2000
"""Most links: the time to load grows with the square of their number and nothing can stop it."""

_MOVING = ("revolute", "continuous", "prismatic")


def require_harmless(path: Path, model: Model) -> None:
    """Raise EngineError for a file that Drake would end the process on, or that fits no question."""
    require_file(path)
    if len(model.links) > MAX_LINKS:
        raise EngineError(f"{model.name} has {len(model.links)} links; drake is given at most {MAX_LINKS}")
    _require_own_world(model)
    try:
        source = XmlSource(read_file(str(path)), str(path))
    except ModelError as error:
        raise EngineError(f"drake is not given what is no XML: {error}") from error
    for message, line in _fatal(source):
        raise EngineError(located(f"drake would end the process: {message}", str(path), line))


def _require_own_world(model: Model) -> None:
    """Drake takes a link named ``world`` for its world, which neither moves nor hangs from a joint."""
    if "world" not in {link.name for link in model.links}:
        return
    if model.root != "world":
        raise EngineError(
            f"drake takes the link 'world' of {model.name} for the world itself, so that the robot hangs "
            "from there and not from its root"
        )
    if model.floating:
        raise EngineError(
            f"drake takes the link 'world' of {model.name} for the world itself, so its base cannot float"
        )


def _fatal(source: XmlSource) -> Iterator[tuple[str, int]]:
    root = source.root
    if root.attributes.get("name") == "":
        yield "the robot's name is empty", root.line
    for transmission in root.all("transmission"):
        kind = transmission.first("type")
        # Its text is taken without a look whether there is any.
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
    """Whether text, of more than blanks, stands in an element before any other; comments do not count."""
    if element.empty:
        return False
    end = (
        element.children[0].span.start if element.children else source.data.rindex(b"</", 0, element.span.end)
    )
    inside = source.data[element.start_tag.end : end]
    return bool(re.sub(rb"<!--.*?-->", b"", inside, flags=re.DOTALL).strip())


def _number(element: SourceElement, attribute: str, default: float) -> float:
    """The attribute as a number; the default where there is none, or none that Drake would take."""
    try:
        value = float(element.attributes.get(attribute, default))
    except ValueError:
        return default
    return default if math.isnan(value) else value
