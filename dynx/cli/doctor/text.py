"""Lines of a report on a terminal: headings, indented sentences, code."""

from __future__ import annotations

import textwrap

from rich.console import Console

from dynx.cli.shell.exits import one_line

STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}
"""Style of each severity."""


def heading(out: Console, text: str, style: str = "bold") -> None:
    """Print a blank line and a title."""
    out.print()
    out.print(text, style=style)


def sentence(out: Console, text: str, indent: int, style: str = "") -> None:
    """Print text wrapped to the terminal's width, each line indented; words are not broken."""
    blanks = " " * indent
    lines = textwrap.wrap(
        text,
        max(out.width, indent + 20),
        initial_indent=blanks,
        subsequent_indent=blanks,
        break_long_words=False,
        break_on_hyphens=False,
    )
    for line in lines:
        out.print(line, style=style)


def block(out: Console, code: str, indent: int) -> None:
    """Print lines of code without wrapping, so that they can be copied."""
    for line in code.splitlines():
        blanks = " " * (indent + len(line) - len(line.lstrip(" ")))
        out.print(f"{blanks}{one_line(line)}")
