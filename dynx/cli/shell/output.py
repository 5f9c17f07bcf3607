"""Output of commands: tables through rich, JSON as text, progress, and checks of files before the work."""

from __future__ import annotations

import errno
import os
import shlex
import stat
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, Protocol, TextIO, TypeVar, cast

import click
from rich.console import Console

from dynx.cli.shell.exits import failure_of, one_line
from dynx.cli.shell.options import QUIET
from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.documents import json_text
from dynx.files.writing import write_text

Document = TypeVar("Document")

Entry = Mapping[str, Any]
"""A JSON document or a part of it."""

PIPE_WIDTH = 10_000
"""Width of a file or pipe [columns], so large that no table is divided."""


def console(*, err: bool = False) -> Console:
    """Return a console on standard output, or with `err` on standard error.

    Lines are not wrapped, so that paths and numbers can be copied: terminals wrap them. Names of robots
    can contain any text, so markup and emoji codes are not interpreted. NO_COLOR, TERM and COLUMNS apply.
    With ``--quiet`` it writes nothing.
    """
    stream = sys.stderr if err else _standard_output()
    width = None if stream.isatty() or "COLUMNS" in os.environ else PIPE_WIDTH
    return Console(
        file=stream,
        width=width,
        quiet=is_quiet(),
        soft_wrap=True,
        markup=False,
        emoji=False,
        highlight=False,
    )


def is_quiet() -> bool:
    """Check whether the present command was called with ``--quiet``."""
    context = click.get_current_context(silent=True)
    return context is not None and bool(context.meta.get(QUIET))


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


def entry_of(kind: type[Document], source: object, **given: object) -> Document:
    """Make a part of a JSON document, of the TypedDict `kind`: its keys are attributes of `source`.

    `given` has the values of the other keys. Arrays and tuples become lists.
    """
    values = {name: given[name] if name in given else getattr(source, name) for name in kind.__annotations__}
    assert given.keys() <= values.keys(), given
    return cast(Document, {name: _plain(value) for name, value in values.items()})


def _plain(value: object) -> object:
    if hasattr(value, "tolist"):  # an array, or a number of NumPy
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def present(
    document: Document,
    show: Callable[[Console, Document], None],
    json_path: str | None,
    *,
    quiet: bool = False,
) -> DynxError | None:
    """Write a document where ``--json`` says; show it as tables unless that is standard output, or `quiet`.

    Return the error of a file that cannot be written; the tables are shown nevertheless.
    """
    error = failure_of(write_json, document, json_path)
    if json_path != "-" and not quiet:
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


class Advance(Protocol):
    """Function that takes the number of items done, the text beside the bar, and a changed total."""

    def __call__(self, done: int, words: str, total: int | None = None, /) -> None:
        """Redraw the bar."""


@contextmanager
def progress_bar(total: int, done: int = 0, words: str = "", *, enabled: bool = True) -> Iterator[Advance]:
    """Show a bar of `total` items during the block."""
    if not enabled or is_quiet() or not sys.stderr.isatty():
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


@contextmanager
def simulated_time_bar(
    engines: int, duration: float, *, enabled: bool = True
) -> Iterator[Callable[[str, float], None]]:
    """Show a bar while several engines simulate `duration` [s] each; yield a function to call with
    the name of an engine and the time [s] that it reached."""
    reached: dict[str, float] = {}
    total, words = round(1e3 * duration) * engines, "simulated time [ms]"
    with progress_bar(total, words=words, enabled=enabled) as advance:

        def progress(engine: str, time: float) -> None:
            reached[engine] = time
            advance(round(1e3 * sum(reached.values())), f"{engine}, {words}")

        yield progress


def log(line: str) -> None:
    """Write a line at once, unless standard error is a terminal, which shows the bar."""
    # Where standard error cannot be written, the work goes on.
    with suppress(OSError):
        if not sys.stderr.isatty():
            click.echo(line, err=True)


def check_writable(path: str) -> None:
    """Raise ArgumentError if `path` is a directory, in no directory, or write-protected."""
    folder = os.path.dirname(path) or "."
    if os.path.isdir(path):
        problem = "is a directory"
    elif not os.path.isdir(folder):
        problem = f"cannot be written: there is no directory {shown(folder, 300)}"
    elif not os.access(path if os.path.exists(path) else folder, os.W_OK):
        problem = "cannot be written: permission denied"
    else:
        return
    raise ArgumentError(f"{shown(path, 300)} {problem}")


def check_json(path: str | None) -> None:
    """Check the file of ``--json``, if that is a file, like `check_writable`."""
    if path is not None and path != "-":
        check_writable(path)


def require_apart(paths: Iterable[str], kept: Iterable[str], what: str) -> None:
    """Raise ArgumentError where a path is one of the files `kept`, under any name.

    `what` describes these files in the message, as in ``a file that is read``.
    """
    files = {_identity(each) for each in kept} - {None}
    for path in paths:
        if _identity(path) in files:
            raise ArgumentError(f"{shown(path, 300)} is {what}, and would be overwritten")


def make_folder(path: str) -> None:
    """Create the directory of an output file where it does not exist."""
    folder = os.path.dirname(path) or "."
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{shown(folder, 300)} cannot be created: {error.strerror}") from error


def _identity(path: str) -> tuple[int, int] | None:
    """Return device and inode of a regular file; None where there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None
