"""Solver of inverse kinematics for one frame of one robot, by a compiled kernel.

A batch is solved with one target in each lane of the processor's vectors; a lane takes the next target when
its own is solved. For a single target the lanes try different starts at once. In both cases the result is
that of the first start, in order, that reaches the target: it does not depend on the other targets, the
number of threads or the number of lanes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dynx.compiled.ik.pose_call import PoseCall
from dynx.compiled.ik.race import Race
from dynx.compiled.ik.starts import Starts, StartTable
from dynx.compiled.ik.step import SETTINGS, Memory, TargetKind
from dynx.ik import (
    IKResult,
    Kinematics,
    Problem,
    Requirement,
    SearchLimits,
    checked_targets,
    improved,
    proofs,
)
from dynx.ik.coordinates import FrameCoordinates
from dynx.model import Model
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats

MAX_RESTARTS = 10_000
"""Most restarts for which a table of starts is made."""


class FrameSolver:
    """Solver for targets of one frame that are of one kind. Safe to use from several threads."""

    def __init__(
        self,
        kernel: IterationKernel,
        coordinates: FrameCoordinates,
        kind: TargetKind,
        table: StartTable | None,
        threads: int,
    ) -> None:
        self._kernel, self._coordinates, self._kind, self._threads = kernel, coordinates, kind, threads
        self._memory, self._table = Memory(coordinates.count), table
        self._seeded: tuple[object, Starts | None] = (None, None)
        # Workspaces of single targets that no call uses at the moment.
        self._free: list[Race] = []

    def solve(self, problem: Problem, kinematics: Kinematics) -> IKResult:
        """Solve all samples; `kinematics` improve what is best where a target is not reached."""
        starts = self._starts(problem)
        rows = self._race(problem, starts) if problem.count == 1 else self._batch(problem, starts)
        n, batch = self._coordinates.count, problem.batch
        q = np.array(np.broadcast_to(problem.q0, (*batch, problem.q0.shape[-1])))
        q[..., self._coordinates.indices] = rows[:, :n].reshape(*batch, n)
        columns = rows[:, n : n + 5].T.reshape(5, *batch)
        errors, counts = columns[:2].copy(), columns[3:].astype(np.int64)
        success = columns[2] != 0.0
        result = IKResult(
            q, np.asarray(success), errors[0, ...], errors[1, ...], counts[0, ...], counts[1, ...]
        )
        if result:
            return result
        better = improved(result, problem, kinematics)
        proof = proofs(problem, kinematics.model, ~better.success.reshape(-1))
        return replace(better, proof=proof.reshape(batch))

    def pose_call(self, model: Model, limits: SearchLimits, rng: int) -> PoseCall:
        """Return a function of single poses with these options."""
        pose = Requirement("", checked_targets(np.eye(4)), None, None, limits)
        q0 = self._coordinates.initial()
        problem = Problem((pose,), self._coordinates, None, q0, False, (), limits, rng)
        return PoseCall(self._kernel, self._memory, self._starts(problem), problem, model)

    def _batch(self, problem: Problem, starts: Starts) -> Floats:
        """Return the memory's results (n, n_results) of all samples."""
        n, size = problem.count, self._coordinates.count
        near = problem.q0[..., self._coordinates.indices]
        near = np.broadcast_to(near, (*problem.batch, size)).reshape(n, size)
        cell = starts.first_rows(problem)
        first = near if problem.begins_at_q0 else starts.rows[cell + starts.offset]
        memory = np.broadcast_to(self._memory.initial, (n, len(self._memory.initial)))
        target = self._kind.rows(problem)
        tasks = [first, memory, target, near, cell[:, None].astype(np.float64)]
        if problem.point is not None:
            tasks.append(np.broadcast_to(problem.point, (n, 3)))
        rows = np.empty((n, self._memory.n_results))
        limits = problem.limits
        settings = [float(getattr(limits, name)) for name in SETTINGS]
        constants = np.concatenate([settings, starts.constants])
        self._kernel(tasks, rows, constants, starts.rows, threads=self._threads)
        return rows

    def _race(self, problem: Problem, starts: Starts) -> Floats:
        """Return the memory's results (1, n_results) of the only sample."""
        try:
            race = self._free.pop()
        except IndexError:
            race = None
        if race is None or race.starts is not starts:
            race = Race(self._kernel, self._kind, self._memory, starts)
        found = race.solve(problem, self._coordinates.indices)
        self._free.append(race)
        return found

    def _starts(self, problem: Problem) -> Starts:
        """Return the starts of all targets."""
        rng, count = problem.rng, problem.limits.max_restarts + 1
        if not isinstance(rng, int):
            return Starts.of(self._coordinates, self._table, np.random.default_rng(rng), count)
        key, starts = self._seeded
        if starts is None or key != (rng, count):
            starts = Starts.of(self._coordinates, self._table, np.random.default_rng(rng), count)
            self._seeded = (rng, count), starts
        return starts
