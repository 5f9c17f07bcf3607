"""Identities of mechanics that the results of one engine must satisfy by themselves.

Each identity is an equation between quantities of a single backend. When two backends differ, the
one that breaks an identity is the one that is wrong. Derivatives in time are numerical
(`dynx.agreement.differentiation`), so no engine's own derivative is taken on trust.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import WorstSample, judge, state
from dynx.agreement.differentiation import time_derivative
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.natural_magnitudes import coriolis_scale, largest, mass_scale
from dynx.agreement.results import BackendResults
from dynx.agreement.sampling import Samples
from dynx.agreement.solutions import compare_forward_dynamics
from dynx.agreement.symmetry import rotate_world
from dynx.backends import Backend
from dynx.backends.hooks import apply_matrix
from dynx.errors import shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, rotate, skew


@dataclass(frozen=True)
class IdentityCheck:
    """How well one backend keeps one identity; errors are relative to natural magnitudes."""

    identity: str
    backend: str
    max_error: float
    tolerance: float
    agree: bool
    worst_sample: WorstSample | None = None
    note: str | None = None


@dataclass(frozen=True)
class Identity:
    """An identity; `residual` gives (what should be zero (n, ...), its natural size).

    `applies` returns why the identity does not apply to a model, or None.
    """

    name: str
    residual: Callable[[Backend, Samples, Magnitudes], tuple[Floats, Floats]]
    tolerance: Callable[[Magnitudes], float]
    applies: Callable[[Model], str | None] = lambda model: None


def check_identities(name: str, backend: Backend, sizes: Magnitudes) -> list[IdentityCheck]:
    """All identities of one backend at the samples of `sizes`, which must be `Samples.differentiable`."""
    samples, checks = sizes.samples, []
    for identity in IDENTITIES:
        tolerance = identity.tolerance(sizes)
        reason = identity.applies(samples.model)
        if reason is not None:
            checks.append(IdentityCheck(identity.name, name, 0.0, tolerance, True, note=reason))
            continue
        try:
            residual, scale = identity.residual(backend, samples, sizes)
        except Exception as error:
            # A backend from elsewhere may break any promise (a wrong shape, NaN where eigenvalues are
            # asked for); that is a failed check, with what was raised, and not the end of the others.
            note = f"{type(error).__name__}: {error}"
            checks.append(IdentityCheck(identity.name, name, np.inf, tolerance, False, note=note))
            continue
        verdict = judge(residual, scale)
        worst = None if verdict.position is None else state(samples, verdict.position[0])
        fine = verdict.relative <= tolerance
        checks.append(IdentityCheck(identity.name, name, verdict.relative, tolerance, fine, worst))
    return [*checks, _inverse_of_inverse(name, backend, sizes)]


def _inverse_of_inverse(name: str, backend: Backend, sizes: Magnitudes) -> IdentityCheck:
    """Inverse dynamics of the acceleration that forward dynamics finds is the torque put in."""
    results = BackendResults(name, backend, sizes.samples)
    found = compare_forward_dynamics(results, results, sizes, both=False)
    return IdentityCheck(
        "inverse dynamics of forward dynamics",
        name,
        found.max_rel_error,
        found.tolerance,
        found.agree,
        found.worst_sample,
        found.note,
    )


# -- algebra ------------------------------------------------------------------------------------------


def _symmetry(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    M = backend.mass_matrix(samples.q)
    return M - np.swapaxes(M, -1, -2), mass_scale(sizes)


def _positivity(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    size = np.where(sizes.root_inertia > 0.0, sizes.root_inertia, 1.0)
    scaled = backend.mass_matrix(samples.q) / (size[:, :, None] * size[:, None, :])
    lowest = np.min(np.linalg.eigvalsh(scaled), axis=-1, initial=0.0)
    return np.minimum(lowest, 0.0), np.ones(1)


def _sum_of_torques(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    moved = apply_matrix(backend.mass_matrix(samples.q), samples.a)
    total = moved + backend.bias_torque(samples.q, samples.v)
    tau = backend.inverse_dynamics(samples.q, samples.v, samples.a)
    lever = np.einsum("nij,nj->ni", mass_scale(sizes), np.abs(samples.a))
    return total - tau, largest(sizes.torque + lever)


def _sum_of_bias(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    products = apply_matrix(backend.coriolis_matrix(samples.q, samples.v), samples.v)
    total = products + backend.gravity_torque(samples.q)
    size = np.einsum("nij,nj->ni", coriolis_scale(sizes), np.abs(samples.v))
    return total - backend.bias_torque(samples.q, samples.v), largest(sizes.bias_torque + size)


def _momentum_of_base(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    """The first six rows of M v are the momentum of all, about and in the base frame."""
    T = backend.forward_kinematics(samples.q, samples.model.root)
    R = T[:, :3, :3]
    momentum = apply_matrix(backend.mass_matrix(samples.q), samples.v)
    linear, about_base = rotate(R, momentum[:, :3]), rotate(R, momentum[:, 3:6])
    center = backend.center_of_mass(samples.q) - T[:, :3, 3]
    expected = np.concatenate([linear, about_base - cross(center, linear)], axis=-1)
    flow = sizes.mass * sizes.speed
    spin = 3.0 * flow * sizes.length + sizes.turning_inertia * sizes.turning_speed
    size = np.stack([flow] * 3 + [spin] * 3, axis=-1)
    return backend.centroidal_momentum(samples.q, samples.v) - expected, size


def _momentum_of_center(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    velocity = apply_matrix(backend.center_of_mass_jacobian(samples.q), samples.v)
    linear = backend.centroidal_momentum(samples.q, samples.v)[:, :3]
    mass = samples.model.total_mass
    return linear - mass * velocity, (max(mass, sizes.mass) * sizes.speed)[:, None]


# -- derivatives along the motion ---------------------------------------------------------------------


def _frame_motion(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    """d/dt of a pose is [[skew(omega) R, velocity], [0, 0]] with (velocity, omega) = J v."""
    frames, n = samples.model.frame_names, len(samples)
    rate = time_derivative(lambda t: backend.forward_kinematics(_at(samples, t)), sizes.frequency)
    poses = backend.forward_kinematics(samples.q)
    residual = np.zeros((n, len(frames), 3, 4))
    for number, frame in enumerate(frames):
        k = number % n
        twist = backend.jacobian(samples.q[k], frame) @ samples.v[k]
        turning = skew(twist[3:]) @ poses[k, number, :3, :3]
        expected = np.concatenate([turning, twist[:3, None]], axis=-1)
        residual[k, number] = rate[k, number, :3] - expected
    size = np.ones((n, 1, 3, 4))
    size[:, 0, :, 3] = sizes.length[:, None]
    return residual, size * sizes.frequency[:, None, None, None]


def _center_motion(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    rate = time_derivative(lambda t: backend.center_of_mass(_at(samples, t)), sizes.frequency)
    velocity = apply_matrix(backend.center_of_mass_jacobian(samples.q), samples.v)
    return rate - velocity, (sizes.length * sizes.frequency)[:, None]


def _gravity_potential(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    rate = time_derivative(lambda t: backend.potential_energy(_at(samples, t)), sizes.frequency)
    power = np.sum(backend.gravity_torque(samples.q) * samples.v, axis=-1)
    return rate - power, sizes.potential_energy * sizes.frequency


def _power(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    """d/dt (kinetic + potential energy) is the power v' tau of the torques."""
    change = np.sum(sizes.linear_column * np.abs(samples.a), axis=-1)
    grows = change / np.where(sizes.speed > 0.0, sizes.speed, 1.0)
    frequency = 2.0 * (sizes.frequency + grows)

    def energy(t: Floats) -> Floats:
        q, v = _at(samples, t), samples.v + t[..., None] * samples.a
        return backend.kinetic_energy(q, v) + backend.potential_energy(q)

    rate = time_derivative(energy, frequency)
    tau = backend.inverse_dynamics(samples.q, samples.v, samples.a)
    kinetic = 0.5 * (sizes.mass * sizes.speed**2 + sizes.turning_inertia * sizes.turning_speed**2)
    size = (kinetic + sizes.potential_energy) * frequency
    return rate - np.sum(tau * samples.v, axis=-1), size


