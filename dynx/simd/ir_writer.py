"""Writer of LLVM IR as text: names, vector types, constants and shuffles.

Text is used instead of a builder library because a kernel has thousands of instructions, which LLVM's parser
reads faster than Python objects could be created.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

NONTEMPORAL = "!nontemporal !1"
"""Ending of a store past the caches, in a module with `NONTEMPORAL_METADATA`."""

NONTEMPORAL_METADATA = "!1 = !{i32 1}"


class Writer:
    """Lines of one function body, with fresh names for its values.

    The code is for a processor with fused multiply-add if `fma` is true.
    """

    def __init__(self, lanes: int, *, fma: bool) -> None:
        self.lanes = lanes
        self.fma = fma
        self.vector = f"<{lanes} x double>"
        self.integers = f"<{lanes} x i64>"
        self.mask = f"<{lanes} x i1>"
        self.lines: list[str] = []
        self._values = self._blocks = 0

    def let(self, instruction: str) -> str:
        """Write an instruction and return the name of its value: a number, which LLVM reads faster.

        The values of a function must be numbered in the order of its text.
        """
        name = f"%{self._values}"
        self._values += 1
        self.lines.append(f"  {name} = {instruction}")
        return name

    def do(self, instruction: str) -> None:
        """Write an instruction without a value."""
        self.lines.append(f"  {instruction}")

    def label(self, name: str) -> None:
        """Write the label that starts a basic block."""
        self.lines.append(f"{name}:")

    def fresh(self, stem: str) -> str:
        """Return a new, unique name for a basic block."""
        self._blocks += 1
        return f"{stem}{self._blocks}"

    def splat(self, value: float) -> str:
        """Return the vector constant with `value` in every lane."""
        return f"splat (double {hex_double(value)})"

    def integer_splat(self, value: int) -> str:
        """Return the vector constant with the 64-bit integer `value` in every lane."""
        return f"splat (i64 {value})"

    def shuffle(self, a: str, b: str, picks: Sequence[int], width: int) -> str:
        """Return the entries `picks` of the concatenation of vectors a and b, of `width` entries each."""
        mask = ", ".join(f"i32 {pick}" for pick in picks)
        kind = f"<{width} x double>"
        return self.let(f"shufflevector {kind} {a}, {kind} {b}, <{len(picks)} x i32> <{mask}>")

    # -- operations on vectors of doubles -------------------------------------------------------------

    def arithmetic(self, op: str, a: str, b: str) -> str:
        """Write `op` of two vectors, such as ``fadd``; return the name of the result."""
        return self.let(f"{op} {self.vector} {a}, {b}")

    def multiply_add(self, a: str, b: str, c: str) -> str:
        """Compute a b + c, with one rounding if the processor has fused multiply-add."""
        if self.fma:
            name = f"@llvm.fma.v{self.lanes}f64"
            return self.let(
                f"call {self.vector} {name}({self.vector} {a}, {self.vector} {b}, {self.vector} {c})"
            )
        return self.arithmetic("fadd", self.arithmetic("fmul", a, b), c)

    def magnitude(self, x: str) -> str:
        """Compute |x|."""
        return self.let(f"call {self.vector} @llvm.fabs.v{self.lanes}f64({self.vector} {x})")

    def select(self, order: str, a: str, b: str, yes: str, no: str) -> str:
        """Select `yes` in the lanes where `fcmp order a, b` holds, and `no` elsewhere, also for NaN."""
        return self.choose(self.compare(order, a, b), yes, no)

    def compare(self, order: str, a: str, b: str) -> str:
        """Return the mask of the lanes where `fcmp order a, b` holds."""
        return self.let(f"fcmp {order} {self.vector} {a}, {b}")

    def choose(self, mask: str, yes: str, no: str) -> str:
        """Select `yes` in the lanes of a mask, and `no` elsewhere."""
        return self.let(f"select {self.mask} {mask}, {self.vector} {yes}, {self.vector} {no}")

    def bits(self, x: str) -> str:
        """Return the bits of x as a vector of integers."""
        return self.let(f"bitcast {self.vector} {x} to {self.integers}")

    def from_bits(self, bits: str) -> str:
        """Return the doubles with these bits."""
        return self.let(f"bitcast {self.integers} {bits} to {self.vector}")


def hex_double(value: float) -> str:
    """Return the hexadecimal form of a double, which LLVM reads without rounding."""
    if value != value:
        return "0x7FF8000000000000"
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
