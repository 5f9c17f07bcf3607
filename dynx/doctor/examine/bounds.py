"""Bounds of what is examined: engines and proofs load a file dozens of times, and engines are recursive."""

from __future__ import annotations

from itertools import count

from dynx.errors import DescriptionError
from dynx.model.xml.source import SourceElement, XmlSource

MAX_BYTES = 8 * 1024 * 1024
"""Largest text [bytes]; the largest description in public use has less than 2 MiB."""

MAX_ELEMENTS = 100_000
"""Largest number of elements."""

MAX_LINKS = 1000
"""Largest number of links."""

MAX_CHAIN = 500
"""Largest number of links between the root and a tip: a chain of 3,800 ends the process in Pinocchio 4.1."""


def require_bounded(source: XmlSource) -> None:
    """Raise DescriptionError for a document larger than is examined."""
    if len(source.data) > MAX_BYTES:
        _refuse(source, None, f"has {len(source.data)} bytes; at most {MAX_BYTES} are examined")
    for number, element in enumerate(source.root.walk()):
        if number >= MAX_ELEMENTS:
            _refuse(source, element, f"has more than {MAX_ELEMENTS} elements, the most that are examined")
    links = source.root.all("link")
    if len(links) > MAX_LINKS:
        excess = links[MAX_LINKS]
        _refuse(source, excess, f"has {len(links)} links; at most {MAX_LINKS} are examined")
    _require_short_chains(source)


def _require_short_chains(source: XmlSource) -> None:
    carried = {_link(joint, "child"): joint for joint in source.root.all("joint")}
    below: dict[str, list[str]] = {}
    for child, joint in carried.items():
        below.setdefault(_link(joint, "parent"), []).append(child)
    # Links of a cycle are below no root, so that they are not reached.
    level = [name for name in below if name not in carried]
    for depth in count():
        if not level:
            return
        if depth > MAX_CHAIN:
            chain = f"has a chain of more than {MAX_CHAIN} links, the most that are examined"
            _refuse(source, carried[level[0]], chain)
        level = [child for name in level for child in below.get(name, ())]


def _link(joint: SourceElement, role: str) -> str:
    element = joint.first(role)
    return "" if element is None else element.attributes.get("link", "")


def _refuse(source: XmlSource, element: SourceElement | None, message: str) -> None:
    line = None if element is None else element.line
    raise DescriptionError(message, source=source.source, line=line)
