"""``<contact>`` of MJCF: the bodies that are excluded from contact, and the pairs of geoms that touch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from dynx.model.geometry.links import ContactFilter, ShapeNumber
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.shapes import Geom
from dynx.model.xml.reading import Element


@dataclass(frozen=True)
class StatedContacts:
    """Excluded pairs of bodies, pairs of geoms, and flags of contact that a file states, by its own names."""

    excluded: Mapping[tuple[str, str], Element]
    paired: Mapping[tuple[str, str], Element]
    enabled: bool
    filters_parents: bool

    @property
    def paired_geoms(self) -> frozenset[str]:
        """Names of the geoms of all pairs."""
        return frozenset(name for pair in self.paired for name in pair)

    def of_robot(
        self, links: Mapping[str, str], geoms: Mapping[str, Sequence[Geom]]
    ) -> tuple[ContactFilter, list[Element]]:
        """Return the filter of a robot, and the elements that name what it has not.

        `links` are its links by the names of bodies, `geoms` those of each link that collide.
        """
        numbers: dict[str, ShapeNumber] = {
            each.name: (link, number)
            for link, found in geoms.items()
            for number, each in enumerate(found)
            if each.name
        }
        found = ContactFilter(
            {
                link: tuple((each.contact.contype, each.contact.conaffinity) for each in shapes)
                for link, shapes in geoms.items()
            },
            tuple((links[a], links[b]) for a, b in self.excluded if a in links and b in links),
            tuple((numbers[a], numbers[b]) for a, b in self.paired if a in numbers and b in numbers),
            self.enabled,
            self.filters_parents,
        )
        left = [
            element
            for known, elements in ((links, self.excluded), (numbers, self.paired))
            for pair, element in elements.items()
            if not all(name in known for name in pair)
        ]
        return found, left

    @property
    def parameters(self) -> Element | None:
        """The first pair that states more than its geoms; its parameters are not read."""
        stated = (each for each in self.paired.values() if set(each.attributes) - {"name", "geom1", "geom2"})
        return next(stated, None)


def read_contacts(document: MjcfText) -> StatedContacts:
    """Read ``<contact>`` of a document. Raises DescriptionError for an element that names no two."""
    reading = document.reading
    found: dict[str, dict[tuple[str, str], Element]] = {"exclude": {}, "pair": {}}
    for element in document.sections("contact"):
        if element.tag in found:
            ends = ("body1", "body2") if element.tag == "exclude" else ("geom1", "geom2")
            first, second = (reading.attribute(element, end, f"<{element.tag}>") for end in ends)
            found[element.tag][first, second] = element
    enabled, parents = (document.options.disabled(each) is None for each in ("contact", "filterparent"))
    return StatedContacts(found["exclude"], found["pair"], enabled, parents)
