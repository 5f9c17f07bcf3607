"""Numbers of a description in 50 digits, taken as the decimals that a file states.

A model holds doubles. The shortest decimal that reads back as a double is the text of the file wherever that
has at most 15 significant digits, and at most half a unit in the last place of the double away elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mpmath
import numpy as np

from dynx.spatial.scalar import Array, Floats

DIGITS = 50


@contextmanager
def fifty_digits() -> Iterator[None]:
    """Evaluate the block in 50 digits. The precision is a setting of the whole process in mpmath."""
    with mpmath.mp.workdps(DIGITS):
        yield


def _decimal(number: float) -> object:
    whole = int(number)
    return mpmath.mpf(whole if whole == number else repr(float(number)))


def decimals(numbers: object) -> Array:
    """Convert nested floats to an array of 50-digit numbers: the shortest decimals that read back as them."""
    array = np.asarray(numbers, dtype=np.float64)
    return np.asarray(np.frompyfunc(_decimal, 1, 1)(array), dtype=object)


def rounded(numbers: Array) -> Floats:
    """Convert 50-digit numbers to the nearest doubles."""
    return np.asarray(numbers).astype(np.float64)
