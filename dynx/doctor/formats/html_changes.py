"""The file itself on the page: lines about a place, and what mending changed."""

from __future__ import annotations

import difflib
import re

from dynx.doctor.formats.html_elements import escape, folded
from dynx.doctor.report import DoctorReport

_SHOWN_LINES = 400
"""Lines of the difference of two texts."""

_LONGEST_LINE = 400
"""Characters of a line that are shown."""


def changes(report: DoctorReport) -> str:
    """The unified difference between the file and the mended one."""
    if report.text is None or report.mended is None:
        return ""
    before, after = lines_of(report.text), lines_of(report.mended)
    lines = list(difflib.unified_diff(before, after, "file", "mended", n=2, lineterm=""))[2:]
    shown = "".join(f"<span{_kind(line)}>{escape(line) or ' '}</span>" for line in lines[:_SHOWN_LINES])
    rest = len(lines) - _SHOWN_LINES
    more = f'<p class="faint">and {rest} more lines: see the mended file.</p>' if rest > 0 else ""
    added = sum(line.startswith("+") for line in lines)
    removed = sum(line.startswith("-") for line in lines)
    summary = f"{added} lines written, {removed} taken away"
    return folded(escape(summary), f'<pre class="diff">{shown}</pre>{more}', opened=len(lines) <= 80)


def excerpt(report: DoctorReport, line: int | None, around: int = 2) -> str:
    """The lines of the file about `line`, which is marked."""
    if report.text is None or line is None:
        return ""
    lines = lines_of(report.text)
    first, last = max(1, line - around), min(len(lines), line + around)
    if first > last:
        return ""
    shown = []
    for number in range(first, last + 1):
        here = ' class="here"' if number == line else ""
        text = escape(lines[number - 1][:_LONGEST_LINE])
        text += " ..." if len(lines[number - 1]) > _LONGEST_LINE else ""
        shown.append(f'<span{here}><span class="line">{number}</span>{text}</span>')
    return f'<pre class="excerpt">{"".join(shown)}</pre>'


def lines_of(text: str) -> list[str]:
    """The lines as an XML parser counts them."""
    return re.split(r"\r\n|\r|\n", text)


def _kind(line: str) -> str:
    kinds = {"+": "plus", "-": "minus", "@": "at"}
    return f' class="{kinds[line[0]]}"' if line[:1] in kinds else ""
