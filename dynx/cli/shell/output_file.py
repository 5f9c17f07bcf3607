"""A results file: refused before hours of work rather than after, and never left half written."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterable

from dynx.errors import ArgumentError, shown


def check_writable(path: str) -> None:
    """Raise ArgumentError if `path` plainly cannot be written."""
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


def require_apart(paths: Iterable[str], kept: Iterable[str], what: str) -> None:
    """Raise ArgumentError where a path is one of the files `kept`, under whatever name: it would be lost.

    `what` says what they are, as in ``a file that is read``.
    """
    files = {_identity(each) for each in kept} - {None}
    for path in paths:
        if _identity(path) in files:
            raise ArgumentError(f"{shown(path, 300)} is {what}, and would be written over")


def make_folder(path: str) -> None:
    """Make the directory of a file that is to be written, where there is none yet."""
    folder = os.path.dirname(path) or "."
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{shown(folder, 300)} cannot be made: {error.strerror}") from error


def write_text(path: str, text: str) -> None:
    """Write `text` (ASCII) to `path`: all of it, or an ArgumentError and the old file as it was."""
    write_bytes(path, text.encode("ascii"))


def write_bytes(path: str, data: bytes) -> None:
    """Write `data` to `path`: all of it, or an ArgumentError and the old file as it was."""
    try:
        if os.path.lexists(path) and not stat.S_ISREG(os.lstat(path).st_mode):
            # A pipe, a device or a link is written through, not replaced.
            with open(path, "wb", opener=_unless_nobody_reads) as stream:
                stream.write(data)
            return
        handle, partial = tempfile.mkstemp(
            dir=os.path.dirname(path) or ".", prefix=".dynx-", suffix=".partial"
        )
        try:
            with open(handle, "wb") as stream:
                stream.write(data)
            os.chmod(partial, _mode(path))
            os.replace(partial, path)
        except BaseException:
            os.unlink(partial)
            raise
    except OSError as error:
        reason = "nobody reads from this pipe" if error.errno == errno.ENXIO else error.strerror
        raise ArgumentError(f"{shown(path, 300)} cannot be written: {reason}") from error


def _unless_nobody_reads(path: str, flags: int) -> int:
    """Open a file; OSError ENXIO for a named pipe without a reader, for which `open` would wait forever."""
    handle = os.open(path, flags | getattr(os, "O_NONBLOCK", 0), 0o666)
    if hasattr(os, "O_NONBLOCK"):
        os.set_blocking(handle, True)
    return handle


def _identity(path: str) -> tuple[int, int] | None:
    """What tells a regular file from every other one, whatever it is called; None where there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None


def _mode(path: str) -> int:
    """The permissions of the file that is replaced, or those of a new one."""
    if os.path.exists(path):
        return stat.S_IMODE(os.stat(path).st_mode)
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask
