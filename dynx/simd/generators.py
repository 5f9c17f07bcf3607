"""Uniform numbers of NumPy's default generator (PCG64) for many seeds, in a loop of machine code.

A generator of NumPy takes about 10 microseconds to be made and half a microsecond to be called. Here each is
32 bytes, and a call advances as many as are chosen, each by a row of numbers.

Sources: M. E. O'Neill, PCG: A family of simple fast space-efficient statistically good algorithms for random
number generation (2014), the variant XSL RR 128/64; NumPy's `SeedSequence` for the seeds. NumPy keeps both
streams as they are (NEP 19).
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dynx.simd.emit import ENTRY
from dynx.simd.image import Code, Image, compile_text
from dynx.simd.target import host
from dynx.spatial.scalar import Floats

Words = NDArray[np.uint32]

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
"""Factor of the linear congruential generator, modulo 2^128."""

_GENERATOR_BYTES = 32
"""Size of a generator: its state and its increment, each of 128 bits, the low ones first."""

_PREFETCHED = 16
"""Distance, in rows, between prefetching a generator and its row, and using them."""

_SEED_BYTES = 16
"""Size of the seeds whose generators are computed here; NumPy computes those of larger ones."""


class Generators:
    """Generators that fill rows of one array, each with the numbers of ``default_rng(seed).random(size)``.

    Not safe for several threads.
    """

    def __init__(self, rows: Floats) -> None:
        """`rows` (count, size) is float64; the entries of a row are contiguous."""
        count, size = rows.shape
        self._states = np.zeros((count, 4), dtype=np.uint64)
        # The code reads the numbers of the rows that it prefetches beyond the last, too.
        self._chosen = np.zeros(count + _PREFETCHED, dtype=np.int64)
        addresses = [each.ctypes.data for each in (self._chosen, self._states, rows)]
        self._words = np.array([0, *addresses, rows.strides[0], size], dtype=np.int64)
        self._head, self._rows, self._draws = self._words.data, rows, size > 0
        self._address, self._entry = self._words.ctypes.data, _entry()

    def seed(self, seeds: Sequence[int], chosen: NDArray[np.intp]) -> None:
        """Seed the generators of some rows, each with its own of `seeds` (count,), whole numbers >= 0."""
        self._states[chosen] = seeded_states([int(seeds[row]) for row in chosen.tolist()])

    def fill(self, chosen: NDArray[np.intp]) -> None:
        """Fill some rows, none of them twice, with the next numbers of their generators, in [0, 1)."""
        n = len(chosen)
        if n and self._draws:
            self._chosen[:n] = chosen
            self._head[0] = n
            self._entry(self._address)


def seeded_states(seeds: Sequence[int]) -> NDArray[np.uint64]:
    """Return the generators (n, 4) of these seeds."""
    small = [seed.bit_length() <= 8 * _SEED_BYTES for seed in seeds]
    content = b"".join(
        seed.to_bytes(_SEED_BYTES, "little") for seed, fits in zip(seeds, small, strict=True) if fits
    )
    states = np.zeros((len(seeds), 4), dtype=np.uint64)
    states[small] = _started(np.frombuffer(content, dtype="<u4").reshape(-1, 4))
    for row, fits in enumerate(small):
        if not fits:
            found = np.random.PCG64(seeds[row]).state["state"]
            states[row] = [part for each in ("state", "inc") for part in _halves(found[each])]
    return states


def _halves(number: int) -> tuple[int, int]:
    """Return the low and the high 64 bits of a number."""
    return number & (1 << 64) - 1, number >> 64


def _started(seeds: Words) -> NDArray[np.uint64]:
    """Return the generators (n, 4) of seeds (n, 4), the low words first."""
    words = _hashed(seeds)
    # NumPy puts the high half of a number of 128 bits first.
    (high, low), (high_step, low_step) = words[:, :2].T, words[:, 2:].T
    high_step = high_step << np.uint64(1) | low_step >> np.uint64(63)
    low_step = low_step << np.uint64(1) | np.uint64(1)
    sums = low + low_step
    high = high + high_step + (sums < low)
    states = np.column_stack([sums, high, low_step, high_step])
    # The first state is one step of the generator from this sum.
    first = Generators(np.empty((len(states), 1)))
    first._states[...] = states
    first.fill(np.arange(len(states)))
    return first._states


def _hashed(seeds: Words) -> NDArray[np.uint64]:
    """Return the four words of 64 bits (n, 4) that NumPy's `SeedSequence` generates from seeds (n, 4)."""
    factors = _HashFactors(0x43B0D7E5, 0x931E8875)
    pool = [factors.hashed(word) for word in seeds.T]
    for source in range(4):
        for target in range(4):
            if source != target:
                mixed = np.uint32(0xCA01F9DD) * pool[target]
                mixed = mixed - np.uint32(0x4973F715) * factors.hashed(pool[source])
                pool[target] = mixed ^ mixed >> np.uint32(16)
    factors = _HashFactors(0x8B51F9DD, 0x58F38DED)
    words = np.column_stack([factors.hashed(pool[k % 4]) for k in range(8)])
    return words.astype("<u4").view("<u8").astype(np.uint64)


