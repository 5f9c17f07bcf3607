"""What dynx states of a robot in MJCF that the format has no element for, in ``<custom>``.

MuJoCo keeps such numbers and texts and gives them no meaning. Each has the name ``dynx:KIND:NAME``, with the
kinds of `NUMBERS` and `TEXTS`. The equality constraint of a mimic joint is named ``dynx:mimic:JOINT``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element as Written
from xml.etree.ElementTree import SubElement

from dynx.errors import nearest, shown
from dynx.model.mjcf.attributes import text
from dynx.model.xml.reading import Element
from dynx.model.xml.values import Reading

PREFIX = "dynx:"
"""Beginning of the names that are those of dynx."""

MIMIC = f"{PREFIX}mimic:"
"""Beginning of the name of the equality constraint of a mimic joint."""

NUMBERS = ("lower", "upper", "velocity", "effort", "locked")
"""Kinds of numbers, by the name of a joint: its limits of position [rad or m] where ``range`` cannot say them
and of effort [N m or N] where ``actuatorfrcrange`` cannot, its largest speed [rad/s or m/s], the position
[rad or m] at which it was locked."""

TEXTS = ("root", "name", "fixed", "link")
"""Kinds of texts: the body of the root link, and the name of that link where the body cannot have it (both
without a name), the name of a fixed joint by that of its link, and that of a link between two joints of one
body by the joint that moves it."""


@dataclass(frozen=True)
class Extension:
    """The statements of one robot, by their kinds and names."""

    numbers: dict[str, dict[str, float]] = field(default_factory=lambda: {kind: {} for kind in NUMBERS})
    texts: dict[str, dict[str, str]] = field(default_factory=lambda: {kind: {} for kind in TEXTS})

    def write(self, root: Written) -> None:
        """Add the section to a document, unless nothing is stated."""
        numbers, texts = ([*_entries(each)] for each in (self.numbers, self.texts))
        if not numbers and not texts:
            return
        section = SubElement(root, "custom")
        for name, number in numbers:
            SubElement(section, "numeric", name=name, data=number)
        for name, word in texts:
            SubElement(section, "text", name=name, data=word)

    @classmethod
    def read(cls, elements: Iterator[Element], reading: Reading) -> Extension:
        """Read the statements among the elements of ``<custom>``; others are left alone.

        Raises DescriptionError for a kind that dynx does not have, and for a number that is none.
        """
        found = cls()
        for element in elements:
            name = element.attributes.get("name", "")
            if not name.startswith(PREFIX):
                continue
            kind, _, of = name.removeprefix(PREFIX).partition(":")
            what = f"<{element.tag}> {shown(name)}"
            if element.tag == "numeric" and kind in NUMBERS:
                (found.numbers[kind][of],) = reading.numbers(element, "data", what, 1)
            elif element.tag == "text" and kind in TEXTS:
                found.texts[kind][of] = reading.name(element, "data", what)
            else:
                known = NUMBERS if element.tag == "numeric" else TEXTS
                raise reading.error(
                    element,
                    f"{what} is no statement of dynx{nearest(kind, known)}",
                )
        return found


def _entries(statements: Mapping[str, Mapping[str, float | str]]) -> Iterator[tuple[str, str]]:
    for kind, by_name in statements.items():
        for name, value in by_name.items():
            yield f"{PREFIX}{kind}:{name}" if name else f"{PREFIX}{kind}", text(value)
