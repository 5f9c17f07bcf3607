"""Progress on standard error: a bar if that is a terminal, else lines."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

import click

from dynx.cli.shell.terminal import console


class Advance(Protocol):
    """Function that takes the number of items done, the text beside the bar, and a changed total."""

    def __call__(self, done: int, words: str, total: int | None = None, /) -> None:
        """Redraw the bar."""


@contextmanager
def progress_bar(total: int, done: int = 0, words: str = "", *, enabled: bool = True) -> Iterator[Advance]:
    """Show a bar of `total` items during the block."""
    if not enabled or not sys.stderr.isatty():
        yield lambda done, words, total=None: None
        return
    # Imported where a bar is shown: it takes a quarter of the time that importing all of rich takes.
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("elapsed"),
    )
    screen = console(err=True)
    screen.soft_wrap = False  # a bar longer than the line could not be redrawn in place
    with Progress(*columns, console=screen, transient=True) as progress:
        bar = progress.add_task(words, total=total, completed=done)
        yield lambda done, words, total=None: progress.update(
            bar, completed=done, description=words, total=total
        )


def log(line: str) -> None:
    """Write a line at once, unless standard error is a terminal, which shows the bar."""
    # Where standard error cannot be written, the work goes on.
    with suppress(OSError):
        if not sys.stderr.isatty():
            click.echo(line, err=True)
