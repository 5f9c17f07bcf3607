"""What is compared: each quantity, how it is asked, how large it naturally is, what error it may have.

A quantity is asked of anything with the methods of `Backend`, the 50-digit referee included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.magnitudes import EPS, Magnitudes
from dynx.agreement.sampling import FrameQuestion, Samples
from dynx.spatial.scalar import Array, Floats

Layout = Literal["samples", "frames", "every_frame", "derivatives"]
"""What the leading axes of an answer count: samples; samples, then frames; or a list of questions
about frames, then the samples of each."""

POINT = (0.3, -0.2, 0.1)
"""The point [m], in the axes of the frame, at which a Jacobian is asked for beside the frames' origins."""


@dataclass(frozen=True)
class Quantity:
    """One line of the report.

    `evaluate` gives the answers, `scale` broadcasts against them, and `tolerance` bounds their
    difference over scale. `native` is the quantity of the backend whose derivation is compared with
    it, `refereed` says whether the referee answers it, and `derived_scale` is what derivation loses:
    columns of a derived mass matrix are differences of torques that hold gravity as well.
    """

    name: str
    evaluate: Callable[[Any, Samples], Array]
    scale: Callable[[Magnitudes], Floats]
    tolerance: Callable[[Magnitudes], float]
    layout: Layout = "samples"
    native: str | None = None
    refereed: bool = False
    derived_scale: Callable[[Magnitudes], Floats] | None = None


def questions_of(layout: Layout, samples: Samples) -> tuple[FrameQuestion, ...]:
    """The questions behind the first axis of a layout that has them."""
    return samples.every_frame if layout == "every_frame" else samples.derivatives


def _rounding(sizes: Magnitudes) -> float:
    return tolerances.rounding(sizes.depth)


def _component(sizes: Magnitudes) -> float:
    return tolerances.component(sizes.depth)


def _component_scale(sizes: Magnitudes) -> Floats:
    """(n, nv): no torque can be more exact than one rounding of the largest (a joint that carries a
    point mass on its own axis takes none, but what is summed to none is as large as the others)."""
    return np.maximum(sizes.torque, largest(sizes.torque) * (EPS / _component(sizes)))


def largest(scale: Floats) -> Floats:
    """(n, 1): the largest entry of each sample's scale (n, nv), for errors in the max norm."""
    return np.asarray(np.max(scale, axis=-1, initial=0.0, keepdims=True))


# -- asked about every frame ------------------------------------------------------------------------


def _asked(name: str, arguments: tuple[str, ...], layout: Layout) -> Callable[[Any, Samples], Array]:
    """Ask `name` of each question in turn and stack the answers (questions, samples, ...)."""

    def evaluate(backend: Any, samples: Samples) -> Array:
        answers = []
        for question in questions_of(layout, samples):
            state = [getattr(samples, argument)[question.samples] for argument in arguments]
            ask = getattr(backend, name)
            answers.append(ask(*state, question.frame, reference=question.reference))
        return np.asarray(np.stack(answers))

    return evaluate


def _per_question(scale: Floats, questions: tuple[FrameQuestion, ...]) -> Floats:
    return np.asarray(np.stack([scale[question.samples] for question in questions]))


def _twist(
    layout: Layout, linear: Callable[[Magnitudes], Floats], angular: Callable[[Magnitudes], Floats]
) -> Callable[[Magnitudes], Floats]:
    """Scale (questions, samples, 6 [, nv]) from sizes (n [, nv]) of linear and angular rows."""

    def scale(sizes: Magnitudes) -> Floats:
        rows = np.stack([linear(sizes)] * 3 + [angular(sizes)] * 3, axis=1)
        return _per_question(rows, questions_of(layout, sizes.samples))

    return scale


def _frame_quantity(
    name: str,
    arguments: tuple[str, ...],
    layout: Layout,
    linear: Callable[[Magnitudes], Floats],
    angular: Callable[[Magnitudes], Floats],
    refereed: bool = True,
) -> Quantity:
    return Quantity(
        name,
        _asked(name, arguments, layout),
        _twist(layout, linear, angular),
        _rounding,
        layout=layout,
        native=name,
        refereed=refereed,
    )


def _linear_acceleration(sizes: Magnitudes) -> Floats:
    a, v = np.abs(sizes.samples.a), np.abs(sizes.samples.v)
    return np.asarray(np.sum(sizes.linear_column * a + sizes.linear_column_rate * v, axis=-1))


def _angular_acceleration(sizes: Magnitudes) -> Floats:
    a, v = np.abs(sizes.samples.a), np.abs(sizes.samples.v)
    return np.asarray(np.sum(sizes.angular_column * a + sizes.angular_column_rate * v, axis=-1))


def _turning(sizes: Magnitudes) -> Floats:
    return np.asarray(np.sum(sizes.angular_column * np.abs(sizes.samples.v), axis=-1))


def pose_scale(sizes: Magnitudes) -> Floats:
    """(n, 1, 4, 4): 1 for rotations, the length of the robot for positions."""
    scale = np.ones((len(sizes.samples), 1, 4, 4))
    scale[:, :, :3, 3] = sizes.length[:, None, None]
    return scale


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


# -- asked once a sample ----------------------------------------------------------------------------


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
    turned = sizes.turning_inertia * _turning(sizes)[:, None, None] * A[:, :, None] * A[:, None, :]
    return np.asarray(linear + turned)


