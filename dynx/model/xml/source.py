"""XML text that can be edited in place: only what must change changes.

`read_xml` gives what a document says; `XmlSource` also knows where it says it. An edit replaces a
stretch of the text, so comments, order, quotes and white space everywhere else stay as they are. An
`XmlSource` is never changed: editing gives a new one, read afresh.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from dynx.model.elements import Note
from dynx.model.xml.reading import read_xml
from dynx.model.xml.text import TextForm, decoded, without_ends

_DECLARED = re.compile(r"""<\?xml[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_BARE_FEED = re.compile(rb"(?<!\r)\n")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*("[^"]*"|'[^']*')""")


@dataclass(frozen=True)
class Span:
    """The bytes from `start` up to, without, `end`."""

    start: int
    end: int


@dataclass(eq=False, repr=False)
class SourceElement:
    """An element and where it stands: the whole of it, and each attribute with the blank before it."""

    tag: str
    attributes: dict[str, str]
    line: int
    span: Span
    start_tag: Span
    places: dict[str, Span]
    parent: SourceElement | None
    children: list[SourceElement] = field(default_factory=list)

    def __repr__(self) -> str:
        return f"<SourceElement {self.tag} in line {self.line}>"

    @property
    def empty(self) -> bool:
        """Whether it is written as one tag, ``<mass/>``."""
        return self.span == self.start_tag

    def all(self, tag: str) -> list[SourceElement]:
        """The elements of that tag directly inside, in document order."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> SourceElement | None:
        """The first element of that tag directly inside: the one engines use."""
        return next((child for child in self.children if child.tag == tag), None)

    def walk(self) -> Iterator[SourceElement]:
        """This element and all below it, in document order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


@dataclass(frozen=True)
class Edit:
    """One stretch of the text, and what stands there instead; edits of one call do not overlap."""

    start: int
    end: int
    text: str


class XmlSource:
    """The text of a document with its tree of elements.

    `data` may be text or bytes in any encoding that `dynx.load` reads; positions are those of the
    text in UTF-8. Raises DescriptionError for what is no XML, as `read_xml` does.
    """

    def __init__(self, data: str | bytes, source: str = "<string>") -> None:
        notes: list[Note] = []
        # For its limits and its errors; the walk below relies on well-formed text.
        read_xml(data, source, notes)
        whole, encoding = decoded(data, source, notes) if isinstance(data, bytes) else (data, None)
        text, self._lines_before = without_ends(whole, notes)
        if encoding is None:
            self.form = TextForm(_declared_encoding(text))
        else:
            front, _, end = whole.partition(text)
            self.form = TextForm(encoding, front, end)
        self.source = source
        self.data = text.encode("utf-8")

    def _with_data(self, data: bytes) -> XmlSource:
        """The same document with other text: made by edits of well-formed text, so it is not checked."""
        new = object.__new__(XmlSource)
        new.data, new.source, new.form = data, self.source, self.form
        new._lines_before = self._lines_before
        return new

    @property
    def text(self) -> str:
        """The document as text."""
        return self.data.decode("utf-8")

    def to_bytes(self) -> bytes:
        """The document as it would be in a file: in the encoding and between the ends that it was read in.

        What was read from text has the encoding that it declares, else UTF-8.
        """
        return self.form.encode(self.text)

    @cached_property
    def root(self) -> SourceElement:
        """The root element."""
        return _Walk(self.data, self._lines_before).root()

    def edited(self, *edits: Edit) -> XmlSource:
        """The document with the edits applied."""
        parts, at = [], 0
        for edit in sorted(edits, key=lambda edit: (edit.start, edit.end)):
            if edit.start < at:
                raise ValueError(f"edits overlap at byte {edit.start} of {self.source}")
            text = _BARE_FEED.sub(self._line_end, edit.text.encode("utf-8"))
            parts += [self.data[at : edit.start], text]
            at = edit.end
        return self._with_data(b"".join([*parts, self.data[at:]]))

    # -- edits --------------------------------------------------------------------------------

    def setting(self, element: SourceElement, name: str, value: str) -> Edit:
        """Give an attribute a value, in the place where it stands or at the end of the start tag."""
        written = f" {name}={quoteattr(value)}"
        place = element.places.get(name)
        if place is not None:
            old = self.data[place.start : place.end].decode("utf-8")
            blank = old[: len(old) - len(old.lstrip())]
            return Edit(place.start, place.end, blank + written.lstrip())
        at = max(
            [span.end for span in element.places.values()],
            default=element.start_tag.start + 1 + len(element.tag.encode("utf-8")),
        )
        return Edit(at, at, written)

    def removing_attribute(self, element: SourceElement, name: str) -> Edit:
        """Take an attribute away, with the blank before it."""
        place = element.places[name]
        return Edit(place.start, place.end, "")

    def replacing(self, element: SourceElement, text: str) -> Edit:
        """Put other text in the place of an element; its further lines are indented like the first."""
        return Edit(element.span.start, element.span.end, self._indented(text, self.indent_of(element)))

    def removing(self, element: SourceElement) -> Edit:
        """Take an element away, and its line where it stood alone."""
        start, end = element.span.start, element.span.end
        before = self.data.rfind(b"\n", 0, start) + 1
        after = self.data.find(b"\n", end)
        after = len(self.data) if after < 0 else after
        if not self.data[before:start].strip() and not self.data[end:after].strip():
            return Edit(max(before - 1, 0), after, "")
        return Edit(start, end, "")

    def inserting(self, parent: SourceElement, text: str, *, first: bool = False) -> Edit:
        """Put text, one or more lines, inside an element: behind what is there, or before it."""
        indent = self.indent_of(parent) + self.unit
        lines = f"\n{indent}{self._indented(text, indent)}"
        if parent.empty:
            tag = self.data[parent.start_tag.start : parent.start_tag.end].decode("utf-8")
            opened = tag[: tag.rindex("/")].rstrip() + ">"
            closed = f"\n{self.indent_of(parent)}</{parent.tag}>"
            return Edit(parent.start_tag.start, parent.start_tag.end, opened + lines + closed)
        if first or not parent.children:
            return Edit(parent.start_tag.end, parent.start_tag.end, lines)
        at = parent.children[-1].span.end
        return Edit(at, at, lines)

    def inserting_after(self, element: SourceElement, text: str) -> Edit:
        """Put text, one or more lines, behind an element, on lines of its own."""
        indent = self.indent_of(element)
        return Edit(element.span.end, element.span.end, f"\n{indent}{self._indented(text, indent)}")

    # -- white space --------------------------------------------------------------------------

    def indent_of(self, element: SourceElement) -> str:
        """The white space in front of an element, as far as its line holds nothing else."""
        before = self.data.rfind(b"\n", 0, element.span.start) + 1
        front = self.data[before : element.span.start]
        return front[: len(front) - len(front.lstrip())].decode("utf-8")

    @cached_property
    def unit(self) -> str:
        """One step of indentation, as the document's first child has it."""
        children = self.root.children
        return (self.indent_of(children[0]) if children else "") or "  "

    def excerpt(self, line: int, around: int = 1) -> list[tuple[int, str]]:
        """The lines about `line` with their numbers, for showing."""
        lines = _LINE_END.split(self.data)
        numbers = range(line - self._lines_before - around, line - self._lines_before + around + 1)
        return [
            (n + self._lines_before, lines[n - 1].decode("utf-8")) for n in numbers if 1 <= n <= len(lines)
        ]

    @cached_property
    def _line_end(self) -> bytes:
        """How the document ends its first line: what is put in ends its lines likewise."""
        feed = self.data.find(b"\n")
        if feed >= 0:
            return b"\r\n" if self.data[:feed].endswith(b"\r") else b"\n"
        return b"\r" if b"\r" in self.data else b"\n"

    def _indented(self, text: str, indent: str) -> str:
        return text.replace("\n", f"\n{indent}")


