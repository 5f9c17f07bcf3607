"""Output: tables through rich and JSON as text, for terminals, pipes and files."""

from __future__ import annotations

import errno
import os
import shlex
import sys
from collections.abc import Callable, Mapping
from typing import TextIO, TypeVar

import click
from rich.console import Console

from dynx.cli.shell.exits import failure_of, one_line
from dynx.errors import DynxError
from dynx.files.documents import json_text
from dynx.files.writing import write_text

Document = TypeVar("Document")

PIPE_WIDTH = 10_000
"""Width of a file or pipe [columns], so large that no table is divided."""


def console(*, err: bool = False) -> Console:
    """Return a console on standard output, or with `err` on standard error.

    Lines are not wrapped, so that paths and numbers can be copied: terminals wrap them. Names of robots
    can contain any text, so markup and emoji codes are not interpreted. NO_COLOR, TERM and COLUMNS apply.
    """
    stream = sys.stderr if err else _standard_output()
    width = None if stream.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return Console(file=stream, width=width, soft_wrap=True, markup=False, emoji=False, highlight=False)


def echo_json(document: object) -> None:
    """Write `document` to standard output."""
    click.echo(json_text(document), file=_standard_output())


def write_json(document: object, path: str | None) -> bool:
    """Write `document` where ``--json`` says; return whether standard output is taken, so that nothing else
    may be written there."""
    if path == "-":
        echo_json(document)
    elif path is not None:
        write_text(path, json_text(document) + "\n")
    return path == "-"


def present(
    document: Document, show: Callable[[Console, Document], None], json_path: str | None
) -> DynxError | None:
    """Write a document where ``--json`` says, and show it as tables unless that is standard output.

    Return the error of a file that cannot be written; the tables are shown nevertheless.
    """
    error = failure_of(write_json, document, json_path)
    if json_path != "-":
        show(console(), document)
    return error


def number(value: float) -> str:
    """Write a number with nine significant digits, and -0 as 0."""
    return "0" if value == 0.0 else f"{value:.9g}"


def counted(count: int, noun: str) -> str:
    """Write ``1 robot`` or ``2 robots``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def command_line() -> str:
    """Return the command line of this process, for running it again."""
    return shlex.join(["dynx", *map(one_line, sys.argv[1:])])


def summary_line(what: str, counts: Mapping[str, int], not_done: int, seconds: float) -> str:
    """Write the last line of a run over robots: the number of results of each kind, and the time."""
    parts = [f"{count} {word}" for word, count in counts.items()]
    parts += [f"{not_done} not done"] if not_done else []
    return f"{what}: {', '.join(parts)}; took {seconds:.1f} s"


def _standard_output() -> TextIO:
    """Return standard output; OSError where the process has none."""
    if sys.stdout is None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    return sys.stdout
