"""Atomic writing of files: the file gets its name only when its content is complete."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from dynx.errors import ArgumentError, shown


@contextmanager
def atomic_file(path: str | os.PathLike[str], mode: int = 0o666) -> Iterator[BinaryIO]:
    """Open a file for writing that gets its name when the block ends without an error.

    Until then it has another name in the same folder. If the block fails, for example because the disk is
    full, that file is deleted and an existing file stays as it was. Symbolic links are followed. A replaced
    file keeps its permissions; a new one gets `mode` minus the umask of the process. A named pipe or a device
    is written directly. Raises ArgumentError if the file cannot be written.
    """
    target = Path(os.path.realpath(path))
    partial = target.with_name(f".dynx-{secrets.token_hex(8)}.part")
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, "it is a directory")
        if target.exists() and not target.is_file():
            with open(target, "wb", opener=_require_reader) as stream:
                yield stream
            return
        with open(partial, "xb", opener=lambda name, flags: os.open(name, flags, mode)) as file:
            yield file
        if target.exists():
            shutil.copymode(target, partial)
        os.replace(partial, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise ArgumentError(f"{shown(os.fspath(path), 300)} cannot be written: {reason}") from error
        raise


def write_bytes(path: str | os.PathLike[str], data: bytes, mode: int = 0o666) -> None:
    """Write `data` to `path` as `atomic_file` does."""
    with atomic_file(path, mode) as file:
        file.write(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text`, which is ASCII, to `path` as `atomic_file` does."""
    write_bytes(path, text.encode("ascii"))


def _require_reader(path: str, flags: int) -> int:
    """Open a file; OSError ENXIO for a named pipe without a reader, on which `open` would block forever."""
    try:
        descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise OSError(errno.ENXIO, "nobody reads from this pipe") from error
        raise
    if hasattr(os, "O_NONBLOCK"):
        os.set_blocking(descriptor, True)
    return descriptor
