"""LLVM IR for exponential, hyperbolic tangent and arctangent of a vector: within 2 ulp everywhere.

The code is straight-line, without branches: where two formulas are needed, both are computed and each lane
selects one. The polynomials are nearly minimax, with relative errors of the function below 2^-56.

- ``exp``: x = k ln 2 + r with |r| <= ln(2) / 2 (Cody and Waite, Software Manual for the Elementary
  Functions, 1980, chapter 6). The factor 2^k is applied in two steps, so subnormal results are rounded once.
- ``tanh``: a polynomial up to `TANH_POLYNOMIAL_LIMIT`, 1 - 2 / (exp(2 |x|) + 1) beyond.
- ``arctan``: reduced to the angles pi/4 and pi/2 beyond 0.6 and tan(3 pi/8) (ibid., chapter 11).

``tanh`` and ``arctan``, which are odd, are computed for |x| and get the sign of x, that of a zero included.
NaN stays NaN, and infinite arguments give the limits of the functions.
"""

from __future__ import annotations

from collections.abc import Sequence

from dynx.simd.ir_writer import Writer
from dynx.simd.trigonometry import ROUNDING_SHIFT, flip_sign

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
"""ln 2 as the sum of two doubles."""

LN2_SHORT = (0.6931467056274414, 4.7493250390316726e-07)
"""ln 2 as a part of 21 bits, whose products with k are exact without a fused multiply-add, and a rest."""

UNDERFLOW, OVERFLOW = -746.0, 710.0
"""Arguments below which the exponential is 0, and above which it is infinite."""

TANH_POLYNOMIAL_LIMIT = 0.55
"""Largest |x| for which tanh is evaluated by the polynomial."""

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
"""(tanh x / x - 1) / x^2 on [0, `TANH_POLYNOMIAL_LIMIT`], ascending in x^2."""

TANH_SATURATION = 20.0
"""Smallest |x| for which tanh is 1 to rounding."""

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

ARCTAN_MIDDLE, ARCTAN_STEEP = 0.6, 2.414213562373095
"""Values of |x| above which the arctangent is expanded about pi/4, and about pi/2."""

QUARTER_PI = (0.7853981633974483, 3.061616997868383e-17)
"""pi/4 as the sum of two doubles."""


def elementary(write: Writer, op: str, x: str) -> str:
    """Write the code of ``exp``, ``tanh`` or ``arctan`` of the vector `x`; return the name of the result."""
    return {"exp": _exp, "tanh": _tanh, "arctan": _arctan}[op](write, x)


