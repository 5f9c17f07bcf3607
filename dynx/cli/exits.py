"""Exit codes of the command line, and how an error becomes one clear line and a code.

0    done; for `agree`, all engines agree; for `ik`, the target was reached
1    done, and the answer is no: engines differ, the target was not reached
2    some input cannot be used (`agree` still did the rest)
70   a defect of dynx
130  interrupted (Ctrl-C); 143 terminated
"""

from __future__ import annotations

import os
import sys
import traceback

import click

from dynx.errors import DynxError

DONE, ANSWER_IS_NO, BAD_INPUT, DEFECT, INTERRUPTED = 0, 1, 2, 70, 130

TRACEBACK_VARIABLE = "DYNX_TRACEBACK"
"""Set to anything but 0 or nothing, this environment variable shows where an error was raised."""


def traceback_wanted() -> bool:
    """Whether `TRACEBACK_VARIABLE` asks for tracebacks."""
    return os.environ.get(TRACEBACK_VARIABLE, "0") not in ("", "0")


def one_line(text: object) -> str:
    """`text` without line breaks or other control characters, fit to be one line of a message."""
    joined = " ".join(str(text).split())
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in joined)


def complain(message: str) -> None:
    """Say `message` on standard error, as one line."""
    click.echo(f"dynx: error: {one_line(message)}", err=True)


def report_failure(error: BaseException, command: str) -> int:
    """Say on standard error what went wrong in `command`; the exit code that belongs to it."""
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
    if isinstance(error, MemoryError):
        complain("out of memory")
        return DEFECT
    hint = "" if traceback_wanted() else "; --traceback shows where"
    complain(f"this is a defect of dynx, not of your input: {type(error).__name__}: {error}{hint}")
    return DEFECT
