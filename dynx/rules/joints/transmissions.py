"""The ``<transmission>`` elements of which Drake makes actuators."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.model.xml.source import SourceElement
from dynx.rules.case import Case
from dynx.rules.text.attributes import number_or_none
from dynx.rules.text.element_text import text_in

_SIMPLE = "SimpleTransmission"


def type_of(case: Case, transmission: SourceElement) -> str | None:
    """Return the type, which is an attribute or an element; None where there is neither, or no text
    in the element."""
    element = transmission.first("type")
    if "type" in transmission.attributes:
        return transmission.attributes["type"]
    return None if element is None else text_in(case.source, element) or None


def transmissions_drake_reads(case: Case) -> Iterator[SourceElement]:
    """Yield transmissions of the one type that Drake reads, with any prefix, and those without a type."""
    for transmission in case.source.root.all("transmission"):
        kind = type_of(case, transmission)
        if kind is None or _SIMPLE in kind:
            yield transmission


def moves_by_actuator(case: Case, transmission: SourceElement) -> bool:
    """Check whether Drake makes an actuator: not for a fixed joint, nor for an effort limit of 0."""
    named = transmission.first("joint")
    joint = None if named is None else case.joints.get(named.attributes.get("name", ""))
    if joint is None or joint.attributes.get("type") == "fixed":
        return False
    limit = joint.first("limit")
    return limit is None or number_or_none(limit, "effort") != 0.0
