"""Damped springs that rebound with a given restitution, as contacts of MuJoCo do.

A contact accelerates the bodies apart by -b v - k r, whatever their masses (r is the distance, v its rate),
as long as this is positive: with k = w^2 and b = 2 z w for the natural frequency w and the damping ratio z.
In steps of h, v is changed first and r by the new v. A body that is found below the surface for the first
time is at a random part of the last step's way below it, so the restitution is the mean over these parts.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

MAX_STEP = 0.05
"""Largest product of step and natural frequency at which the restitution is that of a vanishing step."""

PHASES = 64
"""Number of depths, in the first step below the surface, of which the mean is taken."""

BISECTIONS = 40

MAX_KNOWN = 256
"""Number of results that are kept: worlds are opened again and again with the same materials and step."""


@lru_cache(MAX_KNOWN)
def restitution_of(ratio: float, step: float) -> float:
    """Return the restitution of a contact with a damping ratio; `step` is the product of step and natural
    frequency.

    For a vanishing step a body loses contact when the force has fallen to zero, before the spring is at its
    rest length (Schwager and Poeschel, Granular Matter 9, 2007, eq. 19): the ratio of the speeds is
    exp(-2 z atan(s / z) / s) with s = sqrt(1 - z^2), exp(-2) at z = 1, and with hyperbolic functions beyond.
    """
    if step <= MAX_STEP:
        s = math.sqrt(abs(1.0 - ratio * ratio))
        if s < 1e-6:
            return math.exp(-2.0 * ratio)
        angle = math.atan2(s, ratio) if ratio < 1.0 else math.atanh(s / ratio)
        return math.exp(-2.0 * ratio * angle / s)
    r = -(np.arange(PHASES) + 0.5) / PHASES
    v, force = -np.ones(PHASES), np.ones(PHASES)
    # In units of the step and of the speed of the impact.
    while force.any():
        force = np.maximum(-2.0 * ratio * step * v - step * step * r, 0.0) * (r < 0.0)
        v = v + force
        r = r + v
    return float(v.mean())


@lru_cache(MAX_KNOWN)
def damping_ratio(restitution: float, step: float) -> float:
    """Return the damping ratio of a contact with this restitution, or with the nearest that it can have.

    The largest ratio is that at which a step stops the bodies; the restitution falls up to there.
    """
    low, high = 0.0, 0.5 / step
    if restitution_of(high, step) >= restitution:
        return high
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if restitution_of(middle, step) > restitution:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high) if restitution < 1.0 else 0.0
