"""Exit codes of the command line, and the conversion of an error into one line and a code.

0    success: engines agree, the target was reached, the simulation reached its end
1    negative result: engines differ, the target was not reached, the simulation diverged
2    some input cannot be used (commands for several robots still process the others)
70   a defect of dynx
74   standard output cannot be written, for example because the disk is full (EX_IOERR of sysexits.h)
130  interrupted by Ctrl-C; 143 terminated
141  the reader of standard output closed it, as `head` does (128 + SIGPIPE)
"""

from __future__ import annotations

import errno
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from types import FrameType

import click

from dynx.errors import DynxError, TemporaryFolderError, nearest, shown, traceback_wanted

DONE, NEGATIVE_RESULT, BAD_INPUT, DEFECT, NOT_WRITTEN, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 70, 74, 130, 141

_WRITING_FAILED = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF}
"""Error numbers of writing to an open stream. (Errors of opening a file are reported with its name.)"""


def one_line(text: object) -> str:
    """Replace line breaks and other control characters, so that `text` is one line of a message."""
    joined = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)


def short_line(text: object) -> str:
    """Make one line of at most 200 characters: the name of a robot can be a whole URDF."""
    line = one_line(text)
    return line if len(line) <= 200 else f"{line[:60]}... ({len(line)} characters)"


def complain(message: str) -> None:
    """Write `message` to standard error, as one line."""
    # If standard error cannot be written, the exit code still reports the error.
    with suppress(OSError):
        click.echo(f"dynx: error: {one_line(message)}", err=True)


def remark(message: str) -> None:
    """Write a note to standard error, as one line, whatever ``--quiet`` and ``--json`` say."""
    with suppress(OSError):
        click.echo(f"dynx: note: {one_line(message)}", err=True)


def failure_of(call: Callable[..., object], *args: object) -> DynxError | None:
    """Call a function and return its error, or None, so that results are still shown if it fails."""
    try:
        call(*args)
    except DynxError as error:
        return error
    return None


def exit_code(*errors: DynxError | None, negative: bool = False) -> int:
    """Write the errors of files, where there are any, to standard error; return the exit code of a command,
    whose result is `negative` or not."""
    found = [each for each in errors if each is not None]
    for each in found:
        complain(str(each))
    return BAD_INPUT if found else NEGATIVE_RESULT if negative else DONE


class ClosedPipe(Exception):
    """The reader of standard output closed it."""


@contextmanager
def closed_pipe_raised() -> Iterator[None]:
    """Raise ClosedPipe where click or rich would exit with code 1, which has another meaning here."""
    try:
        yield
    except BrokenPipeError as error:
        raise ClosedPipe from error
    except SystemExit as end:  # raised by rich
        if isinstance(end.__context__, BrokenPipeError):
            raise ClosedPipe from end
        raise


def report_failure(error: BaseException, command: str) -> int:
    """Write the error of `command` to standard error; return its exit code."""
    if isinstance(error, ClosedPipe):  # silent, as is usual for a closed pipe
        _discard_output()
        return PIPE_CLOSED
    if traceback_wanted():
        traceback.print_exception(error, file=sys.stderr)
    if isinstance(error, (click.Abort, KeyboardInterrupt)):
        complain("interrupted")
        return INTERRUPTED
    if isinstance(error, click.exceptions.NoArgsIsHelpError):
        with suppress(OSError):
            click.echo(error.format_message(), err=True)
        return BAD_INPUT
    if isinstance(error, click.UsageError):
        where = command if error.ctx is None else error.ctx.command_path
        complain(f"{_usage_message(error)} (see '{where} --help')")
        return BAD_INPUT
    if isinstance(error, click.ClickException):
        complain(error.format_message())
        return BAD_INPUT
    if isinstance(error, DynxError):
        complain(str(error))
        return NOT_WRITTEN if isinstance(error, TemporaryFolderError) else BAD_INPUT
    if isinstance(error, OSError) and error.filename is None and error.errno in _WRITING_FAILED:
        _discard_output()
        complain(f"standard output cannot be written: {error.strerror}")
        return NOT_WRITTEN
    if isinstance(error, MemoryError):
        complain("out of memory")
        return DEFECT
    hint = "" if traceback_wanted() else "; dynx --traceback COMMAND shows where"
    complain(f"defect of dynx, not of your input: {type(error).__name__}: {error}{hint}")
    return DEFECT


def _usage_message(error: click.UsageError) -> str:
    """Return the message of an error of usage, for an unknown option with the nearest of the command."""
    if not isinstance(error, click.NoSuchOption) or error.ctx is None:
        return error.format_message()
    options = [
        name
        for each in error.ctx.command.params
        if isinstance(each, click.Option) and not each.hidden
        for name in (*each.opts, *each.secondary_opts)
    ]
    former = _former_option(error.option_name, options)
    if former:
        return f"no option {shown(error.option_name)}; {former}"
    # Without dashes, which all options share.
    near = nearest(error.option_name.lstrip("-"), [each.lstrip("-") for each in options])
    found = [name for name in options if f"'{name.lstrip('-')}'" in near] if "?" in near else []
    clause = f"; did you mean {' or '.join(found)}?" if found else ""
    return f"no option {shown(error.option_name)}{clause}"


def _former_option(name: str, options: Collection[str]) -> str:
    """Return what an option of a former name is now, if that is among `options`; empty for any other."""
    from dynx.sim.scenario.options import FORMER_NAMES

    flags = {
        f"--{former}".replace("_", "-"): f"--{present}".replace("_", "-")
        for former, present in FORMER_NAMES.items()
    }
    if flags.get(name) in options:
        return f"it is now {flags[name]}"
    if name == "--joint-dynamics" and "--no-joint-dynamics" in options:
        return "joints have those of the description by default"
    return ""


def _discard_output() -> None:
    """Discard buffered output, which Python would otherwise try to write again at exit, with an error."""
    with suppress(AttributeError, io.UnsupportedOperation):  # no standard output, or one in memory
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


class Interruption:
    """Request to end the run.

    `code` is None until a signal arrives; then it is the exit code, 128 + signal. Set `finishing` to have
    later signals ignored while the results are written.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        self.finishing = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: the first ends the work, later ones are ignored so that no results are lost."""
        if self.finishing or self.code is not None:
            return
        self.code = 128 + number
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Raise KeyboardInterrupt in the block at the first SIGINT or SIGTERM, unless `finishing` is set."""
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption  # only the main thread can set handlers and receives signals
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, interruption.handle) for number in numbers]
    try:
        yield interruption
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
