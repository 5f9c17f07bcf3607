"""Hardened XML reader: a tree of elements with their lines, or one clear error.

Expat parses the text, without namespaces (so an undeclared prefix is no error) and without a document type
(so no entities are expanded or fetched). The reader is not recursive.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from xml.parsers import expat

from dynx.errors import DescriptionError, escaped
from dynx.model.elements import Note
from dynx.model.xml.text import decode, strip_ends

_START = re.compile(r"<(\s*)([^\W\d][\w:.-]*)")
_ATTRIBUTE = re.compile(r"""(\s*)([^\W\d][\w:.-]*\s*=\s*)("[^"]*"|'[^']*')""")
_START_END = re.compile(r"\s*(/?)>")
_END = re.compile(r"</[^<>]*>")
_BARE_AMPERSAND = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#[0-9]+|#x[0-9A-Fa-f]+);)")
_LESS = re.compile("<")
_DASHES = re.compile(r"-{2,}|-\Z")
_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f]")
_NO_LINE_END = re.compile(r"[^\r\n]")
_DECLARATION = re.compile(r"""<\?xml\s+version\s*=\s*(?:"1\.[0-9]"|'1\.[0-9]')[^?]*\?>""")


MAX_REPAIRS = 100_000
"""Largest number of faults that are repaired; a file of nothing else would take a minute."""


@dataclass(frozen=True)
class Repair:
    """Well-formed text, and a note on the first fault of each kind that was repaired."""

    text: str
    notes: tuple[Note, ...]


def repaired(text: str, lines_before: int = 0) -> Repair | None:
    """Return the text without the faults that engines forgive; None where it has others, or none.

    `lines_before` lines were removed in front of the text.
    """
    repairer = _Repairer(text)
    if not repairer.run() or not repairer.faults:
        return None
    notes = tuple(
        Note(f"not well-formed XML: {fault}", lines_before + text.count("\n", 0, at) + 1)
        for fault, at in repairer.faults.items()
    )
    return Repair("".join(repairer.parts), notes)


