"""Followers of paths: descents to one target after the other, each from the solution before, within bounds.

Each is a tracking (`dynx.ik.step`): its first steps have the damping of the search, which is quadratically
convergent near a target, and it also ends in a local minimum of a target that cannot be reached.

`AvoidingFollower` keeps bodies apart. The samples of another follower are kept as long as they are clear.
Where one is too close to something, the descent to its target is repeated with the distances that are too
small as further errors (`dynx.ik.refine`): redundant joints then move around what is in the way. Where that
fails, the sample is not reached and stays at the last configuration that is clear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.descent import MAX_COORDINATES, Descended
from dynx.ik.iterations import tracking_iteration
from dynx.ik.kernels import frame_kernel
from dynx.ik.options import SearchLimits
from dynx.ik.problem import Requirement
from dynx.ik.search import SearchTask
from dynx.ik.step import TRACKING, TargetKind, tracking_settings
from dynx.model.targets import Targets
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats
from dynx.time_limit import not_counted

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance


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


class Follower(Protocol):
    """Solver of targets, one after the other or each on its own.

    Both methods end after fewer targets, at least one, when the time of the search is over.
    """

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
        found: list[Descended] = []
        time_limit = self._requirement.tolerances.time_limit
        for position, rotation in targets.rows(targets.batch):
            sample = self._solve(q, self._task(position, rotation), bounds, abandons=False)
            found.append(sample)
            q = sample.q
            if (stop and not sample.reached) or time_limit.is_over():
                break
        return _followed(found, len(q))

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        found: list[Descended] = []
        for q, (p, R) in zip(starts, targets.rows(targets.batch), strict=True):
            found.append(self._solve(q, self._task(p, R), bounds, abandons=True))
            if self._requirement.tolerances.time_limit.is_over():
                break
        return _followed(found, starts.shape[-1])

    def _task(self, position: Floats | None, rotation: Floats | None) -> SearchTask:
        return self._requirement.task(self._backend, self._coordinates, position, rotation)

    def _solve(self, q: Floats, task: SearchTask, bounds: StepBounds, *, abandons: bool) -> Descended:
        coordinates, limits = self._coordinates, self._requirement.tolerances
        if not coordinates.count:
            error = task.error(q)
            return Descended(q, error.position, error.rotation, error.reached, 0)
        lower, upper = bounds.around(np.array(coordinates.values(q)))
        settings = tracking_settings(limits, abandons=abandons)
        found = task.descend(TRACKING, q, settings, (lower.tolist(), upper.tolist()))
        if coordinates.balls:
            turned = np.abs(coordinates.rotations(q, found.q))
            first = 6 if coordinates.floating else 0
            if (turned > bounds.reach[first : first + len(turned)]).any():
                # The bounds hold for each step of a descent, not for all of them together.
                error = task.error(q)
                return Descended(q, error.position, error.rotation, False, found.steps)
        return found


def _followed(found: list[Descended], nq: int) -> Followed:
    return Followed(
        np.array([sample.q for sample in found]).reshape(len(found), nq),
        np.array([sample.distance for sample in found]),
        np.array([sample.angle for sample in found]),
        np.array([sample.reached for sample in found], dtype=np.bool_),
        np.array([sample.steps for sample in found], dtype=np.int64),
    )


class KernelFollower:
    """`Follower` by a kernel; safe to use from several threads."""

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
        rows = np.empty((targets.batch[0] + 1, n + TRACKING.results))
        rows[0, :n] = q[self._coordinates.indices]
        # The results of a sample are the start of the next.
        x, results, completed = rows[:-1, :n], rows[1:], 0
        for part in self._limits.time_limit.pieces(len(results)):
            done = self._run(x[part], targets[part], results[part], bounds, stop=stop, abandons=False)
            completed = part.start + done
            if completed < part.stop or (stop and not results[completed - 1, n + 2]):
                break
        return self._followed(q, results[:completed])

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend to each target from its own start."""
        x = np.ascontiguousarray(starts[:, self._coordinates.indices])
        rows = np.empty((len(x), self._coordinates.count + TRACKING.results))
        self._run(x, targets, rows, bounds, stop=False, abandons=True)
        return self._followed(starts, rows)

    def _run(
        self, x: Floats, targets: Targets, rows: Floats, bounds: StepBounds, *, stop: bool, abandons: bool
    ) -> int:
        """Fill the results of tasks that start at x; return the number of completed ones."""
        memory = TRACKING.initial(x.shape[1])
        settings = tracking_settings(self._limits, stops=stop, abandons=abandons)
        parts = [np.array(settings), bounds.lower, bounds.upper, bounds.reach]
        if self._point is not None:
            parts.append(self._point)
        tasks = [
            x,
            np.broadcast_to(memory, (len(x), len(memory))),
            self._kind.rows(targets, targets.batch),
            x,
        ]
        return self._kernel.bind_race(tasks, rows, np.concatenate(parts), np.zeros((1, x.shape[1])))()

    def _followed(self, q: Floats, rows: Floats) -> Followed:
        n = self._coordinates.count
        found = np.array(np.broadcast_to(q, (len(rows), q.shape[-1])))
        found[:, self._coordinates.indices] = rows[:, :n]
        distance, angle, reached, steps = rows[:, n : n + 4].T
        return Followed(found, distance, angle, reached != 0.0, steps.astype(np.int64))


