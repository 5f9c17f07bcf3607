"""Sine and cosine to many digits, and how far from them a double is."""

from __future__ import annotations

import math

import mpmath
import numpy as np

from dynx.spatial.scalar import Floats

BITS = 240
"""Working precision; arguments beyond 2^100 need as many bits more as they have before the point."""


def errors(x: Floats, sin: Floats, cos: Floats) -> tuple[Floats, Floats]:
    """Distances of `sin` and `cos` from the functions of `x`, in units of the last place of these."""
    found = np.empty((2, len(x)))
    for k, angle in enumerate(x.tolist()):
        with mpmath.workprec(BITS + max(0, math.frexp(angle)[1])):
            exact = mpmath.cos_sin(mpmath.mpf(angle))[::-1]
            for row, value, got in zip(found, exact, (sin[k], cos[k]), strict=True):
                row[k] = float(abs(mpmath.mpf(float(got)) - value) / math.ulp(float(value)))
    return found[0], found[1]
