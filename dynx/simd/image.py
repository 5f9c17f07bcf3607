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
from dynx.simd.emit import ENTRY, Settings, emit_modules
from dynx.simd.program import Port, Program, collection_paused
from dynx.simd.schedule import program_length
from dynx.simd.target import Processor, host

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
    target: Processor
    objects: tuple[bytes, ...]
    """Object files, whose symbols refer to each other."""

    @property
    def size(self) -> int:
        """Size of the object files [bytes]."""
        return sum(map(len, self.objects))

    def __repr__(self) -> str:
        return f"<Image of {self.size} bytes, {self.lanes} lanes, for {self.target.cpu}>"


def compile_image(
    program: Program, target: Processor | None = None, settings: Settings | None = None
) -> Image:
    """Compile a program to an image, by default for this machine and all lanes of its vectors.

    Raises CompileError if LLVM rejects the emitted code, which would be a defect of dynx.
    """
    target = host() if target is None else target
    settings = (Settings(target.lanes) if settings is None else settings).for_length(program_length(program))
    with collection_paused():
        # Python handles Ctrl-C between two modules.
        modules = emit_modules(program, target, settings)
        objects = tuple(compile_text(text, target, quick=quick) for text, quick in modules)
    return Image(program.inputs, program.outputs, settings.lanes, target, objects)


def compile_text(text: str, target: Processor, *, quick: bool = False) -> bytes:
    """Compile the text of an LLVM module to an object file, without optimisation if `quick`.

    Raises CompileError if LLVM rejects it.
    """
    from dynx.simd.operation_order import in_order_of_text

    with COMPILE_LOCK, in_order_of_text(target):
        try:
            return bytes(target.machine(quick=quick).emit_object(binding.parse_assembly(text)))
        except RuntimeError as error:
            raise CompileError(f"LLVM rejects the code of a kernel: {error}") from error


class Code:
    """An image linked into this process. The code is freed when nothing refers to this object.

    `entry` takes the address of the arguments (`dynx.simd.emit`) and releases Python's global lock;
    `locked_entry` holds it, which saves a good part of a call that takes less than a microsecond. `address`
    is that of the machine code.
    """

    def __init__(self, image: Image) -> None:
        """Link the image. Raises CompileError if that fails."""
        with COMPILE_LOCK:
            try:
                self._jit = binding.create_lljit_compiler(use_jit_link=image.target.short_addresses)
                builder = binding.JITLibraryBuilder()
                for code in image.objects:
                    builder.add_object_img(code)
                builder.add_current_process().export_symbol(ENTRY)
                self._library = builder.link(self._jit, ENTRY)
            except RuntimeError as error:
                raise CompileError(f"a kernel cannot be linked: {error}") from error
        self.address: int = self._library[ENTRY]
        self.entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(self.address)
        self.locked_entry = ctypes.PYFUNCTYPE(None, ctypes.c_void_p)(self.address)
