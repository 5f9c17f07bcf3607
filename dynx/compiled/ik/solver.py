"""Solver of inverse kinematics for one frame of one robot, by a compiled kernel.

A batch is solved with one target in each lane of the processor's vectors; a lane takes the next target when
its own is solved. For a single target the lanes try different starts at once. In both cases the result is
that of the first start, in order, that reaches the target: it does not depend on the other targets, the
number of threads or the number of lanes.
"""

from __future__ import annotations

import numpy as np

from dynx.compiled.ik.step import SETTINGS, Memory, TargetKind
from dynx.ik import IKResult, Kinematics, Problem, improved
from dynx.ik.coordinates import FrameCoordinates
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats

MAX_RESTARTS = 10_000
"""Most restarts for which a table of starts is made."""


class FrameSolver:
    """Solver for targets of one frame that are of one kind. Safe to use from several threads."""

    def __init__(
        self, kernel: IterationKernel, coordinates: FrameCoordinates, kind: TargetKind, threads: int
    ) -> None:
        self._kernel, self._coordinates, self._kind, self._threads = kernel, coordinates, kind, threads
        self._memory = Memory(coordinates.count)
        self._seeded: tuple[object, Floats] = (None, np.empty(0))
        # Workspaces of single targets that no call uses at the moment.
        self._free: list[_Race] = []

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
        return result if result else improved(result, problem, kinematics)

    def _batch(self, problem: Problem, starts: Floats) -> Floats:
        """Return the memory's results (n, n_results) of all samples."""
        n, size = problem.count, self._coordinates.count
        near = problem.q0[..., self._coordinates.indices]
        near = np.broadcast_to(near, (*problem.batch, size)).reshape(n, size)
        first = near if problem.begins_at_q0 else np.broadcast_to(starts[0], near.shape)
        memory = np.broadcast_to(self._memory.initial, (n, len(self._memory.initial)))
        target = self._kind.rows(problem)
        tasks = [first, memory, target, near]
        if problem.point is not None:
            tasks.append(np.broadcast_to(problem.point, (n, 3)))
        rows = np.empty((n, self._memory.n_results))
        limits = problem.limits
        settings = np.array([getattr(limits, name) for name in SETTINGS], dtype=np.float64)
        self._kernel(tasks, rows, settings, starts, threads=self._threads)
        return rows

    def _race(self, problem: Problem, starts: Floats) -> Floats:
        """Return the memory's results (1, n_results) of the only sample."""
        try:
            race = self._free.pop()
        except IndexError:
            race = None
        if race is None or race.starts is not starts:
            race = _Race(self._kernel, self._kind, self._memory, starts)
        found = race.solve(problem, self._coordinates.indices)
        self._free.append(race)
        return found

    def _starts(self, problem: Problem) -> Floats:
        """Return the table of starts (max_restarts + 1, n)."""
        rng, count = problem.rng, problem.limits.max_restarts + 1
        if not isinstance(rng, int):
            return self._coordinates.starts(np.random.default_rng(rng), count)
        key, starts = self._seeded
        if key != (rng, count):
            starts = self._coordinates.starts(np.random.default_rng(rng), count)
            self._seeded = (rng, count), starts
        return starts


class _Race:
    """Workspace for one target at a time, whose tasks are the starts; not safe for several threads."""

    def __init__(self, kernel: IterationKernel, kind: TargetKind, memory: Memory, starts: Floats) -> None:
        count, n = starts.shape
        self.starts = starts
        self._n, self._kind = n, kind
        self._x = starts.copy()
        self._target, self._near, self._point = np.zeros(kind.size), np.zeros(n), np.zeros(3)
        self._settings = np.zeros(len(SETTINGS))
        self._result = np.zeros((count, memory.n_results))
        shared = [memory.initial, self._target, self._near] + [self._point] * kind.point
        tasks = [self._x, *(np.broadcast_to(row, (count, len(row))) for row in shared)]
        self._run = kernel.bind_race(tasks, self._result, self._settings, starts)

    def solve(self, problem: Problem, indices: list[int]) -> Floats:
        """Return the memory's results (1, n_results) of the first start that reaches the target, or of the
        best one, with the iterations and restarts of all starts up to it."""
        limits, n = problem.limits, self._n
        q0 = problem.q0.reshape(-1)
        self._near[:] = q0[indices]
        self._x[0] = self._near if problem.begins_at_q0 else self.starts[0]
        self._target[:] = self._kind.rows(problem)[0]
        if problem.point is not None:
            self._point[:] = problem.point
        # A task that is a start does not restart.
        self._settings[:3] = limits.position_tolerance, limits.rotation_tolerance, limits.max_iterations
        completed = self._run()
        last, done = completed - 1, self._result[:completed]
        if not done[last, n + 2]:
            last = int(np.argmin(done[:, -1]))
        found: Floats = done[last : last + 1].copy()
        found[0, n + 3], found[0, n + 4] = done[:, n + 3].sum(), completed - 1
        return found
