"""Solutions of a target beside the one that the search found: from the closed form, or from random starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dynx.backends.base import Backend
from dynx.errors import NoClosedFormError
from dynx.ik.kernels.kernels import kernel_applies, kernel_solution
from dynx.ik.problem import Problem
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

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
    from dynx.ik.closed_forms.checking import all_solutions

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
