"""Kernels of inverse kinematics: compiled for one frame of one robot, or loaded from the cache.

A batch is solved with one target in each lane of the processor's vectors; a lane takes the next target when
its own is solved. For a single target the lanes try different starts at once. In both cases the result is
that of the first start, in order, that reaches the target: it does not depend on the other targets, the
number of threads or the number of lanes. Single poses with options that were checked before take some
microseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from hashlib import sha256
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

import dynx.compiled.simplification
import dynx.ik.coordinates
import dynx.ik.iterations
import dynx.ik.starts
import dynx.ik.step
import dynx.model.mechanism
import dynx.rbd
import dynx.spatial
from dynx.backends.base import Backend
from dynx.compiled.simplification import simplify_mechanism
from dynx.files.cache import keep, read_cached
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.descent import MAX_COORDINATES
from dynx.ik.iterations import (
    MAX_STEPS,
    POSTURE,
    SHARE_OF_TOLERANCE,
    posture_iteration,
    refinement_iteration,
    solver_iteration,
)
from dynx.ik.options import Options, SearchLimits
from dynx.ik.problem import SOLVERS, Posture, Problem, Requirement
from dynx.ik.reach import proofs
from dynx.ik.result import IKResult, ReachedTarget
from dynx.ik.starts import STARTS_OF_CELL, Starts, StartTable
from dynx.ik.step import POSES, REFINEMENT, SEARCH, SETTINGS, TargetKind
from dynx.model.mechanism import Mechanism
from dynx.model.model import Model
from dynx.model.targets import checked_targets, is_rigid
from dynx.simd.cache import source_version
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration import Iteration, IterationKernel, load_iteration
from dynx.simd.target import host
from dynx.spatial.scalar import Floats
from dynx.time_limit import TimeLimit

LANES = 8
"""Fewest tasks of a piece of work that a time limit divides: the lanes of the widest vectors."""


class Race:
    """Workspace for one target at a time, whose tasks are the starts; not safe for several threads."""

    def __init__(self, kernel: IterationKernel, kind: TargetKind, starts: Starts) -> None:
        count, n = starts.random.shape
        self.starts = starts
        self._n, self._kind = n, kind
        self.x = starts.random.copy()
        self.target, self.near = np.zeros(kind.size), np.zeros(n)
        self._optional = [np.zeros(size) for size in kind.optional_sizes.values()]
        # A task that is a start does not restart.
        self._settings = np.zeros(len(SETTINGS) + 3)
        self.result = np.zeros((count, n + SEARCH.results))
        shared = [SEARCH.initial(n), self.target, self.near, np.zeros(1), *self._optional]
        tasks = [self.x, *(np.broadcast_to(row, (count, len(row))) for row in shared)]
        self._kernel, self._tasks = kernel, tasks
        self.run = kernel.bind_race(tasks, self.result, self._settings, starts.random)
        """Function that solves for the present target and returns the number of completed starts."""

    def prepare(self, problem: Problem, indices: list[int]) -> None:
        """Set everything but the target; `indices` are those of the coordinates in q."""
        limits = problem.limits
        self.near[:] = problem.q0.reshape(-1)[indices]
        for array, values in zip(self._optional, problem.requirements[0].optional, strict=True):
            array[:] = values
        self._settings[:3] = limits.position_tolerance, limits.rotation_tolerance, limits.max_iterations

    def run_within(self, time_limit: TimeLimit) -> int:
        """Do as `run` in pieces, until the time is over."""
        completed = 0
        for part in time_limit.pieces(len(self.result), LANES):
            tasks = [each[part] for each in self._tasks]
            race = self._kernel.bind_race(tasks, self.result[part], self._settings, self.starts.random)
            completed = part.start + race()
            if self.result[completed - 1, self._n + 2]:
                break
        return completed

    def solve(self, problem: Problem, indices: list[int]) -> tuple[Floats, bool]:
        """Return the results (as one row) of the first start that reaches the target, or of the best one,
        with the iterations and restarts of all starts up to it; and whether no start is left to try."""
        self.prepare(problem, indices)
        starts = self.starts
        if starts.near:
            starts.copy_near(self.x.reshape(-1).data, int(starts.first_rows(problem)[0]))
        else:
            self.x[0] = starts.random[0]
        if problem.begins_at_q0:
            self.x[0] = self.near
        self.target[:] = self._kind.rows(problem.targets, problem.batch)[0]
        n, time_limit = self._n, problem.limits.time_limit
        completed = self.run() if time_limit.timeout is None else self.run_within(time_limit)
        last, done = completed - 1, self.result[:completed]
        if not done[last, n + 2]:
            last = int(np.argmin(done[:, -1]))
        found: Floats = done[last : last + 1].copy()
        found[0, n + 3], found[0, n + 4] = done[:, n + 3].sum(), completed - 1
        return found, bool(found[0, n + 2]) or completed == len(self.result)


_POSE = Struct("12d")
_FLOAT64 = np.dtype(np.float64)

Workspace = tuple[Race, memoryview, memoryview, memoryview, memoryview]
"""A race, and its memory: target, starts, what angles are to be near, and results."""


class PoseCall:
    """Solver of single poses for fixed options; safe to use from several threads."""

    def __init__(self, kernel: IterationKernel, starts: Starts, problem: Problem, model: Model) -> None:
        """`problem` has the options, any pose as target, and the configuration without q0."""
        self._kernel, self._starts, self._problem = kernel, starts, problem
        self._indices, self._n = problem.coordinates.indices, problem.coordinates.count
        self._width = self._n + SEARCH.results
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
        race = Race(self._kernel, self._problem.requirements[0].kind, self._starts)
        race.prepare(self._problem, self._indices)
        x, results = (array.reshape(-1).data for array in (race.x, race.result))
        return race, race.target.data, x, race.near.data, results


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
        self._table = table
        self._seeded: tuple[object, Starts | None] = (None, None)
        # Workspaces of single targets that no call uses at the moment.
        self._free: list[Race] = []

    def solve(self, problem: Problem, backend: Backend) -> IKResult:
        """Solve all samples; the reach of the robot bounds the effort.

        A target that the bounds prove out of reach is not tried from more than `FIRST_RESTARTS` others.
        """
        if problem.limits.time_limit.timeout is not None:
            return self._solve_within(problem, backend)
        starts, n, count = self._starts(problem), self._coordinates.count, problem.count
        most, model = problem.limits.max_restarts, backend.model
        unreached, proof = np.ones(count, dtype=bool), None
        if count == 1:
            proof = proofs(problem, model, unreached)
        if proof is not None and not proof[0]:
            rows, _ = self._race(problem, starts)
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
            self._refine(rows, np.flatnonzero(unreached), problem, self._arrays(problem, starts))
        return self._result(rows, problem, proof)

    def _solve_within(self, problem: Problem, backend: Backend) -> IKResult:
        """Solve samples until the time is over: several from few starts first, then each from all."""
        starts, n, count = self._starts(problem), self._coordinates.count, problem.count
        time_limit, most, model = problem.limits.time_limit, problem.limits.max_restarts, backend.model
        arrays, first = self._arrays(problem, starts), min(most, FIRST_RESTARTS)
        rows = np.zeros((count, n + SEARCH.results))
        rows[:, :n], rows[:, n : n + 2] = arrays[3], np.nan
        unreached, proof, begun = np.ones(count, dtype=bool), None, count
        if count == 1:
            proof = proofs(problem, model, unreached)
        if proof is None or proof[0]:
            for part in time_limit.pieces(count, LANES):
                rows[part] = self._batch([array[part] for array in arrays], problem, starts, first)
                begun = part.stop
            unreached = rows[:, n + 2] == 0.0
        if proof is None:
            proof = proofs(problem, model, unreached & (np.arange(count) < begun))
        late = unreached & (proof == "")
        if count > 1 and first == most:
            late[:begun] = False
        for k in np.flatnonzero(late).tolist():
            if count > 1 and time_limit.is_over():
                break
            rows[k : k + 1], is_complete = self._race(problem.sample(k), starts)
            late[k] = not is_complete
        at = np.flatnonzero((rows[:, n + 2] == 0.0) & ~late)
        for part in () if time_limit.is_over() else time_limit.pieces(len(at), LANES):
            self._refine(rows, at[part], problem, arrays)
        found = self._result(rows, problem, proof)
        late &= rows[:, n + 2] == 0.0
        return replace(found, timed_out=late.reshape(problem.batch)) if late.any() else found

    def nearest(self, problem: Problem, posture: Posture) -> tuple[Floats, IKResult]:
        """Return the objective (count,) and the solutions nearest to a posture, each from its own q0."""
        n, count = self._coordinates.count, problem.count
        near = np.broadcast_to(problem.q0, (*problem.batch, problem.q0.shape[-1])).reshape(count, -1)
        begin = np.ascontiguousarray(near[:, self._coordinates.indices])
        shared = (posture.goal, posture.weights, posture.inverse)
        tasks = [begin, _repeated(POSTURE.initial(n), count)]
        tasks.append(self._kind.rows(problem.targets, problem.batch))
        tasks += [_repeated(each, count) for each in shared]
        optional = problem.requirements[0].optional
        limits = replace(
            problem.limits,
            position_tolerance=SHARE_OF_TOLERANCE * problem.limits.position_tolerance,
            rotation_tolerance=SHARE_OF_TOLERANCE * problem.limits.rotation_tolerance,
            max_iterations=MAX_STEPS,
        )
        settings = _settings(replace(problem, limits=limits), 0)
        tasks += [_repeated(each, count) for each in optional]
        rows = np.empty((count, n + POSTURE.results))
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
        return PoseCall(self._kernel, self._starts(problem), problem, model)

    def _arrays(self, problem: Problem, starts: Starts) -> list[Floats]:
        """Return the arrays (n, size) of all samples that the kernel takes."""
        n, size = problem.count, self._coordinates.count
        near = problem.q0[..., self._coordinates.indices]
        near = np.broadcast_to(near, (*problem.batch, size)).reshape(n, size)
        cell = starts.first_rows(problem)
        first = near if problem.begins_at_q0 else starts.rows[cell + starts.offset]
        memory = _repeated(SEARCH.initial(size), n)
        target = self._kind.rows(problem.targets, problem.batch)
        arrays = [first, memory, target, near, cell[:, None].astype(np.float64)]
        arrays += [_repeated(each, n) for each in problem.requirements[0].optional]
        return arrays

    def _batch(self, arrays: list[Floats], problem: Problem, starts: Starts, max_restarts: int) -> Floats:
        """Return the results (n, coordinates and `SEARCH.results`) of the samples with these arrays."""
        rows = np.empty((len(arrays[0]), self._coordinates.count + SEARCH.results))
        constants = np.concatenate([_settings(problem, max_restarts), starts.constants])
        self._kernel(arrays, rows, constants, starts.rows, threads=self._threads)
        return rows

    def _refine(
        self, rows: Floats, at: NDArray[np.int64], problem: Problem, arrays: Sequence[Floats]
    ) -> None:
        """Refine the results of the samples `at` to local minima of their errors."""
        n = self._coordinates.count
        _, _, target, near, _, *optional = (array[at] for array in arrays)
        begin = np.ascontiguousarray(rows[at, :n])
        tasks = [begin, _repeated(REFINEMENT.initial(n), len(at)), target, near, *optional]
        refined = np.empty((len(at), n + REFINEMENT.results))
        self._refinement()(tasks, refined, _settings(problem, 0), begin, threads=self._threads)
        refined[:, n + 3] += rows[at, n + 3]
        rows[at, : refined.shape[1]] = refined

    def _race(self, problem: Problem, starts: Starts) -> tuple[Floats, bool]:
        """Return the results (1, coordinates and `SEARCH.results`) of the only sample, and whether it is
        reached or no start is left to try."""
        try:
            race = self._free.pop()
        except IndexError:
            race = None
        if race is None or race.starts is not starts:
            race = Race(self._kernel, self._kind, starts)
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


def _repeated(row: Floats, count: int) -> Floats:
    """Return the same row (size,) for `count` tasks, without a copy."""
    return np.broadcast_to(row, (count, len(row)))


def _settings(problem: Problem, max_restarts: int) -> Floats:
    """Return the constants of the kernels, in the order of `SETTINGS`."""
    limits = replace(problem.limits, max_restarts=max_restarts)
    return np.array([float(getattr(limits, name)) for name in SETTINGS])


MAX_POSE_CALLS = 16
"""Most combinations of a frame and options for which single poses have a call of their own."""

_OPTIONS_OF_CALLS = frozenset(
    ("position_tolerance", "rotation_tolerance", "max_iterations", "max_restarts", "rng", "all_solutions")
)
"""Options of which each combination has a call of its own."""

Call = Callable[[Any, Any], IKResult | None]
"""Function of a target and q0 that returns None if it does not apply to them."""

IterationBuilder = Callable[[Mechanism, int, FrameCoordinates, TargetKind], Iteration]

SolverKey = tuple[str, TargetKind, bytes]
"""What a solver is made for: the frame, the kind of its targets, and the margin of the limits."""


def kernel_applies(backend: Backend, problem: Problem) -> bool:
    """Check whether a kernel solves a problem: on a backend that compiles, for one frame that 1 to
    `MAX_COORDINATES` joints move, on a fixed base without ball joints."""
    coordinates = problem.coordinates
    if not backend.compiles or backend.model.quaternions or len(problem.requirements) > 1:
        return False
    return 0 < coordinates.count <= MAX_COORDINATES and problem.limits.max_restarts <= MAX_RESTARTS


def solver_key(problem: Problem) -> SolverKey:
    """Return the key of the solver for a problem."""
    margin = b"" if problem.margin is None else problem.margin.tobytes()
    return problem.frame, problem.requirements[0].kind, margin


class KernelSolvers:
    """Solvers by kernels, and calls of single poses, that were made for one backend, which keeps them."""

    def __init__(self) -> None:
        self._solvers: dict[SolverKey, FrameSolver] = {}
        self._calls: dict[object, Call] = {}

    @classmethod
    def of(cls, backend: Backend) -> KernelSolvers:
        """Return those of a backend."""
        return backend.kept(SOLVERS, cls)

    def solver(self, backend: Backend, problem: Problem) -> FrameSolver:
        """Return the solver for problems of this kind, which is made once."""
        key = solver_key(problem)
        solver = self._solvers.get(key)
        if solver is None:
            with COMPILE_LOCK:
                solver = self._solvers.get(key)
                if solver is None:
                    solver = self._solvers[key] = frame_solver(backend, problem)
        return solver

    def call(self, frame: Any, options: Mapping[str, Any]) -> Call | None:
        """Return the call of single poses for a frame and options, or None."""
        try:
            return self._calls.get(_key(frame, options) if options else frame)
        except TypeError:
            # An option that cannot be hashed.
            return None

    def store_call(self, frame: str, options: Mapping[str, Any], backend: Backend) -> None:
        """Make the call for a frame and options that were checked, if it is for poses or all solutions."""
        if not options.keys() <= _OPTIONS_OF_CALLS:
            return
        chosen = Options.of(options)
        tolerances = (chosen.position_tolerance, chosen.rotation_tolerance)
        if not isinstance(chosen.rng, int) or not all(isinstance(bound, float | int) for bound in tolerances):
            return
        if len(self._calls) >= MAX_POSE_CALLS:
            self._calls = {}
        call: Call | None = None
        if chosen.all_solutions:
            from dynx.ik.closed_forms.solver import single_pose_call

            call = single_pose_call(backend.model, frame, chosen.search_limits())
        else:
            solver = self._solvers.get((frame, POSES, b""))
            if solver is not None:
                call = solver.pose_call(backend.model, chosen.search_limits(), chosen.rng)
        if call is not None:
            self._calls[_key(frame, options) if options else frame] = call


def kernel_solution(backend: Backend, problem: Problem) -> IKResult | None:
    """Solve all samples of a problem by a kernel; return None if none applies."""
    if not kernel_applies(backend, problem):
        return None
    return KernelSolvers.of(backend).solver(backend, problem).solve(problem, backend)


def nearest_solutions(backend: Backend, problem: Problem, posture: Posture) -> tuple[Floats, IKResult] | None:
    """Return the objective (count,) and the solutions nearest to a posture, each from its own q0, or None if
    no kernel applies."""
    if not kernel_applies(backend, problem):
        return None
    return KernelSolvers.of(backend).solver(backend, problem).nearest(problem, posture)


def frame_solver(backend: Backend, problem: Problem) -> FrameSolver:
    """Return the solver for problems of this kind, whose kernel comes from the cache if it is there."""
    model, coordinates = backend.model, problem.coordinates
    frame, kind, margin = solver_key(problem)

    @cache
    def refinement() -> IterationKernel:
        with COMPILE_LOCK:
            return frame_kernel(refinement_iteration, model, frame, coordinates, kind, margin)

    @cache
    def posture() -> IterationKernel:
        with COMPILE_LOCK:
            return frame_kernel(posture_iteration, model, frame, coordinates, kind, margin)

    def start_table() -> StartTable:
        recipe = repr((algorithms(), "starts", _content(model, frame, kind, margin), host())).encode()
        name = f"{sha256(recipe).hexdigest()}.starts"
        found = read_cached(name)
        table = None if found is None else StartTable.from_content(found, coordinates.count)
        if table is None:
            table = StartTable.of(coordinates, backend, frame)
            keep(name, table.content)
        return table

    table = start_table() if kind == POSES else None
    search = frame_kernel(solver_iteration, model, frame, coordinates, kind, margin)
    return FrameSolver(search, refinement, posture, coordinates, kind, table, backend.threads)


def frame_kernel(
    iteration: IterationBuilder,
    model: Model,
    frame: str,
    coordinates: FrameCoordinates,
    kind: TargetKind,
    margin: bytes = b"",
    lanes: int | None = None,
) -> IterationKernel:
    """Return the kernel of an iteration for targets of this kind, from the cache if possible; `margin` are
    the bytes of the margin of the limits in `coordinates`."""
    recipe = repr((algorithms(), iteration.__name__, _content(model, frame, kind, margin))).encode()
    number, mechanism = model.frame_index(frame), model.mechanism
    return load_iteration(
        recipe, lambda: iteration(simplify_mechanism(mechanism), number, coordinates, kind), lanes=lanes
    )


def _content(model: Model, frame: str, kind: TargetKind, margin: bytes) -> tuple[object, ...]:
    """Return what a kernel of a frame depends on."""
    number = model.frame_index(frame)
    return (model.links, model.joints, model.extra_frames, model.base_pose, number, kind, margin)


def _key(frame: Any, options: Mapping[str, Any]) -> object:
    """Return the key of a call; a truth value equals a number, but is no seed."""
    return (frame, *options.items(), *map(type, options.values()))


@cache
def algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    own = (dynx.ik.coordinates, dynx.ik.iterations, dynx.ik.starts, dynx.ik.step)
    return source_version(dynx.rbd, dynx.spatial, *own, dynx.model.mechanism, dynx.compiled.simplification)
