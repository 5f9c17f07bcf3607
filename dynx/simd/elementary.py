"""Exponential, hyperbolic tangent and arctangent of a vector, as LLVM IR: within 2 ulp everywhere.

Straight lines without a branch: where two formulas are needed, both are computed and each lane takes
its own. Polynomials are near to minimax, with relative errors of the function below 2^-56.

- ``exp``: x = k ln 2 + r with |r| <= ln(2) / 2 (Cody and Waite, Software Manual for the Elementary
  Functions, 1980, chapter 6). 2^k is multiplied in two steps, so subnormal results are rounded once.
- ``tanh``: a polynomial up to `SMALL`, 1 - 2 / (exp(2 |x|) + 1) beyond.
- ``arctan``: reduced to the angles pi/4 and pi/2 beyond 0.6 and tan(3 pi/8) (ibid., chapter 11).

The odd ones are computed of |x| and have the sign of x, that of a zero as well. NaN stays NaN; the
exponential of infinity is infinity, and all other limits are those of the functions.
"""

from __future__ import annotations

from collections.abc import Sequence

from dynx.simd.text import Writer
from dynx.simd.trigonometry import ROUND, signed

EXP = (
    0.5,
    0.1666666666666667,
    0.04166666666666667,
    0.008333333333326136,
    0.0013888888888883748,
    0.00019841269874820627,
    2.4801587325547743e-05,
    2.7557255400206422e-06,
    2.75572736431103e-07,
    2.5105217004720745e-08,
    2.0914686968086876e-09,
)
"""(exp r - 1 - r) / r^2 on [-ln(2) / 2, ln(2) / 2], ascending in r."""

LN2 = (0.6931471805599453, 2.3190468138462996e-17)
"""ln 2 in two doubles."""

LN2_SHORT = (0.6931467056274414, 4.7493250390316726e-07)
"""The first part of 21 bits, whose products with k are exact without a fused multiply-add."""

UNDERFLOW, OVERFLOW = -746.0, 710.0
"""Beyond these the exponential is 0, and infinite."""

SMALL = 0.55
"""Up to here tanh is a polynomial."""

TANH = (
    -0.3333333333333333,
    0.13333333333332714,
    -0.05396825396743174,
    0.021869488493563037,
    -0.008863234395418095,
    0.003592110347096177,
    -0.0014556615775702365,
    0.0005889348072447028,
    -0.00023463104528300406,
    8.510707927354112e-05,
    -2.0598556673275166e-05,
)
"""(tanh x / x - 1) / x^2 on [0, `SMALL`], ascending in x^2."""

FLAT = 20.0
"""Beyond, tanh is 1 to rounding."""

ARCTAN = (
    -0.3333333333333333,
    0.19999999999998036,
    -0.14285714285358045,
    0.11111111085583719,
    -0.0909090813254714,
    0.07692286036565886,
    -0.06666347708958321,
    0.058791379952744055,
    -0.05240309893378626,
    0.046454794937535744,
    -0.03919464747699078,
    0.028621772747379225,
    -0.015271899703179367,
    0.004235310429770691,
)
"""(arctan t / t - 1) / t^2 on [0, 0.6], ascending in t^2."""

MIDDLE, STEEP = 0.6, 2.414213562373095
"""Where the arctangent is taken about pi/4, and about pi/2."""

QUARTER = (0.7853981633974483, 3.061616997868383e-17)
"""pi/4 in two doubles."""


def elementary(write: Writer, op: str, x: str, *, fma: bool) -> str:
    """The vector of ``exp``, ``tanh`` or ``arctan`` of `x`."""
    return {"exp": _exp, "tanh": _tanh, "arctan": _arctan}[op](_Arithmetic(write, fma), x)


