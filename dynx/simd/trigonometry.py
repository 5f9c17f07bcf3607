"""Sine and cosine of a vector, as LLVM IR: within 2 ulp up to 1e5, the C library's beyond.

The size of the argument is reduced to [-pi/4, pi/4] by the nearest multiple k of pi/2, in three parts of pi/2
(Cody and Waite, Software Manual for the Elementary Functions, 1980; with a fused multiply-add the
first product is exact). Then two minimax polynomials in r^2, each with an error below 2^-56, are
swapped and negated by the last two bits of k. Lanes beyond the limit, and infinities, take a branch
that calls the C library one lane at a time; NaN goes through the polynomials and stays NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from dynx.simd.text import Writer, number

LIMIT = 1e5
"""Largest |x| [rad] of the polynomial path."""

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
"""pi/2 in three doubles."""

HALF_PI_SHORT = (1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
"""pi/2 in parts of 33 bits, whose products with k are exact without a fused multiply-add."""

TOGETHER = 6
"""Most angles whose polynomials are evaluated side by side: what 16 registers hold with their squares."""

ROUND = 6755399441055744.0
"""1.5 * 2^52: adding it rounds to an integer, which is then in the last bits."""


class SineCosine(NamedTuple):
    """The names of the two vectors."""

    sin: str
    cos: str


def sines_and_cosines(write: Writer, angles: Sequence[str], *, fma: bool) -> list[SineCosine]:
    """Both functions of every vector in `angles`, with one branch for all of them."""
    near: list[SineCosine] = []
    far = "zeroinitializer"
    for together in _in_parts(angles):
        sizes = [
            write.let(f"call {write.vector} @llvm.fabs.v{write.lanes}f64({write.vector} {x})")
            for x in together
        ]
        for size in sizes:
            beyond = write.let(f"fcmp ogt {write.vector} {size}, {write.splat(LIMIT)}")
            far = write.let(f"or {write.mask} {far}, {beyond}")
        near += _polynomials(write, together, sizes, fma)
    bits = write.let(f"bitcast {write.mask} {far} to i{write.lanes}")
    some = write.let(f"icmp ne i{write.lanes} {bits}, 0")
    before, slow, done = (write.fresh(stem) for stem in ("near", "far", "trig"))
    write.do(f"br label %{before}")
    write.label(before)
    write.do(f"br i1 {some}, label %{slow}, label %{done}, !prof !0")
    write.label(slow)
    called = [_called(write, x, pair) for x, pair in zip(angles, near, strict=True)]
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


def _in_parts(angles: Sequence[str]) -> list[Sequence[str]]:
    """Parts of about the same size, none larger than `TOGETHER`."""
    n = len(angles)
    parts = -(-n // TOGETHER)
    return [angles[n * k // parts : n * (k + 1) // parts] for k in range(parts)]


def _polynomials(write: Writer, angles: Sequence[str], sizes: Sequence[str], fma: bool) -> list[SineCosine]:
    """Those of each size |x|; the sign of x comes back at the end, that of a zero as well.

    Step by step for all angles: their chains of operations run side by side, and each coefficient is
    loaded once.
    """
    vector, integers = write.vector, write.integers

    def multiply_add(a: str, b: str, c: str) -> str:
        if fma:
            name = f"@llvm.fma.v{write.lanes}f64"
            return write.let(f"call {vector} {name}({vector} {a}, {vector} {b}, {vector} {c})")
        return write.let(f"fadd {vector} {write.let(f'fmul {vector} {a}, {b}')}, {c}")

    def polynomials(coefficients: Sequence[float]) -> list[str]:
        """Ascending in r^2, by Horner's rule."""
        found = [write.splat(coefficients[-1])] * len(squares)
        for coefficient in reversed(coefficients[:-1]):
            found = [
                multiply_add(p, z, write.splat(coefficient)) for p, z in zip(found, squares, strict=True)
            ]
        return found

    turns = [multiply_add(size, write.splat(2.0 / 3.141592653589793), write.splat(ROUND)) for size in sizes]
    counts = [write.let(f"bitcast {vector} {turn} to {integers}") for turn in turns]
    whole = [write.let(f"fsub {vector} {turn}, {write.splat(ROUND)}") for turn in turns]
    rests = _reduced(write, sizes, whole, fma)
    squares = [write.let(f"fmul {vector} {r}, {r}") for r in rests]
    sines = polynomials(SIN)
    cubes = [write.let(f"fmul {vector} {z}, {r}") for z, r in zip(squares, rests, strict=True)]
    sines = [multiply_add(p, cube, r) for p, cube, r in zip(sines, cubes, rests, strict=True)]
    cosines = polynomials((1.0, -0.5, *COS))
    return [_in_quadrant(write, *numbers) for numbers in zip(angles, counts, sines, cosines, strict=True)]


