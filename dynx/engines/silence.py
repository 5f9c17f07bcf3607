"""Suppression and capture of the output that engines write to the C-level streams of the process."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from dynx.errors import nonblank_lines
from dynx.files.temporary import temporary_file


@contextmanager
def silence() -> Iterator[None]:
    """Discard all output of the process to stdout and stderr, that of C libraries included.

    The output of other threads is discarded too.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        with _streams_to(nowhere):
            yield
    finally:
        os.close(nowhere)


@contextmanager
def capture_output(lines: list[str]) -> Iterator[None]:
    """Capture all output of the process as `silence` does, and append its non-blank lines to `lines`."""
    with temporary_file() as file:
        try:
            with _streams_to(file.fileno()):
                yield
        finally:
            file.seek(0)
            lines += nonblank_lines(file.read().decode("utf-8", "replace"))


@contextmanager
def _streams_to(target: int) -> Iterator[None]:
    for stream in (sys.stdout, sys.stderr):
        if not getattr(stream, "closed", True):
            stream.flush()
    _flush_c_streams()
    with ExitStack() as undo:
        for descriptor in (1, 2):
            try:
                kept = os.dup(descriptor)
            except OSError:
                continue  # the process has no such stream
            undo.callback(os.close, kept)
            undo.callback(os.dup2, kept, descriptor)
            os.dup2(target, descriptor)
        # Called before the streams are restored, so that C's buffers are discarded or captured too.
        undo.callback(_flush_c_streams)
        yield


def _flush_c_streams() -> None:
    library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    library.fflush(None)
