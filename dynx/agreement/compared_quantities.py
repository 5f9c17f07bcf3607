"""The compared quantities: those of `dynx.backends.quantities`, and variants of some with other options.

They can be evaluated on any object that has the methods of `Backend`, such as the 50-digit referee.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.magnitudes import (
    EPS,
    NATURAL_MAGNITUDES,
    Layout,
    Magnitudes,
    NaturalMagnitude,
    Scale,
    frame_samples,
    largest,
    wrench_scale,
)
from dynx.agreement.sampling import Samples
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.spatial.scalar import Array, Floats

POINT = (0.3, -0.2, 0.1)
"""Point [m], in the axes of the frame, at which a Jacobian is compared, besides the origins of frames."""

Evaluate = Callable[[Any, Samples], Array]


@dataclass(frozen=True)
class ComparedQuantity:
    """One line of the report.

    `evaluate` returns the results of a backend, `scale` broadcasts against them, and `tolerance` bounds their
    difference over scale. Where the engine computes the quantity called `native` itself, that result is
    compared with the derived one, relative to `derived_scale` (None: no such comparison). `refereed` tells
    whether the referee computes the quantity.
    """

    name: str
    evaluate: Evaluate
    scale: Scale
    tolerance: Callable[[Magnitudes], float]
    layout: Layout = "samples"
    native: str | None = None
    refereed: bool = False
    derived_scale: Scale | None = None


def compared_quantities() -> tuple[ComparedQuantity, ...]:
    """Return all compared quantities except those that solve equations, whose errors are not differences
    (`dynx.agreement.comparison`)."""
    lines: list[ComparedQuantity] = []
    for quantity in QUANTITIES.values():
        if not quantity.solves:
            lines += [_of_table(quantity), *_VARIANTS.get(quantity.name, ())]
    return tuple(lines)


def _of_table(quantity: Quantity) -> ComparedQuantity:
    magnitude = NATURAL_MAGNITUDES[quantity.natural_magnitude]
    return ComparedQuantity(
        quantity.name,
        _evaluation(quantity, magnitude),
        magnitude.scale,
        _rounding,
        magnitude.layout,
        # All other quantities are derived from these two.
        None if quantity.name in ("forward_kinematics", "inverse_dynamics") else quantity.name,
        quantity.refereed,
        magnitude.derived_scale,
    )


def _evaluation(quantity: Quantity, magnitude: NaturalMagnitude) -> Evaluate:
    def at_samples(backend: Any, samples: Samples) -> Array:
        arguments = (getattr(samples, argument) for argument in quantity.arguments)
        return np.asarray(getattr(backend, quantity.name)(*arguments))

    def at_frames(backend: Any, samples: Samples) -> Array:
        """Return the results (entries, samples, ...) for each entry of `frame_samples`."""
        method, results = getattr(backend, quantity.name), []
        for entry in frame_samples(magnitude.layout, samples):
            state = [getattr(samples, argument)[entry.samples] for argument in quantity.arguments]
            results.append(method(*state, entry.frame, reference=entry.reference))
        return np.asarray(np.stack(results))

    return at_frames if magnitude.layout in ("every_frame", "derivatives") else at_samples


def _rounding(magnitudes: Magnitudes) -> float:
    return tolerances.rounding(magnitudes.depth)


def _component(magnitudes: Magnitudes) -> float:
    return tolerances.component(magnitudes.depth)


def _component_scale(magnitudes: Magnitudes) -> Floats:
    """Return the magnitude (n, nv) of each torque, with a lower bound that keeps one rounding of the largest
    torque within tolerance. (The torque of a joint with a point mass on its axis is zero, but it is a sum of
    terms as large as the largest torque.)"""
    return np.maximum(magnitudes.torque, largest(magnitudes.torque) * (EPS / _component(magnitudes)))


def _at_point(backend: Any, samples: Samples) -> Array:
    frame = samples.wrench_frame
    by_reference = [
        backend.jacobian(samples.q, frame, reference=reference, point=POINT)
        for reference in ("local_world_aligned", "local")
    ]
    return np.concatenate(by_reference, axis=-2)


def _at_point_scale(magnitudes: Magnitudes) -> Floats:
    linear = magnitudes.linear_column + np.linalg.norm(POINT) * magnitudes.angular_column
    return np.stack((([linear] * 3) + [magnitudes.angular_column] * 3) * 2, axis=1)


def _with_forces(quantity: str, backend: Any, samples: Samples) -> Array:
    forces, method = {samples.wrench_frame: samples.wrench}, getattr(backend, quantity)
    by_reference = [
        method(samples.q, samples.v, samples.a, external_forces=forces, force_reference=reference)
        for reference in ("local_world_aligned", "local", "world")
    ]
    return np.concatenate(by_reference, axis=-1)


def _wrenches_with_forces_scale(magnitudes: Magnitudes) -> Floats:
    """Return the bound (n, 18) on wrenches with an external one, which is given in three references."""
    force = np.linalg.norm(magnitudes.samples.wrench[:, :3], axis=-1)
    moment = np.linalg.norm(magnitudes.samples.wrench[:, 3:], axis=-1) + force * magnitudes.length
    return np.tile(wrench_scale(magnitudes) + np.stack([force] * 3 + [moment] * 3, axis=-1), 3)


def _with_joint_dynamics(backend: Any, samples: Samples) -> Array:
    return np.asarray(backend.inverse_dynamics(samples.q, samples.v, samples.a, joint_dynamics=True))


def _joint_dynamics_scale(magnitudes: Magnitudes) -> Floats:
    model = magnitudes.samples.model
    total = np.zeros(len(magnitudes.samples))
    fastest = np.max(np.abs(magnitudes.samples.v) + np.abs(magnitudes.samples.a), axis=-1, initial=0.0)
    for joint in model.joints:
        gain = 1.0 if joint.mimic is None else max(abs(joint.mimic.multiplier), joint.mimic.multiplier**2)
        own = joint.dynamics
        total = total + gain * ((own.damping + own.armature) * fastest + own.friction)
    return largest(magnitudes.torque) + np.abs(total)[:, None]


def _inverse_dynamics(backend: Any, samples: Samples) -> Array:
    return np.asarray(backend.inverse_dynamics(samples.q, samples.v, samples.a))


_VARIANTS = {
    "jacobian": (ComparedQuantity("jacobian_at_point", _at_point, _at_point_scale, _rounding),),
    "inverse_dynamics": (
        ComparedQuantity(
            "inverse_dynamics_component", _inverse_dynamics, _component_scale, _component, refereed=True
        ),
        ComparedQuantity(
            "inverse_dynamics_external_forces",
            partial(_with_forces, "inverse_dynamics"),
            lambda s: largest(s.torque) + largest(s.wrench_torque),
            _rounding,
        ),
        ComparedQuantity(
            "inverse_dynamics_joint_dynamics", _with_joint_dynamics, _joint_dynamics_scale, _rounding
        ),
    ),
    "joint_wrenches": (
        ComparedQuantity(
            "joint_wrenches_external_forces",
            partial(_with_forces, "joint_wrenches"),
            lambda s: _wrenches_with_forces_scale(s)[:, None],
            _rounding,
        ),
    ),
    "base_wrench": (
        ComparedQuantity(
            "base_wrench_external_forces",
            partial(_with_forces, "base_wrench"),
            _wrenches_with_forces_scale,
            _rounding,
        ),
    ),
}
"""Variants of a quantity of the table: the same method with other options or another tolerance."""
