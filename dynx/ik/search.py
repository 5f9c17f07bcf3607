"""Errors of frames as tasks, and the search for a configuration from one start after the other.

A start is abandoned when the error falls too slowly (`dynx.ik.step`); the search then restarts at a random
configuration. If no start reaches the target, the best configuration is refined to a local minimum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.descent import (
    MAX_COORDINATES,
    Descended,
    ErrorCall,
    KernelTarget,
    descend_by_kernel,
    descend_on_floats,
)
from dynx.ik.options import SearchLimits
from dynx.ik.step import REFINEMENT, SEARCH, Descent, FrameError
from dynx.model.model import Model
from dynx.spatial.scalar import Floats
from dynx.time_limit import UNLIMITED, TimeLimit


class TaskError(NamedTuple):
    """Error of a task at one configuration."""

    vector: Sequence[float]
    """Weighted error (m,)."""
    position: float
    """Position error [m], the largest of several frames."""
    rotation: float
    """Rotation error [rad], the largest of several frames."""
    reached: bool
    rows: Any
    """How the Jacobian rows of the error follow from those of the frame."""


Bounds = tuple[Sequence[float], Sequence[float]]
"""Lower and upper bounds (n,) of the coordinates."""


class SearchTask(Protocol):
    """Errors to reduce."""

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian (m, n) of the error at q, with the sign of a velocity of the frame."""

    def descend(self, descent: Descent, q: Floats, settings: Sequence[float], bounds: Bounds) -> Descended:
        """Descend from q (nq,) within bounds on the coordinates."""


class FrameTask:
    """Pose, position or rotation of one frame, also with requirements per axis."""

    __slots__ = (
        "_backend", "_coordinates", "_error", "_frame", "_part", "_point", "_target", "_time_limit"
    )  # fmt: skip

    def __init__(
        self,
        backend: Backend,
        frame: str,
        point: Floats | None,
        coordinates: FrameCoordinates,
        tolerances: SearchLimits,
        target: KernelTarget,
    ) -> None:
        """`target` is one target of the frame, or of a point (3,) in its axes."""
        self._backend, self._frame, self._point, self._coordinates = backend, frame, point, coordinates
        self._time_limit = tolerances.time_limit
        self._target, kind = target, target.kind
        self._error = ErrorCall(target, (tolerances.position_tolerance, tolerances.rotation_tolerance))
        rows = slice(0 if kind.position else 3, 6 if kind.rotation else 3)
        self._part = (rows if kind.axes is None else slice(None), coordinates.columns)

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""
        return TaskError(*self._error(self._backend.forward_kinematics(q, self._frame)))

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian rows at q, weighted and along the axes if there are requirements on these."""
        part: Floats = self._backend.jacobian(q, self._frame, point=self._point)[self._part]
        return part if error.rows is None else np.asarray(error.rows @ part)

    def descend(self, descent: Descent, q: Floats, settings: Sequence[float], bounds: Bounds) -> Descended:
        """Descend from q (nq,) within bounds on the coordinates."""
        coordinates, frame, limit = self._coordinates, self._frame, self._time_limit
        if coordinates.count > MAX_COORDINATES:
            return descend_on_floats(descent, self._measured, coordinates, q, settings, bounds, limit)
        return descend_by_kernel(
            descent, self._target, self._backend, frame, coordinates, q, settings, bounds, limit
        )

    def _measured(self, q: Floats) -> tuple[FrameError, Floats]:
        return _measured(self, q)


class SeveralTasks:
    """Errors of several frames at once, one below the other."""

    def __init__(
        self, tasks: list[FrameTask], coordinates: FrameCoordinates, time_limit: TimeLimit = UNLIMITED
    ) -> None:
        self._tasks, self._coordinates, self._time_limit = tasks, coordinates, time_limit

    def error(self, q: Floats) -> TaskError:
        """Return the errors at q (nq,), and the largest of each kind."""
        errors = [task.error(q) for task in self._tasks]
        return TaskError(
            [value for error in errors for value in error.vector],
            max(error.position for error in errors),
            max(error.rotation for error in errors),
            all(error.reached for error in errors),
            errors,
        )

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobians at q, one below the other."""
        parts = [task.jacobian(q, part) for task, part in zip(self._tasks, error.rows, strict=True)]
        return np.concatenate(parts)

    def descend(self, descent: Descent, q: Floats, settings: Sequence[float], bounds: Bounds) -> Descended:
        """Descend from q (nq,) within bounds on the coordinates."""
        return descend_on_floats(
            *(descent, lambda q: _measured(self, q), self._coordinates, q, settings, bounds),
            self._time_limit,
        )


