"""Solutions that are chosen and improved by a secondary objective, sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dynx.backends.base import Backend
from dynx.ik.kernels.kernels import nearest_solutions
from dynx.ik.other_solutions import Target, from_closed_form, from_kernel, one_target
from dynx.ik.problem import Problem
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Search
from dynx.ik.secondary import Admissible, Secondary, best_solution
from dynx.spatial.scalar import Floats

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