def _regressor_scale(sizes: Magnitudes) -> Floats:
    """(n, nv, 10 n_links): what a unit of a parameter, anywhere on the robot, can take.

    A mass takes its acceleration, gravity included, at the end of a lever; a first moment takes the
    same about an axis, or the second derivative of turning at the end of a lever; a second moment takes
    the latter about an axis.
    """
    L, A = sizes.linear_column, sizes.angular_column
    moving = (_linear_acceleration(sizes) + sizes.gravity)[:, None]
    turning = (_angular_acceleration(sizes) + _turning(sizes) ** 2)[:, None]
    ten = [L * moving] + [L * turning + A * moving] * 3 + [A * turning] * 6
    return np.tile(np.stack(ten, axis=-1), len(sizes.samples.model.links))


def _derived_energy_scale(sizes: Magnitudes) -> Floats:
    v = np.abs(sizes.samples.v)
    return np.asarray(0.5 * np.einsum("ni,nij,nj->n", v, _derived_mass_scale(sizes), v))


def _momentum_scale(sizes: Magnitudes) -> Floats:
    linear = sizes.mass * sizes.speed
    angular = linear * sizes.length + sizes.turning_inertia * _turning(sizes)
    return np.stack([linear] * 3 + [angular] * 3, axis=-1)


def _all_poses(backend: Any, samples: Samples) -> Array:
    return np.asarray(backend.forward_kinematics(samples.q))


QUANTITIES: tuple[Quantity, ...] = (
    Quantity("forward_kinematics", _all_poses, pose_scale, _rounding, layout="frames", refereed=True),
    _frame_quantity("jacobian", ("q",), "every_frame", lambda s: s.linear_column, lambda s: s.angular_column),
    Quantity("jacobian_at_point", _at_point, _at_point_scale, _rounding),
    _frame_quantity(
        "jacobian_derivative",
        ("q", "v"),
        "derivatives",
        lambda s: s.linear_column_rate,
        lambda s: s.angular_column_rate,
        refereed=False,
    ),
    _frame_quantity("frame_velocity", ("q", "v"), "every_frame", lambda s: s.speed, _turning, refereed=False),
    _frame_quantity(
        "frame_acceleration",
        ("q", "v", "a"),
        "derivatives",
        _linear_acceleration,
        _angular_acceleration,
        refereed=False,
    ),
    Quantity(
        "inverse_dynamics",
        lambda b, s: b.inverse_dynamics(s.q, s.v, s.a),
        lambda s: largest(s.torque),
        _rounding,
        refereed=True,
    ),
    Quantity(
        "inverse_dynamics_component",
        lambda b, s: b.inverse_dynamics(s.q, s.v, s.a),
        _component_scale,
        _component,
        refereed=True,
    ),
    Quantity(
        "inverse_dynamics_external_forces",
        _with_forces,
        lambda s: largest(s.torque) + largest(s.wrench_torque),
        _rounding,
    ),
    Quantity("inverse_dynamics_joint_dynamics", _with_joint_dynamics, _joint_dynamics_scale, _rounding),
    Quantity(
        "mass_matrix",
        lambda b, s: b.mass_matrix(s.q),
        mass_scale,
        _rounding,
        native="mass_matrix",
        refereed=True,
        derived_scale=_derived_mass_scale,
    ),
    Quantity(
        "bias_torque",
        lambda b, s: b.bias_torque(s.q, s.v),
        lambda s: largest(s.bias_torque),
        _rounding,
        native="bias_torque",
        refereed=True,
    ),
    Quantity(
        "gravity_torque",
        lambda b, s: b.gravity_torque(s.q),
        lambda s: largest(s.gravity_torque),
        _rounding,
        native="gravity_torque",
        refereed=True,
    ),
    Quantity(
        "coriolis_matrix",
        lambda b, s: b.coriolis_matrix(s.q, s.v),
        coriolis_scale,
        _rounding,
        native="coriolis_matrix",
    ),
    Quantity(
        "inertial_regressor",
        lambda b, s: b.inertial_regressor(s.q, s.v, s.a),
        _regressor_scale,
        _rounding,
        native="inertial_regressor",
    ),
    Quantity(
        "center_of_mass",
        lambda b, s: b.center_of_mass(s.q),
        lambda s: s.length[:, None],
        _rounding,
        native="center_of_mass",
        refereed=True,
    ),
    Quantity(
        "center_of_mass_jacobian",
        lambda b, s: b.center_of_mass_jacobian(s.q),
        lambda s: s.linear_column[:, None, :],
        _rounding,
        native="center_of_mass_jacobian",
    ),
    Quantity(
        "centroidal_momentum",
        lambda b, s: b.centroidal_momentum(s.q, s.v),
        _momentum_scale,
        _rounding,
        native="centroidal_momentum",
    ),
    Quantity(
        "kinetic_energy",
        lambda b, s: b.kinetic_energy(s.q, s.v),
        lambda s: s.kinetic_energy,
        _rounding,
        native="kinetic_energy",
        refereed=True,
        derived_scale=_derived_energy_scale,
    ),
    Quantity(
        "potential_energy",
        lambda b, s: b.potential_energy(s.q),
        lambda s: s.potential_energy,
        _rounding,
        native="potential_energy",
        refereed=True,
    ),
)
"""All but forward dynamics and inverse kinematics, whose errors are not plain differences
(`dynx.agreement.solutions`)."""
