"""Temporary files, for engines that read and write only files. No other module imports `tempfile`."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

from dynx.errors import TemporaryFolderError
from dynx.files.reading import printable

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}
"""Errors of a write for which there is no room."""


@contextmanager
def temporary_folder(prefix: str = "dynx-") -> Iterator[Path]:
    """Make a folder that exists while the block lasts.

    Raises TemporaryFolderError if it cannot be made, or if the block cannot write a file in it.
    """
    with ExitStack() as stack:
        with writing_in():
            folder = tempfile.TemporaryDirectory(prefix=prefix, ignore_cleanup_errors=True)
            path = Path(stack.enter_context(folder))
        with writing_in(path):
            yield path


@contextmanager
def temporary_file() -> Iterator[IO[bytes]]:
    """Open a file without a name that exists while the block lasts. Raises TemporaryFolderError."""
    with ExitStack() as stack:
        with writing_in():
            file = stack.enter_context(tempfile.TemporaryFile())
        yield file


@contextmanager
def writing_in(folder: Path | None = None) -> Iterator[None]:
    """Raise TemporaryFolderError where the block cannot write in a temporary folder; errors of other files
    stay. Without `folder` the block makes one."""
    try:
        yield
    except OSError as error:
        of_folder = folder is None or str(error.filename).startswith(str(folder))
        if not of_folder and error.errno not in _FULL:
            raise
        if folder is not None:
            where = os.path.dirname(folder)
        else:
            where = tempfile.tempdir or os.environ.get("TMPDIR", "")
        raise TemporaryFolderError(
            f"the temporary folder {printable(where)} cannot be written: {error.strerror or error}; "
            "free some space there, or name another folder in TMPDIR"
        ) from error
