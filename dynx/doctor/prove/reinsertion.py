"""Reinsertion of one cause into a mended file that dynx cannot read with that cause.

Remedies about the robot need a file that dynx reads. Where one cause prevents that, all causes are removed
from the file, and then the lines of that cause are restored.
"""

from __future__ import annotations

from collections.abc import Sequence

from dynx.doctor.lines import line_opcodes
from dynx.errors import DescriptionError
from dynx.model.xml.source import XmlSource

Lines = tuple[int, int, int, int]
"""Range of equal lines: first and end in one text, first and end in the other."""


def reinserted_text(given: XmlSource, without: XmlSource, mended: XmlSource) -> XmlSource | None:
    """Return the `mended` text with the lines of one cause as they are `given`.

    `without` is the given text with the cause alone removed. None where other remedies changed the same
    lines, the cause changes no line, or the changes overlap.
    """
    texts = (given.text, without.text, mended.text)
    old, base, new = ([*text.splitlines(keepends=True)] for text in texts)
    kept = [each[1:] for each in line_opcodes(base, new) if each[0] == "equal"]
    parts: list[str] = []
    done = 0
    for tag, first, last, start, end in line_opcodes(base, old):
        if tag == "equal":
            continue
        at = _counterpart(kept, first, last)
        if at is None or at < done:
            return None
        parts += [*new[done:at], *old[start:end]]
        done = at + (last - first)
    if not parts:
        return None
    try:
        return XmlSource("".join([*parts, *new[done:]]), given.source)
    except DescriptionError:
        # Where lines repeat, the matches of the two changes can overlap.
        return None


def _counterpart(kept: Sequence[Lines], first: int, last: int) -> int | None:
    """Find where lines of one text start in the other, if they are there unchanged."""
    for begin, end, start, _ in kept:
        if begin <= first and last <= end:
            return start + first - begin
    return None
