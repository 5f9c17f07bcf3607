"""Solver of inverse kinematics for one frame of one robot, by a compiled kernel.

A batch is solved with one target in each lane of the processor's vectors; a lane takes the next target when
its own is solved. For a single target the lanes try different starts at once. In both cases the result is
that of the first start, in order, that reaches the target: it does not depend on the other targets, the
number of threads or the number of lanes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.kernels.pose_call import PoseCall
from dynx.ik.kernels.posture import MAX_STEPS, SHARE_OF_TOLERANCE, PostureMemory
from dynx.ik.kernels.race import Race
from dynx.ik.kernels.refinement import RefinementMemory
from dynx.ik.kernels.starts import Starts, StartTable
from dynx.ik.kernels.step import SETTINGS, Memory, TargetKind
from dynx.ik.problem import Problem, Requirement
from dynx.ik.reach import proofs
from dynx.ik.result import IKResult
from dynx.ik.search import SearchLimits
from dynx.ik.secondary import Posture
from dynx.model import Model
from dynx.model.targets import checked_targets
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats

MAX_RESTARTS = 10_000
"""Most restarts for which a table of starts is made."""


FIRST_RESTARTS = 24
"""Restarts before a target that is not reached is compared with the bounds on the reach."""


class FrameSolver:
    """Solver for targets of one frame that are of one kind. Safe to use from several threads."""

    def __init__(
        self,
        kernel: IterationKernel,
        refinement: Callable[[], IterationKernel],
        posture: Callable[[], IterationKernel],
        coordinates: FrameCoordinates,
        kind: TargetKind,
        table: StartTable | None,
        threads: int,
    ) -> None:
        """`refinement` and `posture` return kernels that are needed only for some problems: for targets that
        are not reached, and for solutions that are to be near to a posture."""
        self._kernel, self._coordinates, self._kind, self._threads = kernel, coordinates, kind, threads
        self._refinement, self._posture = refinement, posture
        self._memory, self._table = Memory(coordinates.count), table
        self._seeded: tuple[object, Starts | None] = (None, None)
        # Workspaces of single targets that no call uses at the moment.
        self._free: list[Race] = []

    def solve(self, problem: Problem, backend: Backend) -> IKResult:
        """Solve all samples; the bounds on the reach of the robot of `kinematics` bound the effort.

        A target that the bounds prove out of reach is not tried from more than `FIRST_RESTARTS` others.
        """
        starts, n, count = self._starts(problem), self._coordinates.count, problem.count
        most, model = problem.limits.max_restarts, backend.model
        unreached, proof = np.ones(count, dtype=bool), None
        if count == 1:
            proof = proofs(problem, model, unreached)
        if proof is not None and not proof[0]:
            rows = self._race(problem, starts)
            unreached = rows[:, n + 2] == 0.0
        else:
            arrays = self._arrays(problem, starts)
            first = min(most, FIRST_RESTARTS)
            rows = self._batch(arrays, problem, starts, first)
            unreached = rows[:, n + 2] == 0.0
            if unreached.any():
                proof = proofs(problem, model, unreached) if proof is None else proof
                again = np.flatnonzero(unreached & (proof == "")) if first < most else np.array([], np.int64)
                if len(again):
                    chosen = [array[again] for array in arrays]
                    rows[again] = self._batch(chosen, problem, starts, most)
                    unreached = rows[:, n + 2] == 0.0
        if unreached.any():
            self._refine(rows, np.flatnonzero(unreached), problem, starts)
        return self._result(rows, problem, proof)

    def nearest(self, problem: Problem, posture: Posture) -> tuple[Floats, IKResult]:
        """Return the objective (count,) and the solutions nearest to a posture, each from its own q0."""
        n, count = self._coordinates.count, problem.count
        memory = PostureMemory(n)
        near = np.broadcast_to(problem.q0, (*problem.batch, problem.q0.shape[-1])).reshape(count, -1)
        begin = np.ascontiguousarray(near[:, self._coordinates.indices])
        shared = (posture.goal, posture.weights, posture.inverse)
        tasks = [begin, np.broadcast_to(memory.initial, (count, len(memory.initial)))]
        tasks.append(self._kind.rows(problem))
        tasks += [np.broadcast_to(each, (count, n)) for each in shared]
        optional = self._kind.optional_values(problem)
        limits = replace(
            problem.limits,
            position_tolerance=SHARE_OF_TOLERANCE * problem.limits.position_tolerance,
            rotation_tolerance=SHARE_OF_TOLERANCE * problem.limits.rotation_tolerance,
            max_iterations=MAX_STEPS,
        )
        settings = _settings(replace(problem, limits=limits), 0)
        tasks += [np.broadcast_to(each, (count, len(each))) for each in optional]
        rows = np.empty((count, memory.n_results))
        self._posture()(tasks, rows, settings, begin, threads=self._threads)
        objective = rows[:, n + 4].copy()
        # In place of the objective: the number of restarts of a result.
        rows[:, n + 4] = 0.0
        return objective, self._result(rows, problem, None)

    def _result(self, rows: Floats, problem: Problem, proof: NDArray[np.object_] | None) -> IKResult:
        n, batch = self._coordinates.count, problem.batch
        q = np.array(np.broadcast_to(problem.q0, (*batch, problem.q0.shape[-1])))
        q[..., self._coordinates.indices] = rows[:, :n].reshape(*batch, n)
        columns = rows[:, n : n + 5].T.reshape(5, *batch)
        errors, counts = columns[:2].copy(), columns[3:].astype(np.int64)
        success = np.asarray(columns[2] != 0.0)
        return IKResult(
            q,
            success,
            errors[0, ...],
            errors[1, ...],
            counts[0, ...],
            counts[1, ...],
            proof=None if success.all() or proof is None else proof.reshape(batch),
        )

    def pose_call(self, model: Model, limits: SearchLimits, rng: int) -> PoseCall:
        """Return a function of single poses with these options, which gives up after a few starts."""
        limits = replace(limits, max_restarts=min(limits.max_restarts, FIRST_RESTARTS))
        pose = Requirement("", checked_targets(np.eye(4)), None, None, limits)
        q0 = self._coordinates.initial()
        problem = Problem((pose,), self._coordinates, None, q0, False, (), limits, rng)
        return PoseCall(self._kernel, self._memory, self._starts(problem), problem, model)

    def _arrays(self, problem: Problem, starts: Starts) -> list[Floats]:
        """Return the arrays (n, size) of all samples that the kernel takes."""
        n, size = problem.count, self._coordinates.count
        near = problem.q0[..., self._coordinates.indices]
        near = np.broadcast_to(near, (*problem.batch, size)).reshape(n, size)
        cell = starts.first_rows(problem)
        first = near if problem.begins_at_q0 else starts.rows[cell + starts.offset]
        memory = np.broadcast_to(self._memory.initial, (n, len(self._memory.initial)))
        target = self._kind.rows(problem)
        arrays = [first, memory, target, near, cell[:, None].astype(np.float64)]
        arrays += [np.broadcast_to(each, (n, len(each))) for each in self._kind.optional_values(problem)]
        return arrays

    def _batch(self, arrays: list[Floats], problem: Problem, starts: Starts, max_restarts: int) -> Floats:
        """Return the memory's results (n, n_results) of the samples with these arrays."""
        rows = np.empty((len(arrays[0]), self._memory.n_results))
        constants = np.concatenate([_settings(problem, max_restarts), starts.constants])
        self._kernel(arrays, rows, constants, starts.rows, threads=self._threads)
        return rows

    def _refine(self, rows: Floats, at: NDArray[np.int64], problem: Problem, starts: Starts) -> None:
        """Refine the results (n, n_results) of the samples `at` to local minima of their errors."""
        memory = RefinementMemory(self._coordinates.count)
        _, _, target, near, _, *optional = (array[at] for array in self._arrays(problem, starts))
        begin = np.ascontiguousarray(rows[at, : memory.n])
        tasks = [
            begin,
            np.broadcast_to(memory.initial, (len(at), len(memory.initial))),
            target,
            near,
            *optional,
        ]
        refined = np.empty((len(at), memory.n_results))
        self._refinement()(tasks, refined, _settings(problem, 0), begin, threads=self._threads)
        refined[:, memory.n + 3] += rows[at, memory.n + 3]
        rows[at, : memory.n_results] = refined

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


def _settings(problem: Problem, max_restarts: int) -> Floats:
    """Return the constants of the kernels, in the order of `SETTINGS`."""
    limits = replace(problem.limits, max_restarts=max_restarts)
    return np.array([float(getattr(limits, name)) for name in SETTINGS])