class _Walk:
    """One pass of expat over well-formed text, noting where everything stands."""

    def __init__(self, data: bytes, lines_before: int) -> None:
        self._data = data
        self._lines_before = lines_before
        self._open: list[SourceElement] = []
        self._root: SourceElement | None = None
        self._parser = expat.ParserCreate(encoding="utf-8")
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end

    def root(self) -> SourceElement:
        try:
            self._parser.Parse(self._data, True)
        finally:
            # The handlers are methods of this object: without this the two keep each other alive.
            self._parser.StartElementHandler = None
            self._parser.EndElementHandler = None
        assert self._root is not None
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        start = at = self._parser.CurrentByteIndex
        at += 1 + len(tag.encode("utf-8"))
        places = {}
        while found := _ATTRIBUTE.match(self._data, at):
            places[found.group(1).decode("utf-8")] = Span(found.start(), found.end())
            at = found.end()
        span = Span(start, self._data.index(b">", at) + 1)
        parent = self._open[-1] if self._open else None
        line = self._lines_before + self._parser.CurrentLineNumber
        element = SourceElement(tag, attributes, line, span, span, places, parent)
        if parent is None:
            self._root = element
        else:
            parent.children.append(element)
        self._open.append(element)

    def _end(self, tag: str) -> None:
        element = self._open.pop()
        if self._data[element.start_tag.end - 2 : element.start_tag.end] == b"/>":
            return
        end = self._data.index(b">", self._parser.CurrentByteIndex) + 1
        element.span = Span(element.span.start, end)


def _declared_encoding(text: str) -> str:
    """The encoding that text declares, where Python can write it so; else UTF-8."""
    declared = _DECLARED.match(text)
    encoding = declared.group(1) if declared else "utf-8"
    try:
        text.encode(encoding, "xmlcharrefreplace")
    except (LookupError, UnicodeError):
        return "utf-8"
    return encoding
