"""Repair of text that is not well-formed XML although every engine reads it.

The engines parse URDF by tinyxml2, which accepts ``--`` in a comment, a bare ``&``, ``<`` in an attribute,
attributes without white space between them, and content around the root element. The repaired text has the
same elements, attributes and lines. Faults that tinyxml2 refuses are left.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from dynx.model.elements import Note

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

    def run(self) -> bool:
        """Repair the whole text; return False where it has a fault that engines do not forgive."""
        at: int | None = 0
        while at is not None and at < len(self.text):
            start = self.text.find("<", at)
            if start < 0:
                # Text at the very end is refused, unlike text in front of further markup.
                return self.ended and not self.depth and not self.text[at:].strip()
            self._characters(at, start)
            at = self._markup(start)
        return at is not None and self.ended and not self.depth

    def _markup(self, at: int) -> int | None:
        """Repair the markup that begins at a position, and return its end; None where it has none."""
        self.in_declarations = self.in_declarations and self.text.startswith("<?xml", at)
        if self.text.startswith("</", at):
            return self._end_tag(at)
        for opening, closing, repair in (
            ("<!--", "-->", self._comment),
            ("<![CDATA[", "]]>", self._emit),
            ("<?", "?>", self._declaration),
            ("<!", ">", self._emit),
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

    def _emit(self, text: str, at: int) -> None:
        """Add a part; behind the root element only its line ends, because no engine reads it."""
        self.parts.append(_NO_LINE_END.sub(" ", text) if self.ended else text)