class _HashFactors:
    """Factors of successive hashes, each the product of the one before and a constant, modulo 2^32."""

    def __init__(self, first: int, ratio: int) -> None:
        self._factor, self._ratio = first, ratio

    def hashed(self, words: Words) -> Words:
        """Return words with the next hash."""
        words = words ^ np.uint32(self._factor)
        self._factor = self._factor * self._ratio % (1 << 32)
        words = words * np.uint32(self._factor)
        return np.asarray(words ^ words >> np.uint32(16))


@cache
def _entry() -> Callable[[int], None]:
    """Return the loop. Its argument is the address of 64-bit words: the number of rows to fill, addresses of
    their numbers, of the generators and of the first row, the distance of rows in bytes, and their size."""
    target = host()
    code = Code(Image((), (), target.lanes, target, (compile_text(_LOOP, target),)))
    _linked.append(code)
    return ctypes.CFUNCTYPE(None, ctypes.c_void_p)(code.address)


_linked: list[Code] = []
"""Code of the loop, which lives as long as the process."""

_FIELDS = {"n": "i64", "chosen": "ptr", "states": "ptr", "rows": "ptr", "bytes": "i64", "size": "i64"}

_LOOP = "\n".join(
    [
        f"define void @{ENTRY}(ptr %words) {{",
        "entry:",
        *(
            f"  %{name}_at = getelementptr i64, ptr %words, i64 {k}\n  %{name} = load {kind}, ptr %{name}_at"
            for k, (name, kind) in enumerate(_FIELDS.items())
        ),
        "  br label %row",
        "row:",
        "  %k = phi i64 [0, %entry], [%k_next, %filled]",
        "  %number_at = getelementptr i64, ptr %chosen, i64 %k",
        "  %number = load i64, ptr %number_at",
        f"  %state_offset = mul i64 %number, {_GENERATOR_BYTES}",
        "  %state_at = getelementptr i8, ptr %states, i64 %state_offset",
        f"  %step_at = getelementptr i8, ptr %state_at, i64 {_GENERATOR_BYTES // 2}",
        "  %first = load i128, ptr %state_at, align 8",
        "  %step = load i128, ptr %step_at, align 8",
        "  %row_offset = mul i64 %number, %bytes",
        "  %row_at = getelementptr i8, ptr %rows, i64 %row_offset",
        f"  %later = add i64 %k, {_PREFETCHED}",
        "  %later_at = getelementptr i64, ptr %chosen, i64 %later",
        "  %later_number = load i64, ptr %later_at",
        f"  %later_offset = mul i64 %later_number, {_GENERATOR_BYTES}",
        "  %later_state = getelementptr i8, ptr %states, i64 %later_offset",
        "  call void @llvm.prefetch.p0(ptr %later_state, i32 1, i32 3, i32 1)",
        "  %later_bytes = mul i64 %later_number, %bytes",
        "  %later_row = getelementptr i8, ptr %rows, i64 %later_bytes",
        "  call void @llvm.prefetch.p0(ptr %later_row, i32 1, i32 3, i32 1)",
        "  br label %draw",
        "draw:",
        "  %j = phi i64 [0, %row], [%j_next, %draw]",
        "  %state = phi i128 [%first, %row], [%next, %draw]",
        f"  %product = mul i128 %state, {_MULTIPLIER}",
        "  %next = add i128 %product, %step",
        "  %low = trunc i128 %next to i64",
        "  %shifted = lshr i128 %next, 64",
        "  %high = trunc i128 %shifted to i64",
        "  %mixed = xor i64 %high, %low",
        "  %turns = lshr i64 %high, 58",
        "  %turned = call i64 @llvm.fshr.i64(i64 %mixed, i64 %mixed, i64 %turns)",
        "  %digits = lshr i64 %turned, 11",
        "  %whole = sitofp i64 %digits to double",
        "  %drawn = fmul double %whole, 0x3CA0000000000000",  # 2^-53
        "  %drawn_at = getelementptr double, ptr %row_at, i64 %j",
        "  store double %drawn, ptr %drawn_at",
        "  %j_next = add i64 %j, 1",
        "  %more = icmp slt i64 %j_next, %size",
        "  br i1 %more, label %draw, label %filled",
        "filled:",
        "  store i128 %next, ptr %state_at, align 8",
        "  %k_next = add i64 %k, 1",
        "  %others = icmp slt i64 %k_next, %n",
        "  br i1 %others, label %row, label %done",
        "done:",
        "  ret void",
        "}",
        "declare i64 @llvm.fshr.i64(i64, i64, i64)",
        "declare void @llvm.prefetch.p0(ptr, i32, i32, i32)",
        "",
    ]
)
