"""XML text that can be edited in place, changing only what an edit replaces.

`read_xml` returns the content of a document; `XmlSource` also stores the position of every element and
attribute. An edit replaces a range of the text, so comments, order, quotes and white space elsewhere are
preserved. An `XmlSource` is immutable: editing returns a new one, parsed again.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from xml.parsers import expat

from dynx.model.elements import Note
from dynx.model.xml.reading import repair_of
from dynx.model.xml.text import TextForm, decode_with_encoding, quoteattr, strip_ends

_DECLARED = re.compile(r"""<\?xml[^>]*?\bencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_BARE_LINE_FEED = re.compile(rb"(?<!\r)\n")
_LONE_CARRIAGE_RETURN = re.compile(rb"\r(?!\n)")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*("[^"]*"|'[^']*')""")
_ATTRIBUTES = re.compile(rb"""(?:\s+[^\s=/>]+\s*=\s*(?:"[^"]*"|'[^']*'))*""")


@dataclass(frozen=True)
class Span:
    """The bytes from `start` up to but excluding `end`."""

    start: int
    end: int


@dataclass(eq=False, repr=False)
class SourceElement:
    """An element of the document `data`, with its span and that of its start tag."""

    tag: str
    attributes: dict[str, str]
    line: int
    span: Span
    start_tag: Span
    data: bytes
    parent: SourceElement | None
    children: list[SourceElement] = field(default_factory=list)

    @cached_property
    def places(self) -> dict[str, Span]:
        """The span of each attribute, including the white space before it.

        Found when it is first used: most documents are parsed to read a few of their elements.
        """
        at = self.start_tag.start + 1 + len(self.tag.encode("utf-8"))
        places = {}
        while found := _ATTRIBUTE.match(self.data, at):
            places[found.group(1).decode("utf-8")] = Span(found.start(), found.end())
            at = found.end()
        return places

    def __repr__(self) -> str:
        return f"<SourceElement {self.tag} in line {self.line}>"

    @property
    def empty(self) -> bool:
        """True if it is written as one tag, ``<mass/>``."""
        return self.span == self.start_tag

    def all(self, tag: str) -> list[SourceElement]:
        """Return the child elements of that tag, in document order."""
        return [child for child in self.children if child.tag == tag]

    def first(self, tag: str) -> SourceElement | None:
        """Return the first child element of that tag, which engines use, or None."""
        return next((child for child in self.children if child.tag == tag), None)

    def walk(self) -> Iterator[SourceElement]:
        """Yield this element and all elements below it, in document order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            yield element
            waiting.extend(reversed(element.children))


@dataclass(frozen=True)
class Edit:
    """Replacement of the bytes from `start` to `end` by `text`; edits applied together must not overlap."""

    start: int
    end: int
    text: str


class XmlSource:
    """Text of a document with its tree of elements.

    `data` may be text, or bytes in any encoding that `dynx.load` reads; positions refer to the text in UTF-8.
    Faults that engines forgive are repaired in the text and listed in `repairs`. Raises DescriptionError for
    text that is not XML, as `read_xml` does.
    """

    def __init__(self, data: str | bytes, source: str = "<string>") -> None:
        notes: list[Note] = []
        whole, encoding = (
            decode_with_encoding(data, source, notes) if isinstance(data, bytes) else (data, None)
        )
        text, self._lines_before = strip_ends(whole, notes)
        if encoding is None:
            self.form = TextForm(_declared_encoding(text))
        else:
            front, _, end = whole.partition(text) if text else (whole, "", "")
            self.form = TextForm(encoding, front, end)
        self.source = source
        # Checks limits and raises errors; `_SourceParser` relies on well-formed text.
        repair = repair_of(text, source, self._lines_before)
        self.repairs = () if repair is None else repair.notes
        self.data = (text if repair is None else repair.text).encode("utf-8")

    def _with_data(self, data: bytes) -> XmlSource:
        """Return the document with new text, unchecked: edits of well-formed text are well-formed."""
        new = object.__new__(XmlSource)
        new.data, new.source, new.form = data, self.source, self.form
        new._lines_before, new.repairs = self._lines_before, self.repairs
        return new

    @property
    def text(self) -> str:
        """The document as text."""
        return self.data.decode("utf-8")

    @property
    def text_with_lines_before(self) -> str:
        """The document after as many empty lines as the file has before it, so that line numbers agree."""
        return "\n" * self._lines_before + self.text

    def to_bytes(self) -> bytes:
        """Return the document as bytes of a file, with the encoding, byte-order mark and trailing characters
        with which it was read.

        A document read from text has the encoding that it declares, or else UTF-8.
        """
        return self.form.encode(self.text)

    def in_utf8(self) -> XmlSource:
        """Return the document in UTF-8 without a byte-order mark, and so declared where it declares an
        encoding."""
        declared = _DECLARED.match(self.text)
        edits = []
        if declared is not None:
            start, end = (len(self.text[:at].encode("utf-8")) for at in declared.span(1))
            edits.append(Edit(start, end, "UTF-8"))
        new = self.apply(*edits)
        front, end_ = (part.replace("\ufeff", "") for part in (self.form.front, self.form.end))
        new.form = TextForm("utf-8", front, end_)
        return new

    def with_line_feeds(self) -> XmlSource:
        """Return the document with a line feed for each carriage return that no line feed follows."""
        new = self._with_data(_LONE_CARRIAGE_RETURN.sub(b"\n", self.data))
        ends = (re.sub(r"\r(?!\n)", "\n", part) for part in (self.form.front, self.form.end))
        new.form = TextForm(self.form.encoding, *ends)
        return new

    def line_at(self, position: int) -> int:
        """Return the number of the line that holds the byte at a position."""
        return self._lines_before + len(_LINE_END.findall(self.data, 0, position)) + 1

    @cached_property
    def root(self) -> SourceElement:
        """The root element."""
        return _SourceParser(self.data, self._lines_before).root()

    def apply(self, *edits: Edit) -> XmlSource:
        """Return the document with the edits applied."""
        parts, at = [], 0
        for edit in sorted(edits, key=lambda edit: (edit.start, edit.end)):
            if edit.start < at:
                raise ValueError(f"edits overlap at byte {edit.start} of {self.source}")
            text = _BARE_LINE_FEED.sub(self._line_end, edit.text.encode("utf-8"))
            parts += [self.data[at : edit.start], text]
            at = edit.end
        return self._with_data(b"".join([*parts, self.data[at:]]))

    def keeping_lines(self, edit: Edit) -> Edit:
        """Return the edit of an element with as many empty lines after it as it removes, so that all else
        stays on its line."""
        start, end = (at - (self.data[at - 1 : at + 1] == b"\r\n") for at in (edit.start, edit.end))
        removed = len(_LINE_END.findall(self.data, start, end))
        return Edit(start, end, edit.text + "\n" * (removed - edit.text.count("\n")))

    def text_in(self, element: SourceElement) -> str:
        """Return the text of an element without children, without blanks around it."""
        inside = self.data[element.start_tag.end : element.span.end].decode()
        return "" if element.empty else inside.partition("</")[0].strip()

    # -- edits --------------------------------------------------------------------------------

    def attribute_edit(self, element: SourceElement, name: str, value: str) -> Edit:
        """Return the edit that sets an attribute, at its position or at the end of the start tag."""
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

    def attribute_removal(self, element: SourceElement, name: str) -> Edit:
        """Return the edit that removes an attribute and the white space before it."""
        place = element.places[name]
        return Edit(place.start, place.end, "")

    def replacement(self, element: SourceElement, text: str) -> Edit:
        """Return the edit that replaces an element by text, with further lines indented like the first."""
        return Edit(element.span.start, element.span.end, self._indented(text, self.indent_of(element)))

    def removal(self, element: SourceElement) -> Edit:
        """Return the edit that removes an element, and its line if nothing else is on it."""
        start, end = element.span.start, element.span.end
        before = self.data.rfind(b"\n", 0, start) + 1
        after = self.data.find(b"\n", end)
        after = len(self.data) if after < 0 else after
        if not self.data[before:start].strip() and not self.data[end:after].strip():
            return Edit(max(before - 1, 0), after, "")
        return Edit(start, end, "")

    def insertion(self, parent: SourceElement, text: str, *, first: bool = False) -> Edit:
        """Return the edit that inserts lines of text as the last (or `first`) child of an element."""
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

    def insertion_after(self, element: SourceElement, text: str) -> Edit:
        """Return the edit that inserts lines of text after an element, on lines of their own."""
        indent = self.indent_of(element)
        return Edit(element.span.end, element.span.end, f"\n{indent}{self._indented(text, indent)}")

    # -- white space --------------------------------------------------------------------------

    def indent_of(self, element: SourceElement) -> str:
        """Return the white space before an element, if nothing else precedes it on its line."""
        before = self.data.rfind(b"\n", 0, element.span.start) + 1
        front = self.data[before : element.span.start]
        return front[: len(front) - len(front.lstrip())].decode("utf-8")

    @cached_property
    def unit(self) -> str:
        """One level of indentation, as at the document's first child."""
        children = self.root.children
        return (self.indent_of(children[0]) if children else "") or "  "

    def excerpt(self, line: int, around: int = 1) -> list[tuple[int, str]]:
        """Return the lines around `line` with their numbers."""
        lines = _LINE_END.split(self.data)
        numbers = range(line - self._lines_before - around, line - self._lines_before + around + 1)
        return [
            (n + self._lines_before, lines[n - 1].decode("utf-8")) for n in numbers if 1 <= n <= len(lines)
        ]

    @cached_property
    def _line_end(self) -> bytes:
        """Line ending of the document's first line, used for inserted text."""
        line_feed = self.data.find(b"\n")
        if line_feed >= 0:
            return b"\r\n" if self.data[:line_feed].endswith(b"\r") else b"\n"
        return b"\r" if b"\r" in self.data else b"\n"

    def _indented(self, text: str, indent: str) -> str:
        """Indent the lines of a text after the first as the document is: two blanks of theirs are a level."""
        first, *rest = text.split("\n")
        bare = [line.lstrip(" ") for line in rest]
        levels = [(len(line) - len(own)) // 2 for line, own in zip(rest, bare, strict=True)]
        return "\n".join(
            [first, *(indent + n * self.unit + own for n, own in zip(levels, bare, strict=True))]
        )


class _SourceParser:
    """One pass of expat over well-formed text that records the positions of elements."""

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
            # The handlers are methods of this object; without this, the reference cycle would keep both
            # alive.
            self._parser.StartElementHandler = None
            self._parser.EndElementHandler = None
        assert self._root is not None
        return self._root

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        start = self._parser.CurrentByteIndex
        written = _ATTRIBUTES.match(self._data, start + 1 + len(tag.encode("utf-8")))
        assert written is not None  # The pattern matches a tag without attributes too.
        span = Span(start, self._data.index(b">", written.end()) + 1)
        parent = self._open[-1] if self._open else None
        line = self._lines_before + self._parser.CurrentLineNumber
        element = SourceElement(tag, attributes, line, span, span, self._data, parent)
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
    """Return the encoding that text declares if Python can encode the text with it, else UTF-8."""
    declared = _DECLARED.match(text)
    encoding = declared.group(1) if declared else "utf-8"
    try:
        text.encode(encoding, "xmlcharrefreplace")
    except (LookupError, UnicodeError):
        return "utf-8"
    return encoding
