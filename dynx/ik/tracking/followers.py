"""Followers of paths: descents to one target after the other, in Python, in a kernel, around obstacles.

Descent to one target after the other, each from the solution before, within bounds on every change.

Levenberg-Marquardt within bounds (`dynx.ik.search`). The first steps have the damping of the search (Sugihara
2011), which is quadratically convergent near a target; a step that increases the error is rejected and the
damping raised (Marquardt 1963), so that the descent also ends in a local minimum of a target that cannot be
reached.

Tracking in a compiled kernel: a descent within bounds to one target after the other.

The tasks of the kernel are the samples of a path, computed in order by one lane: the start of a task is the
result of the one before. The kernel returns at the first sample that is not reached, if it is asked to.

Following of targets by configurations that keep bodies apart.

The samples of another follower are kept as long as they are clear. Where one is too close to something, the
descent to its target is repeated with the distances that are too small as further errors (`dynx.ik.clear`):
redundant joints then move around what is in the way. Where that fails, the sample is not reached and stays at
the last configuration that is clear.
"""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.compiled.simplification import simplify_mechanism
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.kernels import MAX_JOINTS, algorithms
from dynx.ik.options import SearchLimits
from dynx.ik.problem import Requirement
from dynx.ik.search import DAMPING, MIN_DAMPING, REQUIRED_REDUCTION, WINDOW, BoundedStep, Task, TaskError
from dynx.ik.step import FramePath, TargetKind, TracedResidual
from dynx.model.mechanism import Mechanism
from dynx.model.model import Model
from dynx.model.targets import Targets
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.cache import source_version
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.inlining import less, less_equal, maximum, minimum, select
from dynx.simd.iteration import (
    GIVEN_UP,
    NO_RESTART,
    REACHED,
    RUNNING,
    Iteration,
    IterationKernel,
    load_iteration,
)
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import rotate

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance


ACCEPTED_FACTOR, REJECTED_FACTOR = 0.3, 4.0
"""Factors of the damping after a step that reduces the error, and after one that does not."""

MIN_RELATIVE_GAIN = 1e-12
"""A descent ends when a step changes the squared error by a smaller fraction."""

MIN_CHANGE = 1e-13
"""A descent ends when a step changes no coordinate by more [rad or m]."""


@dataclass(frozen=True, eq=False)
class StepBounds:
    """Bounds on the coordinates that move a frame, each an array (n,) [rad or m]."""

    lower: Floats
    upper: Floats
    reach: Floats
    """Largest change from one target to the next."""

    def around(self, x: Floats) -> tuple[Floats, Floats]:
        """Return the bounds of a target whose descent starts at x (n,) within `lower` and `upper`."""
        return np.maximum(self.lower, x - self.reach), np.minimum(self.upper, x + self.reach)

    def within_reach_of(self, x: Floats, reach: Floats) -> StepBounds:
        """Return bounds that keep the coordinates at all targets within the present reach of x, with this
        `reach` for each."""
        lower, upper = self.around(x)
        return replace(self, lower=lower, upper=upper, reach=reach)


@dataclass(frozen=True, eq=False)
class Followed:
    """Configurations (k, nq) at the first k targets, their errors, success and number of steps (k,)."""

    q: Floats
    position_error: Floats
    rotation_error: Floats
    reached: NDArray[np.bool_]
    iterations: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.q)

    def part(self, of: slice) -> Followed:
        """Return some of the samples."""
        return Followed(*(getattr(self, each.name)[of] for each in fields(self)))

    @classmethod
    def joined(cls, pieces: Sequence[Followed]) -> Followed:
        """Return the samples of several pieces, of which there is at least one."""
        return cls(*(np.concatenate([getattr(piece, each.name) for piece in pieces]) for each in fields(cls)))


def part_of(targets: Targets, of: slice) -> Targets:
    """Return some of the targets (n,)."""
    return Targets(
        None if targets.positions is None else targets.positions[of],
        None if targets.rotations is None else targets.rotations[of],
    )


