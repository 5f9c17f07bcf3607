"""Descent to one target after the other, each from the solution before, within bounds on every change.

Levenberg-Marquardt within bounds (`dynx.ik.levenberg_marquardt`). The first steps have the damping of the
search (Sugihara 2011), which is quadratically convergent near a target; a step that increases the error is
rejected and the damping raised (Marquardt 1963), so that the descent also ends in a local minimum of a target
that cannot be reached.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.levenberg_marquardt import BoundedStep
from dynx.ik.problem import Requirement
from dynx.ik.search import DAMPING, MIN_DAMPING, REQUIRED_REDUCTION, WINDOW
from dynx.ik.tasks import Task, TaskError
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats

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
