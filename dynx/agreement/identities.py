"""Identities of mechanics that the results of one engine must satisfy.

Each identity is an equation between quantities of a single backend. When two backends differ, the
one that breaks an identity is wrong. Time derivatives are numerical
(`dynx.agreement.identities`) and do not depend on derivatives of the engine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import BackendResults, WorstSample, compare_forward_dynamics, judge, state
from dynx.agreement.magnitudes import Magnitudes, coriolis_scale, largest, mass_scale, wrench_scale
from dynx.agreement.sampling import Samples
from dynx.agreement.tolerances import STEP
from dynx.backends import Backend
from dynx.backends.hooks import apply_matrix
from dynx.errors import shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_exp, quat_product, rotate, rotation_from_quat, skew

# Numerical derivatives along a motion, accurate to a dozen digits.
#
# A pose, and anything made of poses, is band-limited along a motion at constant velocity: a sum of
# sines and cosines whose frequency is at most W. Bernstein's inequality then bounds every derivative
# by the largest value times a power of W, so the central difference of order 8 with step ``STEP / W`` has a
# known error (`tolerances.derivative`).


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


# A robot in a world that is rotated together with gravity.


ROTATION_VECTOR = (0.7, -1.1, 0.4)
"""Rotation of the world [rad], about an oblique axis, so that exchanged axes show."""


def rotate_world(model: Model) -> tuple[Model, Callable[[Floats], Floats]]:
    """Return a model in the rotated world, and the map from configurations (..., nq) of `model` to its own.

    A floating base is rotated by its configuration, a fixed one by its pose in the world.
    """
    quat = quat_exp(np.array(ROTATION_VECTOR))
    R = rotation_from_quat(quat)
    x, y, z = rotate(R, np.array(model.gravity)).tolist()
    if model.floating:

        def rotate_base(q: Floats) -> Floats:
            attitude = quat_product(np.broadcast_to(quat, (*q.shape[:-1], 4)), q[..., 3:7])
            return np.concatenate([rotate(R, q[..., :3]), attitude, q[..., 7:]], axis=-1)

        return model.with_gravity((x, y, z)), rotate_base
    T = homogeneous(R, np.zeros(3)) @ model.base_pose.matrix
    return model.with_base_pose(T).with_gravity((x, y, z)), lambda q: q


@dataclass(frozen=True)
class IdentityCheck:
    """The error of one identity for one backend, relative to natural magnitudes."""

    identity: str
    backend: str
    max_error: float
    tolerance: float
    agree: bool
    worst_sample: WorstSample | None = None
    note: str | None = None


@dataclass(frozen=True)
class Identity:
    """An identity; `residual` returns a residual (n, ...), zero if the identity holds, and its magnitude.

    `exclusion` returns the reason why the identity does not apply to a model, or None if it does.
    """

    name: str
    residual: Callable[[Backend, Samples, Magnitudes], tuple[Floats, Floats]]
    tolerance: Callable[[Magnitudes], float]
    exclusion: Callable[[Model], str | None] = lambda model: None


def check_identities(name: str, backend: Backend, magnitudes: Magnitudes) -> list[IdentityCheck]:
    """Check all identities of one backend at the samples of `magnitudes`, all of which have to be
    `Samples.differentiable`."""
    samples, checks = magnitudes.samples, []
    for identity in IDENTITIES:
        tolerance = identity.tolerance(magnitudes)
        reason = identity.exclusion(samples.model)
        if reason is not None:
            checks.append(IdentityCheck(identity.name, name, 0.0, tolerance, True, note=reason))
            continue
        try:
            residual, scale = identity.residual(backend, samples, magnitudes)
        except Exception as error:
            # A backend of another package may raise anything, and its results may have a wrong shape or be
            # NaN, for which NumPy raises. That is a failed check; the others go on.
            note = f"{type(error).__name__}: {error}"
            checks.append(IdentityCheck(identity.name, name, np.inf, tolerance, False, note=note))
            continue
        verdict = judge(residual, scale)
        worst = None if verdict.position is None else state(samples, verdict.position[0])
        agree = verdict.relative <= tolerance
        checks.append(IdentityCheck(identity.name, name, verdict.relative, tolerance, agree, worst))
    return [*checks, _inverse_of_inverse(name, backend, magnitudes)]


def _inverse_of_inverse(name: str, backend: Backend, magnitudes: Magnitudes) -> IdentityCheck:
    """Check that inverse dynamics of the result of forward dynamics is the given torque."""
    results = BackendResults(name, backend, magnitudes.samples)
    found = compare_forward_dynamics(results, results, magnitudes, both=False)
    identity, error = "inverse dynamics of forward dynamics", found.max_rel_error
    return IdentityCheck(identity, name, error, found.tolerance, found.agree, found.worst_sample, found.note)


# -- algebra ------------------------------------------------------------------------------------------


def _symmetry(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    M = backend.mass_matrix(samples.q)
    return M - np.swapaxes(M, -1, -2), mass_scale(magnitudes)


def _positivity(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    size = np.where(magnitudes.sqrt_diagonal > 0.0, magnitudes.sqrt_diagonal, 1.0)
    scaled = backend.mass_matrix(samples.q) / (size[:, :, None] * size[:, None, :])
    lowest = np.min(np.linalg.eigvalsh(scaled), axis=-1, initial=0.0)
    return np.minimum(lowest, 0.0), np.ones(1)


def _sum_of_torques(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    moved = apply_matrix(backend.mass_matrix(samples.q), samples.a)
    total = moved + backend.bias_torque(samples.q, samples.v)
    tau = backend.inverse_dynamics(samples.q, samples.v, samples.a)
    inertial = np.einsum("nij,nj->ni", mass_scale(magnitudes), np.abs(samples.a))
    return total - tau, largest(magnitudes.torque + inertial)


def _wrenches_along_axes(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Compare the torques with the components of the joint wrenches along the axes, and with the wrench on a
    floating base."""
    model, state = samples.model, (samples.q, samples.v, samples.a)
    wrenches, size = backend.joint_wrenches(*state), wrench_scale(magnitudes)
    along, sizes = list[Floats](), list[Floats]()
    if model.floating:
        along, sizes = list(backend.base_wrench(*state).T), list(size.T)
    for number, joint in enumerate(model.joints):
        if joint.moves:
            rows = slice(0, 3) if joint.type == "prismatic" else slice(3, 6)
            for axis in np.eye(3) if joint.type == "ball" else [np.array(joint.axis)]:
                along.append(wrenches[:, number, rows] @ axis)
                sizes.append(size[:, rows.start])
    if not along:
        return np.zeros((len(samples), 0)), np.ones(1)
    coupling = model.mechanism.coupling
    S = np.eye(len(along)) if coupling is None else coupling.matrix()
    tau = backend.inverse_dynamics(*state)
    residual = np.stack(along, axis=-1) @ S - tau
    return residual, largest(magnitudes.torque) + np.stack(sizes, axis=-1) @ np.abs(S)


