"""Gains: one number for all coordinates or one for each, checked once when a controller is made."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, GainError
from dynx.model.numbers import real_array
from dynx.spatial.scalar import Floats


def checked_gain(name: str, gain: ArrayLike, length: int, *, per: str = "one for each coordinate") -> Floats:
    """Return `gain` as an array (length,) of finite numbers that are not negative, or a GainError.

    The array is a read-only copy.
    """
    try:
        array = real_array(name, gain)
    except ArgumentError as error:
        raise GainError(str(error)) from None
    if array.shape not in ((), (length,)):
        raise GainError(f"{name} has shape {array.shape}; wanted one number, or {length}, {per}")
    if not np.isfinite(array).all():
        raise GainError(f"{name} is not finite")
    if (array < 0.0).any():
        raise GainError(f"{name} is negative ({float(array.min()):g}); wanted 0 or more")
    full = np.array(np.broadcast_to(array, (length,)))
    full.setflags(write=False)
    return full


def feedback_gains(
    length: int,
    kp: ArrayLike | None,
    kd: ArrayLike | None,
    natural_frequency: ArrayLike | None,
    damping_ratio: ArrayLike,
) -> tuple[Floats, Floats]:
    """Return kp [1/s^2] and kd [1/s] (length,) of an error that obeys e'' + kd e' + kp e = 0.

    Arguments are either both gains, or the natural frequency w [rad/s] and the damping ratio z: kp = w^2, kd
    = 2 z w. Raises GainError for any other combination.
    """
    if natural_frequency is not None:
        if kp is not None or kd is not None:
            raise GainError("gains are given twice: wanted kp and kd, or natural_frequency")
        w = checked_gain("natural_frequency", natural_frequency, length)
        return w * w, 2.0 * checked_gain("damping_ratio", damping_ratio, length) * w
    if kp is None or kd is None:
        raise GainError("wanted kp and kd both, or natural_frequency (with damping_ratio)")
    return checked_gain("kp", kp, length), checked_gain("kd", kd, length)
