"""Edits that write ``<inertial>`` elements into a document."""

from __future__ import annotations

from dynx.model.elements import Inertial, Vector
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.case import Case
from dynx.rules.text.attributes import orientation_edits
from dynx.rules.text.number_text import decimal, is_number
from dynx.rules.text.numeric_attributes import MOMENTS

ZERO_TENSOR = "<inertia {}/>".format(" ".join(f'{name}="0"' for name in MOMENTS))


def zero_inertial() -> str:
    """Return the text of an ``<inertial>`` without mass and moments."""
    return f'<inertial>\n  <mass value="0"/>\n  {ZERO_TENSOR}\n</inertial>'


def inertial_edits(source: XmlSource, link: SourceElement, old: Inertial | None, new: Inertial) -> list[Edit]:
    """Replace the inertial `old` of a link by `new`; unchanged numbers keep their spelling."""
    element = link.first("inertial")
    if old is None or element is None:
        return [source.insertion(link, _inertial_text(new), first=True)]
    edits = []
    origin = element.first("origin")
    for name in ("xyz", "rpy"):
        wanted = getattr(new.origin, name)
        if wanted == getattr(old.origin, name):
            continue
        if origin is None:
            continue
        if name == "rpy":
            edits += orientation_edits(source, origin, wanted)
        else:
            edits.append(
                source.attribute_edit(origin, name, _vector_text(origin.attributes.get(name), wanted))
            )
    if origin is None and new.origin != old.origin:
        edits.append(source.insertion(element, _origin_text(new), first=True))
    mass, tensor = element.first("mass"), element.first("inertia")
    if mass is not None and new.mass != old.mass:
        edits.append(source.attribute_edit(mass, "value", decimal(new.mass)))
    if tensor is not None:
        changed = [name for name in MOMENTS if getattr(new, name) != getattr(old, name)]
        edits += [source.attribute_edit(tensor, name, decimal(getattr(new, name))) for name in changed]
    return edits


def with_inertials(case: Case, inertials: dict[str, Inertial]) -> Case:
    """Return the case with these inertials, by link name."""
    edits: list[Edit] = []
    for name, inertial in inertials.items():
        edits += inertial_edits(case.source, case.links[name], case.inertials[name], inertial)
    return case.with_source(case.source.apply(*edits))


def line_of(case: Case, link: str, tag: str) -> int:
    """Find the line of an element inside the ``<inertial>`` of a link, or of the nearest one around it."""
    element = case.links[link]
    for inner in ("inertial", tag):
        element = element.first(inner) or element
    return element.line


def _vector_text(written: str | None, wanted: Vector) -> str:
    """Write a vector; numbers that stay as they are keep their spelling."""
    words = (written or "").split()
    if len(words) != len(wanted):
        return " ".join(map(decimal, wanted))
    return " ".join(
        word if is_number(word) and float(word) == value else decimal(value)
        for word, value in zip(words, wanted, strict=True)
    )


def _origin_text(inertial: Inertial) -> str:
    xyz, rpy = (" ".join(map(decimal, vector)) for vector in (inertial.origin.xyz, inertial.origin.rpy))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _inertial_text(inertial: Inertial) -> str:
    moments = " ".join(f'{name}="{decimal(getattr(inertial, name))}"' for name in MOMENTS)
    mass = f'<mass value="{decimal(inertial.mass)}"/>'
    lines = [_origin_text(inertial), mass, f"<inertia {moments}/>"]
    return "\n".join(["<inertial>", *(f"  {line}" for line in lines), "</inertial>"])