def path_follower(
    backend: Backend,
    coordinates: FrameCoordinates,
    frame: str,
    targets: Targets,
    point: Floats | None,
    limits: SearchLimits,
) -> KernelFollower | None:
    """Return a follower of targets of this kind; None for a floating base or ball joints, a frame that no
    joint or more than `MAX_COORDINATES` joints move, or a backend that compiles nothing."""
    if not backend.compiles or backend.model.quaternions or not 0 < coordinates.count <= MAX_COORDINATES:
        return None
    kind = TargetKind(targets.positions is not None, targets.rotations is not None, point is not None)

    def make() -> IterationKernel:
        with COMPILE_LOCK:
            alone = FrameCoordinates(backend.model, frame)
            return frame_kernel(tracking_iteration, backend.model, frame, alone, kind, lanes=1)

    return KernelFollower(backend.kept(("path", frame, kind), make), coordinates, kind, point, limits)


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
        time_limit = self._requirement.tolerances.time_limit
        while done < n:
            if pieces and time_limit.is_over():
                break
            part = targets[done : min(n, done + CHUNK)]
            found = self._base.follow(q, part, bounds, stop=True)
            clear = 0
            while clear < len(found) and found.reached[clear] and self._is_clear(found.q[clear]):
                clear += 1
                if time_limit.is_over():
                    break
            if clear:
                pieces.append(found.part(slice(clear)))
                q, done = found.q[clear - 1], done + clear
                if time_limit.is_over():
                    break
            if clear < part.batch[0]:
                # The other follower ends with a sample that it does not reach.
                sample = found.part(slice(clear, clear + 1))
                if sample.reached[0] or not self._is_clear(sample.q[0]):
                    sample = self._avoid(q, part[clear : clear + 1], bounds)
                pieces.append(sample)
                q, done = sample.q[0], done + 1
                if stop and not sample.reached[0]:
                    break
        return Followed.joined(pieces)

    def descend(self, starts: Floats, targets: Targets, bounds: StepBounds) -> Followed:
        """Descend from starts (n, nq); a solution that is too close to something does not count."""
        found = self._base.descend(starts, targets, bounds)
        is_over = self._requirement.tolerances.time_limit.is_over
        for k in np.flatnonzero(found.reached).tolist():
            # A solution that there is no time to examine does not count.
            found.reached[k] = not (k and is_over()) and self._is_clear(found.q[k])
        return found

    def _is_clear(self, q: Floats) -> bool:
        return self._avoidance.is_clear(self._backend, q, self._requirement.tolerances.time_limit)

    def _avoid(self, q: Floats, target: Targets, bounds: StepBounds) -> Followed:
        """Return the sample of a target (1,) that keeps the margins, or else stays clear, near q."""
        with not_counted():
            from dynx.ik.refine import AvoidingDescent

        coordinates = self._coordinates
        ((position, rotation),) = target.rows((1,))
        task = self._requirement.task(self._backend, coordinates, position, rotation)
        around = bounds.around(np.array(coordinates.values(q)))
        time_limit = self._requirement.tolerances.time_limit
        descent = AvoidingDescent(task, self._avoidance, self._backend, coordinates, around, time_limit)
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
