"""Checks of batches without temporary arrays.

The base looks at every entry several times and makes arrays of what it sees, which costs more than a
kernel does. The largest and the smallest entry say of all at once that they are finite and not too
large; only if they are not does the base look, and say which one.
"""

from __future__ import annotations

from math import hypot
from typing import Any

import numpy as np

from dynx.backends.arguments import Arguments
from dynx.errors import ClosedError
from dynx.model.configuration import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE
from dynx.spatial.scalar import Floats

_SHORT = 64
"""Numbers that Python's own loop over a list adds faster than NumPy."""

_FINITE = 1e300
"""No acceleration of a robot is larger; the base decides about one that is."""


class BatchArguments(Arguments):
    """`Arguments` for a backend that is asked for batches."""

    def refuse_closed(self) -> None:
        """Raise ClosedError if the backend was closed."""
        if self.closed:
            raise ClosedError(f"this backend of {self._model.name} was closed; make a new one")

    def q(self, q: Any) -> Floats:
        """A configuration (..., nq), finite, with a unit quaternion for a floating base."""
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
        """A velocity, acceleration or torque (..., nv), finite."""
        if _is_batch(v, self._v_shape) and _below(v, MAX_MAGNITUDE):
            return np.asarray(v)
        return super().v(v, name)

    def finite_acceleration(self, a: Floats) -> Floats:
        """What forward dynamics found, unless the mass matrix was singular there."""
        if _below(a, _FINITE):
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
    """Whether every entry is a number below `bound` in size."""
    if array.size < _SHORT:
        return hypot(*array.reshape(-1).tolist()) < bound
    # NaN is the largest as well as the smallest, and below nothing.
    return bool(np.max(array) < bound and np.min(array) > -bound)
