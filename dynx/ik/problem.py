"""A checked problem of inverse kinematics: what `inverse_kinematics` passes to a solver of many targets."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from dynx.ik.residual import Residual
from dynx.ik.result import IKResult
from dynx.ik.search import Kinematics, Search, SearchLimits
from dynx.ik.targets import Targets
from dynx.spatial.scalar import Floats


@dataclass(frozen=True, eq=False)
class Problem:
    """Targets of one frame, the starts, and the limits of the search, all checked."""

    frame: str
    targets: Targets
    point: Floats | None
    """Point (3,) of the frame that is placed, in its axes [m], or None for its origin."""
    q0: Floats
    """Configurations (..., nq) within limits."""
    begins_at_q0: bool
    """Whether the first start is q0, and not a start of the solver."""
    batch: tuple[int, ...]
    """Leading axes of targets and q0, broadcast."""
    limits: SearchLimits
    rng: np.random.Generator | int | None

    @property
    def count(self) -> int:
        """Number of samples."""
        return math.prod(self.batch)


def improved(result: IKResult, problem: Problem, kinematics: Kinematics) -> IKResult:
    """Return the result with every target that was not reached refined to a local minimum of its error."""
    search = Search(kinematics, problem.frame, problem.point, problem.limits)
    nq = result.q.shape[-1]
    q, success = result.q.reshape(-1, nq).copy(), result.success.reshape(-1).copy()
    columns = (result.position_error, result.rotation_error, result.iterations, result.restarts)
    distances, angles, iterations, restarts = (column.reshape(-1).copy() for column in columns)
    starts = np.broadcast_to(problem.q0, (*problem.batch, nq)).reshape(-1, nq)
    targets = list(problem.targets.rows(problem.batch))
    for k in np.flatnonzero(~success).tolist():
        position, rotation = targets[k]
        residual = Residual(position, rotation, problem.point)
        best = search.evaluate(q[k], residual)
        best.iterations, best.restarts = int(iterations[k]), int(restarts[k])
        found = search.improve(best, starts[k], residual)
        q[k], success[k] = found.q, found.success
        distances[k], angles[k], iterations[k] = found.position_error, found.rotation_error, found.iterations
    batch = problem.batch
    return IKResult(
        q.reshape(*batch, nq), *(x.reshape(batch) for x in (success, distances, angles, iterations, restarts))
    )
