"""Writing LLVM IR as text: names, vector types, constants and shuffles.

Text rather than a builder library: a kernel has thousands of instructions and LLVM's own parser
reads them faster than Python objects can be made.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence


class Writer:
    """Lines of one function body, with fresh names for its values."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.vector = f"<{lanes} x double>"
        self.integers = f"<{lanes} x i64>"
        self.mask = f"<{lanes} x i1>"
        self.lines: list[str] = []
        self._names = 0

    def let(self, instruction: str) -> str:
        """A new value that `instruction` computes."""
        self._names += 1
        name = f"%v{self._names}"
        self.lines.append(f"  {name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """An instruction without a value."""
        self.lines.append(f"  {instruction}")

    def label(self, name: str) -> None:
        """The start of a block."""
        self.lines.append(f"{name}:")

    def fresh(self, stem: str) -> str:
        """A name for a block that no other has."""
        self._names += 1
        return f"{stem}{self._names}"

    def splat(self, value: float) -> str:
        """A vector constant, `value` in every lane."""
        return f"splat (double {number(value)})"

    def integer_splat(self, value: int) -> str:
        """The same for 64-bit integers."""
        return f"splat (i64 {value})"

    def shuffle(self, a: str, b: str, picks: Sequence[int], width: int) -> str:
        """Entries `picks` of the `width` entries of a followed by those of b."""
        mask = ", ".join(f"i32 {pick}" for pick in picks)
        kind = f"<{width} x double>"
        return self.let(f"shufflevector {kind} {a}, {kind} {b}, <{len(picks)} x i32> <{mask}>")


def number(value: float) -> str:
    """A double as LLVM reads it without rounding."""
    if value != value:
        return "0x7FF8000000000000"
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