class _Arithmetic:
    """Operations of whole vectors, by name."""

    def __init__(self, write: Writer, fma: bool) -> None:
        self.write = write
        self.fma = fma

    def do(self, op: str, a: str, b: str) -> str:
        return self.write.let(f"{op} {self.write.vector} {a}, {b}")

    def multiply_add(self, a: str, b: str, c: str) -> str:
        """a b + c, with one rounding where the machine can."""
        vector = self.write.vector
        if self.fma:
            name = f"@llvm.fma.v{self.write.lanes}f64"
            return self.write.let(f"call {vector} {name}({vector} {a}, {vector} {b}, {vector} {c})")
        return self.do("fadd", self.do("fmul", a, b), c)

    def polynomial(self, coefficients: Sequence[float], x: str) -> str:
        """Ascending in x, by Horner's rule."""
        found = self.write.splat(coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            found = self.multiply_add(found, x, self.write.splat(coefficient))
        return found

    def where(self, order: str, a: str, b: str, yes: str, no: str) -> str:
        """`yes` in the lanes where a is `order` b; `no` in the others, and where one is NaN."""
        write = self.write
        chosen = write.let(f"fcmp {order} {write.vector} {a}, {b}")
        return write.let(f"select {write.mask} {chosen}, {write.vector} {yes}, {write.vector} {no}")

    def size(self, x: str) -> str:
        vector = self.write.vector
        return self.write.let(f"call {vector} @llvm.fabs.v{self.write.lanes}f64({vector} {x})")

    def bits(self, x: str) -> str:
        return self.write.let(f"bitcast {self.write.vector} {x} to {self.write.integers}")

    def with_sign_of(self, size: str, x: str) -> str:
        return signed(self.write, size, self.bits(x))

    def power_of_two(self, rounded: str) -> str:
        """2^k, of ROUND + k with -1023 < k < 1024: k is in the last bits."""
        write = self.write
        biased = write.let(f"add {write.integers} {self.bits(rounded)}, {write.integer_splat(1023)}")
        exponent = write.let(f"shl {write.integers} {biased}, {write.integer_splat(52)}")
        return write.let(f"bitcast {write.integers} {exponent} to {write.vector}")


def _reduced(of: _Arithmetic, x: str) -> tuple[str, str, str]:
    """exp(r) of what is left of x, then k as ROUND + k and as itself."""
    splat = of.write.splat
    rounded = of.multiply_add(x, splat(1.4426950408889634), splat(ROUND))
    k = of.do("fsub", rounded, splat(ROUND))
    high, low = LN2 if of.fma else LN2_SHORT
    r = of.multiply_add(k, splat(-high), x)
    # What the second part adds is too small to be lost by rounding r first.
    r = of.multiply_add(k, splat(-low), r)
    rest = of.multiply_add(of.do("fmul", r, r), of.polynomial(EXP, r), r)
    return of.do("fadd", rest, splat(1.0)), rounded, k


def _exp(of: _Arithmetic, x: str) -> str:
    splat = of.write.splat
    x = of.where("ogt", x, splat(OVERFLOW), splat(OVERFLOW), x)
    x = of.where("olt", x, splat(UNDERFLOW), splat(UNDERFLOW), x)
    power, _, k = _reduced(of, x)
    half = of.multiply_add(k, splat(0.5), splat(ROUND))
    others = of.do("fadd", of.do("fsub", k, of.do("fsub", half, splat(ROUND))), splat(ROUND))
    scaled = of.do("fmul", power, of.power_of_two(half))
    return of.do("fmul", scaled, of.power_of_two(others))


def _tanh(of: _Arithmetic, x: str) -> str:
    splat = of.write.splat
    size = of.size(x)
    square = of.do("fmul", size, size)
    near = of.multiply_add(of.do("fmul", size, square), of.polynomial(TANH, square), size)
    cut = of.where("ogt", size, splat(FLAT), splat(FLAT), size)
    power, rounded, _ = _reduced(of, of.do("fadd", cut, cut))
    grown = of.do("fadd", of.do("fmul", power, of.power_of_two(rounded)), splat(1.0))
    far = of.do("fsub", splat(1.0), of.do("fdiv", splat(2.0), grown))
    return of.with_sign_of(of.where("olt", size, splat(SMALL), near, far), x)


def _arctan(of: _Arithmetic, x: str) -> str:
    splat = of.write.splat
    size = of.size(x)

    def by_range(flat: str, middle: str, steep: str) -> str:
        above = of.where("ogt", size, splat(STEEP), steep, middle)
        return of.where("ogt", size, splat(MIDDLE), above, flat)

    top = by_range(size, of.do("fsub", size, splat(1.0)), splat(-1.0))
    bottom = by_range(splat(1.0), of.do("fadd", size, splat(1.0)), size)
    t = of.do("fdiv", top, bottom)
    square = of.do("fmul", t, t)
    low = by_range(splat(0.0), splat(QUARTER[1]), splat(2.0 * QUARTER[1]))
    high = by_range(splat(0.0), splat(QUARTER[0]), splat(2.0 * QUARTER[0]))
    curved = of.multiply_add(of.do("fmul", t, square), of.polynomial(ARCTAN, square), low)
    return of.with_sign_of(of.do("fadd", high, of.do("fadd", curved, t)), x)