@dataclass
class _Repairer:
    """One pass over the text: its repaired parts, and the position of the first fault of each kind.

    `in_declarations` says that only XML declarations were read, `ended` that the root element has ended.
    """

    text: str
    parts: list[str] = field(default_factory=list)
    faults: dict[str, int] = field(default_factory=dict)
    depth: int = 0
    in_declarations: bool = True
    ended: bool = False
    count: int = 0

    def run(self) -> bool:
        """Repair the whole text; return False where it has a fault that engines do not forgive."""
        at: int | None = 0
        while at is not None and at < len(self.text) and self.count <= MAX_REPAIRS:
            start = self.text.find("<", at)
            if start < 0:
                # Text at the very end is refused, unlike text in front of further markup.
                return self.ended and not self.depth and not self.text[at:].strip()
            self._characters(at, start)
            at = self._markup(start)
        return at is not None and self.ended and not self.depth and self.count <= MAX_REPAIRS

    def _markup(self, at: int) -> int | None:
        """Repair the markup that begins at a position, and return its end; None where it has none."""
        self.in_declarations = self.in_declarations and self.text.startswith("<?xml", at)
        if self.text.startswith("</", at):
            return self._end_tag(at)
        for opening, closing, repair in (
            ("<!--", "-->", self._comment),
            ("<![CDATA[", "]]>", self._emit),
            ("<?", "?>", self._declaration),
            ("<!", ">", self._unknown),
        ):
            if self.text.startswith(opening, at):
                end = self.text.find(closing, at + len(opening))
                if end >= 0:
                    repair(self.text[at : end + len(closing)], at)
                return None if end < 0 else end + len(closing)
        return self._start_tag(at)

    def _characters(self, at: int, end: int) -> None:
        content = self.text[at:end]
        if self.depth == 0 and content.strip():
            self.in_declarations = False
            self._fault("text outside of the root element", at)
            content = _NO_LINE_END.sub(" ", content)
        content = self._replace(_CONTROL, " ", content, "a control character", at)
        self._emit(self._replace(_BARE_AMPERSAND, "&amp;", content, "& that is not written &amp;", at), at)

    def _comment(self, comment: str, at: int) -> None:
        content = self._replace(_CONTROL, " ", comment[4:-3], "a control character", at)
        if _DASHES.search(content):
            self._fault("-- in a comment", at)
            content = _DASHES.sub(lambda dashes: "=" * len(dashes.group()), content)
        self.parts.append(f"<!--{content}-->")

    def _unknown(self, written: str, at: int) -> None:
        """Blank out ``<!mesh ...>``, by which authors disable an element; keep a document type."""
        if not written.startswith("<!DOCTYPE"):
            self._fault("<! that begins no comment", at)
            written = _NO_LINE_END.sub(" ", written)
        self._emit(written, at)

    def _declaration(self, written: str, at: int) -> None:
        if not written.startswith("<?xml") or (at == 0 and _DECLARATION.fullmatch(written)):
            self._emit(written, at)
        elif at == 0:
            self._fault("a malformed XML declaration", at)
            self._emit('<?xml version="1.0"?>' + "\n" * written.count("\n"), at)
        elif self.in_declarations:
            self._fault("a second XML declaration", at)
            self._emit(_NO_LINE_END.sub(" ", written), at)
        else:
            self._emit(written, at)

    def _start_tag(self, at: int) -> int | None:
        start = _START.match(self.text, at)
        if start is None:
            return None
        blanks, name = start.groups()
        if blanks:
            self._fault("white space behind <", at)
        if self.ended and not self.depth:
            self._fault("content behind the root element", at)
        tag, end = [f"<{name}{blanks}"], start.end()
        while attribute := _ATTRIBUTE.match(self.text, end):
            before, word, value = attribute.groups()
            if not before and not (blanks and end == start.end()):
                self._fault("no white space between attributes", end)
                before = " "
            value = self._replace(_BARE_AMPERSAND, "&amp;", value, "& that is not written &amp;", end)
            tag.append(before + word + self._replace(_LESS, "&lt;", value, "< that is not written &lt;", end))
            end = attribute.end()
        close = _START_END.match(self.text, end)
        if close is None:
            return None
        self._emit("".join([*tag, close.group()]), at)
        self.depth += 0 if close.group(1) else 1
        self.ended = self.ended or self.depth == 0
        return close.end()

    def _end_tag(self, at: int) -> int | None:
        end = _END.match(self.text, at)
        if end is None:
            return None
        if self.depth == 0:
            self._fault("an end tag without a start tag", at)
            self._emit(_NO_LINE_END.sub(" ", end.group()), at)
            return end.end()
        self._emit(end.group(), at)
        self.depth -= 1
        self.ended = self.ended or self.depth == 0
        return end.end()

    def _replace(self, old: re.Pattern[str], new: str, text: str, fault: str, at: int) -> str:
        """Replace what is a fault, and record the first."""
        found = old.search(text)
        if found is None:
            return text
        self._fault(fault, at + found.start())
        return old.sub(new, text)

    def _fault(self, kind: str, at: int) -> None:
        self.faults.setdefault(kind, at)
        self.count += 1

    def _emit(self, text: str, at: int) -> None:
        """Add a part; behind the root element only its line ends, because no engine reads it."""
        self.parts.append(_NO_LINE_END.sub(" ", text) if self.ended else text)


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
        if system is None and public is None and not internal:
            return  # a name alone defines and fetches nothing
        line = self._lines_before + self._parser.CurrentLineNumber
        raise self._error(
            f"has a document type (<!DOCTYPE {escaped(name)}>), which is not allowed: "
            "it can define entities that expand without bound or fetch other files; remove it",
            line,
        )

    def explained(self, error: expat.ExpatError) -> DescriptionError:
        """Return the error of dynx for one that expat raised."""
        line = self._lines_before + error.lineno
        begun = self._root is not None
        from dynx.model.other_formats import format_hint, wanted_root

        hint = "" if begun else format_hint(self._source)
        return self._error(_explain(error.code, begun, wanted_root(self._source)) + hint, line)

    def _error(self, message: str, line: int) -> DescriptionError:
        return DescriptionError(message, source=self._source, line=line)


def _explain(code: int, begun: bool, root: str) -> str:
    """Describe the expat error `code`; `begun` says whether a first element was read, of which `root` is the
    one that is wanted."""
    reason = expat.ErrorString(code) or "unknown error"
    if reason == expat.errors.XML_ERROR_JUNK_AFTER_DOC_ELEMENT:
        return "content follows the root element; wanted one root element"
    if reason == expat.errors.XML_ERROR_NO_ELEMENTS and not begun:
        return f"the text has no element; wanted {root}"
    if reason in (
        expat.errors.XML_ERROR_NO_ELEMENTS,
        expat.errors.XML_ERROR_UNCLOSED_TOKEN,
        expat.errors.XML_ERROR_UNCLOSED_CDATA_SECTION,
    ):
        return f"not complete XML: the text ends too early ({reason})"
    if not begun and reason in (expat.errors.XML_ERROR_SYNTAX, expat.errors.XML_ERROR_INVALID_TOKEN):
        return "not XML: wanted an element such as <robot name=...>"
    return f"not well-formed XML: {reason.removeprefix('not well-formed ').strip('()')}"
