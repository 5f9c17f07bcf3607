"""Iterations of two more kernels: refinement of targets that are not reached, and of postures.

Refinement of targets that no start reached to a local minimum of the error: the iteration of its kernel.

Where the error stays large the full step overshoots, so a step that does not reduce the error is rejected and
the damping raised (Marquardt 1963), as in `dynx.ik.search`. A rejected step is followed by an evaluation of
the best configuration, from which the next step starts.

Solutions that are nearest to a posture in the null space of their target: the iteration of a kernel.

Of the configurations that reach a target one of least sum of weighted squared distances from a posture g is
sought, as in `dynx.ik.refine`: from the best configuration that reaches the target a step goes along the
projection of g - x to the null space (Siciliano et al., eq. 3.54, in the metric of the weights), and returns
to the target by Newton steps. It counts if the target is reached and the objective is lower; otherwise a
shorter step is tried.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.search import DAMPING, MIN_DAMPING, MIN_RELATIVE_GAIN
from dynx.ik.step import (
    HUGE_ERROR,
    SETTINGS,
    FramePath,
    TargetKind,
    bounded_step,
    shifted_to,
    traced_residual,
)
from dynx.model import Mechanism
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.inlining import less, less_equal, maximum, minimum, select
from dynx.simd.iteration import GIVEN_UP, NO_RESTART, REACHED, RUNNING, Iteration
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats


@dataclass(frozen=True)
class RefinementMemory:
    """Layout of the variables of a task: result, then what the next steps need."""

    n: int
    """Number of coordinates."""

    @property
    def n_results(self) -> int:
        """Size of the result: coordinates, distance, angle, success, iterations."""
        return self.n + 4

    @property
    def initial(self) -> Floats:
        """Variables of a new task: result, squared error, damping factor, and whether x is the best one."""
        return np.array([0.0] * (self.n + 4) + [HUGE_ERROR, DAMPING, 1.0])


def refinement_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that reduces the error of frame number `frame` from one configuration.

    Tasks have the arrays ``x``, where it begins (n,); ``memory`` (`RefinementMemory`); ``target``, ``near``,
    ``point`` and ``axes`` as in `dynx.ik.step.solver_iteration`. The constants are those of
    `SETTINGS`.
    """
    n = coordinates.count
    path = FramePath.of(mechanism, frame, coordinates)

    def step(
        x: Array,
        memory: Array,
        target: Array,
        near: Array,
        settings: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        residual, J, squared = traced_residual(path, kind, x, target, point, axes)
        position_tolerance, rotation_tolerance, max_iterations, _ = settings
        iterations, least, factor, at_best = memory[n + 3 : n + 7]
        trial = 1.0 - at_best
        iterations = iterations + trial
        gain = least - squared
        accepted = maximum(at_best, less(0.0, gain))
        reached = residual.reached(position_tolerance, rotation_tolerance)
        found = [*x, residual.distance, residual.angle, reached]
        best = [select(accepted, a, b) for a, b in zip(found, memory[: n + 3], strict=True)]
        factor = select(at_best, factor, factor * select(accepted, 0.3, 4.0))
        converged = trial * less_equal(abs(gain), MIN_RELATIVE_GAIN * least)
        ends = maximum(converged, less_equal(max_iterations, iterations))
        stepped = bounded_step(J, residual.vector, x, coordinates, factor * squared + MIN_DAMPING)
        next_x = [
            select(accepted, a, b)
            for a, b in zip(shifted_to(stepped, near, coordinates), memory[:n], strict=True)
        ]
        after = [*best, iterations, select(accepted, squared, least), factor, 1.0 - accepted]
        status = select(reached * accepted, REACHED, select(ends, GIVEN_UP, RUNNING))
        return {
            "x": np.array(next_x, dtype=object),
            "memory": np.array(after, dtype=object),
            "status": status,
            "restart": NO_RESTART + 0.0 * squared,
        }

    memory = RefinementMemory(n)
    sizes = {"x": n, "memory": len(memory.initial), "target": kind.size, "near": n}
    sizes |= {"settings": len(SETTINGS)} | kind.optional_sizes
    shapes = {name: (size,) for name, size in sizes.items()}
    return Iteration(trace(step, shapes), ("settings",), memory.n_results)


MAX_STEPS = 300
"""Most steps of one start."""

SHARE_OF_TOLERANCE = 0.01
"""Share of the tolerances within which a configuration counts as on the target. Using all of them would bring
it nearer to the posture by not reaching the target exactly."""

_GREATEST_STEP = 0.3
"""Largest change of a coordinate along the null space in a step [rad or m]."""

_STATIONARY = 1e-7
"""Change of every coordinate [rad or m] below which the posture counts as the nearest."""

_AT_LIMIT = 1e-5
"""Distance from a limit [rad or m] below which a coordinate counts as at it."""

_NEWTON_STEPS = 6.0
"""Steps back to the target after which a step along the null space is given up."""

_GROWTH, _REDUCTION = 1.6, 0.4
"""Factors of the share of a step that is tried, after one that counts and one that does not."""

_ACTIVE_SET_PASSES = 2
"""Times that coordinates at limits are looked for which a step would lead beyond them."""


@dataclass(frozen=True)
class PostureMemory:
    """Layout of the variables of a task: result, then what the next steps need."""

    n: int
    """Number of coordinates."""

    @property
    def n_results(self) -> int:
        """Size of the result: coordinates, distance, angle, success, iterations, objective."""
        return self.n + 5

    @property
    def initial(self) -> Floats:
        """Variables of a new task: result, the step along the null space (n,), the share of it that is tried,
        and the number of steps back to the target."""
        return np.array([0.0] * (self.n + 4) + [HUGE_ERROR] + [0.0] * self.n + [1.0, 0.0])


def posture_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that brings one configuration near to a posture, on the target.

    Tasks have the arrays ``x``, where it begins (n,); ``memory`` (`PostureMemory`); ``target``, ``point`` and
    ``axes`` as in `dynx.ik.step.solver_iteration`; ``near``, the posture (n,); ``weights`` (n,) of
    the squared distances; and ``inverse`` (n,), the diagonal of the inverse metric. The constants are those
    of `SETTINGS`.
    """
    n = coordinates.count
    path = FramePath.of(mechanism, frame, coordinates)
    # Periodic angles stay within their limits too: beyond them they would be far from the posture.
    limits = [coordinates.limits(k) for k in range(n)]

    def step(
        x: Array,
        memory: Array,
        target: Array,
        near: Array,
        weights: Array,
        inverse: Array,
        settings: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        x = shifted_to(list(x), near, coordinates)
        residual, J, squared = traced_residual(path, kind, x, target, point, axes)
        position_tolerance, rotation_tolerance, max_iterations, _ = settings
        iterations, least = memory[n + 3 : n + 5]
        along, (share, back) = memory[n + 5 : 2 * n + 5], memory[2 * n + 5 :]
        reached = residual.reached(position_tolerance, rotation_tolerance)
        away = near - x
        value = sum(w * d * d for w, d in zip(weights, away, strict=True))
        better = reached * less(value, least)
        best = [
            select(better, a, b)
            for a, b in zip([*x, residual.distance, residual.angle, reached], memory[: n + 3], strict=True)
        ]
        wanted = np.array([d * less(0.0, w) for w, d in zip(weights, away, strict=True)])
        here = _null_step(J, residual.vector, wanted, inverse, x, limits)
        along = np.array([select(better, a, b) for a, b in zip(here, along, strict=True)], dtype=object)

        fails = (1.0 - better) * best[n + 2] * maximum(reached, less_equal(_NEWTON_STEPS, back))
        share = select(better, minimum(1.0, _GROWTH * share), select(fails, _REDUCTION * share, share))
        begins = maximum(better, fails)
        tried = [_bounded(best[k] + share * along[k], *limits[k]) for k in range(n)]
        newton = bounded_step(J, residual.vector, x, coordinates, DAMPING * squared + MIN_DAMPING)
        returned = [_bounded(newton[k], *limits[k]) for k in range(n)]
        size = share * _largest(along)
        stationary = best[n + 2] * less(size, _STATIONARY)
        back = select(begins, 0.0, back + 1.0)
        after = [*best, iterations + 1.0, select(better, value, least), *along, share, back]
        ends = less_equal(max_iterations, iterations)
        return {
            "x": np.array([select(begins, a, b) for a, b in zip(tried, returned, strict=True)], dtype=object),
            "memory": np.array(after, dtype=object),
            "status": select(stationary, REACHED, select(ends, GIVEN_UP, RUNNING)),
            "restart": NO_RESTART + 0.0 * squared,
        }

    memory = PostureMemory(n)
    sizes = {"x": n, "memory": len(memory.initial), "target": kind.size, "near": n, "weights": n}
    sizes |= {"inverse": n, "settings": len(SETTINGS)} | kind.optional_sizes
    shapes = {name: (size,) for name, size in sizes.items()}
    return Iteration(trace(step, shapes), ("settings",), memory.n_results)


def _null_step(
    J: Array, error: Array, wanted: Array, inverse: Array, x: Array, limits: list[tuple[float, float]]
) -> Array:
    """Return the step (n,) nearest to `wanted` that removes the error, and leaves the limits of no coordinate
    that is at them."""
    free = np.array([1.0] * len(x), dtype=object)
    step = _linear_solution(J, error, wanted, inverse)
    for _ in range(_ACTIVE_SET_PASSES):
        moves = [_may_move(a, d, *limit) for a, d, limit in zip(x, step, limits, strict=True)]
        free = free * np.array(moves, dtype=object)
        step = _linear_solution(J, error, wanted * free, inverse * free)
    share = minimum(1.0, _GREATEST_STEP / maximum(_largest(step), 1e-300))
    for a, d, limit in zip(x, step, limits, strict=True):
        share = minimum(share, _room(a, d, *limit))
    return np.asarray(step * share)


def _linear_solution(J: Array, error: Array, wanted: Array, inverse: Array) -> Array:
    """Return the step d (n,) with J d = error that is nearest to `wanted`."""
    by_metric = J * inverse
    A = by_metric @ J.T + MIN_DAMPING * np.eye(len(J))
    return np.asarray(wanted + solve_positive_definite(A, error - J @ wanted) @ by_metric)


def _largest(a: Array) -> Any:
    """Return the largest magnitude of the entries."""
    found = abs(a[0])
    for each in a[1:]:
        found = maximum(found, abs(each))
    return found


def _may_move(x: Any, d: Any, low: float, high: float) -> Any:
    """Return 0 for a coordinate at a limit that d would lead beyond it, otherwise 1."""
    moves: Any = 1.0
    if np.isfinite(low):
        moves = 1.0 - less_equal(x, low + _AT_LIMIT) * less(d, 0.0)
    if np.isfinite(high):
        moves = moves * (1.0 - less_equal(high - _AT_LIMIT, x) * less(0.0, d))
    return moves


def _room(x: Any, d: Any, low: float, high: float) -> Any:
    """Return the share of d that leads to a limit, at most 1; 1 for a coordinate that is at a limit."""
    room: Any = 1.0
    if np.isfinite(low):
        beyond = less(low + _AT_LIMIT, x) * less(x + d, low)
        room = select(beyond, (low - x) / minimum(d, -1e-300), room)
    if np.isfinite(high):
        beyond = less(x, high - _AT_LIMIT) * less(high, x + d)
        room = select(beyond, (high - x) / maximum(d, 1e-300), room)
    return room


def _bounded(x: Any, low: float, high: float) -> Any:
    bounded = maximum(low, x) if np.isfinite(low) else x
    return minimum(high, bounded) if np.isfinite(high) else bounded