def _sum_of_bias(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    products = apply_matrix(backend.coriolis_matrix(samples.q, samples.v), samples.v)
    total = products + backend.gravity_torque(samples.q)
    size = np.einsum("nij,nj->ni", coriolis_scale(magnitudes), np.abs(samples.v))
    return total - backend.bias_torque(samples.q, samples.v), largest(magnitudes.bias_torque + size)


def _momentum_of_base(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Compare the momentum with the first six rows of M v, which are the momentum in the base frame."""
    T = backend.forward_kinematics(samples.q, samples.model.root)
    R = T[:, :3, :3]
    momentum = apply_matrix(backend.mass_matrix(samples.q), samples.v)
    linear, about_base = rotate(R, momentum[:, :3]), rotate(R, momentum[:, 3:6])
    offset = backend.center_of_mass(samples.q) - T[:, :3, 3]
    expected = np.concatenate([linear, about_base - cross(offset, linear)], axis=-1)
    linear_size = magnitudes.mass * magnitudes.speed
    angular_size = (
        3.0 * linear_size * magnitudes.length + magnitudes.rotational_inertia * magnitudes.angular_speed
    )
    size = np.stack([linear_size] * 3 + [angular_size] * 3, axis=-1)
    return backend.centroidal_momentum(samples.q, samples.v) - expected, size


def _momentum_of_center(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    velocity = apply_matrix(backend.center_of_mass_jacobian(samples.q), samples.v)
    linear = backend.centroidal_momentum(samples.q, samples.v)[:, :3]
    mass = samples.model.total_mass
    return linear - mass * velocity, (max(mass, magnitudes.mass) * magnitudes.speed)[:, None]


# -- derivatives along the motion ---------------------------------------------------------------------


def _frame_motion(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Compare d/dt of a pose with [[skew(omega) R, velocity], [0, 0]], where (velocity, omega) = J v."""
    frames, n = samples.model.frame_names, len(samples)
    rate = time_derivative(lambda t: backend.forward_kinematics(_at(samples, t)), magnitudes.frequency)
    poses = backend.forward_kinematics(samples.q)
    residual = np.zeros((n, len(frames), 3, 4))
    for number, frame in enumerate(frames):
        k = number % n
        twist = backend.jacobian(samples.q[k], frame) @ samples.v[k]
        rotation_rate = skew(twist[3:]) @ poses[k, number, :3, :3]
        expected = np.concatenate([rotation_rate, twist[:3, None]], axis=-1)
        residual[k, number] = rate[k, number, :3] - expected
    size = np.ones((n, 1, 3, 4))
    size[:, 0, :, 3] = magnitudes.length[:, None]
    return residual, size * magnitudes.frequency[:, None, None, None]


def _center_motion(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    rate = time_derivative(lambda t: backend.center_of_mass(_at(samples, t)), magnitudes.frequency)
    velocity = apply_matrix(backend.center_of_mass_jacobian(samples.q), samples.v)
    return rate - velocity, (magnitudes.length * magnitudes.frequency)[:, None]


def _gravity_potential(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    rate = time_derivative(lambda t: backend.potential_energy(_at(samples, t)), magnitudes.frequency)
    power = np.sum(backend.gravity_torque(samples.q) * samples.v, axis=-1)
    return rate - power, magnitudes.potential_energy * magnitudes.frequency


def _power(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Compare d/dt (kinetic + potential energy) with the power v' tau of the torques."""
    acceleration = np.sum(magnitudes.linear_column * np.abs(samples.a), axis=-1)
    relative = acceleration / np.where(magnitudes.speed > 0.0, magnitudes.speed, 1.0)
    frequency = 2.0 * (magnitudes.frequency + relative)

    def energy(t: Floats) -> Floats:
        q, v = _at(samples, t), samples.v + t[..., None] * samples.a
        return backend.kinetic_energy(q, v) + backend.potential_energy(q)

    rate = time_derivative(energy, frequency)
    tau = backend.inverse_dynamics(samples.q, samples.v, samples.a)
    kinetic = 0.5 * (
        magnitudes.mass * magnitudes.speed**2 + magnitudes.rotational_inertia * magnitudes.angular_speed**2
    )
    size = (kinetic + magnitudes.potential_energy) * frequency
    return rate - np.sum(tau * samples.v, axis=-1), size


def _passivity(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Check that dM/dt - 2 C is skew-symmetric, that is dM/dt = C + C'."""
    frequency = 2.0 * magnitudes.frequency
    rate = time_derivative(lambda t: backend.mass_matrix(_at(samples, t)), frequency)
    C = backend.coriolis_matrix(samples.q, samples.v)
    return rate - C - np.swapaxes(C, -1, -2), magnitudes.inertia_bound * frequency[:, None, None]


# -- symmetry -----------------------------------------------------------------------------------------


def _rotated_world(backend: Backend, samples: Samples, magnitudes: Magnitudes) -> tuple[Floats, Floats]:
    """Check that no torque and no inertia changes when robot, world and gravity are rotated together."""
    model, configurations = rotate_world(samples.model)
    q = configurations(samples.q)
    with type(backend)(model) as other:
        tau = other.inverse_dynamics(q, samples.v, samples.a)
        M = other.mass_matrix(q)
    torque = tau - backend.inverse_dynamics(samples.q, samples.v, samples.a)
    torque = torque / _positive(largest(magnitudes.torque))
    inertia = (M - backend.mass_matrix(samples.q)) / _positive(mass_scale(magnitudes))
    return np.concatenate([torque, inertia.reshape(len(samples), -1)], axis=-1), np.ones(1)


def _positive(size: Floats) -> Floats:
    return np.where(size > 0.0, size, np.finfo(np.float64).tiny)


def _at(samples: Samples, t: Floats) -> Floats:
    """Return the configurations (m, n, nq) at times t (m, n) along the motion at the sample's velocity."""
    return samples.model.integrate(samples.q, samples.v * t[..., None])


def _unphysical_link(model: Model) -> str | None:
    for link in model.links:
        if link.inertial is None:
            continue
        least = np.linalg.eigvalsh(link.inertial.tensor)[0]
        if link.inertial.mass < 0.0 or least < 0.0:
            return f"not checked: no body has the inertia of link {shown(link.name)}; it is used as it stands"
    return None


def _only_floating(model: Model) -> str | None:
    return None if model.floating else "applies to a floating base only"


def _derivative(magnitudes: Magnitudes) -> float:
    return tolerances.derivative(magnitudes.depth)


def _rounding(magnitudes: Magnitudes) -> float:
    return tolerances.rounding(magnitudes.depth)


def _eigenvalue(magnitudes: Magnitudes) -> float:
    return tolerances.eigenvalue(magnitudes.depth, magnitudes.samples.model.nv)


IDENTITIES: tuple[Identity, ...] = (
    Identity("mass matrix is symmetric", _symmetry, _rounding),
    Identity("mass matrix is positive", _positivity, _eigenvalue, _unphysical_link),
    Identity("M a + bias = inverse dynamics", _sum_of_torques, _rounding),
    Identity("joint wrenches along the axes = inverse dynamics", _wrenches_along_axes, _rounding),
    Identity("C v + gravity = bias", _sum_of_bias, _rounding),
    Identity("linear momentum = mass * velocity of its centre", _momentum_of_center, _rounding),
    Identity("momentum = base rows of M v", _momentum_of_base, _rounding, _only_floating),
    Identity("J v = d/dt forward kinematics", _frame_motion, _derivative),
    Identity("J v = d/dt centre of mass", _center_motion, _derivative),
    Identity("gravity torque = gradient of potential energy", _gravity_potential, _derivative),
    Identity("power of the torques = d/dt energy", _power, _derivative),
    Identity("dM/dt - 2 C is skew-symmetric", _passivity, _derivative),
    Identity("turning the world changes nothing", _rotated_world, _rounding),
)
