"""Checks of a results file before the work: a file that cannot be written is refused at once."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable

from dynx.errors import ArgumentError, shown


def check_writable(path: str) -> None:
    """Raise ArgumentError if `path` is a directory, in no directory, or write-protected."""
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


def check_json(path: str | None) -> None:
    """Check the file of ``--json``, if that is a file, like `check_writable`."""
    if path is not None and path != "-":
        check_writable(path)


def require_apart(paths: Iterable[str], kept: Iterable[str], what: str) -> None:
    """Raise ArgumentError where a path is one of the files `kept`, under any name.

    `what` describes these files in the message, as in ``a file that is read``.
    """
    files = {_identity(each) for each in kept} - {None}
    for path in paths:
        if _identity(path) in files:
            raise ArgumentError(f"{shown(path, 300)} is {what}, and would be overwritten")


def make_folder(path: str) -> None:
    """Create the directory of an output file where it does not exist."""
    folder = os.path.dirname(path) or "."
    try:
        os.makedirs(folder, exist_ok=True)
    except OSError as error:
        raise ArgumentError(f"{shown(folder, 300)} cannot be created: {error.strerror}") from error


def _identity(path: str) -> tuple[int, int] | None:
    """Return device and inode of a regular file; None where there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None
