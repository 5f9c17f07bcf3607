"""Engines print to the C-level streams of the process; this keeps them quiet for a moment."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryFile


@contextmanager
def silence() -> Iterator[None]:
    """Send what the process writes to stdout and stderr, C libraries included, nowhere for a moment.

    It acts on the whole process: other threads are silent meanwhile.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        with _streams_to(nowhere):
            yield
    finally:
        os.close(nowhere)


@contextmanager
def overhear(lines: list[str]) -> Iterator[None]:
    """As `silence`; what was written, line by line and without blank ones, is added to `lines`."""
    with TemporaryFile() as file:
        try:
            with _streams_to(file.fileno()):
                yield
        finally:
            file.seek(0)
            written = file.read().decode("utf-8", "replace").splitlines()
            lines += [line.strip() for line in written if line.strip()]


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
                continue  # the process runs without it
            undo.callback(os.close, kept)
            undo.callback(os.dup2, kept, descriptor)
            os.dup2(target, descriptor)
        # Called first on the way out: what is in C's buffers must not come out after all.
        undo.callback(_flush_c_streams)
        yield


def _flush_c_streams() -> None:
    library = ctypes.cdll.msvcrt if sys.platform == "win32" else ctypes.CDLL(None)
    library.fflush(None)
