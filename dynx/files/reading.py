"""Safe reading of files named by the user: only regular files are opened, and their size is limited."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, shown

MAX_BYTES = 64 * 1024 * 1024
"""Largest size of a file [bytes]; the largest description in public use is under 2 MiB."""

MAX_BINARY_BYTES = 1_500_000_000
"""Largest size of a file of arrays or messages, and of what is expanded from it [bytes]."""


class NotRegularError(OSError):
    """The path leads to a directory, a FIFO, a device or a socket; `strerror` says to which."""


def open_regular(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a regular file for reading. Raises OSError, NotRegularError for anything else that is there.

    Opening a device can have effects, and opening a FIFO blocks, so neither is opened.
    """
    try:
        _require_regular(os.stat(path))
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except ValueError as error:
        # Python raises ValueError for a path with a null character.
        raise OSError(errno.EINVAL, str(error)) from None
    try:
        # Another program may have replaced the file meanwhile.
        _require_regular(os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


_LFS_POINTER = b"version https://git-lfs.github.com/spec/"
"""First bytes of the text that a clone has in place of a large file until Git LFS fetches it."""


def read_file(path: str) -> bytes:
    """Return the bytes of a regular file.

    Raises RobotNotFoundError where nothing is there, DescriptionError for a directory, a FIFO, a
    device, a file that may not be read, one above MAX_BYTES, or a pointer of Git LFS.
    """
    try:
        with open_regular(path) as file:
            too_large = os.fstat(file.fileno()).st_size > MAX_BYTES
            data = b"" if too_large else file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise RobotNotFoundError(f"no such file: {shown(path, 300)}") from None
    except NotRegularError as error:
        raise DescriptionError(str(error.strerror), source=printable(path)) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise DescriptionError(f"cannot be read: {reason}", source=printable(path)) from None
    if too_large or len(data) > MAX_BYTES:
        raise DescriptionError(
            f"is larger than {MAX_BYTES // 1024**2} MiB, the most that is read", source=printable(path)
        )
    if data.startswith(_LFS_POINTER):
        raise DescriptionError(
            "is a pointer of Git LFS in place of the file; `git lfs pull` in its repository fetches the file",
            source=printable(path),
        )
    return data


@contextmanager
def named_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """Open a regular file that a user names. Raises ArgumentError for anything that cannot be opened."""
    try:
        file = open_regular(path)
    except OSError as error:
        raise ArgumentError(f"{shown(path, 300)} cannot be read: {error.strerror or error}") from error
    with file:
        yield file


def require_size(file: BinaryIO, most: int = MAX_BINARY_BYTES) -> int:
    """Return the size of an open file [bytes]. Raises ValueError for one above `most`, which a file with
    holes can be without taking space on the disk."""
    size = os.fstat(file.fileno()).st_size
    if size > most:
        raise ValueError(f"it has {size:,} bytes, more than the {most:,} that are read")
    return size


def irregularity(path: str | os.PathLike[str]) -> str:
    """Return what a path leads to, such as "is a FIFO; wanted a regular file"; empty for a regular file, and
    where nothing is there."""
    try:
        _require_regular(os.stat(path))
    except NotRegularError as error:
        return str(error.strerror)
    except (OSError, ValueError):
        pass
    return ""


def checked_path(path: object, name: str = "a path") -> str:
    """Return the path given for the argument `name` as a str. Raises ArgumentError for anything but a str,
    bytes or an `os.PathLike`, and for characters that no name of a file has: NUL and surrogates."""
    try:
        found = os.fsdecode(path)  # type: ignore[arg-type]  # anything is tried
    except TypeError:
        raise ArgumentError(f"{name} is {shown(path)}; wanted a str or an os.PathLike") from None
    try:
        os.fsencode(found)
    except UnicodeEncodeError:
        raise ArgumentError(f"{name} is {shown(found)}; wanted characters of a file's name") from None
    if "\0" in found:
        raise ArgumentError(f"{name} is {shown(found)}; wanted one without the character of the number 0")
    return found


def printable(path: str) -> str:
    """Return `path` for use in a message, quoted where it is empty or long or holds control characters."""
    return path if path and path.isprintable() and len(path) <= 300 else shown(path, 300)


def _require_regular(status: os.stat_result) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise NotRegularError(errno.EISDIR, "is a directory; wanted a file")
    if not stat.S_ISREG(status.st_mode):
        kind = "a FIFO" if stat.S_ISFIFO(status.st_mode) else "a device or socket"
        raise NotRegularError(errno.EINVAL, f"is {kind}; wanted a regular file")
