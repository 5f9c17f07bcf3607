"""Excerpts of a robot's file around a line, and the lines that mending changed."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass

from dynx.doctor.report import DoctorReport

SHOWN_LINES = 400
"""Largest number of lines of the difference that are shown."""

LONGEST_LINE = 400
"""Largest number of characters of a line that are shown."""

KINDS = {"+": "plus", "-": "minus", "@": "at"}


@dataclass(frozen=True)
class TextChanges:
    """Unified difference between the file and the mended one; `lines` are (kind or None, text)."""

    lines: tuple[tuple[str | None, str], ...]
    added: int
    removed: int
    count: int
    """Lines of the whole difference."""

    @property
    def left_out(self) -> int:
        """Lines that are not shown."""
        return self.count - len(self.lines)


def changes(report: DoctorReport) -> TextChanges | None:
    """Compare the file with the mended one; None where nothing was mended."""
    if report.text is None or report.mended is None:
        return None
    before, after = lines_of(report.text), lines_of(report.mended)
    lines = list(difflib.unified_diff(before, after, "file", "mended", n=2, lineterm=""))[2:]
    shown = tuple((KINDS.get(line[:1]), line) for line in lines[:SHOWN_LINES])
    added, removed = (sum(line.startswith(sign) for line in lines) for sign in "+-")
    return TextChanges(shown, added, removed, len(lines))


def excerpt(report: DoctorReport, line: int | None, around: int = 2) -> list[tuple[int, str]]:
    """Return the lines about `line` with their numbers; none where the text or the line is unknown."""
    if report.text is None or line is None:
        return []
    lines = lines_of(report.text if report.form is None else report.form.front + report.text)
    return [
        (number, lines[number - 1][:LONGEST_LINE] + (" ..." if len(lines[number - 1]) > LONGEST_LINE else ""))
        for number in range(max(1, line - around), min(len(lines), line + around) + 1)
    ]


def lines_of(text: str) -> list[str]:
    """Split a text into lines as an XML parser counts them."""
    return re.split(r"\r\n|\r|\n", text)
