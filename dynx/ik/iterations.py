"""Iterations of kernels for one frame of one robot: the steps of `dynx.ik.step` behind the poses of
`dynx.rbd`.

A search, a refinement of targets that no start reached, a tracking, and solutions nearest to a posture. Of
the configurations that reach a target one of least sum of weighted squared distances from a posture g is
sought, as in `dynx.ik.refine`: from the best configuration that reaches the target a step goes along the
projection of g - x to the null space (Siciliano et al., eq. 3.54, in the metric of the weights), and returns
to the target by Newton steps. It counts if the target is reached and the objective is lower; otherwise a
shorter step is tried.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.ik.coordinates import FULL_TURN, FrameCoordinates
from dynx.ik.step import (
    DAMPING,
    HUGE_ERROR,
    MIN_DAMPING,
    NO_RESULT,
    REFINEMENT,
    SEARCH,
    SETTINGS,
    TRACKING,
    TRACKING_SETTINGS,
    WINDOW,
    Descent,
    DescentLayout,
    TargetKind,
    bounded_step,
    frame_error,
    tracking_step,
    within_bounds,
)
from dynx.model.mechanism import Mechanism
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, frame_jacobian
from dynx.rbd.kinematics import ancestry, body_poses, frame_pose
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.iteration import Iteration
from dynx.simd.iteration_status import GIVEN_UP, NO_RESTART, REACHED, RUNNING
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, less, less_equal, maximum, minimum, select

_ROUNDING_SHIFT = 6755399441055744.0
"""1.5 * 2^52: adding it to a double and subtracting it again rounds the double to an integer."""


@dataclass(frozen=True)
class FramePath:
    """The bodies between root and frame, and their joint positions as an affine map of the coordinates."""

    mechanism: Mechanism
    A: Floats
    b: Floats

    @classmethod
    def of(cls, mechanism: Mechanism, frame: int, coordinates: FrameCoordinates) -> FramePath:
        placed = mechanism.frames[frame]
        bodies = tuple(reversed(ancestry(mechanism, placed.body)))
        chain = tuple(replace(mechanism.bodies[body], parent=k - 1) for k, body in enumerate(bodies))
        path = replace(mechanism, bodies=chain, frames=(replace(placed, body=len(chain) - 1),), coupling=None)
        n = len(mechanism.bodies)
        if mechanism.coupling is None:
            A, b = np.eye(n), np.zeros(n)
        else:
            A, b = mechanism.coupling.affine_map()
        return cls(path, A[np.ix_(bodies, coordinates.indices)], b[list(bodies)])

    def pose(self, x: Array) -> tuple[Array, Array, Array]:
        """Return rotation, position and Jacobian (6, n) of the frame in world axes."""
        poses = body_poses(self.mechanism, self.A @ x + self.b)
        R, p = frame_pose(self.mechanism, poses, 0)
        J = frame_jacobian(self.mechanism, poses, 0, LOCAL_WORLD_ALIGNED) @ self.A
        return np.asarray(R), np.asarray(p), np.asarray(J)


def shifted_to(x: Sequence[Any], near: Array, coordinates: FrameCoordinates) -> Array:
    """Return x with its periodic angles shifted by full turns, within their limits and nearest to `near`."""
    shifted = list(x)
    for k in coordinates.periodic:
        turns = (x[k] - near[k]) * (1.0 / FULL_TURN)
        value = x[k] - FULL_TURN * ((turns + _ROUNDING_SHIFT) - _ROUNDING_SHIFT)
        low, high = coordinates.limits(k)
        if np.isfinite(low):
            value = value + FULL_TURN * less(value, low)
        if np.isfinite(high):
            value = value - FULL_TURN * less(high, value)
        if np.isfinite(low):
            value = maximum(low, value)
        shifted[k] = minimum(high, value) if np.isfinite(high) else value
    return np.array(shifted, dtype=object)


def _iteration(
    layout: DescentLayout,
    n: int,
    kind: TargetKind,
    step: Callable[..., dict[str, Any]],
    tasks: Mapping[str, int],
    constants: Mapping[str, int],
) -> Iteration:
    """Trace a step with n coordinates, with the sizes of further arrays of its tasks and of its constants."""
    sizes = {"x": n, "memory": len(layout.initial(n)), "target": kind.size, "near": n}
    shapes = {name: (size,) for name, size in {**sizes, **tasks, **constants}.items()}
    return Iteration(trace(step, shapes), tuple(constants), n + layout.results)


def solver_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that solves for the coordinates that move frame number `frame`.

    Tasks have the arrays ``x``, the first start (n,); ``memory`` (`SEARCH`); ``target``, the first three rows
    of a pose (12,), a position (3,) or a rotation (9,); ``near`` (n,), to which periodic angles are shifted;
    ``cell``, the first row of starts near the target; ``point`` (3,) if there is one; and ``axes`` (12,),
    weights and bounds per axis, if there are such. The constants are those of `SETTINGS`, then the numbers
    that the rows of starts follow from (`dynx.ik.starts`).
    """
    n, path = coordinates.count, FramePath.of(mechanism, frame, coordinates)

    def step(cell: Array, starts: Array, memory: Array, **given: Array) -> dict[str, Any]:
        found = _descent_step(SEARCH, path, coordinates, kind, memory=memory, **given)
        found["restart"] = select(found.pop("again"), _row(memory, cell, starts), NO_RESTART)
        return found

    tasks = {"cell": 1, **kind.optional_sizes}
    return _iteration(SEARCH, n, kind, step, tasks, {"settings": len(SETTINGS), "starts": 3})


