"""Parts of a step of a closed loop that its executors share, for arrays of any scalar.

The plain executor evaluates them on floats; compiled steps trace them (`dynx.sim.loop_step`). Other
parts that they share are `clamp` (`dynx.spatial.scalar`), the law of friction and semi-implicit Euler
(`dynx.sim.plants`), control steps and the delay (`dynx.steppers.clock`), and the checks of what a controller
returns (`dynx.sim.controller_checks`).
"""

from __future__ import annotations

from collections.abc import Iterable
from math import hypot
from typing import Any

import numpy as np

from dynx.control.base import Measurement
from dynx.model import Model
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.spatial.manifold import integrate
from dynx.spatial.scalar import Array, Floats, sign

MAX_SQUARED_SPEED = DIVERGENCE_SPEED**2
"""Sum of squared velocities from which on a simulation counts as diverged."""


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
    if not model.quaternions:
        return np.asarray(q + displacement)
    if q.dtype == object:
        return integrate(q, displacement, floating=model.floating, balls=model.ball_places)
    return model.integrate(q, displacement)


def at_limit(tau: Array, limit: Array) -> Array:
    """Return 1 for torques (..., nv) at their effort limits (nv,), to which they are clamped, otherwise 0.

    On symbols limits must be finite.
    """
    return np.asarray(1.0 - sign(limit - abs(tau)))


def torque_sum(tau: Array) -> Any:
    """Return the sum of torques (nv,), which is finite only if all of them are.

    An overflowed torque is an error even if effort limits would make it finite.
    """
    return sum(tau.tolist())


def squared_speed(v: Array) -> Any:
    """Return the sum of squares of v (nv,), for symbols. The state diverged unless it is below
    `MAX_SQUARED_SPEED`, which NaN is not."""
    return v.dot(v)


def is_diverged(v: Floats) -> bool:
    """Check the same for floats, a microsecond faster and without a warning of an overflow."""
    return not hypot(*v.tolist()) < DIVERGENCE_SPEED


def with_disturbances(tau: Array, friction: Array | None, pushes: Iterable[tuple[Array, Array]]) -> Array:
    """Return the torque `tau` (nv,) minus that of smoothed friction, plus that of pushes.

    A push is the Jacobian (6, nv) of its frame and its wrench (6,).
    """
    if friction is not None:
        tau = tau - friction
    for J, wrench in pushes:
        tau = tau + J.T @ wrench
    return tau
