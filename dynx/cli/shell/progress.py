"""The bar on standard error that long work shows, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dynx.cli.shell.terminal import console

Advance = Callable[[int, str], None]
"""Told how many are done, and what to say beside the bar."""


@contextmanager
def progress_bar(total: int, done: int = 0, words: str = "", *, wanted: bool = True) -> Iterator[Advance]:
    """A bar of `total` pieces while the block lasts."""
    if not wanted or not sys.stderr.isatty():
        yield lambda done, words: None
        return
    # Imported where a bar is shown: it takes a quarter of the time of all of rich.
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    screen = console(err=True)
    screen.soft_wrap = False  # a bar that ran over the line could not be drawn again in place
    with Progress(*columns, console=screen, transient=True) as progress:
        bar = progress.add_task(words, total=total, completed=done)
        yield lambda done, words: progress.update(bar, completed=done, description=words)
