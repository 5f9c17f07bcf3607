"""Cache of dynx on disk, shared between processes: contents that are computed again when they are missing.

The folder is given by the environment variable ``DYNX_CACHE_DIR``, by default the user's cache folder of
dynx. ``DYNX_CACHE=0`` switches the cache off; a folder that cannot be written is silently not used. Some
contents are code that is executed, so a folder that another user owns or may write to is not used either.

Each file has a checksum and is written under a temporary name first, so that a truncated, altered or
unfinished file is never used but computed again and replaced.
"""

from __future__ import annotations

import contextlib
import os
import stat
from hashlib import sha256
from pathlib import Path

import platformdirs

from dynx.errors import ArgumentError
from dynx.files.reading import open_regular
from dynx.files.writing import write_bytes

MAX_CACHE_BYTES = 512 * 2**20
"""Largest size of the cache [bytes]; beyond it the least recently used files are removed."""

OFF_WORDS = frozenset({"0", "no", "off", "false"})
"""Values of ``DYNX_CACHE`` that switch the cache off."""

_MAGIC = b"dynx cache 3\n"
_DIGEST = 32


def read_cached(name: str) -> bytes | None:
    """Return the content that is kept under the name of a file; None if there is none or it is damaged."""
    folder = _cache_folder()
    if folder is None:
        return None
    path = folder / name
    try:
        with open_regular(path) as file:
            content = file.read()
        os.utime(path)
    except OSError:
        return None
    start = len(_MAGIC) + _DIGEST
    digest, body = content[len(_MAGIC) : start], content[start:]
    if content[: len(_MAGIC)] != _MAGIC or sha256(body).digest() != digest:
        return None
    return body


def keep(name: str, content: bytes) -> None:
    """Keep a content under the name of a file, atomically; nothing happens if the cache cannot be used."""
    folder = _cache_folder()
    if folder is None:
        return
    # Only the user may read or write it, whatever the umask: it may hold code that is run.
    with contextlib.suppress(ArgumentError, OSError):
        write_bytes(folder / name, _MAGIC + sha256(content).digest() + content, mode=0o600, sync=False)
        _evict(folder)


def source_hash(*sources: Path) -> str:
    """Return a hash of Python files and of the Python files in folders and in the folders below them.

    It is a part of the names under which their results are kept, so that no result of another source is used.
    """
    digest = sha256()
    for source in sources:
        files = sorted(source.rglob("*.py")) if source.is_dir() else [source]
        for file in files:
            name, text = file.relative_to(source).as_posix(), file.read_bytes()
            digest.update(f"{name} {len(text)}\n".encode())
            digest.update(text)
    return digest.hexdigest()


def _cache_folder() -> Path | None:
    """Return the cache folder, created if necessary, or None if the cache is off or unusable."""
    if os.environ.get("DYNX_CACHE", "").strip().lower() in OFF_WORDS:
        return None
    given = os.environ.get("DYNX_CACHE_DIR")
    folder = (Path(given) if given else platformdirs.user_cache_path("dynx")) / "kernels"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
    except OSError:
        return None
    if hasattr(os, "geteuid") and (
        state.st_uid != os.geteuid() or state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    ):
        return None
    return folder if os.access(folder, os.W_OK | os.X_OK) else None


def _evict(folder: Path) -> None:
    """Remove the least recently used files until the folder holds at most `MAX_CACHE_BYTES`."""
    found = []
    with os.scandir(folder) as entries:
        for entry in entries:
            # Another process may remove a file between listing it and reading its state.
            with contextlib.suppress(FileNotFoundError):
                state = entry.stat()
                found.append((state.st_mtime, state.st_size, entry.path))
    total = sum(size for _, size, _ in found)
    for _, size, name in sorted(found):
        if total <= MAX_CACHE_BYTES:
            return
        with contextlib.suppress(OSError):
            os.unlink(name)
        total -= size
