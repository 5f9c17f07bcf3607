"""Gains of the feedback of an error: given both, or by natural frequency and damping ratio."""

from __future__ import annotations

from numpy.typing import ArrayLike

from dynx.errors import GainError
from dynx.model.numbers import checked_gain
from dynx.spatial.scalar import Floats


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
        got = "kp alone" if kd is None and kp is not None else "kd alone" if kd is not None else "none"
        raise GainError(
            f"gains: {got} is given; wanted kp and kd both, or natural_frequency (with damping_ratio)"
        )
    return checked_gain("kp", kp, length), checked_gain("kd", kd, length)
