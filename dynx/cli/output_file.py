"""A results file: refused before hours of work rather than after, and never left half written."""

from __future__ import annotations

import os
import stat
import tempfile

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


def write_text(path: str, text: str) -> None:
    """Write `text` (ASCII) to `path`: all of it, or an ArgumentError and the old file as it was."""
    try:
        if os.path.lexists(path) and not stat.S_ISREG(os.lstat(path).st_mode):
            # A pipe, a device or a link is written through, not replaced.
            with open(path, "w", encoding="ascii") as stream:
                stream.write(text)
            return
        handle, partial = tempfile.mkstemp(dir=os.path.dirname(path) or ".", prefix=".dynx-", suffix=".json")
        try:
            with open(handle, "w", encoding="ascii") as stream:
                stream.write(text)
            os.chmod(partial, 0o666 & ~_umask())
            os.replace(partial, path)
        except BaseException:
            os.unlink(partial)
            raise
    except OSError as error:
        raise ArgumentError(f"{shown(path, 300)} cannot be written: {error.strerror}") from error


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
