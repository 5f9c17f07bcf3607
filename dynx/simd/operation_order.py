"""Order of the operations in machine code: that of the text, which LLVM would otherwise change."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from dynx.simd.target import Processor, set_llvm_option


@contextmanager
def in_order_of_text(target: Processor) -> Iterator[None]:
    """Let LLVM keep the order of the operations, in a ``with`` block that compiles.

    LLVM's scheduler moves operations apart to hide latencies, which processors of x86 hide themselves. Then
    more values are needed at a time than there are registers, and kernels are up to a tenth slower. LLVM has
    this option for the whole process, so that it is restored for other libraries.
    """
    if not target.triple.startswith("x86_64"):
        yield
        return
    set_llvm_option("-enable-misched=0")
    try:
        yield
    finally:
        set_llvm_option("-enable-misched=1")
