"""Comparison of two results of one quantity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from dynx.agreement import tolerances
from dynx.agreement.compared_quantities import ComparedQuantity
from dynx.agreement.magnitudes import Layout, Magnitudes, frame_samples
from dynx.agreement.sampling import Samples
from dynx.errors import DynxError, EngineError, SingularMassMatrixError
from dynx.model import Model
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import pose_error

# -- results of one backend, or of the referee, at one set of samples ----------------------------


REFEREE = "referee"
"""Name of the results in 50 digits."""

DERIVED = "derived"
"""Name of the results that are derived from an engine's own poses and inverse dynamics."""


@dataclass(frozen=True)
class Refusal:
    """An error of `dynx.errors` in place of a result."""

    error: DynxError

    @property
    def singular(self) -> bool:
        """True if the mass matrix is singular, so that no unique acceleration exists."""
        return isinstance(self.error, SingularMassMatrixError)

    def __str__(self) -> str:
        return f"{type(self.error).__name__}: {self.error}"


class BackendResults:
    """Results of `backend` by name, each evaluated once; errors are results too."""

    def __init__(self, name: str, backend: Any, samples: Samples) -> None:
        self.name = name
        self.backend = backend
        self.samples = samples
        self._known: dict[str, Array | Refusal] = {}

    def of(self, name: str, evaluate: Callable[[Any, Samples], Array]) -> Array | Refusal:
        """Return the result of the quantity `name`, evaluated at the first call."""
        if name not in self._known:
            self._known[name] = self.attempt(evaluate)
        return self._known[name]

    def attempt(self, evaluate: Callable[[Any, Samples], Array]) -> Array | Refusal:
        """Return the result of `evaluate` without storing it, or the error that it raised."""
        try:
            return np.asarray(evaluate(self.backend, self.samples))
        except DynxError as error:
            return Refusal(error)
        except Exception as error:
            # A backend of another package may raise anything; the other comparisons are still made.
            broken = EngineError(f"{self.name} failed with {type(error).__name__}: {error}")
            broken.__cause__ = error
            return Refusal(broken)


@dataclass(frozen=True)
class WorstSample:
    """The sample with the largest error, and everything needed to reproduce it."""

    index: int
    kind: str
    q: tuple[float, ...]
    v: tuple[float, ...]
    a: tuple[float, ...]
    tau: tuple[float, ...]
    frame: str | None = None
    reference: str | None = None


@dataclass(frozen=True)
class Comparison:
    """The difference of two results of a quantity.

    `pair` joins two names by ``~``: two backends, or a backend and ``referee`` (50 digits) or ``derived``
    (results that dynx derives from that engine's own poses and inverse dynamics). `max_rel_error` is the
    largest error divided by the natural magnitude of the quantity (`dynx.agreement.magnitudes`).
    """

    quantity: str
    pair: str
    max_abs_error: float
    max_rel_error: float
    tolerance: float
    agree: bool
    worst_sample: WorstSample | None = None
    note: str | None = None

    @property
    def names(self) -> tuple[str, str]:
        """The two names of `pair`."""
        first, _, second = self.pair.partition("~")
        return first, second


@dataclass(frozen=True)
class ErrorVerdict:
    """The largest absolute error and the largest relative error, which may be at different entries.

    `position` is that of the relative one in the array; None without entries.
    """

    absolute: float
    relative: float
    position: tuple[int, ...] | None


def judge(error: Array, scale: Floats) -> ErrorVerdict:
    """Return the largest error relative to `scale`, which broadcasts against it.

    Where the scale is 0, an error of 0 counts as 0 and any other as infinite. NaN counts as infinite.
    """
    absolute = np.abs(error).astype(np.float64)
    if not absolute.size:
        return ErrorVerdict(0.0, 0.0, None)
    absolute = np.where(np.isfinite(absolute), absolute, np.inf)
    relative = np.where(absolute == 0.0, 0.0, np.inf)
    np.divide(absolute, np.broadcast_to(scale, absolute.shape), out=relative, where=scale > 0.0)
    worst = np.unravel_index(int(np.argmax(relative)), relative.shape)
    return ErrorVerdict(float(np.max(absolute)), float(relative[worst]), tuple(int(k) for k in worst))