def _polynomial(write: Writer, coefficients: Sequence[float], x: str) -> str:
    """Evaluate a polynomial by Horner's rule; coefficients ascend in the power of x."""
    found = write.splat(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        found = write.multiply_add(found, x, write.splat(coefficient))
    return found


def _copy_sign(write: Writer, magnitude: str, x: str) -> str:
    return flip_sign(write, magnitude, write.bits(x))


def _power_of_two(write: Writer, rounded: str) -> str:
    """Compute 2^k, -1023 < k < 1024, from the double ROUNDING_SHIFT + k, whose last bits hold k."""
    biased = write.let(f"add {write.integers} {write.bits(rounded)}, {write.integer_splat(1023)}")
    return write.from_bits(write.let(f"shl {write.integers} {biased}, {write.integer_splat(52)}"))


def _exp_of_remainder(write: Writer, x: str) -> tuple[str, str, str]:
    """Return exp(r) of the remainder r = x - k ln 2, the double ROUNDING_SHIFT + k, and k."""
    splat = write.splat
    rounded = write.multiply_add(x, splat(1.4426950408889634), splat(ROUNDING_SHIFT))
    k = write.arithmetic("fsub", rounded, splat(ROUNDING_SHIFT))
    high, low = LN2 if write.fma else LN2_SHORT
    r = write.multiply_add(k, splat(-high), x)
    # The second part is so small that rounding r before adding it does no harm.
    r = write.multiply_add(k, splat(-low), r)
    rest = write.multiply_add(write.arithmetic("fmul", r, r), _polynomial(write, EXP, r), r)
    return write.arithmetic("fadd", rest, splat(1.0)), rounded, k


def _exp(write: Writer, x: str) -> str:
    splat = write.splat
    x = write.select("ogt", x, splat(OVERFLOW), splat(OVERFLOW), x)
    x = write.select("olt", x, splat(UNDERFLOW), splat(UNDERFLOW), x)
    power, _, k = _exp_of_remainder(write, x)
    half = write.multiply_add(k, splat(0.5), splat(ROUNDING_SHIFT))
    others = write.arithmetic(
        "fadd",
        write.arithmetic("fsub", k, write.arithmetic("fsub", half, splat(ROUNDING_SHIFT))),
        splat(ROUNDING_SHIFT),
    )
    scaled = write.arithmetic("fmul", power, _power_of_two(write, half))
    return write.arithmetic("fmul", scaled, _power_of_two(write, others))


def _tanh(write: Writer, x: str) -> str:
    splat = write.splat
    magnitude = write.magnitude(x)
    square = write.arithmetic("fmul", magnitude, magnitude)
    near = write.multiply_add(
        write.arithmetic("fmul", magnitude, square), _polynomial(write, TANH, square), magnitude
    )
    clamped = write.select("ogt", magnitude, splat(TANH_SATURATION), splat(TANH_SATURATION), magnitude)
    power, rounded, _ = _exp_of_remainder(write, write.arithmetic("fadd", clamped, clamped))
    grown = write.arithmetic(
        "fadd", write.arithmetic("fmul", power, _power_of_two(write, rounded)), splat(1.0)
    )
    far = write.arithmetic("fsub", splat(1.0), write.arithmetic("fdiv", splat(2.0), grown))
    return _copy_sign(write, write.select("olt", magnitude, splat(TANH_POLYNOMIAL_LIMIT), near, far), x)


def _arctan(write: Writer, x: str) -> str:
    splat = write.splat
    magnitude = write.magnitude(x)

    def by_range(flat: str, middle: str, steep: str) -> str:
        above = write.select("ogt", magnitude, splat(ARCTAN_STEEP), steep, middle)
        return write.select("ogt", magnitude, splat(ARCTAN_MIDDLE), above, flat)

    top = by_range(magnitude, write.arithmetic("fsub", magnitude, splat(1.0)), splat(-1.0))
    bottom = by_range(splat(1.0), write.arithmetic("fadd", magnitude, splat(1.0)), magnitude)
    t = write.arithmetic("fdiv", top, bottom)
    square = write.arithmetic("fmul", t, t)
    low = by_range(splat(0.0), splat(QUARTER_PI[1]), splat(2.0 * QUARTER_PI[1]))
    high = by_range(splat(0.0), splat(QUARTER_PI[0]), splat(2.0 * QUARTER_PI[0]))
    curved = write.multiply_add(write.arithmetic("fmul", t, square), _polynomial(write, ARCTAN, square), low)
    return _copy_sign(write, write.arithmetic("fadd", high, write.arithmetic("fadd", curved, t)), x)


ROOT_ESTIMATE = "@llvm.x86.avx512.rsqrt14.pd.512"
"""LLVM's name of the instruction that estimates 1 / sqrt(x) of eight doubles to 2^-14."""

DECLARED_ROOT_ESTIMATE = f"declare <8 x double> {ROOT_ESTIMATE}(<8 x double>, <8 x double>, i8)"


def quotient_by_root(write: Writer, a: str, x: str) -> str:
    """Compute a / sqrt(x) to 2 ulp for eight doubles, x of at least 1e-300 and finite, on a processor with
    AVX-512.

    Two steps of Newton's method improve the estimate of the processor. Root and quotient would keep its
    divider occupied several times as long.
    """
    half = write.arithmetic("fmul", x, write.splat(0.5))
    y = write.let(
        f"call {write.vector} {ROOT_ESTIMATE}({write.vector} {x}, {write.vector} zeroinitializer, i8 -1)"
    )
    for _ in range(2):
        negative = write.let(f"fneg {write.vector} {write.arithmetic('fmul', half, y)}")
        error = write.multiply_add(negative, y, write.splat(0.5))
        y = write.multiply_add(y, error, y)
    return write.arithmetic("fmul", a, y)
