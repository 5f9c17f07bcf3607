"""Strict readers of attributes of a description (names, numbers, vectors), with the line in each error."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass, field

from dynx.errors import DescriptionError, UnsupportedFeatureError, escaped, shown
from dynx.model.elements import Note, Vector
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.model.xml.reading import Element

MAX_NAME = 1000
"""Largest length of a name [characters]; 1,264 characters overflow PyBullet's stack."""

DECIMAL = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
"""Decimal number of a description, whose match takes linear time."""

_NOT_IN_XML = "\ufffe\uffff"
_XACRO = "; xacro did not expand it"
_WHY_IGNORED = {"loop_joint": "; the loop that it closes stays open"}
_COUNTS = {1: "one", 2: "two", 3: "three", 4: "four", 5: "five", 6: "six", 7: "seven"}


@dataclass
class Reading:
    """State of reading one document: its source, and the notes for the user.

    `quaternions` says whether the version of its robot gives ``quat_xyzw`` a meaning.
    """

    source: str
    notes: list[Note] = field(default_factory=list)
    quaternions: bool = False
    _ignored: dict[tuple[str, str], tuple[int, int]] = field(default_factory=dict)

    def error(self, element: Element, message: str) -> DescriptionError:
        """Return the error to raise about `element`."""
        return DescriptionError(message, source=self.source, line=element.line)

    def unsupported(self, element: Element, message: str) -> UnsupportedFeatureError:
        """Return the error to raise about a feature that dynx does not support."""
        return UnsupportedFeatureError(message, source=self.source, line=element.line)

    def note(self, element: Element, message: str) -> None:
        """Add a note on how `element` was read."""
        self.notes.append(Note(message, element.line))

    def ignore_unknown(self, parent: Element, known: Iterable[str]) -> None:
        """Count the elements in `parent` that are not `known`, for one note per tag."""
        for child in parent.children:
            if child.tag not in known:
                count, line = self._ignored.get((parent.tag, child.tag), (0, child.line))
                self._ignored[parent.tag, child.tag] = (count + 1, line)

    def note_ignored(self) -> None:
        """Convert the counts of `ignore_unknown` since the last call to notes."""
        for (inside, tag), (count, line) in self._ignored.items():
            times = "" if count == 1 else f" ({count} times)"
            why = _WHY_IGNORED.get(tag, _XACRO if tag.startswith("xacro:") else "")
            message = f"unknown element <{escaped(tag)}> in <{inside}> was ignored{times}{why}"
            self.notes.append(Note(message, line))
        self._ignored.clear()

    def only(self, parent: Element, tag: str) -> Element | None:
        """Return the element of that tag, or None; the first, with a note, if there are several."""
        found = parent.all(tag)
        if len(found) > 1:
            self.note(found[1], f"<{parent.tag}> has {len(found)} <{tag}>; the first is used, as engines do")
        return found[0] if found else None

    def required(self, parent: Element, tag: str, what: str) -> Element:
        """Return the element of that tag; raise an error if it is missing."""
        found = self.only(parent, tag)
        if found is None:
            raise self.error(parent, f"{what} has no <{tag}>")
        return found

    def attribute(self, element: Element, name: str, what: str) -> str:
        """Return a required attribute; raise an error if it is missing."""
        value = element.attributes.get(name)
        if value is None:
            others = ", ".join(map(shown, list(element.attributes)[:3]))
            hint = f"; it has {others}" if others else ""
            raise self.error(element, f"<{element.tag}> of {what} has no attribute {name}{hint}")
        return value

    def name(self, element: Element, attribute: str, what: str) -> str:
        """Return a required attribute that is a name; raise an error if it is missing or invalid."""
        value = element.attributes.get(attribute)
        if value is None:
            raise self.error(element, f'{what} has no {attribute}; wanted {attribute}="..."')
        fault = name_fault(value)
        if fault is not None:
            raise self.error(element, f"the {attribute} of {what} {fault}")
        return value

    def number(self, element: Element, attribute: str, what: str, *, bound: float = MAX_MAGNITUDE) -> float:
        """Return a required attribute that is one finite number below `bound` in magnitude; raise an error
        otherwise."""
        text = self.attribute(element, attribute, what)
        value = self._parsed(element, attribute, text, what, "a number")
        self._require_below(bound, (value,), element, attribute, what)
        return value

    def number_or(
        self, element: Element, attribute: str, what: str, default: float, *, bound: float = MAX_MAGNITUDE
    ) -> float:
        """Return an attribute as `number` does, or `default` if it is missing."""
        if attribute not in element.attributes:
            return default
        return self.number(element, attribute, what, bound=bound)

    def vector(self, element: Element, attribute: str, what: str, *, bound: float = MAX_MAGNITUDE) -> Vector:
        """Return a required attribute of three finite numbers below `bound` in magnitude; raise an error
        otherwise."""
        x, y, z = self.numbers(element, attribute, what, 3)
        self._require_below(bound, (x, y, z), element, attribute, what)
        return (x, y, z)

    def numbers(self, element: Element, attribute: str, what: str, count: int) -> tuple[float, ...]:
        """Return a required attribute of `count` finite numbers; raise an error otherwise."""
        text = self.attribute(element, attribute, what)
        words = text.split()
        wanted = f"{_COUNTS.get(count, count)} numbers separated by white space"
        if len(words) != count:
            raise self._unreadable(element, attribute, text, what, wanted)
        return tuple(self._parsed(element, attribute, word, what, wanted, text) for word in words)

    def _parsed(
        self, element: Element, attribute: str, word: str, what: str, wanted: str, text: str | None = None
    ) -> float:
        word = word.strip()
        if DECIMAL.fullmatch(word):
            value = float(word)
            if math.isfinite(value):
                return value
        raise self._unreadable(element, attribute, word if text is None else text, what, wanted)

    def _require_below(
        self, bound: float, values: tuple[float, ...], element: Element, attribute: str, what: str
    ) -> None:
        if not all(abs(value) < bound for value in values):
            text = shown(element.attributes[attribute])
            raise self.error(
                element,
                f"{attribute} in <{element.tag}> of {what} is {text}; wanted less than {bound:g} in "
                "magnitude, since products of larger numbers overflow",
            )

    def _unreadable(
        self, element: Element, attribute: str, text: str, what: str, wanted: str
    ) -> DescriptionError:
        hint = ""
        if "${" in text or "$(" in text:
            hint = (
                "; this is xacro that was not expanded: copy the file, in its folder, to a name that ends in "
                ".xacro, which dynx expands; in URDF, dynx doctor --fix writes values that the file states"
            )
        elif "," in text:
            hint = "; decimals take a point, and numbers are separated by white space"
        message = f"{attribute} in <{element.tag}> of {what} is {shown(text)}; wanted {wanted}{hint}"
        return self.error(element, message)


def name_fault(name: str) -> str | None:
    """Return why a name is invalid, or None if it is valid."""
    if not name:
        return "is empty"
    if len(name) > MAX_NAME:
        return f"has {len(name)} characters; at most {MAX_NAME} are accepted"
    for character in name:
        if unicodedata.category(character) in ("Cc", "Cs", "Zl", "Zp") or character in _NOT_IN_XML:
            return f"is {shown(name)}, which contains the control character U+{ord(character):04X}"
    return None
