"""Excerpts of a text around a line, and the lines in which two versions of it differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dynx.files.lines import Opcode, line_opcodes, lines_of

SHOWN_LINES = 400
"""Largest number of lines of the difference that are shown."""

LONGEST_LINE = 400
"""Largest number of characters of a line that are shown."""

KINDS = {"+": "plus", "-": "minus", "@": "at"}


@dataclass(frozen=True)
class TextChanges:
    """Unified difference of two versions of a text; `lines` are (kind or None, text)."""

    lines: tuple[tuple[str | None, str], ...]
    added: int
    removed: int
    count: int
    """Lines of the whole difference."""

    @property
    def left_out(self) -> int:
        """Lines that are not shown."""
        return self.count - len(self.lines)


def text_changes(old: str, new: str) -> TextChanges:
    """Compare two versions of a text."""
    lines = list(_difference(lines_of(old), lines_of(new)))
    shown = tuple((KINDS.get(line[:1]), line) for line in lines[:SHOWN_LINES])
    added, removed = (sum(line.startswith(sign) for line in lines) for sign in "+-")
    return TextChanges(shown, added, removed, len(lines))


def excerpt_of(text: str, line: int, around: int = 2) -> list[tuple[int, str]]:
    """Return the lines of a text about `line`, with their numbers."""
    lines = lines_of(text)
    return [
        (number, lines[number - 1][:LONGEST_LINE] + (" ..." if len(lines[number - 1]) > LONGEST_LINE else ""))
        for number in range(max(1, line - around), min(len(lines), line + around) + 1)
    ]


def _difference(before: Sequence[str], after: Sequence[str], context: int = 2) -> Iterator[str]:
    """Yield the lines of a unified difference."""
    group: list[Opcode] = []
    for code in [*line_opcodes(before, after), None]:
        if code is not None and code[0] != "equal":
            group.append(code)
            continue
        if group and (code is None or code[2] - code[1] > 2 * context):
            yield from _hunk(before, after, group, context)
            group = []


def _hunk(
    before: Sequence[str], after: Sequence[str], group: Sequence[Opcode], context: int
) -> Iterator[str]:
    """Yield changes that are near each other, with the lines around and between them."""
    _, first, _, start, _ = group[0]
    _, _, last, _, end = group[-1]
    lead, trail = min(context, first), min(context, len(before) - last)
    spans = (first - lead, last + trail, start - lead, end + trail)
    yield f"@@ -{_range(*spans[:2])} +{_range(*spans[2:])} @@"
    at = first - lead
    for _, i, i_end, j, j_end in group:
        yield from (f" {line}" for line in before[at:i])
        yield from (f"-{line}" for line in before[i:i_end])
        yield from (f"+{line}" for line in after[j:j_end])
        at = i_end
    yield from (f" {line}" for line in before[at : last + trail])


def _range(first: int, end: int) -> str:
    """Write a range of lines as `diff -u` does."""
    count = end - first
    return f"{first + 1}" if count == 1 else f"{first + (count > 0)},{count}"
