"""Numbers in 50 digits: sines and cosines, and independence of the context of the caller."""

from __future__ import annotations

from decimal import ROUND_UP, Context, Decimal, FloatOperation, localcontext

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.same import same_robot
from dynx.same.decimals import DIGITS, decimals, fifty_digits, rounded
from dynx.spatial.scalar import cos, sin, sqrt


@given(st.floats(-1e3, 1e3))
def test_sines_and_cosines_have_fifty_digits(angle: float) -> None:
    with fifty_digits(), mpmath.mp.workdps(DIGITS + 20):
        x = mpmath.mpf(repr(angle))
        for ours, theirs in ((sin, mpmath.sin), (cos, mpmath.cos)):
            (value,) = ours(decimals([angle])).tolist()
            assert abs(mpmath.mpf(str(value)) - theirs(x)) < mpmath.mpf(10) ** -(DIGITS + 5)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_numbers_are_the_shortest_decimals(number: float) -> None:
    (value,) = decimals([number]).tolist()
    assert value == Decimal(repr(number))
    assert rounded(decimals(number)) == number


def test_roots_have_fifty_digits() -> None:
    with fifty_digits():
        root = sqrt(decimals([2.0]))[0]
        assert abs(root * root - 2) < Decimal(10) ** -(DIGITS - 2)


@pytest.mark.parametrize("context", [Context(prec=3), Context(rounding=ROUND_UP, traps=[FloatOperation])])
def test_the_context_of_the_caller_does_not_matter(context: Context) -> None:
    arm = dynx.load("six_axis_arm")
    other = arm.to_urdf().replace('mass value="4.2"', 'mass value="4.200001"')
    with localcontext(context):
        report = same_robot(arm, other)
        assert not report.same
        assert same_robot(arm, arm).same
    (each,) = report.differences
    np.testing.assert_allclose(each.size, 1e-6 / 4.2, rtol=1e-6)
