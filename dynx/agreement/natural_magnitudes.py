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
"""Leading axes of an array of results: samples; samples, then frames; or one of the two lists of frames of
`Samples`, then the samples of each."""

Scale = Callable[[Magnitudes], Floats]


@dataclass(frozen=True)
class NaturalMagnitude:
    """Bounds at every sample.

    `scale` broadcasts against the results, whose leading axes are those of `layout`. `derived_scale`
    holds for results that dynx derives, where derivation loses digits: columns of a derived mass matrix are
    differences of torques that contain gravity.
    """

    scale: Scale
    layout: Layout = "samples"
    derived_scale: Scale | None = None


def frame_samples(layout: Layout, samples: Samples) -> tuple[FrameSamples, ...]:
    """The frames and samples that the first axis of such a layout counts."""
    return samples.every_frame if layout == "every_frame" else samples.derivatives


def largest(scale: Floats) -> Floats:
    """(n, 1): the largest entry of each sample's scale (n, nv), for errors in the max norm."""
    return np.asarray(np.max(scale, axis=-1, initial=0.0, keepdims=True))


def pose_scale(sizes: Magnitudes) -> Floats:
    """(n, 1, 4, 4): 1 for rotations, the length of the robot for positions."""
    scale = np.ones((len(sizes.samples), 1, 4, 4))
    scale[:, :, :3, 3] = sizes.length[:, None, None]
    return scale


def mass_scale(sizes: Magnitudes) -> Floats:
    """(n, nv, nv): sqrt(M_ii M_jj)."""
    return np.asarray(sizes.root_inertia[:, :, None] * sizes.root_inertia[:, None, :])


def _derived_mass_scale(sizes: Magnitudes) -> Floats:
    gravity = sizes.gravity_torque
    return mass_scale(sizes) + gravity[:, :, None] + gravity[:, None, :]


def coriolis_scale(sizes: Magnitudes) -> Floats:
    """(n, nv, nv): m Jp' dJp + Jr' I dJr, either factor the one that changes, each by its bound.

    Not the bound on M times a rate of turning: a robot that slides without turning has levers that grow
    and shrink by its speed, which cancel (a point mass on the axis of a joint of a sliding base).
    """
    L, rate, A = sizes.linear_column, sizes.linear_column_rate, sizes.angular_column
    linear = sizes.mass * (L[:, :, None] * rate[:, None, :] + rate[:, :, None] * L[:, None, :])
    turned = sizes.turning_inertia * _angular_speed(sizes)[:, None, None] * A[:, :, None] * A[:, None, :]
    return np.asarray(linear + turned)


def _regressor_scale(sizes: Magnitudes) -> Floats:
    """(n, nv, 10 n_links): what a unit of a parameter, anywhere on the robot, can take.

    A mass takes its acceleration, gravity included, at the end of a lever; a first moment takes the
    same about an axis, or the second derivative of turning at the end of a lever; a second moment takes
    the latter about an axis.
    """
    L, A = sizes.linear_column, sizes.angular_column
    moving = (_linear_acceleration(sizes) + sizes.gravity)[:, None]
    turning = (_angular_acceleration(sizes) + _angular_speed(sizes) ** 2)[:, None]
    ten = [L * moving] + [L * turning + A * moving] * 3 + [A * turning] * 6
    return np.tile(np.stack(ten, axis=-1), len(sizes.samples.model.links))


def _derived_energy_scale(sizes: Magnitudes) -> Floats:
    v = np.abs(sizes.samples.v)
    return np.asarray(0.5 * np.einsum("ni,nij,nj->n", v, _derived_mass_scale(sizes), v))


def _momentum_scale(sizes: Magnitudes) -> Floats:
    linear = sizes.mass * sizes.speed
    angular = linear * sizes.length + sizes.turning_inertia * _angular_speed(sizes)
    return np.stack([linear] * 3 + [angular] * 3, axis=-1)


def _twist(layout: Layout, linear: Scale, angular: Scale) -> NaturalMagnitude:
    """Bounds (questions, samples, 6 [, nv]) from bounds (n [, nv]) of linear and angular rows."""

    def scale(sizes: Magnitudes) -> Floats:
        rows = np.stack([linear(sizes)] * 3 + [angular(sizes)] * 3, axis=1)
        questions = frame_samples(layout, sizes.samples)
        return np.asarray(np.stack([rows[question.samples] for question in questions]))

    return NaturalMagnitude(scale, layout)


def _linear_acceleration(sizes: Magnitudes) -> Floats:
    a, v = np.abs(sizes.samples.a), np.abs(sizes.samples.v)
    return np.asarray(np.sum(sizes.linear_column * a + sizes.linear_column_rate * v, axis=-1))


def _angular_acceleration(sizes: Magnitudes) -> Floats:
    a, v = np.abs(sizes.samples.a), np.abs(sizes.samples.v)
    return np.asarray(np.sum(sizes.angular_column * a + sizes.angular_column_rate * v, axis=-1))


def _angular_speed(sizes: Magnitudes) -> Floats:
    return np.asarray(np.sum(sizes.angular_column * np.abs(sizes.samples.v), axis=-1))


NATURAL_MAGNITUDES: dict[str, NaturalMagnitude] = {
    "pose": NaturalMagnitude(pose_scale, "frames"),
    "length": NaturalMagnitude(lambda s: s.length[:, None]),
    "jacobian": _twist("every_frame", lambda s: s.linear_column, lambda s: s.angular_column),
    "linear jacobian": NaturalMagnitude(lambda s: s.linear_column[:, None, :]),
    "jacobian rate": _twist("derivatives", lambda s: s.linear_column_rate, lambda s: s.angular_column_rate),
    "velocity": _twist("every_frame", lambda s: s.speed, _angular_speed),
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
