"""Numbers of a description in 50 digits, taken as the decimals that a file states.

A model holds doubles. The shortest decimal that reads back as a double is the text of the file wherever that
has at most 15 significant digits, and at most half a unit in the last place of the double away elsewhere.
Python's `decimal` computes with them: its numbers are those of C, and ten times as fast as those of mpmath.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from decimal import Context, Decimal, localcontext
from functools import lru_cache

import numpy as np

from dynx.spatial.scalar import Array, Floats

DIGITS = 50

GUARD_DIGITS = 10
"""Further digits in which sines and cosines are summed."""

MAX_SUMMED = 4.0
"""Largest angle [rad] of a sum: the terms, and with them the digits lost, grow with the angle."""


class StatedDecimal(Decimal):
    """A number as a description states it; what is computed from it is a `Decimal`."""

    def sin(self) -> Decimal:
        """Return the sine of an angle [rad]."""
        return _sine_and_cosine(self)[0]

    def cos(self) -> Decimal:
        """Return the cosine of an angle [rad]."""
        return _sine_and_cosine(self)[1]


@contextmanager
def fifty_digits() -> Iterator[None]:
    """Evaluate the block in 50 digits, whatever the context of the caller; other threads keep theirs."""
    with localcontext(Context(prec=DIGITS)):
        yield


@lru_cache(maxsize=4096)
def _sine_and_cosine(angle: Decimal) -> tuple[Decimal, Decimal]:
    if abs(angle) > MAX_SUMMED:
        import mpmath  # rarely needed, and slow to import

        with mpmath.mp.workdps(DIGITS + GUARD_DIGITS):
            x = mpmath.mpf(str(angle))
            return Decimal(str(mpmath.sin(x))), Decimal(str(mpmath.cos(x)))
    with localcontext(Context(prec=DIGITS + GUARD_DIGITS)) as context:
        # Taylor series of both at once: term n is x^n / n!.
        term, n, sums = Decimal(1), 0, [Decimal(0), Decimal(0)]
        while abs(term) > Decimal(10) ** -context.prec:
            sums[n % 2] += term if n % 4 < 2 else -term
            n += 1
            term = term * angle / n
        return sums[1], sums[0]


def _decimal(number: float) -> StatedDecimal:
    whole = int(number)
    # Beyond 2^53 the digits of a whole number are more than those of the shortest decimal.
    short = whole == number and abs(whole) <= 2**53
    return StatedDecimal(whole if short else repr(float(number)))


def decimals(numbers: object) -> Array:
    """Convert nested floats to an array of 50-digit numbers: the shortest decimals that read back as them."""
    array = np.asarray(numbers, dtype=np.float64)
    return np.asarray(np.frompyfunc(_decimal, 1, 1)(array), dtype=object)


def rounded(numbers: Array) -> Floats:
    """Convert 50-digit numbers to the nearest doubles."""
    return np.asarray(numbers).astype(np.float64)
