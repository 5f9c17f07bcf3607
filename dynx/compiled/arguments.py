"""Checks of the arguments of batches without temporary arrays.

The checks of `Arguments` read the data several times and make temporary arrays, which takes longer than a
kernel. Here only the largest and the smallest entry are tested; if they are not finite or too large, the
checks of `Arguments` follow, which name the invalid entry.
"""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np

from dynx.backends.arguments import Arguments
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE
from dynx.spatial.scalar import Floats

_MAX_LIST_SIZE = 64
"""Size up to which a C loop over a Python list is faster than NumPy."""

_MAX_ACCELERATION = 1e300
"""Magnitude above which accelerations are checked one by one."""


class FastArguments(Arguments):
    """`Arguments` with fast checks of batches."""

    def q(self, q: Any) -> Floats:
        if not self.closed and _is_batch(q, self._q_shape) and _below(q, MAX_MAGNITUDE):
            if not self._floating:
                return np.asarray(q)
            quat = q[..., 3:7]
            off = np.einsum("...i,...i->...", quat, quat) - 1.0
            if (
                np.max(off, initial=0.0) <= UNIT_NORM_TOLERANCE
                and np.min(off, initial=0.0) >= -UNIT_NORM_TOLERANCE
            ):
                return np.asarray(q)
        return super().q(q)

    def v(self, v: Any, name: str = "v") -> Floats:
        if _is_batch(v, self._v_shape) and _below(v, MAX_MAGNITUDE):
            return np.asarray(v)
        return super().v(v, name)

    def finite_acceleration(self, a: Floats) -> Floats:
        if _below(a, _MAX_ACCELERATION):
            return a
        return super().finite_acceleration(a)


def _is_batch(array: Any, shape: tuple[int]) -> bool:
    return (
        type(array) is np.ndarray
        and array.dtype == np.float64
        and array.ndim > 1
        and array.shape[-1:] == shape
        and array.flags.c_contiguous
    )


def _below(array: Floats, bound: float) -> bool:
    """Check whether every entry is a number of magnitude below `bound`."""
    if array.size < _MAX_LIST_SIZE:
        return hypot(*array.reshape(-1).tolist()) < bound
    # If any entry is NaN, minimum and maximum are NaN, and both comparisons are false.
    return bool(np.max(array) < bound and np.min(array) > -bound)
