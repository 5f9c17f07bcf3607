"""Kernels of inverse kinematics: compiled for one frame of one robot, or loaded from the cache."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from hashlib import sha256

import dynx.compiled.ik
import dynx.compiled.simplification
import dynx.ik.axis_residual
import dynx.ik.coordinates
import dynx.ik.search
import dynx.ik.tracking.descent
import dynx.model.mechanism
import dynx.rbd
import dynx.spatial
from dynx.compiled.ik.posture import posture_iteration
from dynx.compiled.ik.refinement import refinement_iteration
from dynx.compiled.ik.solver import MAX_RESTARTS, FrameSolver
from dynx.compiled.ik.starts import StartTable
from dynx.compiled.ik.step import POSES, TargetKind, solver_iteration
from dynx.compiled.ik.tracking import tracking_iteration
from dynx.compiled.simplification import simplify_mechanism
from dynx.files.cache import keep, read_cached
from dynx.ik import Kinematics, Problem
from dynx.ik.coordinates import FrameCoordinates
from dynx.model import Mechanism, Model
from dynx.simd.cache import source_version
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration import Iteration, IterationKernel, load_iteration
from dynx.simd.target import host

MAX_JOINTS = 24
"""Most joints between root and frame for which a kernel is compiled, in some seconds."""


IterationBuilder = Callable[[Mechanism, int, FrameCoordinates, TargetKind], Iteration]

SolverKey = tuple[str, TargetKind, bytes]
"""What a solver is made for: the frame, the kind of its targets, and the margin of the limits."""


def applies(problem: Problem) -> bool:
    """Check whether a kernel solves a problem: for one frame that 1 to `MAX_JOINTS` joints move, on a fixed
    base."""
    coordinates = problem.coordinates
    if coordinates.floating or problem.limits.max_restarts > MAX_RESTARTS or len(problem.requirements) > 1:
        return False
    return 0 < coordinates.count <= MAX_JOINTS


def solver_key(problem: Problem) -> SolverKey:
    """Return the key of the solver for a problem."""
    margin = b"" if problem.margin is None else problem.margin.tobytes()
    return problem.frame, TargetKind.of(problem), margin


def frame_key(frame: str) -> SolverKey:
    """Return the key of the solver for poses of a frame within the limits."""
    return frame, POSES, b""


def frame_solver(kinematics: Kinematics, problem: Problem, threads: int) -> FrameSolver:
    """Return the solver for problems of this kind, whose kernel comes from the cache if it is there."""
    model, coordinates = kinematics.model, problem.coordinates
    frame, kind, margin = solver_key(problem)
    number = model.frame_index(frame)
    content = (model.links, model.joints, model.extra_frames, model.base_pose, number, kind, margin)

    def load(iteration: IterationBuilder) -> IterationKernel:
        recipe = repr((_algorithms(), iteration.__name__, content)).encode()
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
        recipe = repr((_algorithms(), "starts", content, host())).encode()
        name = f"{sha256(recipe).hexdigest()}.starts"
        found = read_cached(name)
        table = None if found is None else StartTable.from_content(found, coordinates.count)
        if table is None:
            table = StartTable.of(coordinates, kinematics, frame)
            keep(name, table.content)
        return table

    table = start_table() if kind == POSES else None
    return FrameSolver(load(solver_iteration), refinement, posture, coordinates, kind, table, threads)


def path_kernel(model: Model, frame: str, kind: TargetKind) -> IterationKernel:
    """Return the kernel that follows targets of this kind one after the other, from the cache if possible."""
    coordinates, number = FrameCoordinates(model, frame), model.frame_index(frame)
    content = (model.links, model.joints, model.extra_frames, model.base_pose, number, kind)
    mechanism = simplify_mechanism(model.mechanism)
    return load_iteration(
        repr(("path", _algorithms(), content)).encode(),
        lambda: tracking_iteration(mechanism, number, coordinates, kind),
        lanes=1,
    )


@cache
def _algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    packages = (dynx.rbd, dynx.spatial, dynx.compiled.ik)
    modules = (dynx.ik.coordinates, dynx.ik.search, dynx.ik.tracking.descent, dynx.model.mechanism)
    return source_version(*packages, *modules, dynx.ik.axis_residual, dynx.compiled.simplification)
