"""Machine code kept between processes.

The folder is that of the environment variable ``DYNX_CACHE_DIR``, or else the user's cache folder of
dynx; ``DYNX_CACHE=0`` switches the cache off, and so, without a word, does a folder that cannot be
written. Code found there is run, so a folder that somebody else owns or may write to is not used.

An image is found by a key: the hash of its *recipe* and of all that turns the recipe into machine
code. A recipe is any text that decides what the program is; `recipe_of` gives that of a program at
hand, and a caller who knows a shorter one saves the time of tracing. Each file carries a checksum and
is written under another name first, so that what is cut short, altered or being written by another
process is never used: it is compiled again and replaced.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path

import platformdirs

from dynx.errors import ArgumentError, CompileError
from dynx.files.writing import write_bytes
from dynx.simd.emit import Settings
from dynx.simd.image import Image, compiled
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.target import Target, compiler_version, host

LARGEST = 512 * 2**20
"""Bytes the cache may hold; beyond, what was not used for longest is removed."""

OFF = frozenset({"0", "no", "off", "false"})
"""What ``DYNX_CACHE`` is set to where nothing shall be kept."""

_SUFFIX = ".kernel"
_MAGIC = b"dynx kernel 1\n"
_DIGEST = 32


def cached_kernel(
    recipe: bytes,
    program: Callable[[], Program],
    *,
    target: Target | None = None,
    settings: Settings | None = None,
) -> Kernel:
    """The kernel of `recipe`: from the cache, or of `program()`, which the cache then remembers."""
    target = host() if target is None else target
    settings = Settings(target.lanes) if settings is None else settings
    folder = _folder()
    if folder is None:
        return Kernel(program(), target=target, settings=settings)
    path = folder / (_key(recipe, target, settings) + _SUFFIX)
    found = _read(path, target)
    if found is not None:
        with contextlib.suppress(CompileError):
            return Kernel(found)
    image = compiled(program(), target, settings)
    _write(path, image)
    return Kernel(image)


def recipe_of(program: Program) -> bytes:
    """A recipe for a program: its nodes and ports, every constant to the last bit."""
    nodes = [(node.op, node.args, node.slot, float(node.value).hex()) for node in program.nodes]
    return repr((nodes, program.inputs, program.outputs, program.results)).encode()


def _key(recipe: bytes, target: Target, settings: Settings) -> str:
    digest = sha256()
    for part in (recipe, repr(target), repr(settings), compiler_version(), _emitter_version()):
        text = part if isinstance(part, bytes) else part.encode()
        digest.update(len(text).to_bytes(8, "little"))
        digest.update(text)
    return digest.hexdigest()


@cache
def _emitter_version() -> str:
    """A hash of the compiler's own text."""
    return source_hash(Path(__file__).parent)


def source_hash(*sources: Path) -> str:
    """A hash of the Python text of files and of folders (without those inside)."""
    digest = sha256()
    for source in sources:
        names = sorted(os.listdir(source)) if source.is_dir() else [""]
        for name in names:
            if name and not name.endswith(".py"):
                continue
            text = (source / name).read_bytes()
            digest.update(f"{name} {len(text)}\n".encode())
            digest.update(text)
    return digest.hexdigest()


# -- files -------------------------------------------------------------------------------------------


def _folder() -> Path | None:
    """Where kernels are kept, made if need be; None where the cache is off."""
    if os.environ.get("DYNX_CACHE", "").strip().lower() in OFF:
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


def _read(path: Path, target: Target) -> Image | None:
    """The image in a file, if it is there and whole."""
    try:
        content = path.read_bytes()
        os.utime(path)
    except OSError:
        return None
    start = len(_MAGIC) + _DIGEST
    digest, body = content[len(_MAGIC) : start], content[start:]
    if content[: len(_MAGIC)] != _MAGIC or sha256(body).digest() != digest:
        return None
    size = int.from_bytes(body[:4], "little")
    head = json.loads(body[4 : 4 + size])
    inputs, outputs = (
        tuple(Port(name, tuple(shape)) for name, shape in head[side]) for side in ("inputs", "outputs")
    )
    return Image(inputs, outputs, head["lanes"], target, body[4 + size :])


def _write(path: Path, image: Image) -> None:
    """Keep an image: all of it or nothing. Not being able to is no error."""
    ports = {
        side: [(port.name, port.shape) for port in found]
        for side, found in (("inputs", image.inputs), ("outputs", image.outputs))
    }
    head = json.dumps({**ports, "lanes": image.lanes}).encode()
    body = len(head).to_bytes(4, "little") + head + image.code
    # Only the user may read or write it, whatever the umask: it holds code that is run.
    with contextlib.suppress(ArgumentError, OSError):
        write_bytes(path, _MAGIC + sha256(body).digest() + body, mode=0o600)
        _make_room(path.parent)


def _make_room(folder: Path) -> None:
    """Remove what was not used for longest until the folder holds at most `LARGEST` bytes."""
    found = []
    with os.scandir(folder) as entries:
        for entry in entries:
            # Another process may remove a file between listing and looking.
            with contextlib.suppress(FileNotFoundError):
                state = entry.stat()
                found.append((state.st_mtime, state.st_size, entry.path))
    total = sum(size for _, size, _ in found)
    for _, size, name in sorted(found):
        if total <= LARGEST:
            return
        with contextlib.suppress(OSError):
            os.unlink(name)
        total -= size