def _passivity(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    """dM/dt - 2 C is skew-symmetric: dM/dt = C + C'."""
    frequency = 2.0 * sizes.frequency
    rate = time_derivative(lambda t: backend.mass_matrix(_at(samples, t)), frequency)
    C = backend.coriolis_matrix(samples.q, samples.v)
    return rate - C - np.swapaxes(C, -1, -2), sizes.inertia_bound * frequency[:, None, None]


# -- symmetry -----------------------------------------------------------------------------------------


def _turned_world(backend: Backend, samples: Samples, sizes: Magnitudes) -> tuple[Floats, Floats]:
    """Turning robot, world and gravity together changes no torque and no inertia."""
    model, configurations = rotate_world(samples.model)
    q = configurations(samples.q)
    with type(backend)(model) as other:
        tau = other.inverse_dynamics(q, samples.v, samples.a)
        M = other.mass_matrix(q)
    torque = tau - backend.inverse_dynamics(samples.q, samples.v, samples.a)
    inertia = M - backend.mass_matrix(samples.q)
    n = len(samples)
    torque, inertia = torque / _positive(largest(sizes.torque)), inertia / _positive(mass_scale(sizes))
    return np.concatenate([torque, inertia.reshape(n, -1)], axis=-1), np.ones(1)


def _positive(size: Floats) -> Floats:
    return np.where(size > 0.0, size, np.finfo(np.float64).tiny)


def _at(samples: Samples, t: Floats) -> Floats:
    """Configurations (m, n, nq) at times t (m, n) along the motion at the sample's velocity."""
    return samples.model.integrate(samples.q, samples.v * t[..., None])


def _physical(model: Model) -> str | None:
    for link in model.links:
        if link.inertial is None:
            continue
        least = np.linalg.eigvalsh(link.inertial.tensor)[0]
        if link.inertial.mass < 0.0 or least < 0.0:
            return f"not checked: no body has the inertia of link {shown(link.name)}; it is used as it stands"
    return None


def _only_floating(model: Model) -> str | None:
    return None if model.floating else "applies to a floating base only"


def _derivative(sizes: Magnitudes) -> float:
    return tolerances.derivative(sizes.depth)


def _rounding(sizes: Magnitudes) -> float:
    return tolerances.rounding(sizes.depth)


def _eigenvalue(sizes: Magnitudes) -> float:
    return tolerances.eigenvalue(sizes.depth, sizes.samples.model.nv)


IDENTITIES: tuple[Identity, ...] = (
    Identity("mass matrix is symmetric", _symmetry, _rounding),
    Identity("mass matrix is positive", _positivity, _eigenvalue, _physical),
    Identity("M a + bias = inverse dynamics", _sum_of_torques, _rounding),
    Identity("C v + gravity = bias", _sum_of_bias, _rounding),
    Identity("linear momentum = mass * velocity of its centre", _momentum_of_center, _rounding),
    Identity("momentum = base rows of M v", _momentum_of_base, _rounding, _only_floating),
    Identity("J v = d/dt forward kinematics", _frame_motion, _derivative),
    Identity("J v = d/dt centre of mass", _center_motion, _derivative),
    Identity("gravity torque = gradient of potential energy", _gravity_potential, _derivative),
    Identity("power of the torques = d/dt energy", _power, _derivative),
    Identity("dM/dt - 2 C is skew-symmetric", _passivity, _derivative),
    Identity("turning the world changes nothing", _turned_world, _rounding),
)
