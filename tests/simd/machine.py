"""Direct execution of the code that `emit` returns, by LLVM without the layers of `Kernel`."""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Sequence

import numpy as np
from llvmlite import binding

from dynx.simd.emit import ENTRY, Settings, emit
from dynx.simd.program import Program
from dynx.simd.target import Processor, host
from dynx.spatial.scalar import Floats

X86 = platform.machine().lower() in ("x86_64", "amd64")
SSE2 = Processor(host().triple, "x86-64", "")
"""The baseline of x86-64: vectors of two doubles, no fused multiply-add."""

TARGETS: tuple[Processor, ...] = (host(), SSE2) if X86 else (host(),)
"""This processor and, if it is an x86-64 one, the baseline of that family."""

LANES = (2, 4, 8)


class Machine:
    """A program compiled for `target`."""

    def __init__(self, program: Program, target: Processor, settings: Settings) -> None:
        self._program = program
        module = binding.parse_assembly(emit(program, target, settings))
        module.verify()
        self._jit = binding.create_lljit_compiler()
        code = target.machine(quick=settings.quick).emit_object(module)
        builder = binding.JITLibraryBuilder().add_object_img(code)
        self._library = builder.add_current_process().export_symbol(ENTRY).link(self._jit, ENTRY)
        self._entry = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(self._library[ENTRY])

    def fill(self, inputs: Sequence[Floats], outputs: Sequence[Floats], n: int) -> None:
        """Evaluate `n` samples, at least as many as lanes; arrays (n, port size) may have any row stride."""
        words = [n]
        for array in (*inputs, *outputs):
            words += [array.ctypes.data, array.strides[0]]
        self._entry(np.array(words, dtype=np.int64).ctypes.data)

    def __call__(self, inputs: Sequence[Floats]) -> list[Floats]:
        """Evaluate all samples into new arrays."""
        n = len(inputs[0])
        outputs = [np.empty((n, port.size)) for port in self._program.outputs]
        self.fill(inputs, outputs, n)
        return outputs


def same_bits(a: Floats, b: Floats) -> np.bool_:
    """Return whether all numbers have the same bits; all NaN count as equal."""
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    return np.all((a.view(np.int64) == b.view(np.int64)) | (np.isnan(a) & np.isnan(b)))
