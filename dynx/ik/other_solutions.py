"""Solutions of a target beside the one that the search found: from the closed form, or from random starts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from dynx.errors import NoClosedFormError
from dynx.ik.closed_form.checking import all_solutions
from dynx.ik.problem import Problem
from dynx.ik.result import IKResult
from dynx.ik.targets import Targets
from dynx.ik.tasks import Kinematics
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

Target = tuple[Floats | None, Floats | None]
"""Position (3,) and rotation (3, 3) of a target, or None for a part that is free."""

ProblemSolver = Callable[[Problem], "IKResult | None"]
"""Method ``solve_inverse_kinematics`` of kinematics that solve many targets at once; it returns None for a
problem that it does not apply to."""


def from_closed_form(
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


def from_kernel(
    problem: Problem,
    target: Target,
    start: Floats,
    rng: np.random.Generator,
    count: int,
    solve_all: ProblemSolver,
    others: Sequence[Floats] = (),
) -> list[Floats] | None:
    """Return solutions of a target from random starts and `others`, or None if no kernel applies."""
    if len(problem.requirements) > 1:
        return None
    draws = [problem.coordinates.random(start, rng) for _ in range(count)]
    q0 = np.array([*draws, *others]).reshape(-1, len(start))
    several = replace(one_target(problem, target, q0), limits=replace(problem.limits, max_restarts=0))
    found = solve_all(several)
    return None if found is None else list(found.q[found.success])


def one_target(problem: Problem, target: Target, q0: Floats) -> Problem:
    """Return the problem of one target of a problem for one frame, from several starts (k, nq)."""
    requirement = replace(problem.requirements[0], targets=Targets(*target))
    return replace(problem, requirements=(requirement,), q0=q0, begins_at_q0=True, batch=(len(q0),))
