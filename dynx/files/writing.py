"""Writing a file: all of it, or nothing under its name."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from dynx.errors import ArgumentError, shown


@contextmanager
def whole_file(path: str | os.PathLike[str]) -> Iterator[BinaryIO]:
    """A file to write into, which gets its name when the block ends well.

    Until then it has another name in the same folder. If the disk is full, or anything else ends the
    block early, it is deleted and what was there before stays. A link is followed, and the permissions
    of a file that is replaced are kept. Raises ArgumentError where the system does not let it be written.
    """
    target = Path(os.path.realpath(path))
    partial = target.with_name(f".dynx-{secrets.token_hex(8)}.part")
    try:
        if target.is_dir():
            raise IsADirectoryError(0, "it is a directory")
        with partial.open("xb") as file:
            yield file
        if target.exists():
            shutil.copymode(target, partial)
        os.replace(partial, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            partial.unlink()
        if isinstance(error, OSError):
            why = error.strerror or str(error)
            raise ArgumentError(f"{shown(os.fspath(path), 300)} cannot be written: {why}") from error
        raise
