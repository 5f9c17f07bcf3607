"""Errors of sines and cosines against many-digit values."""

from __future__ import annotations

import math

import mpmath
import numpy as np

from dynx.spatial.scalar import Floats

BITS = 240
"""Working precision [bits]; large arguments need in addition as many bits as their integer part."""


def errors(x: Floats, sin: Floats, cos: Floats) -> tuple[Floats, Floats]:
    """Return the errors of `sin` and `cos` of `x`, in units in the last place of the exact values."""
    found = np.empty((2, len(x)))
    for k, angle in enumerate(x.tolist()):
        with mpmath.workprec(BITS + max(0, math.frexp(angle)[1])):
            exact = mpmath.cos_sin(mpmath.mpf(angle))[::-1]
            for row, value, got in zip(found, exact, (sin[k], cos[k]), strict=True):
                row[k] = float(abs(mpmath.mpf(float(got)) - value) / math.ulp(float(value)))
    return found[0], found[1]
