"""Errors of the kernels' exponential, tanh and arctangent over the whole range."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import mpmath
import numpy as np
import pytest

from dynx.simd.elementary import (
    ARCTAN,
    ARCTAN_MIDDLE,
    ARCTAN_STEEP,
    EXP,
    LN2,
    LN2_SHORT,
    OVERFLOW,
    QUARTER_PI,
    TANH,
    TANH_POLYNOMIAL_LIMIT,
    UNDERFLOW,
)
from dynx.simd.emit import Settings
from dynx.simd.target import Processor
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, arctan, exp, tanh
from tests.simd.interp import interpret
from tests.simd.machine import LANES, TARGETS, Machine, same_bits

MAX_ERROR = 2.0
"""Documented error bound, in units in the last place."""
NUMPY = 4.0
"""Error bound that NumPy uses for its own functions, in units in the last place."""
FUNCTIONS: dict[str, Callable[[Array], Array]] = {"exp": exp, "tanh": tanh, "arctan": arctan}
EXACT: dict[str, Callable[[Any], Any]] = {"exp": mpmath.exp, "tanh": mpmath.tanh, "arctan": mpmath.atan}
each_target = pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
each_function = pytest.mark.parametrize("name", FUNCTIONS)


@functools.cache
def machine(name: str, target: Processor, lanes: int, fast: bool) -> Machine:
    return Machine(trace(FUNCTIONS[name], {"x": (1,)}), target, Settings(lanes, fast=fast))


def evaluated(name: str, target: Processor, x: Floats, *, lanes: int = 4, fast: bool = True) -> Floats:
    return np.asarray(machine(name, target, lanes, fast)([np.ascontiguousarray(x)[:, None]])[0][:, 0])


def errors(name: str, x: Floats, found: Floats) -> Floats:
    """Return the errors of `found`, in units in the last place of the exact values."""
    distances = []
    # Extra digits: 1 - tanh and arctan x - x cancel many leading ones.
    with mpmath.workprec(2400):
        for number, got in zip(x.tolist(), found.tolist(), strict=True):
            with mpmath.workprec(200 if abs(number) > 1e-9 else 2400):
                exact = EXACT[name](mpmath.mpf(number))
                if not math.isfinite(got):
                    # The exact value rounds to infinity.
                    distances.append(0.0 if abs(exact) > mpmath.mpf(2) ** 1024 * (1 - 2.0**-54) else np.inf)
                else:
                    distances.append(float(abs(mpmath.mpf(got) - exact) / math.ulp(float(exact))))
    return np.array(distances)


def around(*centers: float) -> Floats:
    """Return numbers close to the centers, with either sign."""
    x = np.concatenate([np.nextafter(c, [np.inf, -np.inf]) + np.array([0.0, 0.0]) for c in centers])
    return np.concatenate([x, -x, centers, np.negative(centers)])


RNG = np.random.default_rng(21)
SIGNS = RNG.choice([-1.0, 1.0], 2000)
MULTIPLES = np.arange(-1075, 1024) * math.log(2.0)
POINTS: dict[str, Floats] = {
    "over all magnitudes": SIGNS * 10.0 ** RNG.uniform(-30.0, 3.0, 2000),
    "ordinary": RNG.uniform(-4.0, 4.0, 4000),
    "up to the ends": RNG.uniform(-760.0, 720.0, 2000),
    "where formulas change": around(
        TANH_POLYNOMIAL_LIMIT, ARCTAN_MIDDLE, ARCTAN_STEEP, 1.0, 19.0, 19.1, 20.0, OVERFLOW, UNDERFLOW
    ),
    "close to there": np.concatenate(
        [c + RNG.uniform(-0.05, 0.05, 1000) for c in (TANH_POLYNOMIAL_LIMIT, ARCTAN_MIDDLE, ARCTAN_STEEP)]
    ),
    "between multiples of ln 2": np.concatenate([MULTIPLES, MULTIPLES + 0.5 * math.log(2.0)]),
    "subnormal results": RNG.uniform(-745.2, -708.3, 2000),
    "largest results": RNG.uniform(709.0, 709.79, 500),
    "tiny": np.concatenate([2.0 ** np.arange(-1074.0, -20.0, 7.0), -(2.0 ** np.arange(-1074.0, -20.0, 7.0))]),
    "huge": np.concatenate([SIGNS[:200] * 10.0 ** RNG.uniform(3.0, 308.0, 200), [np.finfo(float).max]]),
}


@each_target
@each_function
@pytest.mark.parametrize("points", POINTS)
def test_within_two_units_everywhere(name: str, target: Processor, points: str) -> None:
    x = POINTS[points]
    assert errors(name, x, evaluated(name, target, x)).max() <= MAX_ERROR


@each_target
@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("exp", [np.inf, 0.0, np.nan, 1.0, 1.0, np.inf, 0.0]),
        ("tanh", [1.0, -1.0, np.nan, 0.0, -0.0, 1.0, -1.0]),
        ("arctan", [math.pi / 2, -math.pi / 2, np.nan, 0.0, -0.0, math.pi / 2, -math.pi / 2]),
    ],
)
def test_limits_zeros_and_nan(name: str, target: Processor, wanted: list[float]) -> None:
    x = np.array([np.inf, -np.inf, np.nan, 0.0, -0.0, 1e300, -1e300])
    assert same_bits(evaluated(name, target, x), np.array(wanted))


@each_target
@each_function
def test_the_same_in_every_lane_and_mode_and_odd_where_it_should_be(name: str, target: Processor) -> None:
    """Bit for bit: the simplification that moves the sign out of an odd function is exact."""
    x = np.concatenate([RNG.uniform(-30.0, 30.0, 400), [0.0, 5e-324, 1e300, np.inf, np.nan]])
    one = evaluated(name, target, x)
    for lanes in LANES:
        for fast in (True, False):
            again = evaluated(name, target, x[::-1], lanes=lanes, fast=fast)[::-1]
            assert same_bits(one, again)
    if name != "exp":
        assert same_bits(-one, evaluated(name, target, -x))


@each_target
@each_function
def test_lanes_do_not_affect_each_other(name: str, target: Processor) -> None:
    x = RNG.uniform(-10.0, 10.0, 8)
    clean = evaluated(name, target, x, lanes=8)
    for lane in range(8):
        for strange in (1e6, -1e6, np.inf, -np.inf, np.nan, 5e-324):
            dirty = x.copy()
            dirty[lane] = strange
            after = evaluated(name, target, dirty, lanes=8)
            assert same_bits(np.delete(after, lane), np.delete(clean, lane))


@each_function
def test_the_interpreter_and_numpy_s_own_functions_on_symbols_mean_the_same(name: str) -> None:
    x = np.concatenate([POINTS["ordinary"][:500], POINTS["huge"][:20]])
    ufunc: Callable[[Array], Array] = getattr(np, name)
    program = trace(lambda x: ufunc(x), {"x": (1,)})
    assert program == trace(FUNCTIONS[name], {"x": (1,)})
    assert errors(name, x, interpret(program, [x[:, None]])[0][:, 0]).max() <= NUMPY


def test_the_parts_of_constants_add_up() -> None:
    with mpmath.workprec(300):
        for parts, exact, bits in (
            (LN2, mpmath.log(2), 105),
            (LN2_SHORT, mpmath.log(2), 70),
            (QUARTER_PI, mpmath.pi / 4, 105),
        ):
            assert abs(mpmath.fsum(map(mpmath.mpf, parts)) / exact - 1) < mpmath.mpf(2) ** -bits
    # Products with up to 2^11 are exact.
    assert int(math.ldexp(math.frexp(LN2_SHORT[0])[0], 53)) % 2**32 == 0


def test_errors_of_the_polynomials() -> None:
    """Relative errors of the functions below 2^-56."""

    def sum_of(coefficients: tuple[float, ...], x: Any) -> Any:
        return sum(coefficient * x**n for n, coefficient in enumerate(coefficients))

    with mpmath.workprec(200):
        for k in range(1, 300):
            r = mpmath.log(2) / 2 * (2 * k - 300) / 300
            assert abs((1 + r + r * r * sum_of(EXP, r)) / mpmath.exp(r) - 1) < 2.0**-56
            for coefficients, function, last in (
                (TANH, mpmath.tanh, TANH_POLYNOMIAL_LIMIT),
                (ARCTAN, mpmath.atan, ARCTAN_MIDDLE),
            ):
                t = mpmath.mpf(last) * k / 299
                found = t * (1 + t * t * sum_of(coefficients, t * t))
                assert abs(found / function(t) - 1) < 2.0**-56
