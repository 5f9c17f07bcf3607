"""Elements of MJCF as rules see them: with the attributes of their classes, and with their body."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from dynx.model.elements import Inertial
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.expansion import read_document
from dynx.model.xml.reading import Element
from dynx.model.xml.source import SourceElement
from dynx.rules.case import Case
from dynx.rules.numbers_in_text import decimal
from dynx.rules.rule import Detection
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation


@dataclass(frozen=True)
class PartOfBody:
    """An element of the world or of a body, as it is given and with its defaults; `body` is None in the
    world, and for a body without a name."""

    given: Element
    resolved: Element
    body: str | None
    bodies: int
    """Number of bodies around the element."""


def mjcf_text(case: Case) -> MjcfText:
    """Return the document of a case in MJCF, with the files that it includes; raises the errors of `load`."""
    document = read_document(case.source.text_with_lines_before, case.source.source)
    assert document is not None, "the case is no MJCF"
    return document


def parts_of_bodies(document: MjcfText, *tags: str) -> Iterator[PartOfBody]:
    """Yield the elements of these tags in the world and in all bodies, in document order."""
    trees = reversed(document.root.all("worldbody"))
    waiting: list[tuple[Element, str | None, str | None, int]] = [(tree, None, None, 0) for tree in trees]
    while waiting:
        element, childclass, body, bodies = waiting.pop()
        if element.tag in tags:
            has_class = element.tag in ("geom", "joint", "site")
            resolved = document.resolved(element, childclass) if has_class else element
            yield PartOfBody(element, resolved, body, bodies)
        inner = element.attributes.get("childclass", childclass)
        if element.tag == "body":
            body, bodies = element.attributes.get("name"), bodies + 1
        waiting += [(child, inner, body, bodies) for child in reversed(element.children)]


def free_joints_with(document: MjcfText, attribute: str, what: str) -> Iterator[Detection]:
    """Yield the free joints that state a coefficient other than 0, which acts on the floating base."""
    for part in parts_of_bodies(document, "joint"):
        numbers = part.resolved.attributes.get(attribute, "0").split()
        if part.resolved.attributes.get("type") == "free" and any(map(float, numbers)):
            name = part.given.attributes.get("name") or (part.body and f"{part.body}_joint")
            message = f"the free joint has {what} {numbers[0]}"
            yield found_in(document, part.given, message, link=part.body, joint=name)


def found_in(document: MjcfText, element: Element, message: str, **place: str | None) -> Detection:
    """Return the detection in an element of the document; one of another file is named with that file."""
    source = document.reading.source_of(element)
    here = source == document.reading.source
    message = message if here else f"{message} ({source}, line {element.line})"
    return Detection(place.get("link"), place.get("joint"), element.line if here else None, message)


@dataclass(frozen=True, eq=False)
class BodyInText:
    """A body of the text of the case itself, not of an included file, which edits can change.

    `name` is that of its link; None where it is not known, because an ``<include>``, ``<attach>`` or
    ``<replicate>`` before it adds bodies. `childclass` is the class of defaults of its children.
    """

    element: SourceElement
    name: str | None
    childclass: str | None

    def children(self, *tags: str) -> list[SourceElement]:
        """Return the children of these tags, not those in a ``<frame>``."""
        return [child for child in self.element.children if child.tag in tags]


def bodies_in_text(case: Case, document: MjcfText) -> list[BodyInText]:
    """List the bodies in the text of a case, in document order."""
    found: list[BodyInText] = []
    trees = reversed(case.source.root.all("worldbody"))
    waiting: list[tuple[SourceElement, str | None]] = [(tree, None) for tree in trees]
    bodies, counted = (
        0,
        not any(each.tag in ("include", "replicate", "attach") for each in case.source.root.walk()),
    )
    while waiting:
        element, childclass = waiting.pop()
        inner = element.attributes.get("childclass", childclass)
        if element.tag == "body":
            bodies += 1
            number = f"body_{bodies}" if counted else None
            found.append(BodyInText(element, element.attributes.get("name", number), inner))
        if element.tag in ("worldbody", "body", "frame"):
            waiting += [(child, inner) for child in reversed(element.children)]
    return found


def with_defaults(document: MjcfText, element: SourceElement, childclass: str | None) -> dict[str, str]:
    """Return the attributes of an element, with those that it has from its class of defaults."""
    plain = Element(element.tag, dict(element.attributes), element.line)
    return dict(document.resolved(plain, childclass).attributes)


def inertial_text(inertial: Inertial) -> str:
    """Write an inertial as an element of MJCF, about the axes of the body."""
    tensor = inertial.link_tensor
    products = (tensor[0, 1], tensor[0, 2], tensor[1, 2])
    moments = np.diagonal(tensor)
    inertia = f'diaginertia="{decimals(moments)}"'
    if any(products):
        inertia = f'fullinertia="{decimals([*moments, *products])}"'
    return f'<inertial pos="{decimals(inertial.origin.xyz)}" mass="{decimals([inertial.mass])}" {inertia}/>'


def decimals(numbers: Iterable[float]) -> str:
    """Write numbers as an attribute, each with the fewest digits that keep it."""
    return " ".join(map(decimal, numbers))


def quaternion_text(R: Floats) -> str:
    """Write a rotation (3, 3) as the attribute ``quat``: w, x, y, z."""
    x, y, z, w = quat_from_rotation(R)
    return decimals((w, x, y, z))