def _in_quadrant(write: Writer, x: str, k: str, sin: str, cos: str) -> SineCosine:
    """Swapped and negated by the last two bits of k; the sine has the sign of x as well."""
    vector, integers = write.vector, write.integers
    last = write.let(f"shl {integers} {k}, {write.integer_splat(63)}")
    swap = write.let(f"icmp slt {integers} {last}, zeroinitializer")
    s = write.let(f"select {write.mask} {swap}, {vector} {cos}, {vector} {sin}")
    c = write.let(f"select {write.mask} {swap}, {vector} {sin}, {vector} {cos}")
    after = write.let(f"add {integers} {k}, {write.integer_splat(1)}")
    below = write.let(f"bitcast {vector} {x} to {integers}")
    half = write.let(f"shl {integers} {k}, {write.integer_splat(62)}")
    odd = write.let(f"xor {integers} {half}, {below}")
    even = write.let(f"shl {integers} {after}, {write.integer_splat(62)}")
    return SineCosine(signed(write, s, odd), signed(write, c, even))


def signed(write: Writer, x: str, sign: str) -> str:
    """-x where the first bit of `sign` is set."""
    first = write.let(f"and {write.integers} {sign}, {write.integer_splat(-(2**63))}")
    bits = write.let(f"bitcast {write.vector} {x} to {write.integers}")
    flipped = write.let(f"xor {write.integers} {bits}, {first}")
    return write.let(f"bitcast {write.integers} {flipped} to {write.vector}")


def _reduced(write: Writer, sizes: Sequence[str], turns: Sequence[str], fma: bool) -> list[str]:
    """x - k pi/2 of each."""
    vector = write.vector
    if not fma:
        return [_reduced_by_short_parts(write, x, k) for x, k in zip(sizes, turns, strict=True)]
    rests = list(sizes)
    for part in HALF_PI:
        call = f"call {vector} @llvm.fma.v{write.lanes}f64"
        rests = [
            write.let(f"{call}({vector} {k}, {vector} {write.splat(-part)}, {vector} {r})")
            for k, r in zip(turns, rests, strict=True)
        ]
    return rests


def _reduced_by_short_parts(write: Writer, x: str, k: str) -> str:
    vector = write.vector
    first, second, third = (write.let(f"fmul {vector} {k}, {write.splat(part)}") for part in HALF_PI_SHORT)
    high = write.let(f"fsub {vector} {x}, {first}")
    r = write.let(f"fsub {vector} {high}, {second}")
    # What that subtraction rounded away, and the third part (Dekker's sum).
    back = write.let(f"fsub {vector} {high}, {r}")
    lost = write.let(f"fsub {vector} {back}, {second}")
    rest = write.let(f"fsub {vector} {lost}, {third}")
    return write.let(f"fadd {vector} {r}, {rest}")


def _called(write: Writer, x: str, near: SineCosine) -> SineCosine:
    """Each lane beyond the limit by the C library."""
    results = []
    for function, pair in zip(("sin", "cos"), near, strict=True):
        vector = pair
        for lane in range(write.lanes):
            one = write.let(f"extractelement {write.vector} {x}, i32 {lane}")
            exact = write.let(f"call double @{function}(double {one})")
            size = write.let(f"call double @llvm.fabs.f64(double {one})")
            beyond = write.let(f"fcmp ogt double {size}, {number(LIMIT)}")
            kept = write.let(f"extractelement {write.vector} {vector}, i32 {lane}")
            chosen = write.let(f"select i1 {beyond}, double {exact}, double {kept}")
            vector = write.let(f"insertelement {write.vector} {vector}, double {chosen}, i32 {lane}")
        results.append(vector)
    return SineCosine(*results)


def declarations(lanes: int) -> list[str]:
    """What a module must declare for the functions above."""
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
