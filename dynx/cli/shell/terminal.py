"""Where output goes: tables through rich, JSON as text, both fit for pipes and old terminals."""

from __future__ import annotations

import errno
import os
import sys
from typing import TextIO

import click
from rich.console import Console

from dynx.files.documents import json_text

PIPE_WIDTH = 10_000
"""Columns where nobody watches: a table in a file or a pipe is never divided."""


def console(*, err: bool = False) -> Console:
    """A console on standard output or error; `err` also sends tables away from JSON on stdout.

    Lines are not wrapped, so that paths and numbers can be copied: a terminal does that for itself.
    Names of robots may hold anything, so neither markup nor emoji codes are read. NO_COLOR, TERM
    and COLUMNS are honoured.
    """
    stream = sys.stderr if err else _standard_output()
    width = None if stream.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return Console(file=stream, width=width, soft_wrap=True, markup=False, emoji=False, highlight=False)


def echo_json(document: object) -> None:
    """Write `document` to standard output."""
    click.echo(json_text(document), file=_standard_output())


def number(value: float) -> str:
    """A number of a table: nine significant digits, and zero as 0 whatever its sign."""
    return "0" if value == 0.0 else f"{value:.9g}"


def counted(count: int, noun: str) -> str:
    """``1 robot``, ``2 robots``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _standard_output() -> TextIO:
    """Standard output; OSError where the process was started without one."""
    if sys.stdout is None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    return sys.stdout
