"""Hardened XML reader: a tree of elements with their lines, or one clear error.

Expat parses the text, without namespaces (so an undeclared prefix is no error) and without a document type
(so no entities are expanded or fetched). The reader is not recursive.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from xml.parsers import expat

from dynx.errors import DescriptionError, escaped
from dynx.model.elements import Note
from dynx.model.xml.repair import Repair, repaired
from dynx.model.xml.text import decode, strip_ends

MAX_DEPTH = 256
"""Largest nesting depth of elements; URDF needs 6."""

MAX_ELEMENTS = 2_000_000
"""Largest number of elements in one document; it bounds memory."""


MAX_ATTRIBUTES = 1000
"""Largest number of attributes of one element; URDF needs 8. Parsers of engines take quadratic time."""


@dataclass(slots=True)
class Element:
    """An XML element: tag with its prefix, attributes, line, and child elements."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""
    """Character data, where `read_xml` was given the tag in `with_text`."""

    def all(self, tag: str) -> list[Element]:
        """Return the child elements of that tag, in document order."""
        return [child for child in self.children if child.tag == tag]


def read_xml(
    data: str | bytes,
    source: str,
    notes: list[Note],
    *,
    opaque: Collection[str] = (),
    max_counts: Mapping[str, int] | None = None,
    with_text: Collection[str] = (),
) -> Element:
    """Read a document and return its root element.

    The content of an element whose tag is in `opaque` is checked but not stored. `max_counts` limits how
    often a tag may occur directly below the root. Character data are stored for the tags in `with_text`,
    which name elements without children. Notes are appended to `notes`. Raises DescriptionError for text that
    is not XML, is truncated, has a document type, is nested deeper than MAX_DEPTH, or has more elements than
    MAX_ELEMENTS or `max_counts`, or more attributes of one than MAX_ATTRIBUTES, allow. Faults of the XML that
    engines forgive are repaired, with notes.
    """
    text = decode(data, source, notes) if isinstance(data, bytes) else data
    text, lines_before = strip_ends(text, notes)

    def builder() -> _TreeBuilder:
        return _TreeBuilder(source, lines_before, opaque, max_counts or {}, with_text)

    root, repair = _parse(text, lines_before, builder)
    notes += () if repair is None else repair.notes
    return root


def repair_of(text: str, source: str, lines_before: int = 0) -> Repair | None:
    """Check a document as `read_xml` does, and return its repair; None where it is well-formed."""
    return _parse(text, lines_before, lambda: _TreeBuilder(source, lines_before, (), {}, ()))[1]


def _parse(
    text: str, lines_before: int, builder: Callable[[], _TreeBuilder]
) -> tuple[Element, Repair | None]:
    tree = builder()
    try:
        return tree.build(text), None
    except expat.ExpatError as error:
        fault = tree.explained(error)
    repair = repaired(text, lines_before)
    if repair is not None:
        with suppress(expat.ExpatError):
            return builder().build(repair.text), repair
    raise fault


class _TreeBuilder:
    """Handlers of expat that build the tree; `lines_before` lines were removed in front of the text."""

    def __init__(
        self,
        source: str,
        lines_before: int,
        opaque: Collection[str],
        max_counts: Mapping[str, int],
        with_text: Collection[str],
    ) -> None:
        self._source, self._lines_before = source, lines_before
        self._opaque, self._remaining = frozenset(opaque), dict(max_counts)
        self._max_counts = max_counts
        self._with_text, self._texts = frozenset(with_text), list[str]()
        self._open: list[Element] = []
        self._depth = 0
        self._opaque_depth: int | None = None
        self._count = 0
        self._root: Element | None = None
        self._parser = expat.ParserCreate(encoding="utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._parser.StartDoctypeDeclHandler = self._doctype
        if with_text:
            self._parser.CharacterDataHandler = self._characters

    def build(self, text: str) -> Element:
        try:
            self._parser.Parse(text.encode("utf-8"), True)
        except UnicodeEncodeError as error:
            line = self._lines_before + text.count("\n", 0, error.start) + 1
            raise self._error("contains half of a surrogate pair, which is not a character", line) from None
        finally:
            # The handlers are methods of this object; without this, the reference cycle would keep both
            # alive.
            self._parser.StartElementHandler = None
            self._parser.EndElementHandler = None
            self._parser.StartDoctypeDeclHandler = None
            self._parser.CharacterDataHandler = None
        if self._root is None:
            raise self._error("contains no element", self._lines_before + 1)
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        line = self._lines_before + self._parser.CurrentLineNumber
        self._depth += 1
        self._count += 1
        if self._depth > MAX_DEPTH:
            raise self._error(f"elements are nested more than {MAX_DEPTH} deep", line)
        if len(attributes) > MAX_ATTRIBUTES:
            raise self._error(
                f"an element has {len(attributes)} attributes; at most {MAX_ATTRIBUTES} are read", line
            )
        if self._count > MAX_ELEMENTS:
            raise self._error(f"contains more than {MAX_ELEMENTS} elements", line)
        if self._opaque_depth is not None:
            return
        if self._depth == 2 and tag in self._remaining:
            self._remaining[tag] -= 1
            if self._remaining[tag] < 0:
                raise self._error(f"contains more than {self._max_counts[tag]} <{tag}>, the limit", line)
        element = Element(tag, attributes, line)
        if self._open:
            self._open[-1].children.append(element)
        else:
            self._root = element
        self._open.append(element)
        if tag in self._opaque:
            self._opaque_depth = self._depth
        self._texts.clear()

    def _end(self, tag: str) -> None:
        if self._opaque_depth is None or self._opaque_depth == self._depth:
            self._opaque_depth = None
            element = self._open.pop()
            if self._texts and not element.children and tag in self._with_text:
                element.text = "".join(self._texts)
        self._texts.clear()
        self._depth -= 1

    def _characters(self, text: str) -> None:
        if self._open[-1].tag in self._with_text:
            self._texts.append(text)

    def _doctype(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        line = self._lines_before + self._parser.CurrentLineNumber
        raise self._error(
            f"has a document type (<!DOCTYPE {escaped(name)}>), which is not allowed: "
            "it can define entities that expand without bound or fetch other files; remove it",
            line,
        )

    def explained(self, error: expat.ExpatError) -> DescriptionError:
        """Return the error of dynx for one that expat raised."""
        line = self._lines_before + error.lineno
        return self._error(_explain(error.code, self._root is not None), line)

    def _error(self, message: str, line: int) -> DescriptionError:
        return DescriptionError(message, source=self._source, line=line)


def _explain(code: int, begun: bool) -> str:
    """Describe the expat error `code`; `begun` says whether a first element was read."""
    reason = expat.ErrorString(code) or "unknown error"
    if reason == expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT:
        return "content follows the root element; wanted one root element"
    if reason == expat.errors.XML_ERROR_NO_ELEMENTS and not begun:
        return "the text has no element; wanted <robot name=...>"
    if reason in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    ):
        return f"not complete XML: the text ends too early ({reason})"
    if not begun and reason in (expat.errors.XML_ERROR_SYNTAX, expat.errors.XML_ERROR_INVALID_TOKEN):
        return "not XML: wanted an element such as <robot name=...>"
    return f"not well-formed XML: {reason.removeprefix('not well-formed ').strip('()')}"
