"""Single targets: the lanes of the processor's vectors try several starts of one target at once."""

from __future__ import annotations

import numpy as np

from dynx.ik.kernels.starts import Starts
from dynx.ik.kernels.step import SETTINGS, Memory, TargetKind
from dynx.ik.problem import Problem
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats


class Race:
    """Workspace for one target at a time, whose tasks are the starts; not safe for several threads."""

    def __init__(self, kernel: IterationKernel, kind: TargetKind, memory: Memory, starts: Starts) -> None:
        count, n = starts.random.shape
        self.starts = starts
        self._n, self._kind = n, kind
        self.x = starts.random.copy()
        self.target, self.near = np.zeros(kind.size), np.zeros(n)
        self._optional = [np.zeros(size) for size in kind.optional_sizes.values()]
        # A task that is a start does not restart.
        self._settings = np.zeros(len(SETTINGS) + 3)
        self.result = np.zeros((count, memory.n_results))
        shared = [memory.initial, self.target, self.near, np.zeros(1), *self._optional]
        tasks = [self.x, *(np.broadcast_to(row, (count, len(row))) for row in shared)]
        self.run = kernel.bind_race(tasks, self.result, self._settings, starts.random)
        """Function that solves for the present target and returns the number of completed starts."""

    def prepare(self, problem: Problem, indices: list[int]) -> None:
        """Set everything but the target; `indices` are those of the coordinates in q."""
        limits = problem.limits
        self.near[:] = problem.q0.reshape(-1)[indices]
        for array, values in zip(self._optional, self._kind.optional_values(problem), strict=True):
            array[:] = values
        self._settings[:3] = limits.position_tolerance, limits.rotation_tolerance, limits.max_iterations

    def solve(self, problem: Problem, indices: list[int]) -> Floats:
        """Return the memory's results (1, n_results) of the first start that reaches the target, or of the
        best one, with the iterations and restarts of all starts up to it."""
        self.prepare(problem, indices)
        starts = self.starts
        if starts.near:
            starts.copy_near(self.x.reshape(-1).data, int(starts.first_rows(problem)[0]))
        else:
            self.x[0] = starts.random[0]
        if problem.begins_at_q0:
            self.x[0] = self.near
        self.target[:] = self._kind.rows(problem)[0]
        n, completed = self._n, self.run()
        last, done = completed - 1, self.result[:completed]
        if not done[last, n + 2]:
            last = int(np.argmin(done[:, -1]))
        found: Floats = done[last : last + 1].copy()
        found[0, n + 3], found[0, n + 4] = done[:, n + 3].sum(), completed - 1
        return found
