"""LLVM IR for sine and cosine of a vector: within 2 ulp up to 1e5 rad, the C library's beyond.

The magnitude of the argument is reduced to [-pi/4, pi/4] by the nearest multiple k of pi/2, with pi/2 split
into three parts (Cody and Waite, Software Manual for the Elementary Functions, 1980; with a fused
multiply-add the first product is exact). Then two minimax polynomials in r^2, each with an error below 2^-56,
are swapped and negated according to the last two bits of k. Lanes beyond the limit, and infinities, take a
branch that calls the C library one lane at a time; NaN propagates through the polynomials.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from dynx.simd.ir_writer import Writer, hex_double

LIMIT = 1e5
"""Largest |x| [rad] for which the polynomials are used."""

SIN = (
    -0.1666666666666663,
    0.008333333333322108,
    -0.00019841269829580166,
    2.7557313618017424e-06,
    -2.5050747218202254e-08,
    1.5896197635833298e-10,
)
"""(sin r / r - 1) / r^2 on [0, pi/4], ascending in r^2."""

COS = (
    0.041666666666666595,
    -0.001388888888887304,
    2.4801587288841367e-05,
    -2.7557314176231524e-07,
    2.0875700414985914e-09,
    -1.1358513897263882e-11,
)
"""(cos r - 1 + r^2 / 2) / r^4 on [0, pi/4], ascending in r^2."""

HALF_PI = (1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33)
"""pi/2 as the sum of three doubles."""

HALF_PI_SHORT = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""pi/2 in parts of 33 bits, whose products with k are exact without a fused multiply-add."""

ANGLES_PER_BATCH = 6
"""Most angles whose polynomials are interleaved: as many as fit into 16 registers with their squares."""

ROUNDING_SHIFT = 6755399441055744.0
"""1.5 * 2^52: adding it to a double rounds that to an integer, which the last bits then hold."""

REPLACEMENTS = {"sin": "beyond_limit_sin", "cos": "beyond_limit_cos"}
"""Names of the functions that replace lanes beyond `LIMIT`."""


class SineCosine(NamedTuple):
    """Names of the vectors of sines and cosines."""

    sin: str
    cos: str


def sines_and_cosines(write: Writer, angles: Sequence[str]) -> list[SineCosine]:
    """Write sine and cosine of every vector in `angles`, with one branch for all of them."""
    near: list[SineCosine] = []
    far = "zeroinitializer"
    for batch in _batches(angles):
        magnitudes = [write.magnitude(x) for x in batch]
        for magnitude in magnitudes:
            beyond = write.let(f"fcmp ogt {write.vector} {magnitude}, {write.splat(LIMIT)}")
            far = write.let(f"or {write.mask} {far}, {beyond}")
        near += _polynomials(write, batch, magnitudes)
    bits = write.let(f"bitcast {write.mask} {far} to i{write.lanes}")
    some = write.let(f"icmp ne i{write.lanes} {bits}, 0")
    before, slow, done = (write.fresh(stem) for stem in ("near", "far", "trig"))
    write.do(f"br label %{before}")
    write.label(before)
    write.do(f"br i1 {some}, label %{slow}, label %{done}, !prof !0")
    write.label(slow)
    called = [_corrected(write, x, pair) for x, pair in zip(angles, near, strict=True)]
    write.do(f"br label %{done}")
    write.label(done)
    found = []
    for pair, other in zip(near, called, strict=True):
        s, c = (
            write.let(f"phi {write.vector} [{fast}, %{before}], [{exact}, %{slow}]")
            for fast, exact in zip(pair, other, strict=True)
        )
        found.append(SineCosine(s, c))
    return found