class Follower(Protocol):
    """Solver of targets, one after the other or each on its own."""

    def follow(self, q: Floats, targets: Targets, bounds: StepBounds, *, stop: bool) -> Followed:
        """Descend to each target (n,) from the solution of the one before, the first from q (nq,).

        With `stop` it ends with the first target that is not reached.
        """

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend to each target (n,) from its own start (n, nq), and abandon starts that make no progress
        (`dynx.ik.search`)."""


class SampleFollower:
    """Follower on any backend, which evaluates a pose and a Jacobian for every step."""

    def __init__(self, backend: Backend, requirement: Requirement) -> None:
        self._backend, self._requirement = backend, requirement
        self._coordinates = FrameCoordinates(backend.model, requirement.frame)

    def follow(self, q: Floats, targets: Targets, bounds: StepBounds, *, stop: bool) -> Followed:
        found: list[_Sample] = []
        for position, rotation in targets.rows(targets.batch):
            sample = self._solve(q, self._task(position, rotation), bounds, abandons=False)
            found.append(sample)
            q = sample.q
            if stop and not sample.reached:
                break
        return _followed(found, len(q))

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        rows = zip(starts, targets.rows(targets.batch), strict=True)
        found = [self._solve(q, self._task(p, R), bounds, abandons=True) for q, (p, R) in rows]
        return _followed(found, starts.shape[-1])

    def _task(self, position: Floats | None, rotation: Floats | None) -> Task:
        return self._requirement.task(self._backend, self._coordinates, position, rotation)

    def _solve(self, q: Floats, task: Task, bounds: StepBounds, *, abandons: bool) -> _Sample:
        coordinates = self._coordinates
        lower, upper = bounds.around(np.array(coordinates.values(q)))
        step = BoundedStep(lower.tolist(), upper.tolist())
        best, factor = _measured(q, task), DAMPING
        J: Floats | None = None
        recent: deque[float] = deque(maxlen=WINDOW)
        most = self._requirement.tolerances.max_iterations
        while not best.reached and best.iterations < most and coordinates.count:
            if abandons:
                if len(recent) == WINDOW and best.squared > REQUIRED_REDUCTION * recent[0]:
                    break
                recent.append(best.squared)
            if J is None:
                J = task.jacobian(best.q, best.error)
            x = coordinates.values(best.q)
            y = step(J, best.error.vector, x, factor * best.squared + MIN_DAMPING)
            trial = _measured(coordinates.with_values(best.q, y), task)
            trial.iterations = best.iterations + 1
            gain = best.squared - trial.squared
            ends = abs(gain) <= MIN_RELATIVE_GAIN * best.squared
            ends = ends or max(abs(a - b) for a, b in zip(x, y, strict=True)) <= MIN_CHANGE
            if gain > 0.0 or trial.reached:
                best, J = trial, None
                factor *= ACCEPTED_FACTOR
            else:
                best.iterations = trial.iterations
                factor *= REJECTED_FACTOR
            if ends:
                break
        return best


def _measured(q: Floats, task: Task) -> _Sample:
    error = task.error(q)
    return _Sample(
        q, error, error.position, error.rotation, 0.5 * sum([x * x for x in error.vector]), error.reached
    )


@dataclass
class _Sample:
    """A configuration and its error."""

    q: Floats
    error: TaskError
    distance: float
    angle: float
    squared: float
    reached: bool
    iterations: int = 0


def _followed(found: list[_Sample], nq: int) -> Followed:
    return Followed(
        np.array([sample.q for sample in found]).reshape(len(found), nq),
        np.array([sample.distance for sample in found]),
        np.array([sample.angle for sample in found]),
        np.array([sample.reached for sample in found], dtype=np.bool_),
        np.array([sample.iterations for sample in found], dtype=np.int64),
    )


_HUGE = 1e300
"""Squared error before the first step."""

SETTINGS = ("position_tolerance", "rotation_tolerance", "max_iterations", "stops", "abandons")
"""Constants of the kernel, in order: the last two are 1 to return at a target that is not reached, and to
abandon descents without progress."""


def n_results(n: int) -> int:
    """Return the size of a result: coordinates, distance, angle, success, number of steps."""
    return n + 4


def initial_memory(n: int) -> Floats:
    """Return the memory of a new task: a result, the squared error, the damping factor, recent errors."""
    factor = DAMPING / ACCEPTED_FACTOR
    return np.array([0.0] * n_results(n) + [_HUGE, factor] + [_HUGE] * WINDOW)


def tracking_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that descends to one target of frame number `frame`.

    Tasks have ``x`` and ``near`` (n,), both the start; ``memory``; and ``target`` (`TargetKind`). The
    constants are those of `SETTINGS`, the bounds ``lower``, ``upper`` and ``reach`` (n,) of `StepBounds`, and
    ``point`` (3,) if there is one.
    """
    n = coordinates.count
    path = FramePath.of(mechanism, frame, coordinates)

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
        R, p, J = path.pose(x)
        if point is not None:
            lever = rotate(R, point)
            p = p + lever
            J = np.concatenate([J[:3] + np.cross(J[3:].T, lever).T, J[3:]])
        position, rotation = kind.parts(target)
        residual = TracedResidual.of(
            None if position is None else position - p, None if rotation is None else rotation @ R.T
        )
        squared = 0.5 * sum(e * e for e in residual.vector)
        best, (steps, least, factor), recent = memory[:n], memory[n + 3 : n + 6], list(memory[n + 6 :])
        better, accepted = less(squared, least), less_equal(squared, least)
        factor = select(better, ACCEPTED_FACTOR * factor, select(accepted, factor, REJECTED_FACTOR * factor))
        low = [maximum(a, b - c) for a, b, c in zip(lower, near, reach, strict=True)]
        high = [minimum(a, b + c) for a, b, c in zip(upper, near, reach, strict=True)]
        rows = J[0 if kind.position else 3 : 6 if kind.rotation else 3]
        new = _projected_step(rows, residual.vector, x, low, high, factor * squared + MIN_DAMPING)

        position_tolerance, rotation_tolerance, max_iterations, stops, abandons = settings
        reached = less_equal(residual.distance, position_tolerance) * less_equal(
            residual.angle, rotation_tolerance
        )
        change: Any = 0.0
        for a, b in zip(new, x, strict=True):
            change = maximum(change, abs(a - b))
        converged = accepted * maximum(
            less_equal(change, MIN_CHANGE), less_equal(least - squared, MIN_RELATIVE_GAIN * least) * better
        )
        stagnant = abandons * less(REQUIRED_REDUCTION * recent[0], squared)
        ended = maximum(maximum(reached, converged), maximum(stagnant, less_equal(max_iterations, steps)))
        # A kernel returns at a task that is "reached".
        status = select(ended, select(reached, GIVEN_UP, select(stops, REACHED, GIVEN_UP)), RUNNING)
        kept = maximum(better, reached)
        measured = [*x, residual.distance, residual.angle, reached]
        result = [select(kept, a, b) for a, b in zip(measured, memory[: n + 3], strict=True)]
        after = [*result, steps + 1.0 - ended, select(kept, squared, least), factor, *recent[1:], squared]
        return {
            "x": np.array([select(accepted, a, b) for a, b in zip(new, best, strict=True)], dtype=object),
            "memory": np.array(after, dtype=object),
            "status": status,
            "restart": NO_RESTART,
        }

    sizes = {"x": n, "memory": len(initial_memory(n)), "target": kind.size, "near": n}
    constants = {"settings": len(SETTINGS), "lower": n, "upper": n, "reach": n}
    if kind.point:
        constants["point"] = 3
    shapes = {name: (size,) for name, size in (sizes | constants).items()}
    return Iteration(trace(step, shapes), tuple(constants), n_results(n))


