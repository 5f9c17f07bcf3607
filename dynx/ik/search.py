"""Descent from one start, and restarts from random configurations until the target is reached.

The descent is Levenberg-Marquardt with a damping proportional to the remaining squared error: robust far from
the target and quadratically convergent near it, whether or not the target can be reached and the Jacobian has
full rank (Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE Trans.
Robotics 27(5), 2011, eq. 13). Every step respects the limits and is accepted. A start is abandoned when the
squared error has not fallen enough over a few steps; this criterion is independent of scale and works at a
bound, at a singularity and in a local minimum alike. If no start reaches the target, the best configuration
is refined to a local minimum.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.levenberg_marquardt import BoundedStep
from dynx.ik.tasks import Task, TaskError
from dynx.model import Model
from dynx.spatial.scalar import Floats

# Chosen on UR5, Panda, iiwa and a Talos arm for the fewest evaluations; a factor of 3 in either
# direction, or a window of 2 to 6 steps, costs at most a third more.
DAMPING = 0.1
"""Damping per unit of squared error (half the squared norm of the residual)."""
MIN_DAMPING = 1e-9
"""Damping that keeps the system definite at a singular configuration on the target."""
WINDOW = 3
"""Number of steps over which progress is measured."""
REQUIRED_REDUCTION = 0.6
"""A start is abandoned unless the squared error falls below this fraction of itself over the window."""
MIN_RELATIVE_GAIN = 1e-12
"""Refinement of an unreached target ends when a step changes the squared error by a smaller fraction."""


@dataclass(frozen=True)
class SearchLimits:
    """Tolerances within which a target counts as reached, and limits on the number of steps and starts."""

    position_tolerance: float  # [m]
    rotation_tolerance: float  # [rad]
    max_iterations: int  # of each start
    max_restarts: int


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


class Search:
    """Search for configurations that reduce the error of a task to its tolerances."""

    def __init__(self, model: Model, coordinates: FrameCoordinates, limits: SearchLimits) -> None:
        self._model, self._limits, self._coordinates = model, limits, coordinates
        self._step = BoundedStep(coordinates.lower, coordinates.upper)

    def run(
        self, task: Task, q0: Floats, rng: np.random.Generator | int | None, *, begin_at_q0: bool
    ) -> Candidate:
        """Reach the target from q0 (nq,) within limits, or from a random start; return the best result."""
        if self._coordinates.count == 0:
            return self.evaluate(q0, task)
        start, best, iterations = q0, None, 0
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
            if best.success:
                return best
        assert best is not None
        return self.improve(best, q0, task)

    def improve(self, best: Candidate, q0: Floats, task: Task) -> Candidate:
        """Return the local minimum near the best configuration of all starts, or that if it is no better."""
        q, steps = self._refine(best.q, task)
        refined = self.evaluate(self._coordinates.nearest(q, q0), task)
        refined.iterations, refined.restarts = best.iterations + steps, best.restarts
        if refined.success or refined.squared_error <= best.squared_error:
            return refined
        best.iterations = refined.iterations
        return best

    def within_limits(self, q: Floats, q0: Floats) -> Floats:
        """Return q with angles shifted by full turns to be near q0, then clipped to the limits."""
        return self._coordinates.clipped(self._model.clip(self._coordinates.nearest(q, q0)))

    def evaluate(self, q: Floats, task: Task) -> Candidate:
        """Measure the errors at q by forward kinematics."""
        error = task.error(q)
        return Candidate(q, error.position, error.rotation, _half_square(error.vector), error.reached)

    def descend(self, q: Floats, task: Task) -> tuple[Floats, int]:
        """Descend from one start; return (the best configuration found, the number of steps)."""
        error_at, jacobian_at = task.error, task.jacobian
        coordinates, max_iterations = self._coordinates, self._limits.max_iterations
        best, least = q, float("inf")
        recent: deque[float] = deque(maxlen=WINDOW)
        for steps in range(max_iterations + 1):
            error = error_at(q)
            if error.reached:
                return q, steps
            vector = error.vector
            squared_error = 0.5 * sum([x * x for x in vector])
            if squared_error < least:
                best, least = q, squared_error
            stagnant = len(recent) == WINDOW and squared_error > REQUIRED_REDUCTION * recent[0]
            if stagnant or steps == max_iterations:
                break
            recent.append(squared_error)
            damping = DAMPING * squared_error + MIN_DAMPING
            y = self._step(jacobian_at(q, error), vector, coordinates.values(q), damping)
            q = coordinates.with_values(q, y)
        return best, steps

    def _refine(self, q: Floats, task: Task) -> tuple[Floats, int]:
        """Descend to a local minimum near q; return (the best configuration, the number of steps).

        Where the error stays large the full step overshoots, so a step that does not reduce the error is
        rejected and the damping raised (Marquardt 1963).
        """
        error = task.error(q)
        squared_error, factor, steps = _half_square(error.vector), DAMPING, 0
        while steps < self._limits.max_iterations:
            steps += 1
            trial = self._step_from(q, task, error, factor * squared_error + MIN_DAMPING)
            trial_error = task.error(trial)
            trial_square = _half_square(trial_error.vector)
            gain = squared_error - trial_square
            if gain > 0.0:
                q, error, squared_error = trial, trial_error, trial_square
                factor *= 0.3
            else:
                factor *= 4.0
            if abs(gain) <= MIN_RELATIVE_GAIN * squared_error:
                break
        return q, steps

    def _step_from(self, q: Floats, task: Task, error: TaskError, damping: float) -> Floats:
        """Return the configuration after one step from q."""
        coordinates = self._coordinates
        y = self._step(task.jacobian(q, error), error.vector, coordinates.values(q), damping)
        return coordinates.with_values(q, y)


def _half_square(residual: tuple[float, ...]) -> float:
    return 0.5 * sum([x * x for x in residual])
