"""Parts of a step of a closed loop that its executors share, for arrays of any scalar.

The plain executor evaluates them on floats; the staged executor and batches trace them on symbols. Other
parts that they share are `clamp` (`dynx.spatial.scalar`), the law of friction and semi-implicit Euler
(`dynx.sim.plants`), and the delay (`dynx.sim.clock`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.control.base import Measurement
from dynx.model import Model
from dynx.spatial.branchless import integrate
from dynx.spatial.scalar import Array, sign


def measure(
    model: Model,
    t: Any,
    q: Array,
    v: Array,
    noise: tuple[Array, Array] | None = None,
    random: Array | None = None,
) -> Measurement:
    """Return the measurement of the state q (nq,), v (nv,) at time `t` [s].

    `noise` is a displacement of q (nv,) and an error of v (nv,), `random` the controller's random numbers.
    """
    if noise is not None:
        q, v = _displaced(model, q, noise[0]), v + noise[1]
    measurement = Measurement(t, q, v)
    return measurement if random is None else measurement.with_random(random)


def _displaced(model: Model, q: Array, displacement: Array) -> Array:
    if not model.floating:
        return np.asarray(q + displacement)
    return integrate(q, displacement) if q.dtype == object else model.integrate(q, displacement)


def at_limit(tau: Array, limit: Array) -> Array:
    """Return 1 for torques (..., nv) at their effort limits (nv,), to which they are clamped, otherwise 0.

    On symbols limits must be finite.
    """
    return np.asarray(1.0 - sign(limit - abs(tau)))
