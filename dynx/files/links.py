"""Symbolic links in the place of files whose names dynx chooses."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path, PurePath

from dynx.errors import ArgumentError, shown


def refuse_links(folder: str | os.PathLike[str], names: Iterable[str]) -> None:
    """Raise ArgumentError for a file or folder in `folder` that is a symbolic link.

    Only a path that the user names is followed. A link under a name that dynx chooses may be of somebody
    else, and leads what is written to another place. `names` are relative paths.
    """
    for name in names:
        path = Path(folder)
        for part in PurePath(name).parts:
            path /= part
            if path.is_symlink():
                raise ArgumentError(
                    f"{shown(path, 300)} is a link, through which dynx would write; remove it"
                )
