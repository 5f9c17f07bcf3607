"""The text that is emitted for one small program, kept as a file to be read.

Where emission changes on purpose, ``python -m tests.simd.test_golden`` writes it anew; read the
difference before committing it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dynx.simd.emit import Settings, emit
from dynx.simd.target import Processor
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, sin

GOLDEN = Path(__file__).parent / "golden" / "product_and_sine.ll"


def text() -> str:
    """a b + sin a, two lanes, strict, for a processor with fused multiply-add."""

    def function(x: Array) -> Array:
        return np.asarray(x[0] * x[1] + sin(x[0]))

    target = Processor("x86_64-unknown-linux-gnu", "haswell", "+avx,+avx2,+fma")
    return emit(trace(function, {"x": (2,)}), target, Settings(2, fast=False))


def test_emitted_text_is_the_golden_text() -> None:
    assert text() == GOLDEN.read_text(), "renew it with python -m tests.simd.test_golden"


if __name__ == "__main__":
    GOLDEN.write_text(text())
