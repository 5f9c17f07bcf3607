"""The ``<transmission>`` elements of which Drake makes actuators."""

from __future__ import annotations

from collections.abc import Iterator

from dynx.model.xml_source import SourceElement
from dynx.rules.case import Case
from dynx.rules.element_text import text_in

_SIMPLE = "SimpleTransmission"


def type_of(case: Case, transmission: SourceElement) -> str | None:
    """The type, which is an attribute or an element; None where there is neither."""
    element = transmission.first("type")
    if "type" in transmission.attributes:
        return transmission.attributes["type"]
    return None if element is None else text_in(case.source, element)


def transmissions_drake_reads(case: Case) -> Iterator[SourceElement]:
    """Those of the one type that it knows, whatever is in front of it, and those without a type."""
    for transmission in case.source.root.all("transmission"):
        kind = type_of(case, transmission)
        if kind is None or _SIMPLE in kind:
            yield transmission
