"""Single poses of a frame with options that were checked before: some microseconds a call."""

from __future__ import annotations

from struct import Struct
from typing import Any

import numpy as np

from dynx.ik.kernels.race import Race
from dynx.ik.kernels.starts import STARTS_OF_CELL, Starts
from dynx.ik.kernels.step import Memory, TargetKind
from dynx.ik.problem import Problem
from dynx.ik.result import IKResult, ReachedTarget
from dynx.model.model import Model
from dynx.model.targets import is_rigid
from dynx.simd.iteration import IterationKernel

_POSE = Struct("12d")
_FLOAT64 = np.dtype(np.float64)

Workspace = tuple[Race, memoryview, memoryview, memoryview, memoryview]
"""A race, and its memory: target, starts, what angles are to be near, and results."""


class PoseCall:
    """Solver of single poses for fixed options; safe to use from several threads."""

    def __init__(
        self, kernel: IterationKernel, memory: Memory, starts: Starts, problem: Problem, model: Model
    ) -> None:
        """`problem` has the options, any pose as target, and the configuration without q0."""
        self._kernel, self._memory, self._starts, self._problem = kernel, memory, starts, problem
        self._indices, self._n, self._width = problem.coordinates.indices, memory.n, memory.n_results
        self._q0 = problem.q0.reshape(-1)
        self._places_all = self._indices == list(range(len(self._q0)))
        lower, upper = model.lower.copy(), model.upper.copy()
        self._limits = list(zip(lower.tolist(), upper.tolist(), strict=True))
        # Workspaces that no call uses at the moment: without and with q0.
        self._free: tuple[list[Workspace], list[Workspace]] = ([], [])
        assert starts.cells is not None
        self._cells = starts.cells

    def __call__(self, target: Any, q0: Any = None) -> IKResult | None:
        """Return the result for a pose (4, 4), or None if that or q0 (nq,) is not valid as it stands, or if
        the pose is not reached."""
        if type(target) is not np.ndarray or target.dtype is not _FLOAT64 or target.shape != (4, 4):
            return None
        rows = target.tolist()
        if not is_rigid(rows) or not (q0 is None or self._is_within(q0)):
            return None
        free = self._free[q0 is not None]
        try:
            workspace = free.pop()
        except IndexError:
            workspace = self._workspace()
        race, target_view, x_view, near_view, results = workspace
        self._starts.copy_near(x_view, STARTS_OF_CELL * self._cells.number_of_one(rows))
        _POSE.pack_into(target_view, 0, *rows[0], *rows[1], *rows[2])
        if q0 is not None:
            near_view[:] = x_view[: self._n] = (q0 if self._places_all else q0[self._indices]).data
        completed, n, width = race.run(), self._n, self._width
        end = width * completed
        first = end - width + n
        distance, angle, reached = results[first], results[first + 1], results[first + 2]
        iterations = results[first + 3] if completed == 1 else sum(results[n + 3 : end : width])
        q = race.result[completed - 1, :n].copy()
        free.append(workspace)
        if not reached:
            return None
        if not self._places_all:
            of_frame, q = q, (self._q0 if q0 is None else q0).copy()
            q[self._indices] = of_frame
        return ReachedTarget.of(q, (distance, angle, int(iterations), completed - 1))

    def _is_within(self, q0: Any) -> bool:
        """Check whether q0 is a contiguous configuration (nq,) within the limits."""
        if type(q0) is not np.ndarray or q0.dtype is not _FLOAT64 or q0.shape != self._q0.shape:
            return False
        values = zip(q0.tolist(), self._limits, strict=True)
        return bool(q0.flags.c_contiguous) and all(low <= x <= high for x, (low, high) in values)

    def _workspace(self) -> Workspace:
        race = Race(self._kernel, TargetKind.of(self._problem), self._memory, self._starts)
        race.prepare(self._problem, self._indices)
        x, results = (array.reshape(-1).data for array in (race.x, race.result))
        return race, race.target.data, x, race.near.data, results
