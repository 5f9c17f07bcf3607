"""Secondary objectives: being near to a configuration, manipulability, distance to the limits.

Of several solutions the best is chosen, and then improved within the null space of the task (Siciliano et
al., section 3.5.1): each step goes along the projected gradient, returns to the target by Newton steps, and
counts only if the target is still reached and the objective is better. So the first objective never suffers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.search import Candidate, Search
from dynx.ik.tasks import Task
from dynx.spatial.scalar import Floats

MAXIMA = ("manipulability", "limit_distance")
"""Values of the option `maximize`."""

MAX_STEPS = 60
"""Most steps in the null space."""

MAX_IMPROVED = 3
"""Most solutions that are improved: the best one may lead to a poor local optimum."""

_LEAST_STEP = 1e-7
"""Length of a step [rad or m] below which the objective counts as stationary."""

_FIRST_STEP, _GREATEST_STEP = 0.1, 0.5
"""Lengths of steps [rad or m]."""

_DIFFERENCE = 1e-5
"""Half the distance [rad or m] of central differences of the objective."""

_RANK = 1e-6
"""Singular values below this fraction of the largest count as zero."""

Objective = Callable[[Floats], float]
"""Function of q (nq,) that is to become small."""

Admissible = Callable[[Floats], bool]
"""Function of q (nq,) that tells whether it may be a solution."""


@dataclass(frozen=True, eq=False)
class Posture:
    """An objective that is a sum of squares: weights (n,) times squared distances of joints from a goal (n,)
    [rad or m]."""

    goal: Floats
    weights: Floats

    @property
    def inverse(self) -> Floats:
        """Inverse weights (n,), of mean 1; those of joints that do not count are 1."""
        found = np.where(self.weights > 0.0, 1.0 / np.where(self.weights > 0.0, self.weights, 1.0), 1.0)
        return np.asarray(found / found.mean())


@dataclass(frozen=True, eq=False)
class Secondary:
    """What a solution is chosen by."""

    nearest: Floats | None
    """Configurations (..., nq) to which solutions are to be near, or None."""
    maximize: str | None
    """One of `MAXIMA`, or None."""

    def posture(self, coordinates: FrameCoordinates) -> Posture | None:
        """Return the posture of one sample, or None if the objective is no sum of squared distances."""
        if self.nearest is not None:
            goal = coordinates.joint_values(self.nearest)
            return Posture(goal, np.ones(len(goal)))
        if self.maximize == "manipulability":
            return None
        low, high = coordinates.joint_limits
        bounded = np.isfinite(low) & np.isfinite(high)
        middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
        half = np.where(bounded, 0.5 * (np.where(bounded, high, 0.0) - np.where(bounded, low, 0.0)), np.inf)
        return Posture(middle, np.where(bounded, 1.0 / np.maximum(half, 1e-12) ** 2, 0.0))

    def objective(self, coordinates: FrameCoordinates, task: Task) -> Objective:
        """Return the objective of one sample."""
        posture = self.posture(coordinates)
        if posture is None:
            return lambda q: -_log_manipulability(task, q)
        goal, weights = posture.goal, posture.weights
        return lambda q: float(weights @ (coordinates.joint_values(q) - goal) ** 2)


def _log_manipulability(task: Task, q: Floats) -> float:
    """Return the logarithm of Yoshikawa's measure sqrt(det(J J')) of the task at q."""
    values = np.linalg.svd(task.jacobian(q, task.error(q)), compute_uv=False)
    return float(np.log(np.maximum(values, 1e-12)).sum())


def best_solution(
    search: Search,
    coordinates: FrameCoordinates,
    task: Task,
    starts: list[Floats],
    secondary: Secondary,
    is_admissible: Admissible | None = None,
) -> Candidate | None:
    """Return the best solution from starts (nq,), improved, or None if none of them reaches the target and is
    admissible."""
    admits = is_admissible or (lambda q: True)
    objective = secondary.objective(coordinates, task)
    shift_to = starts[0] if secondary.nearest is None else secondary.nearest
    solutions: list[tuple[float, Candidate]] = []
    iterations = 0
    for start in starts:
        q, steps = search.descend(start, task)
        iterations += steps
        found = search.evaluate(coordinates.nearest(q, shift_to), task)
        if found.success and admits(found.q):
            solutions.append((objective(found.q), found))
    solutions.sort(key=lambda each: each[0])
    improved: list[tuple[float, Candidate]] = []
    for value, begin in solutions[:MAX_IMPROVED]:
        found, steps, reached = _improved(search, coordinates, task, begin, value, objective, admits)
        iterations += steps
        improved.append((reached, found))
    if not improved:
        return None
    best = min(improved, key=lambda each: each[0])[1]
    best.iterations, best.restarts = iterations, len(starts) - 1
    return best


def _improved(
    search: Search,
    coordinates: FrameCoordinates,
    task: Task,
    begin: Candidate,
    value: float,
    objective: Objective,
    admits: Admissible,
) -> tuple[Candidate, int, float]:
    """Return the solution after steps in the null space that lower the objective from `value`, the number of
    steps, and the objective."""
    best, length, steps = begin, _FIRST_STEP, 0
    direction: Floats | None = None
    while steps < MAX_STEPS and length > _LEAST_STEP:
        steps += 1
        if direction is None:
            direction = _descent_direction(coordinates, task, best.q, objective)
            if direction is None:
                break
        x = np.array(coordinates.values(best.q)) + length * direction
        moved = np.clip(x, coordinates.lower, coordinates.upper).tolist()
        q, _ = search.descend(coordinates.with_values(best.q, moved), task)
        trial = search.evaluate(coordinates.nearest(q, best.q), task)
        lower = objective(trial.q) if trial.success else np.inf
        if lower < value and admits(trial.q):
            best, value, direction = trial, lower, None
            length = min(1.6 * length, _GREATEST_STEP)
        else:
            length *= 0.4
    return best, steps, value


def _descent_direction(
    coordinates: FrameCoordinates, task: Task, q: Floats, objective: Objective
) -> Floats | None:
    """Return the unit direction (n,) of steepest descent among those that keep the task; None if there is
    none."""
    x = np.array(coordinates.values(q))
    lower, upper = np.array(coordinates.lower), np.array(coordinates.upper)
    J = task.jacobian(q, task.error(q))
    free = np.ones(len(x), dtype=bool)
    for _ in range(len(x)):
        _, s, V_T = np.linalg.svd(J * free)
        rank = int((s > _RANK * max(float(s[0]), 1e-300)).sum()) if len(s) else 0
        null = V_T[rank:] * free
        null = null[np.abs(null).max(axis=1) > _RANK]
        if not len(null):
            return None
        slopes = [
            objective(coordinates.with_values(q, (x + h * row).tolist()))
            for row in null
            for h in (_DIFFERENCE, -_DIFFERENCE)
        ]
        gradient = (np.array(slopes[::2]) - np.array(slopes[1::2])) / (2.0 * _DIFFERENCE)
        direction = -gradient @ null
        length = float(np.linalg.norm(direction))
        if length < 1e-9:
            return None
        direction /= length
        # A coordinate at a limit does not move beyond it.
        blocked = free & (((x <= lower) & (direction < 0.0)) | ((x >= upper) & (direction > 0.0)))
        if not blocked.any():
            return np.asarray(direction)
        free &= ~blocked
    return None
