"""Numerical derivatives along a motion, accurate to a dozen digits.

A pose, and anything made of poses, is band-limited along a motion at constant velocity: a sum of
sines and cosines whose frequency is at most W. Bernstein's inequality then bounds every derivative
by the largest value times a power of W, so the central difference of order 8 with step ``STEP / W`` has a
known error (`tolerances.derivative`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.agreement.tolerances import STEP
from dynx.spatial.scalar import Floats

WEIGHTS = {1: 4.0 / 5.0, 2: -1.0 / 5.0, 3: 4.0 / 105.0, 4: -1.0 / 280.0}
"""Weight of f(k h) - f(-k h), to be divided by h."""

MAX_REST_FREQUENCY = 1e-100
"""Frequency [rad/s] below which a robot counts as at rest, because the step ``STEP / W`` would overflow."""


def time_derivative(function: Callable[[Floats], Floats], frequency: Floats) -> Floats:
    """Return the time derivative of ``function(t)`` at t = 0 for n motions at once.

    `frequency` (n,) is each motion's highest angular frequency [rad/s]. `function` takes m times for each
    motion as an array (m, n), and returns (m, n, ...); the derivative is (n, ...).
    """
    step = STEP / np.where(frequency > MAX_REST_FREQUENCY, frequency, 1.0)
    multiples = [k for order in WEIGHTS for k in (order, -order)]
    values = function(np.array(multiples)[:, None] * step)
    total = sum(
        weight * (values[2 * row] - values[2 * row + 1]) for row, weight in enumerate(WEIGHTS.values())
    )
    return np.asarray(total / step.reshape(-1, *([1] * (values.ndim - 2))))