def _batches(angles: Sequence[str]) -> list[Sequence[str]]:
    """Divide angles into batches of about equal size, none larger than `ANGLES_PER_BATCH`."""
    n = len(angles)
    parts = -(-n // ANGLES_PER_BATCH)
    return [angles[n * k // parts : n * (k + 1) // parts] for k in range(parts)]


def _polynomials(write: Writer, angles: Sequence[str], magnitudes: Sequence[str]) -> list[SineCosine]:
    """Write sine and cosine of each angle by polynomials in its magnitude; the sign is applied at the end.

    Each step is written for all angles before the next one: their chains of operations then execute in
    parallel, and each coefficient is loaded once.
    """
    multiply_add = write.multiply_add

    def polynomials(coefficients: Sequence[float]) -> list[str]:
        """Evaluate a polynomial by Horner's rule; coefficients ascend in powers of r^2."""
        found = [write.splat(coefficients[-1])] * len(squares)
        for coefficient in reversed(coefficients[:-1]):
            found = [
                multiply_add(p, z, write.splat(coefficient)) for p, z in zip(found, squares, strict=True)
            ]
        return found

    shifted = [
        multiply_add(magnitude, write.splat(2.0 / 3.141592653589793), write.splat(ROUNDING_SHIFT))
        for magnitude in magnitudes
    ]
    counts = [write.bits(k) for k in shifted]
    multiples = [write.arithmetic("fsub", k, write.splat(ROUNDING_SHIFT)) for k in shifted]
    remainders = _reduce(write, magnitudes, multiples)
    squares = [write.arithmetic("fmul", r, r) for r in remainders]
    sines = polynomials(SIN)
    cubes = [write.arithmetic("fmul", z, r) for z, r in zip(squares, remainders, strict=True)]
    sines = [multiply_add(p, cube, r) for p, cube, r in zip(sines, cubes, remainders, strict=True)]
    cosines = polynomials((1.0, -0.5, *COS))
    return [_apply_quadrant(write, *numbers) for numbers in zip(angles, counts, sines, cosines, strict=True)]


def _apply_quadrant(write: Writer, x: str, k: str, sin: str, cos: str) -> SineCosine:
    """Swap and negate sine and cosine by the last two bits of k, and give the sine the sign of x."""
    vector, integers = write.vector, write.integers
    last = write.let(f"shl {integers} {k}, {write.integer_splat(63)}")
    swap = write.let(f"icmp slt {integers} {last}, zeroinitializer")
    s = write.let(f"select {write.mask} {swap}, {vector} {cos}, {vector} {sin}")
    c = write.let(f"select {write.mask} {swap}, {vector} {sin}, {vector} {cos}")
    after = write.let(f"add {integers} {k}, {write.integer_splat(1)}")
    below = write.bits(x)
    half = write.let(f"shl {integers} {k}, {write.integer_splat(62)}")
    odd = write.let(f"xor {integers} {half}, {below}")
    even = write.let(f"shl {integers} {after}, {write.integer_splat(62)}")
    return SineCosine(flip_sign(write, s, odd), flip_sign(write, c, even))


def flip_sign(write: Writer, x: str, sign: str) -> str:
    """Return -x in the lanes where the first bit of `sign` is set, x elsewhere."""
    first = write.let(f"and {write.integers} {sign}, {write.integer_splat(-(2**63))}")
    return write.from_bits(write.let(f"xor {write.integers} {write.bits(x)}, {first}"))


def _reduce(write: Writer, magnitudes: Sequence[str], multiples: Sequence[str]) -> list[str]:
    """Return x - k pi/2 for each magnitude x and multiple k."""
    if not write.fma:
        return [_reduce_without_fma(write, x, k) for x, k in zip(magnitudes, multiples, strict=True)]
    remainders = list(magnitudes)
    for part in HALF_PI:
        remainders = [
            write.multiply_add(k, write.splat(-part), r) for k, r in zip(multiples, remainders, strict=True)
        ]
    return remainders


def _reduce_without_fma(write: Writer, x: str, k: str) -> str:
    first, second, third = (write.arithmetic("fmul", k, write.splat(part)) for part in HALF_PI_SHORT)
    high = write.arithmetic("fsub", x, first)
    r = write.arithmetic("fsub", high, second)
    # Add what that subtraction rounded away, and the third part (Dekker's sum).
    back = write.arithmetic("fsub", high, r)
    rest = write.arithmetic("fsub", write.arithmetic("fsub", back, second), third)
    return write.arithmetic("fadd", r, rest)


def _corrected(write: Writer, x: str, near: SineCosine) -> SineCosine:
    """Call the functions that replace lanes beyond the limit."""
    found = (
        write.let(f"call {write.vector} @{name}({write.vector} {x}, {write.vector} {vector})")
        for name, vector in zip(REPLACEMENTS.values(), near, strict=True)
    )
    return SineCosine(*found)


def _replacement(function: str, lanes: int) -> str:
    """Return the text of the function of x and a near result that replaces each lane beyond the limit by the
    result of the C library.

    It is called and not written out for each angle, because it is long and hardly ever needed.
    """
    write = Writer(lanes, fma=False)
    found = "%near"
    for lane in range(lanes):
        one = write.let(f"extractelement {write.vector} %x, i32 {lane}")
        exact = write.let(f"call double @{function}(double {one})")
        magnitude = write.let(f"call double @llvm.fabs.f64(double {one})")
        beyond = write.let(f"fcmp ogt double {magnitude}, {hex_double(LIMIT)}")
        kept = write.let(f"extractelement {write.vector} {found}, i32 {lane}")
        chosen = write.let(f"select i1 {beyond}, double {exact}, double {kept}")
        found = write.let(f"insertelement {write.vector} {found}, double {chosen}, i32 {lane}")
    vector = write.vector
    head = f"define internal {vector} @{REPLACEMENTS[function]}({vector} %x, {vector} %near) cold noinline {{"
    return "\n".join([head, "entry:", *write.lines, f"  ret {vector} {found}", "}"])


def replacements(functions: Sequence[str], lanes: int) -> list[str]:
    """Return the texts of the functions that sines and cosines in the texts `functions` call, if there are
    any."""
    if not any(f"@{name}(" in text for name in REPLACEMENTS.values() for text in functions):
        return []
    return [_replacement(function, lanes) for function in REPLACEMENTS]


def declarations(lanes: int) -> list[str]:
    """Return the declarations and metadata that a module needs for the functions above."""
    vector = f"<{lanes} x double>"
    return [
        f"declare {vector} @llvm.fabs.v{lanes}f64({vector})",
        f"declare {vector} @llvm.fma.v{lanes}f64({vector}, {vector}, {vector})",
        f"declare {vector} @llvm.sqrt.v{lanes}f64({vector})",
        "declare double @llvm.fabs.f64(double)",
        "declare double @sin(double)",
        "declare double @cos(double)",
        '!0 = !{!"branch_weights", i32 1, i32 100000}',
    ]
