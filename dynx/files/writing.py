"""Atomic writing of files: the file gets its name only when its content is complete and on the disk."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from dynx.errors import ArgumentError, shown
from dynx.files.reading import checked_path

if sys.platform != "win32":
    import fcntl

_UNFINISHED_NAME = re.compile(r"\.dynx-[0-9a-f]{16}\.part")

_ABANDONED_AFTER = 86_400.0
"""Age [s] from which an unfinished file counts as abandoned on systems without file locks."""

_WITHOUT_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.ENOSYS}
"""Errors of file systems that have no `fsync`."""

_cleared_folders: set[Path] = set()


@contextmanager
def atomic_file(path: str | os.PathLike[str], mode: int = 0o666, *, sync: bool = True) -> Iterator[BinaryIO]:
    """Open a file for writing that gets its name when the block ends without an error.

    Until then it has another name in the same folder. If the block fails, for example because the disk is
    full, that file is deleted and an existing file stays as it was; if the process is killed, the next one
    that writes into the folder deletes it. With `sync` the content is on the disk before the file gets its
    name, so that it survives a power failure. Symbolic links are followed. A replaced file keeps its
    permissions; a new one gets `mode` minus the umask of the process. A named pipe or a device is written
    directly. Raises ArgumentError if the file cannot be written.
    """
    target = Path(os.path.realpath(checked_path(path)))
    partial: Path | None = None
    try:
        if os.path.isdir(target):
            raise IsADirectoryError(errno.EISDIR, "it is a directory")
        if os.path.exists(target) and not os.path.isfile(target):
            with open(target, "wb", opener=_require_reader) as stream:
                yield stream
            return
        if target.parent not in _cleared_folders:
            clear_unfinished(target.parent)
            _cleared_folders.add(target.parent)
        partial, file = _unfinished_file(target.parent, mode)
        with file:
            yield file
            file.flush()
            if sync:
                _sync(file.fileno())
            if os.path.exists(target):
                shutil.copymode(target, partial)
            if sys.platform != "win32":
                # The file is still locked, so that nobody takes it for an abandoned one.
                os.replace(partial, target)
        if sys.platform == "win32":
            os.replace(partial, target)
        if sync:
            _sync_folder(target.parent)
    except BaseException as error:
        if partial is not None:
            with contextlib.suppress(OSError):
                partial.unlink()
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise ArgumentError(f"{shown(os.fspath(path), 300)} cannot be written: {reason}") from error
        raise


def write_bytes(path: str | os.PathLike[str], data: bytes, mode: int = 0o666, *, sync: bool = True) -> None:
    """Write `data` to `path` as `atomic_file` does."""
    with atomic_file(path, mode, sync=sync) as file:
        file.write(data)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write `text`, which is ASCII, to `path` as `atomic_file` does."""
    write_bytes(path, text.encode("ascii"))


def clear_unfinished(folder: Path) -> None:
    """Delete the unfinished files in a folder whose processes have ended, as far as they can be deleted."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if _UNFINISHED_NAME.fullmatch(entry.name):
                with contextlib.suppress(OSError):
                    if entry.is_file(follow_symlinks=False):
                        _delete_abandoned(entry.path)


def _unfinished_file(folder: Path, mode: int) -> tuple[Path, BinaryIO]:
    """Create a file that is locked until it is closed, where the file system has locks."""
    while True:
        path = folder / f".dynx-{secrets.token_hex(8)}.part"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        file = os.fdopen(os.open(path, flags, mode), "wb")
        if sys.platform != "win32":
            with contextlib.suppress(OSError):
                fcntl.flock(file, fcntl.LOCK_EX)
        # Another process may have deleted the file before it was locked.
        if os.fstat(file.fileno()).st_nlink:
            return path, file
        file.close()


def _delete_abandoned(path: str) -> None:
    """Delete an unfinished file unless a process is writing it. Raises OSError where that is not known."""
    if sys.platform == "win32":
        if time.time() - os.stat(path).st_mtime > _ABANDONED_AFTER:
            os.unlink(path)
    else:
        descriptor = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_NOFOLLOW)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.unlink(path)
        finally:
            os.close(descriptor)


def _sync(descriptor: int) -> None:
    """Wait until the content of an open file or folder is on the disk."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _WITHOUT_SYNC:
            raise


def _sync_folder(folder: Path) -> None:
    """Wait until the names in a folder are on the disk, where the system can do that."""
    if sys.platform == "win32":
        return
    # The file is complete under its name; a folder that cannot be read does not make it invalid.
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            _sync(descriptor)
        finally:
            os.close(descriptor)


def _require_reader(path: str, flags: int) -> int:
    """Open a file; OSError ENXIO for a named pipe without a reader, on which `open` would block forever."""
    try:
        descriptor = os.open(path, flags | getattr(os, "O_NONBLOCK", 0))
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise OSError(errno.ENXIO, "nobody reads from this pipe") from error
        raise
    if sys.platform != "win32":
        os.set_blocking(descriptor, True)
    return descriptor
