"""Evaluation of `dynx.rbd` in 50 digits, where a difference quotient is as good as a derivative.

With a step of 1e-16 the central difference has a relative error of about 1e-32 and rounding adds
1e-50 / 1e-16 = 1e-34, so an identity between derivatives holds to IDENTITY_TOLERANCE or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mpmath
import numpy as np
from numpy.typing import ArrayLike

from dynx.model import Mechanism, Model, build_mechanism
from dynx.spatial.scalar import Array, append_axis, sqrt
from dynx.spatial.so3 import cross, rotate, rotation_from_quat

DIGITS = 50
STEP = 16
IDENTITY_TOLERANCE = 1e-24


def exactly(numbers: object) -> Array:
    """Convert nested numbers to an array of 50-digit numbers."""
    return np.asarray(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(numbers, dtype=float)), dtype=object)


@contextmanager
def fifty_digits() -> Iterator[None]:
    """Make mpmath compute with 50 digits inside the context."""
    with mpmath.workdps(DIGITS):
        yield


def exact_mechanism(model: Model) -> Mechanism:
    """Build the mechanism of a model, its inertias merged in 50 digits."""
    return build_mechanism(model, exactly)


def tree_q(model: Model, q: ArrayLike) -> Array:
    """Return a configuration in tree coordinates, its quaternion normalised in 50 digits."""
    coupling = model.mechanism.coupling
    q = np.asarray(q, dtype=float)
    tree = exactly(q if coupling is None else coupling.expand_q(q))
    return unit(model.mechanism, tree)


def unit(mechanism: Mechanism, q: Array) -> Array:
    """Return `q` with its quaternion, if any, scaled to unit length."""
    if not mechanism.floating:
        return q
    quat = q[..., 3:7]
    quat = quat / append_axis(sqrt(np.sum(quat * quat, axis=-1)))
    return np.concatenate([q[..., :3], quat, q[..., 7:]], axis=-1)


def along_motion(mechanism: Mechanism, q: Array, v: Array, t: Any) -> Array:
    """Return the point at time t of a smooth curve through q whose velocity at t = 0 is v."""
    if not mechanism.floating:
        return np.asarray(q + v * t)
    position = q[:3] + rotate(rotation_from_quat(q[3:7]), v[:3]) * t
    half, vector, scalar = v[3:6] * t / 2, q[3:6], q[6]
    new_vector = half * scalar + vector + cross(vector, half)
    quat = np.concatenate([new_vector, np.asarray([scalar - np.sum(vector * half)], dtype=object)])
    return unit(mechanism, np.concatenate([position, quat, q[7:] + v[6:] * t]))


def rate(function: Callable[[Array], Array], mechanism: Mechanism, q: Array, v: Array) -> Array:
    """Return d/dt of function(q(t)) at t = 0 along the motion v, by a central difference."""
    h = mpmath.mpf(10) ** -STEP
    ahead = function(along_motion(mechanism, q, v, h))
    behind = function(along_motion(mechanism, q, v, -h))
    return np.asarray((ahead - behind) / (2 * h), dtype=object)


def distance(a: Array, b: Array) -> float:
    """Return max |a - b| relative to max(1, max |a|, max |b|)."""
    a, b = np.asarray(a, dtype=object), np.asarray(b, dtype=object)
    if a.size == 0:
        return 0.0
    scale = max(1.0, float(np.max(np.abs(a))), float(np.max(np.abs(b))))
    return float(np.max(np.abs(a - b))) / scale
