"""Quantities that solve equations: the solution of each engine is verified by the other engine.

Two accelerations, or two configurations that reach one target, may differ while both are right. So each
engine checks that the other's solution satisfies the equation.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.comparison import (
    Comparison,
    ErrorVerdict,
    compare_refusals,
    concluded,
    failed_comparison,
    judge,
    not_finite_note,
    state,
)
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.results import BackendResults, Refusal
from dynx.agreement.sampling import Samples
from dynx.model import Model
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import pose_error

TARGETS = 2
"""Number of targets of inverse kinematics, small because each takes hundreds of evaluations."""


def regular_samples(magnitudes: Magnitudes) -> list[int]:
    """Return the indices of samples whose mass matrix is numerically positive definite, or [0] without any.

    Where it is singular (a stretched wrist whose links are point masses) no unique acceleration exists, and
    rounding decides whether an engine detects that.
    """
    least = tolerances.singular(magnitudes.samples.model.nv)
    return np.flatnonzero(magnitudes.lowest_eigenvalue > least).tolist() or [0]


def compare_forward_dynamics(
    solver: BackendResults, verifier: BackendResults, magnitudes: Magnitudes, *, both: bool = True
) -> Comparison:
    """Compare backward errors: the acceleration of the solver, put into the inverse dynamics of the
    verifier, must require the given torque. With `both`, each verifies the other."""
    name, samples = "forward_dynamics", solver.samples
    tolerance = tolerances.solving()
    chosen = regular_samples(magnitudes)

    def solve(backend: Any, samples: Samples) -> Array:
        return np.asarray(backend.forward_dynamics(samples.q[chosen], samples.v[chosen], samples.tau[chosen]))

    pairs = [(solver, verifier), (verifier, solver)] if both else [(solver, verifier)]
    solutions = [each.of(name, solve) for each, _ in pairs]
    refused = compare_refusals(name, solver, verifier, solutions, tolerance)
    if refused is not None:
        return refused
    worst = ErrorVerdict(0.0, 0.0, None)
    left_out = len(samples) - len(chosen)
    notes = []
    if left_out:
        notes.append(f"without {left_out} of {len(samples)} samples, where the mass matrix is singular")
    for (one, other), a in zip(pairs, solutions, strict=True):
        assert not isinstance(a, Refusal)
        tau = other.attempt(partial(_required_torque, a=a, chosen=chosen))
        if isinstance(tau, Refusal):
            return failed_comparison(name, solver, verifier, tolerance, f"{other.name} refuses: {tau}")
        not_finite = not_finite_note((one, a), (other, tau))
        notes += [not_finite] if not_finite else []
        verdict = _backward_error(a, tau, chosen, magnitudes)
        if verdict.relative > worst.relative or worst.position is None:
            worst = verdict
    where = None if worst.position is None else state(samples, chosen[worst.position[0]])
    return concluded(name, solver, verifier, worst, tolerance, where, "; ".join(notes) or None)


def _required_torque(backend: Any, samples: Samples, *, a: Array, chosen: list[int]) -> Array:
    """Return the torque that the accelerations require; NaN where they are not finite."""
    if a.shape != (len(chosen), samples.model.nv) or not np.isfinite(a).all():
        return np.full((len(chosen), samples.model.nv), np.nan)
    return np.asarray(backend.inverse_dynamics(samples.q[chosen], samples.v[chosen], a))


def _backward_error(a: Array, tau: Array, chosen: list[int], magnitudes: Magnitudes) -> ErrorVerdict:
    samples = magnitudes.samples
    if tau.shape != a.shape or not np.isfinite(tau.astype(np.float64)).all():
        return ErrorVerdict(np.inf, np.inf, (0,))
    everywhere = np.zeros_like(samples.tau)
    everywhere[chosen] = a
    return judge(tau - samples.tau[chosen], magnitudes.solved_torque(everywhere)[chosen, None])


def compare_inverse_kinematics(
    first: BackendResults, second: BackendResults, magnitudes: Magnitudes
) -> Comparison:
    """Compare the poses of the second engine at the first one's solutions with the targets, and vice versa.

    Targets are poses of the deepest frame within limits, and searches start nearby. A search that does not
    reach its target is not a disagreement; the note counts such searches.
    """
    name, samples, frame = "inverse_kinematics", first.samples, deepest_frame(first.samples.model)
    tolerance = tolerances.target_distance(magnitudes.depth, float(np.max(magnitudes.length)))
    q_target, q_start = _targets(samples)

    def solve(backend: Any, samples: Samples) -> Array:
        target = backend.forward_kinematics(q_target, frame)
        result = backend.inverse_kinematics(target, frame, q_start)
        q = np.where(result.success[:, None], result.q, np.nan)
        return np.concatenate([q, target.reshape(len(q), 16)], axis=-1)

    solutions = [each.of(name, solve) for each in (first, second)]
    refused = compare_refusals(name, first, second, solutions, tolerance)
    if refused is not None:
        return refused
    errors = []
    for solution, verifier in zip(solutions, (second, first), strict=True):
        assert not isinstance(solution, Refusal)
        q, target = solution[:, : samples.model.nq], solution[:, samples.model.nq :].reshape(-1, 4, 4)
        found = np.isfinite(q).all(axis=-1)
        reached = verifier.attempt(partial(_poses, q=q[found], frame=frame))
        if isinstance(reached, Refusal):
            return failed_comparison(name, first, second, tolerance, f"{verifier.name} refuses: {reached}")
        errors.append(_distance(target[found], reached))
    searches = 2 * len(q_target)
    missed = searches - sum(len(error) for error in errors)
    verdict = judge(np.concatenate(errors), np.ones(1))
    note = f"{missed} of {searches} searches reported no solution" if missed else None
    return concluded(name, first, second, verdict, tolerance, note=note)


def _poses(backend: Any, samples: Samples, *, q: Array, frame: str) -> Array:
    return np.asarray(backend.forward_kinematics(q, frame))


def deepest_frame(model: Model) -> str:
    """Return the first of the frames with the most moving joints between them and the root."""
    mechanism = model.mechanism
    depths = [len(ancestry(mechanism, frame.body)) for frame in mechanism.frames]
    return model.frame_names[int(np.argmax(depths))]


def _targets(samples: Samples) -> tuple[Floats, Floats]:
    """Return target configurations within limits, and starting points some tenths of a radian away."""
    model = samples.model
    q = samples.q[:TARGETS]
    q_target = model.clip(q)
    return q_target, model.clip(model.integrate(q_target, 0.1 * samples.v[: len(q)]))


def _distance(T_world_target: Floats, T_world_frame: Floats) -> Floats:
    position, rotation = pose_error(T_world_target, T_world_frame)
    return np.stack([np.linalg.norm(position, axis=-1), np.linalg.norm(rotation, axis=-1)], axis=-1)