def _measured(task: SearchTask, q: Floats) -> tuple[FrameError, Floats]:
    """Return the error of a task, whose tolerances decided whether it is reached, and its Jacobian."""
    error = task.error(q)
    within = float(error.reached)
    found = FrameError(np.array(error.vector), error.position, error.rotation, within, False, False)
    return found, task.jacobian(q, error)


@dataclass
class Candidate:
    """A configuration and its errors with respect to the target."""

    q: Floats
    position_error: float
    rotation_error: float
    squared_error: float
    success: bool
    iterations: int = 0
    restarts: int = 0
    timed_out: bool = False
    """Whether the time was over before the search was complete."""
    by_frame: Sequence[tuple[float, float]] = ()
    """Errors of each frame, if there are several."""

    @classmethod
    def not_begun(cls, q: Floats, frames: int) -> Candidate:
        """Make the candidate of a target for which no time was left, at its start: no error is known."""
        by_frame = [(math.nan, math.nan)] * frames if frames > 1 else ()
        return cls(q, math.nan, math.nan, math.inf, False, timed_out=True, by_frame=by_frame)


class Search:
    """Search for configurations that reduce the error of a task to its tolerances."""

    def __init__(self, model: Model, coordinates: FrameCoordinates, limits: SearchLimits) -> None:
        self._model, self._limits, self._coordinates = model, limits, coordinates
        self._settings = (
            limits.position_tolerance, limits.rotation_tolerance, limits.max_iterations, 0.0
        )  # fmt: skip
        self._bounds = (coordinates.lower, coordinates.upper)

    def run(
        self, task: SearchTask, q0: Floats, rng: np.random.Generator | int | None, *, begin_at_q0: bool
    ) -> Candidate:
        """Reach the target from q0 (nq,) within limits, or from a random start; return the best result."""
        if self._coordinates.count == 0:
            return self.evaluate(q0, task)
        start, best, iterations, time_limit = q0, None, 0, self._limits.time_limit
        for restarts in range(self._limits.max_restarts + 1):
            if restarts or not begin_at_q0:
                # Created when first needed, since that takes longer than a step.
                rng = np.random.default_rng(rng)
                start = self._coordinates.random(q0, rng)
            q, steps = self.descend(start, task)
            iterations += steps
            found = self.evaluate(self._coordinates.nearest(q, q0), task)
            if best is None or found.squared_error < best.squared_error or found.success:
                best = found
            best.iterations, best.restarts = iterations, restarts
            best.timed_out = not best.success and time_limit.is_over()
            if best.success or best.timed_out:
                return best
        assert best is not None
        return self.improve(best, q0, task)

    def improve(self, best: Candidate, q0: Floats, task: SearchTask) -> Candidate:
        """Return the local minimum near the best configuration of all starts, or that if it is no better."""
        found = task.descend(REFINEMENT, best.q, self._settings, self._bounds)
        q, steps = found.q, found.steps
        refined = self.evaluate(self._coordinates.nearest(q, q0), task)
        refined.iterations, refined.restarts = best.iterations + steps, best.restarts
        best.timed_out = refined.timed_out = not refined.success and self._limits.time_limit.is_over()
        if refined.success or refined.squared_error <= best.squared_error:
            return refined
        best.iterations = refined.iterations
        return best

    def within_limits(self, q: Floats, q0: Floats) -> Floats:
        """Return q with angles shifted by full turns to be near q0, then clipped to the limits."""
        return self._coordinates.clipped(self._model.clip(self._coordinates.nearest(q, q0)))

    def evaluate(self, q: Floats, task: SearchTask) -> Candidate:
        """Measure the errors at q by forward kinematics."""
        error = task.error(q)
        found = Candidate(q, error.position, error.rotation, _half_square(error.vector), error.reached)
        if isinstance(task, SeveralTasks):
            found.by_frame = [(part.position, part.rotation) for part in error.rows]
        return found

    def descend(self, q: Floats, task: SearchTask) -> tuple[Floats, int]:
        """Descend from one start; return (the best configuration found, the number of steps)."""
        found = task.descend(SEARCH, q, self._settings, self._bounds)
        return found.q, found.steps


def _half_square(vector: Sequence[float]) -> float:
    return 0.5 * sum([x * x for x in vector])
