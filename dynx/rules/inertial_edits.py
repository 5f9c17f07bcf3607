"""Writing ``<inertial>`` elements into a document, and moving inertia between links welded together."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.model.elements import Inertial
from dynx.model.xml_source import Edit, SourceElement, XmlSource
from dynx.rules.case import Case
from dynx.rules.central_inertia import CentralInertia
from dynx.rules.rigid_groups import RigidGroup

MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def number(value: float) -> str:
    """The shortest decimal that reads back as the same double; engines read no ``-0``."""
    return repr(float(value) + 0.0)


def zero_inertial() -> str:
    """The text of an ``<inertial>`` that says there is no mass."""
    moments = " ".join(f'{name}="0"' for name in MOMENTS)
    return f'<inertial>\n  <mass value="0"/>\n  <inertia {moments}/>\n</inertial>'


def inertial_edits(source: XmlSource, link: SourceElement, old: Inertial | None, new: Inertial) -> list[Edit]:
    """Edits that make a link say `new` where it says `old`; numbers that stay keep their spelling."""
    element = link.first("inertial")
    if old is None or element is None:
        return [source.inserting(link, _inertial_text(new), first=True)]
    edits = []
    origin = element.first("origin")
    for name in ("xyz", "rpy"):
        wanted = getattr(new.origin, name)
        if wanted == getattr(old.origin, name):
            continue
        text = " ".join(map(number, wanted))
        if origin is not None:
            edits.append(source.setting(origin, name, text))
    if origin is None and new.origin != old.origin:
        edits.append(source.inserting(element, _origin_text(new), first=True))
    mass, tensor = element.first("mass"), element.first("inertia")
    if mass is not None and new.mass != old.mass:
        edits.append(source.setting(mass, "value", number(new.mass)))
    if tensor is not None:
        changed = [name for name in MOMENTS if getattr(new, name) != getattr(old, name)]
        edits += [source.setting(tensor, name, number(getattr(new, name))) for name in changed]
    return edits


def with_inertials(case: Case, inertials: dict[str, Inertial]) -> Case:
    """The case with other inertials for the links named; a link that dynx does not know is left alone."""
    old = {link.name: link.inertial for link in case.model.links}
    edits: list[Edit] = []
    for name, inertial in inertials.items():
        edits += inertial_edits(case.source, case.links[name], old[name], inertial)
    return case.with_source(case.source.edited(*edits))


def without_mass(inertial: Inertial) -> Inertial:
    """The same element with a mass and moments of zero; its origin stays."""
    return Inertial(0.0, inertial.origin)


def lumped(case: Case, group: RigidGroup, links: Iterable[str], into: str) -> CentralInertia:
    """The inertia of links of a group together, in the frame of the link `into`."""
    inertials = {link.name: link.inertial for link in case.model.links}
    total: CentralInertia | None = None
    # The link itself first: where nothing has mass its centre stays.
    for name in sorted(links, key=lambda name: name != into):
        inertial = inertials[name]
        if inertial is not None:
            part = CentralInertia.of(inertial).seen_from(*group.pose(name, into))
            total = part if total is None else total + part
    return CentralInertia.of(Inertial()) if total is None else total


def line_of(case: Case, link: str, tag: str) -> int:
    """The line of an element inside the ``<inertial>`` of a link, or of what is around it."""
    element = case.links[link]
    for inner in ("inertial", tag):
        element = element.first(inner) or element
    return element.line


def _origin_text(inertial: Inertial) -> str:
    xyz, rpy = (" ".join(map(number, vector)) for vector in (inertial.origin.xyz, inertial.origin.rpy))
    return f'<origin xyz="{xyz}" rpy="{rpy}"/>'


def _inertial_text(inertial: Inertial) -> str:
    moments = " ".join(f'{name}="{number(getattr(inertial, name))}"' for name in MOMENTS)
    mass = f'<mass value="{number(inertial.mass)}"/>'
    lines = [_origin_text(inertial), mass, f"<inertia {moments}/>"]
    return "\n".join(["<inertial>", *(f"  {line}" for line in lines), "</inertial>"])