def compare(
    quantity: ComparedQuantity, first: BackendResults, second: BackendResults, magnitudes: Magnitudes
) -> Comparison:
    """Compare the results of two backends by their difference. Derived results are `second`.

    An error that a backend raises counts as its result: the comparison then fails with infinite errors and a
    note, unless both report a singular mass matrix. Results of different shapes fail too.
    """
    samples = first.samples
    tolerance = quantity.tolerance(magnitudes)
    results = [each.of(quantity.name, quantity.evaluate) for each in (first, second)]
    refusal = compare_refusals(quantity.name, first, second, results, tolerance)
    if refusal is not None:
        return refusal
    one, other = results
    assert not isinstance(one, Refusal)
    assert not isinstance(other, Refusal)
    if one.shape != other.shape:
        shapes = f"{first.name} gives shape {one.shape}, {second.name} {other.shape}"
        return failed_comparison(quantity.name, first, second, tolerance, shapes)
    scale = (quantity.derived_scale if second.name == DERIVED else None) or quantity.scale
    verdict = judge(_difference(one, other), scale(magnitudes))
    worst = locate(verdict.position, quantity.layout, samples)
    note = not_finite_note((first, one), (second, other))
    return concluded(quantity.name, first, second, verdict, tolerance, worst, note)


def not_finite_note(*results: tuple[BackendResults, Array]) -> str | None:
    """Return a note that names the backends whose results contain NaN or infinity, or None."""
    names = [by.name for by, result in results if not np.isfinite(result.astype(np.float64)).all()]
    return f"{' and '.join(names)}: NaN or infinity in the result" if names else None


def concluded(
    name: str,
    first: BackendResults,
    second: BackendResults,
    verdict: ErrorVerdict,
    tolerance: float,
    worst: WorstSample | None = None,
    note: str | None = None,
) -> Comparison:
    """Return the comparison of two results of the quantity `name`, whose largest error is `verdict`."""
    pair, error = f"{first.name}~{second.name}", verdict.relative
    return Comparison(name, pair, verdict.absolute, error, tolerance, error <= tolerance, worst, note)


def compare_refusals(
    name: str,
    first: BackendResults,
    second: BackendResults,
    results: Sequence[Array | Refusal],
    tolerance: float,
) -> Comparison | None:
    """Compare backends of which some raised an error; return None if all have results.

    They agree if all report a singular mass matrix.
    """
    refused = [result for result in results if isinstance(result, Refusal)]
    if not refused:
        return None
    if len(refused) == len(results) and all(result.singular for result in refused):
        note = f"refused alike: {refused[0].error}"
        return concluded(name, first, second, ErrorVerdict(0.0, 0.0, None), tolerance, note=note)
    note = "; ".join(
        f"{each.name}: {result}"
        for each, result in zip((first, second), results, strict=False)
        if isinstance(result, Refusal)
    )
    return failed_comparison(name, first, second, tolerance, note)


def failed_comparison(
    name: str, first: BackendResults, second: BackendResults, tolerance: float, note: str
) -> Comparison:
    """Return a comparison that fails without a finite error."""
    return concluded(name, first, second, ErrorVerdict(np.inf, np.inf, None), tolerance, note=note)


def state(samples: Samples, k: int, frame: str | None = None, reference: str | None = None) -> WorstSample:
    """Return sample number k of `samples` as a record."""
    q, v, a, tau = (tuple(each[k].tolist()) for each in (samples.q, samples.v, samples.a, samples.tau))
    return WorstSample(int(samples.index[k]), samples.kinds[k], q, v, a, tau, frame, reference)


def locate(position: tuple[int, ...] | None, layout: Layout, samples: Samples) -> WorstSample | None:
    """Return the sample (and frame) of a position in a result."""
    if position is None:
        return None
    if layout == "samples":
        return state(samples, position[0])
    if layout == "frames":
        return state(samples, position[0], samples.model.frame_names[position[1]])
    entry = frame_samples(layout, samples)[position[0]]
    return state(samples, int(entry.samples[position[1]]), entry.frame, entry.reference)


def _difference(one: Array, other: Array) -> Array:
    """Return `one` minus `other`. The difference is exact where one of them holds 50-digit numbers, because
    those represent doubles exactly."""
    if one.dtype == object or other.dtype == object:
        return np.asarray(one.astype(object) - other.astype(object))
    with np.errstate(invalid="ignore"):
        return np.asarray(one - other)


# -- quantities that solve equations --------------------------------------------------------------
#
# The solution of each engine is verified by the other engine. Two accelerations, or two configurations that
# reach one target, may differ while both are right. So each engine checks that the other's solution satisfies
# the equation.


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
            return failed_comparison(name, solver, verifier, tolerance, f"{other.name}: {tau}")
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
            return failed_comparison(name, first, second, tolerance, f"{verifier.name}: {reached}")
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
