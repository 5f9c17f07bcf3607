"""Exit codes of the command line, and how an error becomes one clear line and a code.

0    done; for `agree`, all engines agree; for `ik`, the target was reached; for `sim`, the end was
1    done, and the answer is no: engines differ, the target was not reached, the simulation diverged
2    some input cannot be used (`agree` still did the rest)
70   a defect of dynx
74   standard output cannot be written: the disk is full, say (EX_IOERR of sysexits.h)
130  interrupted (Ctrl-C); 143 terminated
141  whoever read standard output stopped reading, as `head` does (128 and SIGPIPE)
"""

from __future__ import annotations

import errno
import io
import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import click

from dynx.errors import DynxError, traceback_wanted

DONE, ANSWER_IS_NO, BAD_INPUT, DEFECT, NOT_WRITTEN, INTERRUPTED, PIPE_CLOSED = 0, 1, 2, 70, 74, 130, 141

_WRITING_FAILED = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF}
"""What writing to a stream that is open can meet; an error of opening a file bears its name."""


def one_line(text: object) -> str:
    """`text` without line breaks or other control characters, fit to be one line of a message."""
    joined = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)


def short_line(text: object) -> str:
    """As `one_line`, and cut where it is very long: what names a robot may be anything."""
    line = one_line(text)
    return line if len(line) <= 200 else f"{line[:60]}... ({len(line)} characters)"


def complain(message: str) -> None:
    """Say `message` on standard error, as one line."""
    # Where standard error cannot be written, the exit code is all that can still be said.
    with suppress(OSError):
        click.echo(f"dynx: error: {one_line(message)}", err=True)


class ClosedPipe(Exception):
    """Whoever read the output stopped reading."""


@contextmanager
def closed_pipe_raised() -> Iterator[None]:
    """Raise ClosedPipe where click or rich would end with exit code 1, which means something else here."""
    try:
        yield
    except BrokenPipeError as error:
        raise ClosedPipe from error
    except SystemExit as end:  # what rich makes of it
        if isinstance(end.__context__, BrokenPipeError):
            raise ClosedPipe from end
        raise


def report_failure(error: BaseException, command: str) -> int:
    """Say on standard error what went wrong in `command`; the exit code that belongs to it."""
    if isinstance(error, ClosedPipe):  # nothing is said, as is the custom
        _discard_output()
        return PIPE_CLOSED
    if traceback_wanted():
        traceback.print_exception(error, file=sys.stderr)
    if isinstance(error, (click.Abort, KeyboardInterrupt)):
        complain("interrupted")
        return INTERRUPTED
    if isinstance(error, click.UsageError):
        where = command if error.ctx is None else error.ctx.command_path
        complain(f"{error.format_message()} (see '{where} --help')")
        return BAD_INPUT
    if isinstance(error, click.ClickException):
        complain(error.format_message())
        return BAD_INPUT
    if isinstance(error, DynxError):
        complain(str(error))
        return BAD_INPUT
    if isinstance(error, OSError) and error.filename is None and error.errno in _WRITING_FAILED:
        _discard_output()
        complain(f"standard output cannot be written: {error.strerror}")
        return NOT_WRITTEN
    if isinstance(error, MemoryError):
        complain("out of memory")
        return DEFECT
    hint = "" if traceback_wanted() else "; --traceback shows where"
    complain(f"this is a defect of dynx, not of your input: {type(error).__name__}: {error}{hint}")
    return DEFECT


def _discard_output() -> None:
    """Send what is still buffered nowhere: Python would try again to write it when it ends, and complain."""
    with suppress(AttributeError, io.UnsupportedOperation):  # no standard output, or one in memory
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
