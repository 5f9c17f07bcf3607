"""Lines of a report on a terminal: headings, sentences that keep their indent, code as it stands."""

from __future__ import annotations

import textwrap

from rich.console import Console

from dynx.cli.shell.exits import one_line

STYLES = {"error": "bold red", "warning": "yellow", "note": "dim"}
"""How loud each severity is."""


def heading(out: Console, text: str, style: str = "bold") -> None:
    """A blank line and a title."""
    out.print()
    out.print(text, style=style)


def sentence(out: Console, text: str, indent: int, style: str = "") -> None:
    """Words in lines of the terminal's width, each indented; a word that is too long runs over."""
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
    """Lines of code, each as it stands, to be copied."""
    for line in code.splitlines():
        blanks = " " * (indent + len(line) - len(line.lstrip(" ")))
        out.print(f"{blanks}{one_line(line)}")
