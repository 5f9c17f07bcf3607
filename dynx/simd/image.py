"""Machine code: a program compiled to an object file, and that file linked into this process.

An `Image` is inert data, fit for a file; `Code` is the same loaded and callable. LLVM works under one
lock. A fork waits for it, so that a child never inherits a compiler in the middle of its work.
"""

from __future__ import annotations

import ctypes
import os
import threading
from dataclasses import dataclass

from llvmlite import binding

from dynx.errors import CompileError
from dynx.simd.emit import ENTRY, Settings, emit
from dynx.simd.program import Port, Program
from dynx.simd.target import Target, host

COMPILING = threading.RLock()
"""Held while LLVM compiles or links, and by callers while they have a kernel made for them."""

if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=COMPILING.acquire,
        after_in_parent=COMPILING.release,
        after_in_child=COMPILING.release,
    )


@dataclass(frozen=True)
class Image:
    """Object code for `target`, and what it reads and writes."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    lanes: int
    target: Target
    code: bytes

    def __repr__(self) -> str:
        return f"<Image of {len(self.code)} bytes, {self.lanes} lanes, for {self.target.cpu}>"


def compiled(program: Program, target: Target | None = None, settings: Settings | None = None) -> Image:
    """The image of a program: for this machine and all its lanes, unless told otherwise.

    Raises CompileError where LLVM refuses what was emitted, which is a defect of dynx.
    """
    target = host() if target is None else target
    settings = Settings(target.lanes) if settings is None else settings
    text = emit(program, target, settings)
    with COMPILING:
        try:
            code = target.machine().emit_object(binding.parse_assembly(text))
        except RuntimeError as error:
            raise CompileError(f"LLVM refuses the code of a kernel: {error}") from error
    return Image(program.inputs, program.outputs, settings.lanes, target, bytes(code))


class Code:
    """An image linked into this process. The code is freed when nothing refers to this object.

    `entry` takes the address of the arguments (`dynx.simd.emit`) and lets other threads of Python run
    meanwhile; `brief_entry` does not, which saves a good part of a call that takes less than a
    microsecond.
    """

    def __init__(self, image: Image) -> None:
        """Raises CompileError if the image cannot be linked."""
        with COMPILING:
            try:
                self._jit = binding.create_lljit_compiler(use_jit_link=image.target.near)
                builder = binding.JITLibraryBuilder().add_object_img(image.code).add_current_process()
                self._library = builder.export_symbol(ENTRY).link(self._jit, ENTRY)
            except RuntimeError as error:
                raise CompileError(f"a kernel cannot be linked: {error}") from error
        address = self._library[ENTRY]
        self.entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)
        self.brief_entry = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)(address)
