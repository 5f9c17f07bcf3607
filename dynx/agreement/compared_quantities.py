"""The quantities that are compared: those of the table, and variants of some that share their code.

A quantity is evaluated by anything that has the methods of `Backend`, the 50-digit referee included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.magnitudes import EPS, Magnitudes
from dynx.agreement.natural_magnitudes import (
    NATURAL_MAGNITUDES,
    Layout,
    NaturalMagnitude,
    Scale,
    frame_samples,
    largest,
)
from dynx.agreement.sampling import Samples
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.spatial.scalar import Array, Floats

POINT = (0.3, -0.2, 0.1)
"""Point [m], in the axes of the frame, at which a Jacobian is compared beside the frames' origins."""

Evaluate = Callable[[Any, Samples], Array]


@dataclass(frozen=True)
class ComparedQuantity:
    """One line of the report.

    `evaluate` gives the results of a backend, `scale` broadcasts against them, and `tolerance` bounds
    their difference over scale. `native` is the quantity of the backend whose derivation is compared with
    it, `refereed` whether the referee computes it, and `derived_scale` the scale of derived results.
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
    """All but quantities that solve equations, whose errors are not differences, and inverse kinematics
    (`dynx.agreement.solutions`)."""
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
        # All derivations start from these two.
        None if quantity.name in ("forward_kinematics", "inverse_dynamics") else quantity.name,
        quantity.refereed,
        magnitude.derived_scale,
    )


def _evaluation(quantity: Quantity, magnitude: NaturalMagnitude) -> Evaluate:
    def at_samples(backend: Any, samples: Samples) -> Array:
        arguments = (getattr(samples, argument) for argument in quantity.arguments)
        return np.asarray(getattr(backend, quantity.name)(*arguments))

    def at_frames(backend: Any, samples: Samples) -> Array:
        """Results (questions, samples, ...), one question after the other."""
        method, results = getattr(backend, quantity.name), []
        for question in frame_samples(magnitude.layout, samples):
            state = [getattr(samples, argument)[question.samples] for argument in quantity.arguments]
            results.append(method(*state, question.frame, reference=question.reference))
        return np.asarray(np.stack(results))

    return at_frames if magnitude.layout in ("every_frame", "derivatives") else at_samples


def _rounding(sizes: Magnitudes) -> float:
    return tolerances.rounding(sizes.depth)


def _component(sizes: Magnitudes) -> float:
    return tolerances.component(sizes.depth)


def _component_scale(sizes: Magnitudes) -> Floats:
    """(n, nv): no torque can be more exact than one rounding of the largest (a joint that carries a
    point mass on its own axis takes none, but what is summed to none is as large as the others)."""
    return np.maximum(sizes.torque, largest(sizes.torque) * (EPS / _component(sizes)))


def _at_point(backend: Any, samples: Samples) -> Array:
    frame = samples.wrench_frame
    by_reference = [
        backend.jacobian(samples.q, frame, reference=reference, point=POINT)
        for reference in ("local_world_aligned", "local")
    ]
    return np.concatenate(by_reference, axis=-2)


def _at_point_scale(sizes: Magnitudes) -> Floats:
    linear = sizes.linear_column + np.linalg.norm(POINT) * sizes.angular_column
    return np.stack((([linear] * 3) + [sizes.angular_column] * 3) * 2, axis=1)


def _with_forces(backend: Any, samples: Samples) -> Array:
    forces = {samples.wrench_frame: samples.wrench}
    by_reference = [
        backend.inverse_dynamics(
            samples.q, samples.v, samples.a, external_forces=forces, force_reference=reference
        )
        for reference in ("local_world_aligned", "local", "world")
    ]
    return np.concatenate(by_reference, axis=-1)


def _with_joint_dynamics(backend: Any, samples: Samples) -> Array:
    return np.asarray(backend.inverse_dynamics(samples.q, samples.v, samples.a, joint_dynamics=True))


def _joint_dynamics_scale(sizes: Magnitudes) -> Floats:
    model = sizes.samples.model
    total = np.zeros(len(sizes.samples))
    fastest = np.max(np.abs(sizes.samples.v) + np.abs(sizes.samples.a), axis=-1, initial=0.0)
    for joint in model.joints:
        gain = 1.0 if joint.mimic is None else max(abs(joint.mimic.multiplier), joint.mimic.multiplier**2)
        own = joint.dynamics
        total = total + gain * ((own.damping + own.armature) * fastest + own.friction)
    return largest(sizes.torque) + np.abs(total)[:, None]


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
            _with_forces,
            lambda s: largest(s.torque) + largest(s.wrench_torque),
            _rounding,
        ),
        ComparedQuantity(
            "inverse_dynamics_joint_dynamics", _with_joint_dynamics, _joint_dynamics_scale, _rounding
        ),
    ),
}
"""Lines that follow a quantity of the table: the same method with other options or another tolerance."""