def _projected_step(
    J: Array, error: Array, x: Array, low: list[Any], high: list[Any], damping: Any
) -> list[Any]:
    """Return the coordinates (n,) after a projected step (`dynx.ik.step`)."""
    m, n = J.shape
    gradient = error @ J
    free = [
        (1.0 - less_equal(value, a) * less(slope, 0.0)) * (1.0 - less_equal(b, value) * less(0.0, slope))
        for value, a, b, slope in zip(x, low, high, gradient, strict=True)
    ]
    masked = J * np.array(free, dtype=object)
    if m <= n:
        dx = solve_positive_definite(masked @ J.T + damping * np.eye(m), error) @ masked
    else:
        dx = solve_positive_definite(masked.T @ masked + damping * np.eye(n), error @ masked)
    return [minimum(b, maximum(a, value)) for value, a, b in zip(x + dx, low, high, strict=True)]


class KernelFollower:
    """Follower (`dynx.ik.tracking.Follower`) by a kernel; safe to use from several threads."""

    def __init__(
        self,
        kernel: IterationKernel,
        coordinates: FrameCoordinates,
        kind: TargetKind,
        point: Floats | None,
        limits: SearchLimits,
    ) -> None:
        self._kernel, self._coordinates, self._kind = kernel, coordinates, kind
        self._point, self._limits = point, limits

    def follow(self, q: Floats, targets: Targets, bounds: StepBounds, *, stop: bool) -> Followed:
        """Descend to each target from the solution of the one before."""
        n = self._coordinates.count
        rows = np.empty((len(_flat(targets)) + 1, n_results(n)))
        rows[0, :n] = q[self._coordinates.indices]
        # The results of a sample are the start of the next.
        completed = self._run(rows[:-1, :n], targets, rows[1:], bounds, stop=stop, abandons=False)
        return self._followed(q, rows[1 : 1 + completed])

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend to each target from its own start."""
        x = np.ascontiguousarray(starts[:, self._coordinates.indices])
        rows = np.empty((len(x), n_results(self._coordinates.count)))
        self._run(x, targets, rows, bounds, stop=False, abandons=True)
        return self._followed(starts, rows)

    def _run(
        self, x: Floats, targets: Targets, rows: Floats, bounds: StepBounds, *, stop: bool, abandons: bool
    ) -> int:
        """Fill the results of tasks that start at x; return the number of completed ones."""
        limits, memory = self._limits, initial_memory(x.shape[1])
        settings = [
            limits.position_tolerance,
            limits.rotation_tolerance,
            limits.max_iterations,
            stop,
            abandons,
        ]
        parts = [np.array(settings, dtype=np.float64), bounds.lower, bounds.upper, bounds.reach]
        if self._point is not None:
            parts.append(self._point)
        tasks = [x, np.broadcast_to(memory, (len(x), len(memory))), _flat(targets), x]
        return self._kernel.bind_race(tasks, rows, np.concatenate(parts), np.zeros((1, x.shape[1])))()

    def _followed(self, q: Floats, rows: Floats) -> Followed:
        n = self._coordinates.count
        found = np.array(np.broadcast_to(q, (len(rows), q.shape[-1])))
        found[:, self._coordinates.indices] = rows[:, :n]
        distance, angle, reached, steps = rows[:, n : n + 4].T
        return Followed(found, distance, angle, reached != 0.0, steps.astype(np.int64))


def _flat(targets: Targets) -> Floats:
    """Return targets (k,) as rows (k, size) of a kernel."""
    positions, rotations = targets.positions, targets.rotations
    if positions is None or rotations is None:
        one = rotations if positions is None else positions
        assert one is not None
        return np.ascontiguousarray(one).reshape(len(one), -1)
    return np.concatenate([rotations, positions[:, :, None]], axis=2).reshape(-1, 12)


def path_follower(
    backend: Backend,
    coordinates: FrameCoordinates,
    frame: str,
    targets: Targets,
    point: Floats | None,
    limits: SearchLimits,
) -> KernelFollower | None:
    """Return a follower of targets of this kind; None for a floating base, a frame that no joint or more than
    `MAX_JOINTS` joints move, or a backend that compiles nothing."""
    if not backend.compiles or coordinates.floating or not 0 < coordinates.count <= MAX_JOINTS:
        return None
    kind = TargetKind(targets.positions is not None, targets.rotations is not None, point is not None)

    def make() -> IterationKernel:
        with COMPILE_LOCK:
            return path_kernel(backend.model, frame, kind)

    return KernelFollower(backend.kept(("path", frame, kind), make), coordinates, kind, point, limits)


def path_kernel(model: Model, frame: str, kind: TargetKind) -> IterationKernel:
    """Return the kernel that follows targets of this kind one after the other, from the cache if possible."""
    coordinates, number = FrameCoordinates(model, frame), model.frame_index(frame)
    content = (model.links, model.joints, model.extra_frames, model.base_pose, number, kind)
    mechanism = simplify_mechanism(model.mechanism)
    return load_iteration(
        repr(("path", algorithms(), _source(), content)).encode(),
        lambda: tracking_iteration(mechanism, number, coordinates, kind),
        lanes=1,
    )


@cache
def _source() -> str:
    """Return the hash of the source of what is traced here."""
    return source_version(sys.modules[__name__])


CHUNK = 64
"""Samples that the other follower solves before they are checked."""


class AvoidingFollower:
    """Follower whose samples, where they are reached, keep all margins."""

    def __init__(
        self,
        base: Follower,
        backend: Backend,
        requirement: Requirement,
        coordinates: FrameCoordinates,
        avoidance: Avoidance,
    ) -> None:
        self._base, self._backend, self._avoidance = base, backend, avoidance
        self._requirement, self._coordinates = requirement, coordinates

    def follow(self, q: Floats, targets: Targets, bounds: StepBounds, *, stop: bool) -> Followed:
        """Follow targets (n,) from q (nq,), each from the solution of the one before."""
        n, done = targets.batch[0], 0
        pieces: list[Followed] = []
        while done < n:
            part = part_of(targets, slice(done, min(n, done + CHUNK)))
            found = self._base.follow(q, part, bounds, stop=True)
            clear = 0
            while clear < len(found) and found.reached[clear] and self._is_clear(found.q[clear]):
                clear += 1
            if clear:
                pieces.append(found.part(slice(clear)))
                q, done = found.q[clear - 1], done + clear
            if clear < part.batch[0]:
                # The other follower ends with a sample that it does not reach.
                sample = found.part(slice(clear, clear + 1))
                if sample.reached[0] or not self._is_clear(sample.q[0]):
                    sample = self._avoid(q, part_of(part, slice(clear, clear + 1)), bounds)
                pieces.append(sample)
                q, done = sample.q[0], done + 1
                if stop and not sample.reached[0]:
                    break
        return Followed.joined(pieces)

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend from starts (n, nq); a solution that is too close to something does not count."""
        found = self._base.descend(starts, targets, bounds)
        for k in np.flatnonzero(found.reached).tolist():
            found.reached[k] = self._is_clear(found.q[k])
        return found

    def _is_clear(self, q: Floats) -> bool:
        return self._avoidance.is_clear(self._backend, q)

    def _avoid(self, q: Floats, target: Targets, bounds: StepBounds) -> Followed:
        """Return the sample of a target (1,) that keeps the margins, or else stays clear, near q."""
        from dynx.ik.clear import AvoidingDescent

        coordinates = self._coordinates
        ((position, rotation),) = target.rows((1,))
        task = self._requirement.task(self._backend, coordinates, position, rotation)
        around = bounds.around(np.array(coordinates.values(q)))
        descent = AvoidingDescent(task, self._avoidance, self._backend, coordinates, around)
        moved, steps, reached = descent.run(q)
        stays = not reached and not self._is_clear(moved)
        error = task.error(q if stays else moved)
        return Followed(
            (q if stays else moved)[None],
            np.array([error.position]),
            np.array([error.rotation]),
            np.array([reached], dtype=np.bool_),
            np.array([steps], dtype=np.int64),
        )
