"""Machine code: a program compiled to an object file, and that file linked into this process.

An `Image` is plain data that can be stored in a file; `Code` is an image linked and callable. All use of LLVM
happens under one lock. A fork waits for the lock, so that a child never inherits a half-finished compilation.
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

COMPILE_LOCK = threading.RLock()
"""Lock held while LLVM compiles or links, and by callers while they obtain a kernel."""

if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=COMPILE_LOCK.acquire,
        after_in_parent=COMPILE_LOCK.release,
        after_in_child=COMPILE_LOCK.release,
    )


@dataclass(frozen=True)
class Image:
    """Object code for `target`, with the input and output ports of the program."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    lanes: int
    target: Target
    code: bytes

    def __repr__(self) -> str:
        return f"<Image of {len(self.code)} bytes, {self.lanes} lanes, for {self.target.cpu}>"


def compile_image(program: Program, target: Target | None = None, settings: Settings | None = None) -> Image:
    """Compile a program to an image, by default for this machine and all lanes of its vectors.

    Raises CompileError if LLVM rejects the emitted code, which would be a defect of dynx.
    """
    target = host() if target is None else target
    settings = Settings(target.lanes) if settings is None else settings
    text = emit(program, target, settings)
    with COMPILE_LOCK:
        try:
            code = target.machine().emit_object(binding.parse_assembly(text))
        except RuntimeError as error:
            raise CompileError(f"LLVM rejects the code of a kernel: {error}") from error
    return Image(program.inputs, program.outputs, settings.lanes, target, bytes(code))


class Code:
    """An image linked into this process. The code is freed when nothing refers to this object.

    `entry` takes the address of the arguments (`dynx.simd.emit`) and releases Python's global lock;
    `locked_entry` holds it, which saves a good part of a call that takes less than a microsecond.
    """

    def __init__(self, image: Image) -> None:
        """Link the image. Raises CompileError if that fails."""
        with COMPILE_LOCK:
            try:
                self._jit = binding.create_lljit_compiler(use_jit_link=image.target.short_addresses)
                builder = binding.JITLibraryBuilder().add_object_img(image.code).add_current_process()
                self._library = builder.export_symbol(ENTRY).link(self._jit, ENTRY)
            except RuntimeError as error:
                raise CompileError(f"a kernel cannot be linked: {error}") from error
        address = self._library[ENTRY]
        self.entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address)
        self.locked_entry = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)(address)
