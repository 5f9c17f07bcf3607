"""Safe reading of a file named by the user, which has to be a regular file of limited size."""

from __future__ import annotations

import os
import stat

from dynx.errors import ArgumentError, DescriptionError, RobotNotFoundError, shown

MAX_BYTES = 64 * 1024 * 1024
"""Largest size of a file [bytes]; the largest description in public use is under 2 MiB."""


def read_file(path: str) -> bytes:
    """Return the bytes of a regular file.

    Raises RobotNotFoundError where nothing is there, DescriptionError for a directory, a FIFO, a
    device, a file that may not be read, or one above MAX_BYTES.
    """
    try:
        # The type is checked before the file is opened, because opening a device can have effects and opening
        # a FIFO blocks.
        _require_regular(os.stat(path), path)
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        descriptor = os.open(path, flags)
        with open(descriptor, "rb") as file:
            _require_regular(os.fstat(descriptor), path)
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise RobotNotFoundError(f"no such file: {shown(path, 300)}") from None
    except DescriptionError:
        raise
    except (OSError, ValueError) as error:
        # Python raises ValueError for a path with a null character.
        reason = getattr(error, "strerror", None) or str(error)
        raise DescriptionError(f"cannot be read: {reason}", source=printable(path)) from None
    if len(data) > MAX_BYTES:
        raise _too_large(path)
    return data


def checked_path(path: object) -> str:
    """Return a path as a str. Raises ArgumentError for anything but a str, bytes or an `os.PathLike`."""
    try:
        return os.fsdecode(path)  # type: ignore[arg-type]
    except TypeError:
        raise ArgumentError(f"a path is {shown(path)}; wanted a str or an os.PathLike") from None


def printable(path: str) -> str:
    """Return `path` for use in a message, quoted where it is long or holds control characters."""
    return path if path.isprintable() and len(path) <= 300 else shown(path, 300)


def _require_regular(status: os.stat_result, path: str) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise DescriptionError("is a directory; wanted a file", source=printable(path))
    if not stat.S_ISREG(status.st_mode):
        kind = "a FIFO" if stat.S_ISFIFO(status.st_mode) else "a device or socket"
        raise DescriptionError(f"is {kind}; wanted a regular file", source=printable(path))
    if status.st_size > MAX_BYTES:
        raise _too_large(path)


def _too_large(path: str) -> DescriptionError:
    return DescriptionError(
        f"is larger than {MAX_BYTES // 1024**2} MiB, the most that is read", source=printable(path)
    )
