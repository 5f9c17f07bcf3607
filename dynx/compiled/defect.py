"""Defect of the arguments of a sample: a number by which a kernel checks them while they are in registers.

It is below `MAX_DEFECT` exactly if the arguments are finite and not too large, and quaternions have unit
length.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.model import Mechanism
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE
from dynx.spatial.scalar import Array

MAX_DEFECT = MAX_MAGNITUDE**2
"""Bound on the defect of a sample with valid arguments."""

MAX_RESULT = 1e300
"""Bound on the results of quantities that solve an equation; accelerations of robots are smaller."""


def argument_defect(mechanism: Mechanism, q: Array, *rates: Array) -> Array:
    """Return the sum of squares of all arguments; far above `MAX_DEFECT` for a quaternion not of length 1."""
    total = sum_by_pairs([x * x for x in np.concatenate([q, *rates])])
    for first in (*(3,) * mechanism.floating, *mechanism.ball_places):
        total = total + quaternion_defect(q[first : first + 4])
    return np.array([total], dtype=object)


def result_defect(result: Array) -> Any:
    """Return a number above `MAX_DEFECT` if an entry of the result (n,) is beyond `MAX_RESULT`."""
    return np.sum(abs(result)) * (MAX_DEFECT / MAX_RESULT)


def quaternion_defect(quaternion: Array) -> Any:
    """Return zero for a quaternion (4,) of length 1, and a number far above `MAX_DEFECT` for any other."""
    off = abs(sum(x * x for x in quaternion) - 1.0)
    return (off - UNIT_NORM_TOLERANCE).maximum(0.0) * (MAX_DEFECT * 1e100)


def sum_by_pairs(terms: list[Any]) -> Any:
    """Add terms in pairs: few additions then depend on one another, and the processor overlaps them."""
    while len(terms) > 1:
        odd = terms[len(terms) // 2 * 2 :]
        terms = [a + b for a, b in zip(terms[::2], terms[1::2], strict=False)] + odd
    return terms[0] if terms else 0.0
