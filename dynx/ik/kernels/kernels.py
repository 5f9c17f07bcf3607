"""Kernels of inverse kinematics: compiled for one frame of one robot, or loaded from the cache."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from hashlib import sha256
from typing import Any

import dynx.compiled.simplification
import dynx.ik.axis_residual
import dynx.ik.coordinates
import dynx.ik.kernels
import dynx.ik.search
import dynx.model.mechanism
import dynx.rbd
import dynx.spatial
from dynx.backends.base import Backend
from dynx.compiled.simplification import simplify_mechanism
from dynx.files.cache import keep, read_cached
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.kernels.posture import posture_iteration
from dynx.ik.kernels.refinement import refinement_iteration
from dynx.ik.kernels.solver import MAX_RESTARTS, FrameSolver
from dynx.ik.kernels.starts import StartTable
from dynx.ik.kernels.step import POSES, TargetKind, solver_iteration
from dynx.ik.options import Options
from dynx.ik.problem import Problem
from dynx.ik.result import IKResult
from dynx.ik.secondary import Posture
from dynx.model.mechanism import Mechanism
from dynx.simd.cache import source_version
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration import Iteration, IterationKernel, load_iteration
from dynx.simd.target import host
from dynx.spatial.scalar import Floats

MAX_JOINTS = 24
"""Most joints between root and frame for which a kernel is compiled, in some seconds."""

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
    `MAX_JOINTS` joints move, on a fixed base."""
    coordinates = problem.coordinates
    if not backend.compiles or coordinates.floating or len(problem.requirements) > 1:
        return False
    return 0 < coordinates.count <= MAX_JOINTS and problem.limits.max_restarts <= MAX_RESTARTS


def solver_key(problem: Problem) -> SolverKey:
    """Return the key of the solver for a problem."""
    margin = b"" if problem.margin is None else problem.margin.tobytes()
    return problem.frame, TargetKind.of(problem), margin


class KernelSolvers:
    """Solvers by kernels, and calls of single poses, that were made for one backend, which keeps them."""

    def __init__(self) -> None:
        self._solvers: dict[SolverKey, FrameSolver] = {}
        self._calls: dict[object, Call] = {}

    @classmethod
    def of(cls, backend: Backend) -> KernelSolvers:
        """Return those of a backend."""
        return backend.kept(cls, cls)

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
            from dynx.ik.closed_forms.single_pose import single_pose_call

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
    number = model.frame_index(frame)
    content = (model.links, model.joints, model.extra_frames, model.base_pose, number, kind, margin)

    def load(iteration: IterationBuilder) -> IterationKernel:
        recipe = repr((algorithms(), iteration.__name__, content)).encode()
        return load_iteration(
            recipe, lambda: iteration(simplify_mechanism(model.mechanism), number, coordinates, kind)
        )

    @cache
    def refinement() -> IterationKernel:
        with COMPILE_LOCK:
            return load(refinement_iteration)

    @cache
    def posture() -> IterationKernel:
        with COMPILE_LOCK:
            return load(posture_iteration)

    def start_table() -> StartTable:
        recipe = repr((algorithms(), "starts", content, host())).encode()
        name = f"{sha256(recipe).hexdigest()}.starts"
        found = read_cached(name)
        table = None if found is None else StartTable.from_content(found, coordinates.count)
        if table is None:
            table = StartTable.of(coordinates, backend, frame)
            keep(name, table.content)
        return table

    table = start_table() if kind == POSES else None
    return FrameSolver(load(solver_iteration), refinement, posture, coordinates, kind, table, backend.threads)


def _key(frame: Any, options: Mapping[str, Any]) -> object:
    """Return the key of a call; a truth value equals a number, but is no seed."""
    return (frame, *options.items(), *map(type, options.values()))


@cache
def algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    packages = (dynx.rbd, dynx.spatial, dynx.ik.kernels)
    modules = (dynx.ik.coordinates, dynx.ik.search, dynx.model.mechanism)
    return source_version(*packages, *modules, dynx.ik.axis_residual, dynx.compiled.simplification)
