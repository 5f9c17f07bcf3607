"""Natural magnitudes: bounds on the terms of a quantity, by which its error is divided.

The table of quantities (`dynx.backends.quantities`) names one of these for each quantity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.sampling import FrameSamples, Samples
from dynx.spatial.scalar import Floats

Layout = Literal["samples", "frames", "every_frame", "derivatives"]
"""Leading axes of an array of results: samples; samples, then frames; or the entries of one of the two lists
of `FrameSamples`, then the samples of each."""

Scale = Callable[[Magnitudes], Floats]


@dataclass(frozen=True)
class NaturalMagnitude:
    """Bounds at every sample.

    `scale` broadcasts against the results, whose leading axes are those of `layout`. `derived_scale`
    is for results that dynx derives, if the derivation loses digits: columns of a derived mass matrix are
    differences of torques that contain gravity.
    """

    scale: Scale
    layout: Layout = "samples"
    derived_scale: Scale | None = None


def frame_samples(layout: Layout, samples: Samples) -> tuple[FrameSamples, ...]:
    """Return the entries along the first axis of layout ``every_frame`` or ``derivatives``."""
    return samples.every_frame if layout == "every_frame" else samples.derivatives


def largest(scale: Floats) -> Floats:
    """Return the largest entry (n, 1) of each sample's scale (n, nv), for errors in the max norm."""
    return np.asarray(np.max(scale, axis=-1, initial=0.0, keepdims=True))


def pose_scale(magnitudes: Magnitudes) -> Floats:
    """Return the scale (n, 1, 4, 4) of poses: 1 for rotations, the length of the robot for positions."""
    scale = np.ones((len(magnitudes.samples), 1, 4, 4))
    scale[:, :, :3, 3] = magnitudes.length[:, None, None]
    return scale


def mass_scale(magnitudes: Magnitudes) -> Floats:
    """Return the scale (n, nv, nv) of mass matrices: sqrt(M_ii M_jj)."""
    return np.asarray(magnitudes.sqrt_diagonal[:, :, None] * magnitudes.sqrt_diagonal[:, None, :])


def _derived_mass_scale(magnitudes: Magnitudes) -> Floats:
    gravity = magnitudes.gravity_torque
    return mass_scale(magnitudes) + gravity[:, :, None] + gravity[:, None, :]


def coriolis_scale(magnitudes: Magnitudes) -> Floats:
    """Return a bound (n, nv, nv) on m (Jp' dJp + dJp' Jp) + Jr' I dJr, from bounds on each factor.

    The bound on M times an angular speed would be too small: the lever arms of a robot that translates
    without rotating change with its speed, and these terms cancel (a point mass on the axis of a joint on a
    translating base).
    """
    L, rate, A = magnitudes.linear_column, magnitudes.linear_column_rate, magnitudes.angular_column
    linear = magnitudes.mass * (L[:, :, None] * rate[:, None, :] + rate[:, :, None] * L[:, None, :])
    angular = (
        magnitudes.rotational_inertia
        * _angular_velocity(magnitudes)[:, None, None]
        * A[:, :, None]
        * A[:, None, :]
    )
    return np.asarray(linear + angular)


def _regressor_scale(magnitudes: Magnitudes) -> Floats:
    """Return a bound (n, nv, 10 n_links) on the torque of a unit of each parameter, anywhere on the robot.

    With lever arm L, proper acceleration p and angular terms w = |alpha| + omega^2, a mass requires L p, a
    first moment L w + p, and a second moment w.
    """
    L, A = magnitudes.linear_column, magnitudes.angular_column
    p = (_linear_acceleration(magnitudes) + magnitudes.gravity)[:, None]
    w = (_angular_acceleration(magnitudes) + _angular_velocity(magnitudes) ** 2)[:, None]
    ten = [L * p] + [L * w + A * p] * 3 + [A * w] * 6
    return np.tile(np.stack(ten, axis=-1), len(magnitudes.samples.model.links))


def _derived_energy_scale(magnitudes: Magnitudes) -> Floats:
    v = np.abs(magnitudes.samples.v)
    return np.asarray(0.5 * np.einsum("ni,nij,nj->n", v, _derived_mass_scale(magnitudes), v))


def _momentum_scale(magnitudes: Magnitudes) -> Floats:
    linear = magnitudes.mass * magnitudes.speed
    angular = linear * magnitudes.length + magnitudes.rotational_inertia * _angular_velocity(magnitudes)
    return np.stack([linear] * 3 + [angular] * 3, axis=-1)


def _twist(layout: Layout, linear: Scale, angular: Scale) -> NaturalMagnitude:
    """Return the bounds (entries, samples, 6 [, nv]) from bounds (n [, nv]) of linear and angular rows."""

    def scale(magnitudes: Magnitudes) -> Floats:
        rows = np.stack([linear(magnitudes)] * 3 + [angular(magnitudes)] * 3, axis=1)
        entries = frame_samples(layout, magnitudes.samples)
        return np.asarray(np.stack([rows[entry.samples] for entry in entries]))

    return NaturalMagnitude(scale, layout)


def _linear_acceleration(magnitudes: Magnitudes) -> Floats:
    a, v = np.abs(magnitudes.samples.a), np.abs(magnitudes.samples.v)
    return np.asarray(np.sum(magnitudes.linear_column * a + magnitudes.linear_column_rate * v, axis=-1))


def _angular_acceleration(magnitudes: Magnitudes) -> Floats:
    a, v = np.abs(magnitudes.samples.a), np.abs(magnitudes.samples.v)
    return np.asarray(np.sum(magnitudes.angular_column * a + magnitudes.angular_column_rate * v, axis=-1))


def _angular_velocity(magnitudes: Magnitudes) -> Floats:
    return np.asarray(np.sum(magnitudes.angular_column * np.abs(magnitudes.samples.v), axis=-1))


NATURAL_MAGNITUDES: dict[str, NaturalMagnitude] = {
    "pose": NaturalMagnitude(pose_scale, "frames"),
    "length": NaturalMagnitude(lambda s: s.length[:, None]),
    "jacobian": _twist("every_frame", lambda s: s.linear_column, lambda s: s.angular_column),
    "linear jacobian": NaturalMagnitude(lambda s: s.linear_column[:, None, :]),
    "jacobian rate": _twist("derivatives", lambda s: s.linear_column_rate, lambda s: s.angular_column_rate),
    "velocity": _twist("every_frame", lambda s: s.speed, _angular_velocity),
    "acceleration": _twist("derivatives", _linear_acceleration, _angular_acceleration),
    "torque": NaturalMagnitude(lambda s: largest(s.torque)),
    "bias torque": NaturalMagnitude(lambda s: largest(s.bias_torque)),
    "gravity torque": NaturalMagnitude(lambda s: largest(s.gravity_torque)),
    "inertia": NaturalMagnitude(mass_scale, derived_scale=_derived_mass_scale),
    "coriolis": NaturalMagnitude(coriolis_scale),
    "regressor": NaturalMagnitude(_regressor_scale),
    "momentum": NaturalMagnitude(_momentum_scale),
    "kinetic energy": NaturalMagnitude(lambda s: s.kinetic_energy, derived_scale=_derived_energy_scale),
    "potential energy": NaturalMagnitude(lambda s: s.potential_energy),
}
"""Natural magnitudes by name."""
