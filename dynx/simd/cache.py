"""Cache of compiled kernels on disk, shared between processes.

The folder is given by the environment variable ``DYNX_CACHE_DIR``, by default the user's cache folder of
dynx. ``DYNX_CACHE=0`` switches the cache off; a folder that cannot be written is silently not used. Cached
code is executed, so a folder that another user owns or may write to is not used either.

The key of an image is the hash of its *recipe* and of everything that turns the recipe into machine code. A
recipe is any text that determines the program. `program_recipe` derives one from a program; a caller who
knows a shorter one saves the time of tracing. Each file has a checksum and is written under a temporary
name first, so that a truncated, altered or unfinished file is never used but compiled again and replaced.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from itertools import accumulate, pairwise
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np
import platformdirs

from dynx._version import __version__
from dynx.errors import ArgumentError, CompileError
from dynx.files.reading import open_regular
from dynx.files.writing import write_bytes
from dynx.simd.call_table import RoutineCode
from dynx.simd.emit import Settings
from dynx.simd.image import Code, Image, compile_image, compile_routines
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.routines import RoutineSet
from dynx.simd.target import Target, compiler_version, host

MAX_CACHE_BYTES = 512 * 2**20
"""Largest size of the cache [bytes]; beyond it the least recently used files are removed."""

OFF_WORDS = frozenset({"0", "no", "off", "false"})
"""Values of ``DYNX_CACHE`` that switch the cache off."""

T = TypeVar("T")

_SUFFIX = ".kernel"
_MAGIC = b"dynx kernel 2\n"
_DIGEST = 32


def load_kernel(
    recipe: bytes,
    program: Callable[[], Program],
    *,
    target: Target | None = None,
    settings: Settings | None = None,
) -> Kernel:
    """Load the kernel of `recipe` from the cache, or compile `program()` and store it there."""
    target = host() if target is None else target
    settings = Settings(target.lanes) if settings is None else settings
    return load_code(recipe, lambda: compile_image(program(), target, settings), target, settings, Kernel)


def load_routines(recipe: bytes, routines: RoutineSet) -> RoutineCode:
    """Load a set of routines, which `recipe` determines, from the cache, or compile it and store it there."""
    target = host()

    def load(lanes: int) -> tuple[Image, Code]:
        settings = Settings(lanes)
        return load_code(
            recipe,
            lambda: compile_routines(routines, target, settings),
            target,
            settings,
            lambda image: (image, Code(image)),
        )

    (_, single), (image, several) = load(1), load(target.lanes)
    return RoutineCode(single, several, image)


def load_code(
    recipe: bytes,
    compiled: Callable[[], Image],
    target: Target,
    settings: Settings,
    link: Callable[[Image], T],
) -> T:
    """Link the image of `recipe` from the cache, or that of `compiled()`, which is then stored there."""
    folder = _cache_folder()
    if folder is None:
        return link(compiled())
    path = folder / (_key(recipe, target, settings) + _SUFFIX)
    found = _read(path, target)
    if found is not None:
        with contextlib.suppress(CompileError):
            return link(found)
    image = compiled()
    _write(path, image)
    return link(image)


def program_recipe(program: Program) -> bytes:
    """Return the recipe of a program: its nodes and ports, with every constant in hexadecimal."""
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
    """Return a hash of the source text of `dynx.simd`."""
    return source_hash(Path(__file__).parent)


def source_version(*modules: ModuleType) -> str:
    """Return the versions of dynx and NumPy, and the hash of the source text of modules.

    A package counts with all its modules and the packages inside it. The text is a part of the recipe of what
    these modules trace, so that no kernel of another source is used.
    """
    files = (Path(str(module.__file__)) for module in modules)
    sources = (file.parent if file.name == "__init__.py" else file for file in files)
    return f"{__version__} {np.__version__} {source_hash(*sources)}"


def source_hash(*sources: Path) -> str:
    """Return a hash of Python files and of the Python files in folders and in the folders below them."""
    digest = sha256()
    for source in sources:
        files = sorted(source.rglob("*.py")) if source.is_dir() else [source]
        for file in files:
            name, text = file.relative_to(source).as_posix(), file.read_bytes()
            digest.update(f"{name} {len(text)}\n".encode())
            digest.update(text)
    return digest.hexdigest()


# -- files -------------------------------------------------------------------------------------------


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


def _read(path: Path, target: Target) -> Image | None:
    """Read the image in a file; None if the file is absent or its checksum is wrong."""
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
    size = int.from_bytes(body[:4], "little")
    head = json.loads(body[4 : 4 + size])
    inputs, outputs = (
        tuple(Port(name, tuple(shape)) for name, shape in head[side]) for side in ("inputs", "outputs")
    )
    ends = [4 + size + end for end in accumulate(head["sizes"], initial=0)]
    objects = tuple(body[start:end] for start, end in pairwise(ends))
    return Image(inputs, outputs, head["lanes"], target, objects)


def _write(path: Path, image: Image) -> None:
    """Write an image atomically; failure to write is ignored."""
    ports = {
        side: [(port.name, port.shape) for port in found]
        for side, found in (("inputs", image.inputs), ("outputs", image.outputs))
    }
    sizes = [len(code) for code in image.objects]
    head = json.dumps({**ports, "lanes": image.lanes, "sizes": sizes}).encode()
    body = b"".join([len(head).to_bytes(4, "little"), head, *image.objects])
    # Only the user may read or write it, whatever the umask: it holds code that is run.
    with contextlib.suppress(ArgumentError, OSError):
        write_bytes(path, _MAGIC + sha256(body).digest() + body, mode=0o600, sync=False)
        _evict(path.parent)


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
