"""Errors of the kernels' sine and cosine, with and without fused multiply-add."""

from __future__ import annotations

import functools
import math

import mpmath
import numpy as np
import pytest

from dynx.simd.emit import Settings
from dynx.simd.target import Processor
from dynx.simd.trace import trace
from dynx.simd.trigonometry import COS, HALF_PI, HALF_PI_SHORT, LIMIT, SIN
from dynx.spatial.scalar import Array, Floats, cos, sin
from tests.simd.exact import errors
from tests.simd.interp import cosine, sine
from tests.simd.machine import LANES, TARGETS, Machine, same_bits

MAX_ERROR = 2.0
"""Documented error bound up to `LIMIT`, in units in the last place."""
MAX_ERROR_BEYOND_LIMIT = 1.0
"""Error bound beyond `LIMIT`, in units in the last place."""


@functools.cache
def machine(target: Processor, lanes: int, fast: bool) -> Machine:
    def both(x: Array) -> dict[str, Array]:
        return {"sin": sin(x), "cos": cos(x)}

    return Machine(trace(both, {"x": (1,)}), target, Settings(lanes, fast=fast))


def evaluated(target: Processor, x: Floats, *, lanes: int = 4, fast: bool = True) -> tuple[Floats, Floats]:
    s, c = machine(target, lanes, fast)([np.ascontiguousarray(x)[:, None]])
    return s[:, 0], c[:, 0]


def nearest_doubles(first: int, last: int, quarter: bool) -> Floats:
    """Return the doubles nearest to multiples of pi/2, or to the points halfway between them."""
    with mpmath.workprec(200):
        return np.array([float((k + mpmath.mpf(quarter) / 2) * mpmath.pi / 2) for k in range(first, last)])


def neighbours(x: Floats) -> Floats:
    return np.concatenate([x, np.nextafter(x, np.inf), np.nextafter(x, 0.0)])


LAST = int(LIMIT / (math.pi / 2))
RNG = np.random.default_rng(20)
POINTS: dict[str, Floats] = {
    "over all magnitudes": RNG.choice([-1.0, 1.0], 4000) * 10.0 ** RNG.uniform(-20.0, 5.0, 4000),
    "up to the limit": RNG.uniform(-LIMIT, LIMIT, 4000),
    "one turn": RNG.uniform(-math.pi, math.pi, 4000),
    "multiples of pi/2": neighbours(
        np.concatenate([nearest_doubles(1, 700, False), nearest_doubles(LAST - 500, LAST, False)])
    ),
    "between them": neighbours(
        np.concatenate([nearest_doubles(0, 700, True), nearest_doubles(LAST - 500, LAST, True)])
    ),
    "tiny": np.concatenate([2.0 ** np.arange(-1074.0, -20.0), -(2.0 ** np.arange(-1074.0, -20.0))]),
    "at the limit": np.array([LIMIT, -LIMIT, np.nextafter(LIMIT, 0.0), np.nextafter(-LIMIT, 0.0)]),
}
# Points with the largest errors among 10^6 random ones, with and without fused multiply-add.
POINTS["worst known"] = np.array(
    [20012.73060153038, -87673.74460542334, -1.070266328123239, 974.6791207762334, 653.9557173179303]
)


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
@pytest.mark.parametrize("points", POINTS)
def test_within_two_units_up_to_the_limit(target: Processor, points: str) -> None:
    x = POINTS[points]
    worst = max(error.max() for error in errors(x, *evaluated(target, x)))
    assert worst <= MAX_ERROR


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
def test_within_one_unit_beyond_it(target: Processor) -> None:
    x = np.array([1e6, 1e15, 1e22, 1e300, np.nextafter(LIMIT, np.inf), np.finfo(float).max])
    x = np.concatenate([x, -x, 10.0 ** RNG.uniform(5.0, 308.0, 1000)])
    worst = max(error.max() for error in errors(x, *evaluated(target, x)))
    assert worst <= MAX_ERROR_BEYOND_LIMIT


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
def test_infinity_and_nan_give_nan_and_zero_keeps_its_sign(target: Processor) -> None:
    s, c = evaluated(target, np.array([np.inf, -np.inf, np.nan, 0.0, -0.0]))
    assert same_bits(s, np.array([np.nan, np.nan, np.nan, 0.0, -0.0]))
    assert same_bits(c, np.array([np.nan, np.nan, np.nan, 1.0, 1.0]))


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
def test_odd_and_even_and_the_same_in_every_lane_and_mode(target: Processor) -> None:
    """Bit for bit: the simplification that moves the sign out of sine and cosine is exact."""
    x = np.concatenate(
        [RNG.uniform(0.0, 10.0, 500), RNG.uniform(0.0, 2.0 * LIMIT, 500), [0.0, 5e-324, 1e300]]
    )
    s, c = evaluated(target, x)
    for lanes in LANES:
        for fast in (True, False):
            back = evaluated(target, -x[::-1], lanes=lanes, fast=fast)
            assert same_bits(-s[::-1], back[0])
            assert same_bits(c[::-1], back[1])


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
def test_a_large_angle_in_one_lane_does_not_affect_the_others(target: Processor) -> None:
    """All lanes take the branch, but only that lane uses the result of the C library."""
    x = RNG.uniform(-10.0, 10.0, 8)
    clean = evaluated(target, x, lanes=8)
    for lane in range(8):
        for large in (1e6, np.inf, np.nan):
            dirty = x.copy()
            dirty[lane] = large
            for before, after in zip(clean, evaluated(target, dirty, lanes=8), strict=True):
                assert same_bits(np.delete(after, lane), np.delete(before, lane))


def test_the_interpreter_takes_the_c_library() -> None:
    x = np.concatenate([POINTS["one turn"], [1e6, 1e300]])
    assert max(error.max() for error in errors(x, sine(x), cosine(x))) <= MAX_ERROR_BEYOND_LIMIT
    assert np.all(np.isnan(sine(np.array([np.inf, -np.inf, np.nan]))))


def test_the_parts_of_half_pi_add_up() -> None:
    with mpmath.workprec(300):
        half_pi = mpmath.pi / 2
        for parts, bits in ((HALF_PI, 150), (HALF_PI_SHORT, 100)):
            assert abs(mpmath.fsum(map(mpmath.mpf, parts)) / half_pi - 1) < mpmath.mpf(2) ** -bits
        for part in HALF_PI_SHORT[:2]:
            # Products with up to 2^20 quarter turns are exact.
            assert int(math.ldexp(math.frexp(part)[0], 53)) % 2**20 == 0


def test_errors_of_the_polynomials() -> None:
    """Relative errors below 2^-56 over [0, pi/4]."""
    with mpmath.workprec(200):
        for k in range(1, 500):
            r = mpmath.pi / 4 * k / 499
            z = r * r
            s = r * (1 + z * sum(coefficient * z**n for n, coefficient in enumerate(SIN)))
            c = 1 - z / 2 + z * z * sum(coefficient * z**n for n, coefficient in enumerate(COS))
            assert abs(s / mpmath.sin(r) - 1) < 2.0**-56
            assert abs(c / mpmath.cos(r) - 1) < 2.0**-56