def refinement_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that reduces the error of frame number `frame` from one configuration.

    Tasks have the arrays ``x``, where it begins (n,); ``memory`` (`REFINEMENT`); ``target``, ``near``,
    ``point`` and ``axes`` as in `solver_iteration`. The constants are those of `SETTINGS`.
    """
    n, path = coordinates.count, FramePath.of(mechanism, frame, coordinates)

    def step(**given: Array) -> dict[str, Any]:
        return {**_descent_step(REFINEMENT, path, coordinates, kind, **given), "restart": NO_RESTART}

    return _iteration(REFINEMENT, n, kind, step, kind.optional_sizes, {"settings": len(SETTINGS)})


def _descent_step(
    descent: Descent,
    path: FramePath,
    coordinates: FrameCoordinates,
    kind: TargetKind,
    *,
    x: Array,
    memory: Array,
    target: Array,
    near: Array,
    settings: Array,
    point: Array | None = None,
    axes: Array | None = None,
) -> dict[str, Any]:
    """Return the outputs of a step within the limits, with its periodic angles near to `near`."""
    error, J = frame_error(kind, path.pose(x), target, point, axes)
    found = descent.step(error, J, x, memory, settings, coordinates.lower, coordinates.upper)
    return {**found, "x": shifted_to(found["x"], near, coordinates)}


def _row(memory: Array, cell: Array, starts: Array) -> Any:
    """Return the row of the next start."""
    near, offset, base = starts
    number = memory[-WINDOW - 3] + 1.0
    turned = number + offset
    turned = turned - near * less_equal(near, turned)
    return select(less(number, near), cell[0] + turned, base + number)


def tracking_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that descends to one target of frame number `frame`.

    Tasks have ``x`` and ``near`` (n,), both the start; ``memory`` (`TRACKING`); and ``target``. The constants
    are those of `TRACKING_SETTINGS`, the bounds ``lower``, ``upper`` and ``reach`` (n,) of `StepBounds`, and
    ``point`` (3,) if there is one. The tasks of a kernel are the samples of a path, computed in order by one
    lane: the start of a task is the result of the one before. The kernel returns at the first sample that is
    not reached, if the settings say so.
    """
    n, path = coordinates.count, FramePath.of(mechanism, frame, coordinates)

    def step(
        x: Array,
        memory: Array,
        target: Array,
        near: Array,
        settings: Array,
        lower: Array,
        upper: Array,
        reach: Array,
        point: Array | None = None,
    ) -> dict[str, Any]:
        error, J = frame_error(kind, path.pose(x), target, point)
        low = [maximum(a, b - c) for a, b, c in zip(lower, near, reach, strict=True)]
        high = [minimum(a, b + c) for a, b, c in zip(upper, near, reach, strict=True)]
        return {**tracking_step(error, J, x, memory, settings, low, high), "restart": NO_RESTART}

    constants = {"settings": len(TRACKING_SETTINGS), "lower": n, "upper": n, "reach": n}
    return _iteration(TRACKING, n, kind, step, {}, constants | kind.optional_sizes)


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


POSTURE = DescentLayout(numbers=(*NO_RESULT, HUGE_ERROR, 1.0, 0.0), results=5, vectors=1)
"""Further numbers: the objective, a result; the share of the step along the null space that is tried, and the
number of steps back to the target. The vector is that step."""


def posture_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that brings one configuration near to a posture, on the target.

    Tasks have the arrays ``x``, where it begins (n,); ``memory`` (`POSTURE`); ``target``, ``point`` and
    ``axes`` as in `solver_iteration`; ``near``, the posture (n,); ``weights`` (n,) of the squared distances;
    and ``inverse`` (n,), the diagonal of the inverse metric. The constants are those of `SETTINGS`.
    """
    n, path = coordinates.count, FramePath.of(mechanism, frame, coordinates)
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
        residual, J = frame_error(kind, path.pose(x), target, point, axes)
        squared = residual.squared
        position_tolerance, rotation_tolerance, max_iterations, _ = settings
        iterations, least = memory[n + 3 : n + 5]
        (share, back), along = memory[n + 5 : n + 7], memory[n + 7 :]
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
        tried = [within_bounds(best[k] + share * along[k], *limits[k]) for k in range(n)]
        newton = bounded_step(
            J, residual.vector, x, coordinates.lower, coordinates.upper, DAMPING * squared + MIN_DAMPING
        )
        returned = [within_bounds(newton[k], *limits[k]) for k in range(n)]
        size = share * _largest(along)
        stationary = best[n + 2] * less(size, _STATIONARY)
        back = select(begins, 0.0, back + 1.0)
        after = [*best, iterations + 1.0, select(better, value, least), share, back, *along]
        ends = less_equal(max_iterations, iterations)
        return {
            "x": np.array([select(begins, a, b) for a, b in zip(tried, returned, strict=True)], dtype=object),
            "memory": np.array(after, dtype=object),
            "status": select(stationary, REACHED, select(ends, GIVEN_UP, RUNNING)),
            "restart": NO_RESTART,
        }

    tasks = {"weights": n, "inverse": n, **kind.optional_sizes}
    return _iteration(POSTURE, n, kind, step, tasks, {"settings": len(SETTINGS)})


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
