"""Solutions that are chosen and improved by a secondary objective, sample by sample."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dynx.errors import NoClosedFormError
from dynx.ik.closed_form.checking import all_solutions
from dynx.ik.problem import Problem
from dynx.ik.result import IKResult
from dynx.ik.search import Search
from dynx.ik.secondary import Secondary, best_solution
from dynx.ik.targets import Targets
from dynx.ik.tasks import Kinematics
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

STARTS = 24
"""Most random starts from which solutions are sought."""

_COLUMNS = ("q", "position_error", "rotation_error", "iterations", "restarts")

Target = tuple[Floats | None, Floats | None]
"""Position (3,) and rotation (3, 3) of a target, or None for a part that is free."""

ProblemSolver = Callable[[Problem], "IKResult | None"]


def preferred_solutions(
    kinematics: Kinematics,
    problem: Problem,
    secondary: Secondary,
    first: IKResult,
    solve_all: ProblemSolver | None,
) -> IKResult:
    """Return the best solutions of the samples that the result `first` reaches; the others stay.

    Other solutions come from the closed form, if there is one, or from random starts: in a kernel by
    `solve_all`, otherwise one after the other.
    """
    coordinates, nq = problem.coordinates, kinematics.model.nq
    search, starts = Search(kinematics.model, coordinates, problem.limits), problem.starts()
    goals = None
    if secondary.nearest is not None:
        goals = np.broadcast_to(secondary.nearest, (*problem.batch, nq)).reshape(-1, nq)
    q = first.q.reshape(-1, nq).copy()
    columns = (first.position_error, first.rotation_error, first.iterations, first.restarts)
    distances, angles, iterations, restarts = (column.reshape(-1).copy() for column in columns)
    reached, count = first.success.reshape(-1), min(problem.limits.max_restarts, STARTS)
    samples = zip(problem.tasks(kinematics), problem.targets.rows(problem.batch), strict=True)
    for (k, task), target in samples:
        if not reached[k] or not coordinates.count:
            continue
        goal, rng = None if goals is None else goals[k], np.random.default_rng(problem.rng)
        begins = [q[k]] if goal is None else [coordinates.with_joints_of(starts[k], goal), q[k]]
        known = _from_closed_form(kinematics, problem, target, starts[k])
        if known is None and solve_all is not None:
            known = _from_kernel(problem, target, starts[k], rng, count, solve_all)
        if known is None:
            known = [coordinates.random(starts[k], rng) for _ in range(count)]
        begins += [coordinates.clipped(each) for each in known]
        best = best_solution(search, coordinates, task, begins, replace(secondary, nearest=goal))
        q[k], distances[k], angles[k] = best.q, best.position_error, best.rotation_error
        iterations[k] += best.iterations
        restarts[k] += best.restarts
    errors = (column.reshape(problem.batch) for column in (distances, angles, iterations, restarts))
    return replace(first, **dict(zip(_COLUMNS, (q.reshape(first.q.shape), *errors), strict=True)))


def _from_closed_form(
    kinematics: Kinematics, problem: Problem, target: Target, start: Floats
) -> list[Floats] | None:
    """Return all solutions of a target, or None if there is no closed form."""
    targets = problem.targets
    is_pose = targets.positions is not None and targets.rotations is not None
    if not problem.is_plain or not is_pose or problem.point is not None or problem.coordinates.count != 6:
        return None
    position, rotation = target
    assert position is not None
    assert rotation is not None
    limits = problem.limits
    tolerances = (limits.position_tolerance, limits.rotation_tolerance)
    try:
        found = all_solutions(
            kinematics, homogeneous(rotation, position), problem.frame, start, None, *tolerances
        )
    except NoClosedFormError:
        return None
    return list(found.q[found.success]) or None


def _from_kernel(
    problem: Problem,
    target: Target,
    start: Floats,
    rng: np.random.Generator,
    count: int,
    solve_all: ProblemSolver,
) -> list[Floats] | None:
    """Return solutions of a target from random starts, or None if no kernel applies."""
    if not problem.is_plain:
        return None
    q0 = np.array([problem.coordinates.random(start, rng) for _ in range(count)]).reshape(count, len(start))
    requirement = replace(problem.requirements[0], targets=Targets(*target))
    several = replace(
        problem,
        requirements=(requirement,),
        q0=q0,
        begins_at_q0=True,
        batch=(count,),
        limits=replace(problem.limits, max_restarts=0),
    )
    found = solve_all(several)
    return None if found is None else list(found.q[found.success])
