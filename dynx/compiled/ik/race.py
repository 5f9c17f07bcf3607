"""Single targets: the lanes of the processor's vectors try several starts of one target at once."""

from __future__ import annotations

from struct import Struct
from typing import Any

import numpy as np

from dynx.compiled.ik.starts import STARTS_OF_CELL, Starts
from dynx.compiled.ik.step import SETTINGS, Memory, TargetKind
from dynx.ik import IKResult, Problem, is_rigid
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats

_POSE = Struct("12d")
_FLOAT64 = np.dtype(np.float64)


class Race:
    """Workspace for one target at a time, whose tasks are the starts; not safe for several threads."""

    def __init__(self, kernel: IterationKernel, kind: TargetKind, memory: Memory, starts: Starts) -> None:
        count, n = starts.random.shape
        self.starts = starts
        self._n, self._kind = n, kind
        self.x = starts.random.copy()
        self.target, self._near, self._point = np.zeros(kind.size), np.zeros(n), np.zeros(3)
        # A task that is a start does not restart.
        self._settings = np.zeros(len(SETTINGS) + 3)
        self.result = np.zeros((count, memory.n_results))
        shared = [memory.initial, self.target, self._near, np.zeros(1)] + [self._point] * kind.point
        tasks = [self.x, *(np.broadcast_to(row, (count, len(row))) for row in shared)]
        self.run = kernel.bind_race(tasks, self.result, self._settings, starts.random)
        """Function that solves for the present target and returns the number of completed starts."""

    def prepare(self, problem: Problem, indices: list[int]) -> None:
        """Set everything but the target; `indices` are those of the coordinates in q."""
        limits = problem.limits
        self._near[:] = problem.q0.reshape(-1)[indices]
        if problem.point is not None:
            self._point[:] = problem.point
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
            self.x[0] = self._near
        self.target[:] = self._kind.rows(problem)[0]
        n, completed = self._n, self.run()
        last, done = completed - 1, self.result[:completed]
        if not done[last, n + 2]:
            last = int(np.argmin(done[:, -1]))
        found: Floats = done[last : last + 1].copy()
        found[0, n + 3], found[0, n + 4] = done[:, n + 3].sum(), completed - 1
        return found


class PoseCall:
    """Solver of single poses for fixed options, without a start q0; safe to use from several threads.

    A call takes some microseconds, because the options were checked before.
    """

    def __init__(
        self, kernel: IterationKernel, memory: Memory, starts: Starts, problem: Problem, indices: list[int]
    ) -> None:
        """`problem` has the options, and any pose as target."""
        self._kernel, self._memory, self._starts = kernel, memory, starts
        self._problem, self._indices, self._n = problem, indices, memory.n
        self._q0 = problem.q0.reshape(-1)
        self._places_all = indices == list(range(len(self._q0)))
        # Workspaces that no call uses at the moment.
        self._free: list[tuple[Race, memoryview, memoryview]] = []
        assert starts.cells is not None
        self._cells = starts.cells

    def __call__(self, target: Any) -> IKResult | None:
        """Return the result for a pose (4, 4), or None if it is not a valid pose or is not reached."""
        if type(target) is not np.ndarray or target.dtype is not _FLOAT64 or target.shape != (4, 4):
            return None
        rows = target.tolist()
        if not is_rigid(rows):
            return None
        try:
            workspace = self._free.pop()
        except IndexError:
            workspace = self._workspace()
        race, target_view, x_view = workspace
        self._starts.copy_near(x_view, STARTS_OF_CELL * self._cells.number_of_one(rows))
        _POSE.pack_into(target_view, 0, *rows[0], *rows[1], *rows[2])
        completed, n = race.run(), self._n
        row = race.result[completed - 1]
        q = row[:n].copy()
        distance, angle, reached, iterations = row[n : n + 4].tolist()
        if completed > 1:
            iterations = race.result[:completed, n + 3].sum()
        self._free.append(workspace)
        if not reached:
            return None
        if not self._places_all:
            of_frame, q = q, self._q0.copy()
            q[self._indices] = of_frame
        return IKResult(
            q,
            np.array(True),
            np.array(distance),
            np.array(angle),
            np.array(int(iterations)),
            np.array(completed - 1),
        )

    def _workspace(self) -> tuple[Race, memoryview, memoryview]:
        race = Race(self._kernel, TargetKind.of(self._problem), self._memory, self._starts)
        race.prepare(self._problem, self._indices)
        return race, race.target.data, race.x.reshape(-1).data
