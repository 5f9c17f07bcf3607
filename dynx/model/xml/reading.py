"""One hardened reading of XML: a tree of elements that know their lines, or one clear error.

Expat does the parsing, without namespaces (so an undeclared prefix is no error) and without a
document type (so there are no entities to expand or to fetch). Nothing here recurses.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from xml.parsers import expat

from dynx.errors import DescriptionError, escaped
from dynx.model.elements import Note
from dynx.model.xml.text import decode, without_ends

MAX_DEPTH = 256
"""Deepest nesting of elements; URDF itself needs 6."""

MAX_ELEMENTS = 2_000_000
"""Most elements in one document; it bounds memory."""


@dataclass(slots=True)
class Element:
    """An XML element: tag with its prefix, attributes, line, and the elements directly inside."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)

    def all(self, tag: str) -> list[Element]:
        """The elements of that tag directly inside, in document order."""
        return [child for child in self.children if child.tag == tag]


def read_xml(
    data: str | bytes,
    source: str,
    notes: list[Note],
    *,
    opaque: Collection[str] = (),
    at_most: Mapping[str, int] | None = None,
) -> Element:
    """The root element of a document.

    What is inside an element whose tag is in `opaque` is checked but not kept. `at_most` bounds how
    often a tag may occur directly below the root. Notes are added to `notes`. Raises
    DescriptionError for what is not XML, is cut off, has a document type, nests deeper than
    MAX_DEPTH, or holds more elements than MAX_ELEMENTS or `at_most` allows.
    """
    text = decode(data, source, notes) if isinstance(data, bytes) else data
    text, first = without_ends(text, notes)
    return _TreeBuilder(source, first, opaque, at_most or {}).build(text)


class _TreeBuilder:
    """Collects what expat reports; `first` lines were taken away in front of the text."""

    def __init__(self, source: str, first: int, opaque: Collection[str], at_most: Mapping[str, int]) -> None:
        self._source, self._first = source, first
        self._opaque, self._left = frozenset(opaque), dict(at_most)
        self._at_most = at_most
        self._open: list[Element] = []
        self._depth = 0
        self._hidden_below: int | None = None
        self._count = 0
        self._root: Element | None = None
        self._parser = expat.ParserCreate(encoding="utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype

    def build(self, text: str) -> Element:
        try:
            self._parser.Parse(text.encode("utf-8"), True)
        except expat.ExpatError as error:
            raise self._error(
                _said_plainly(error.code, self._root is not None), self._first + error.lineno
            ) from None
        except UnicodeEncodeError as error:
            line = self._first + text.count("\n", 0, error.start) + 1
            raise self._error("holds half of a surrogate pair, which is no character", line) from None
        finally:
            # The handlers are methods of this object: without this the two keep each other alive.
            self._parser.StartElementHandler = None
            self._parser.EndElementHandler = None
            self._parser.StartDoctypeDeclHandler = None
        if self._root is None:
            raise self._error("holds no element", self._first + 1)
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self._first + self._parser.CurrentLineNumber
        self._depth += 1
        self._count += 1
        if self._depth > MAX_DEPTH:
            raise self._error(f"elements are nested more than {MAX_DEPTH} deep", line)
        if self._count > MAX_ELEMENTS:
            raise self._error(f"holds more than {MAX_ELEMENTS} elements", line)
        if self._hidden_below is not None:
            return
        if self._depth == 2 and tag in self._left:
            self._left[tag] -= 1
            if self._left[tag] < 0:
                raise self._error(f"holds more than {self._at_most[tag]} <{tag}>, the most accepted", line)
        element = Element(tag, attributes, line)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)
        if tag in self._opaque:
            self._hidden_below = self._depth

    def _end(self, tag: str) -> None:
        if self._hidden_below is None or self._hidden_below == self._depth:
            self._hidden_below = None
            self._open.pop()
        self._depth -= 1

    def _doctype(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        line = self._first + self._parser.CurrentLineNumber
        raise self._error(
            f"has a document type (<!DOCTYPE {escaped(name)}>), which is refused: "
            "it can define entities that expand without bound or fetch other files; remove it",
            line,
        )

    def _error(self, message: str, line: int) -> DescriptionError:
        return DescriptionError(message, source=self._source, line=line)


def _said_plainly(code: int, begun: bool) -> str:
    """What expat means by `code`; `begun` says whether a first element was seen."""
    said = expat.ErrorString(code) or "unknown error"
    if said == expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT:
        return "something follows the end of the root element; wanted one root element and no more"
    if said in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    ):
        return f"not complete XML: the text ends too early ({said})"
    if not begun and said in (expat.errors.XML_ERROR_SYNTAX, expat.errors.XML_ERROR_INVALID_TOKEN):
        return "not XML: wanted an element such as <robot name=...>"
    return f"not well-formed XML: {said.removeprefix('not well-formed ')}"
