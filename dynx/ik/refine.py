"""Solutions that are chosen and improved by a secondary objective, such as being near to a configuration.

Of several solutions, of the closed form or from random starts, the best is chosen, and then improved within
the null space of the task (Siciliano et al., section 3.5.1): each step goes along the projected gradient,
returns to the target by Newton steps, and counts only if the target is still reached and the objective is
better. So the first objective never suffers.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dynx.backends.base import Backend
from dynx.errors import NoClosedFormError
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.kernels import kernel_applies, kernel_solution, nearest_solutions
from dynx.ik.problem import Objective, Problem, Secondary
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Search, SearchTask
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

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

Admissible = Callable[[Floats], bool]
"""Function of q (nq,) that tells whether it may be a solution."""


def best_solution(
    search: Search,
    coordinates: FrameCoordinates,
    task: SearchTask,
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
    task: SearchTask,
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
    coordinates: FrameCoordinates, task: SearchTask, q: Floats, objective: Objective
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


Target = tuple[Floats | None, Floats | None]
"""Position (3,) and rotation (3, 3) of a target, or None for a part that is free."""


def from_closed_form(
    backend: Backend, problem: Problem, target: Target, start: Floats
) -> list[Floats] | None:
    """Return all solutions of a target, or None if there is no closed form."""
    targets = problem.targets
    is_pose = targets.positions is not None and targets.rotations is not None
    if not problem.is_plain or not is_pose or problem.point is not None or problem.coordinates.count != 6:
        return None
    position, rotation = target
    assert position is not None
    assert rotation is not None
    from dynx.ik.closed_forms.solver import all_solutions

    limits = problem.limits
    tolerances = (limits.position_tolerance, limits.rotation_tolerance)
    try:
        found = all_solutions(
            backend, homogeneous(rotation, position), problem.frame, start, None, *tolerances
        )
    except NoClosedFormError:
        return None
    return list(found.q[found.success]) or None


def from_kernel(
    backend: Backend,
    problem: Problem,
    target: Target,
    start: Floats,
    rng: np.random.Generator,
    count: int,
    others: Sequence[Floats] = (),
) -> list[Floats] | None:
    """Return solutions of a target from random starts and `others`, or None if no kernel applies."""
    if not kernel_applies(backend, problem):
        return None
    draws = [problem.coordinates.random(start, rng) for _ in range(count)]
    q0 = np.array([*draws, *others]).reshape(-1, len(start))
    several = replace(one_target(problem, target, q0), limits=replace(problem.limits, max_restarts=0))
    found = kernel_solution(backend, several)
    return None if found is None else list(found.q[found.success])


def one_target(problem: Problem, target: Target, q0: Floats) -> Problem:
    """Return the problem of one target of a problem for one frame, from several starts (k, nq)."""
    requirement = replace(problem.requirements[0], targets=Targets(*target))
    return replace(problem, requirements=(requirement,), q0=q0, begins_at_q0=True, batch=(len(q0),))


STARTS = 24
"""Most random starts from which solutions are sought."""

_COLUMNS = ("q", "position_error", "rotation_error", "iterations", "restarts")


def preferred_solutions(
    backend: Backend,
    problem: Problem,
    secondary: Secondary,
    first: IKResult,
    is_admissible: Admissible | None = None,
) -> IKResult:
    """Return the best solutions of the samples that the result `first` reaches; the others stay.

    With `is_admissible` only configurations count for which it is True, as it is for those of `first`.

    Other solutions come from the closed form, if there is one, or from random starts: in a kernel, if one
    applies, otherwise one after the other.
    """
    coordinates, nq = problem.coordinates, backend.model.nq
    search, starts = Search(backend.model, coordinates, problem.limits), problem.starts()
    goals = None
    if secondary.nearest is not None:
        goals = np.broadcast_to(secondary.nearest, (*problem.batch, nq)).reshape(-1, nq)
    q = first.q.reshape(-1, nq).copy()
    columns = (first.position_error, first.rotation_error, first.iterations, first.restarts)
    distances, angles, iterations, restarts = (column.reshape(-1).copy() for column in columns)
    reached, count = first.success.reshape(-1), min(problem.limits.max_restarts, STARTS)
    samples = zip(problem.tasks(backend), problem.targets.rows(problem.batch), strict=True)
    for (k, task), target in samples:
        if not reached[k] or not coordinates.count:
            continue
        goal, rng = None if goals is None else goals[k], np.random.default_rng(problem.rng)
        begins = [q[k]] if goal is None else [coordinates.with_joints_of(starts[k], goal), q[k]]
        known = from_closed_form(backend, problem, target, starts[k])
        is_complete = known is not None
        if known is None:
            known = from_kernel(backend, problem, target, starts[k], rng, count, begins[:-1])
        if known is None:
            known = [coordinates.random(starts[k], rng) for _ in range(count)]
        begins += [coordinates.clipped(each) for each in known]
        of_sample = replace(secondary, nearest=goal)
        best = None
        # A kernel knows nothing of what is admissible.
        if is_admissible is None and not is_complete:
            best = _nearest(backend, problem, target, begins, starts[k], of_sample)
        if best is None:
            best = best_solution(search, coordinates, task, begins, of_sample, is_admissible)
        if best is None:
            # Rounding decides at the edge of a tolerance or of a margin: what was found stays.
            continue
        q[k], distances[k], angles[k] = best.q, best.position_error, best.rotation_error
        iterations[k] += best.iterations
        restarts[k] += best.restarts
    errors = (column.reshape(problem.batch) for column in (distances, angles, iterations, restarts))
    return replace(first, **dict(zip(_COLUMNS, (q.reshape(first.q.shape), *errors), strict=True)))


def _nearest(
    backend: Backend,
    problem: Problem,
    target: Target,
    begins: list[Floats],
    start: Floats,
    secondary: Secondary,
) -> Candidate | None:
    """Return the best solution from some that a kernel improves, or None if no kernel applies, or if the
    objective is no posture."""
    coordinates = problem.coordinates
    posture = None if coordinates.floating else secondary.posture(coordinates)
    if posture is None:
        return None
    found = nearest_solutions(backend, one_target(problem, target, np.array(begins)), posture)
    if found is None:
        return None
    objective, solutions = found
    best = int(np.argmin(np.where(solutions.success, objective, np.inf)))
    if not solutions.success[best]:
        return None
    # Joints that do not count stay near the start.
    shift_to = start.copy()
    counts = posture.weights > 0.0
    shift_to[np.array(coordinates.indices)[counts]] = posture.goal[counts]
    q = coordinates.nearest(solutions.q[best], shift_to)
    errors = float(solutions.position_error[best]), float(solutions.rotation_error[best])
    steps = int(solutions.iterations.sum())
    return Candidate(q, *errors, float(objective[best]), True, steps, len(begins) - 1)
