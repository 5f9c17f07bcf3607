"""Compiled kernels in the cache on disk (`dynx.files.cache`).

The key of an image is the hash of its *recipe* and of everything that turns the recipe into machine code. A
recipe is any text that determines the program. `program_recipe` derives one from a program; a caller who
knows a shorter one saves the time of tracing.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from itertools import accumulate, pairwise
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import numpy as np

from dynx._version import __version__
from dynx.errors import CompileError
from dynx.files.cache import keep, read_cached, source_hash
from dynx.simd.emit import Settings
from dynx.simd.image import Image, compile_image
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.target import Processor, compiler_version, host
from dynx.time_limit import not_counted

T = TypeVar("T")


def load_kernel(
    recipe: bytes,
    program: Callable[[], Program],
    *,
    target: Processor | None = None,
    settings: Settings | None = None,
) -> Kernel:
    """Load the kernel of `recipe` from the cache, or compile `program()` and store it there."""
    target = host() if target is None else target
    settings = Settings(target.lanes) if settings is None else settings
    return load_code(recipe, lambda: compile_image(program(), target, settings), target, settings, Kernel)


def load_code(
    recipe: bytes,
    compiled: Callable[[], Image],
    target: Processor,
    settings: Settings,
    link: Callable[[Image], T],
) -> T:
    """Link the image of `recipe` from the cache, or that of `compiled()`, which is then stored there."""
    name = f"{_key(recipe, target, settings)}.kernel"
    found = read_cached(name)
    if found is not None:
        with contextlib.suppress(CompileError):
            return link(_image_of(found, target))
    # A search whose first step needs a kernel is not charged for it.
    with not_counted():
        image = compiled()
        keep(name, _content_of(image))
        return link(image)


def program_recipe(program: Program) -> bytes:
    """Return the recipe of a program: its nodes and ports, with every constant in hexadecimal."""
    nodes = [(node.op, node.args, node.slot, float(node.value).hex()) for node in program.nodes]
    return repr((nodes, program.inputs, program.outputs, program.results)).encode()


def _key(recipe: bytes, target: Processor, settings: Settings) -> str:
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


def _image_of(content: bytes, target: Processor) -> Image:
    """Return the image in a content of the cache."""
    size = int.from_bytes(content[:4], "little")
    head = json.loads(content[4 : 4 + size])
    inputs, outputs = (
        tuple(Port(name, tuple(shape)) for name, shape in head[side]) for side in ("inputs", "outputs")
    )
    ends = [4 + size + end for end in accumulate(head["sizes"], initial=0)]
    objects = tuple(content[start:end] for start, end in pairwise(ends))
    return Image(inputs, outputs, head["lanes"], target, objects)


def _content_of(image: Image) -> bytes:
    """Return an image as a content of the cache."""
    ports = {
        side: [(port.name, port.shape) for port in found]
        for side, found in (("inputs", image.inputs), ("outputs", image.outputs))
    }
    sizes = [len(code) for code in image.objects]
    head = json.dumps({**ports, "lanes": image.lanes, "sizes": sizes}).encode()
    return b"".join([len(head).to_bytes(4, "little"), head, *image.objects])
