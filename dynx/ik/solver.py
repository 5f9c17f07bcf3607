"""`inverse_kinematics`: checks arguments, broadcasts batches, runs a method and measures its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, nearest, shown
from dynx.ik.options import IKOptions, Options, spells_options
from dynx.ik.problem import SOLVERS, Problem, argument_note, checked_problem
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Search
from dynx.model.numbers import checked_bool
from dynx.time_limit import not_counted

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from dynx.ik.closed_forms.solutions import IKSolutions
    from dynx.ik.kernels import KernelSolvers
    from dynx.ik.options import FrameTarget

METHODS = ("dynx", "engine")
"""Values of the option `method`."""


@overload
def inverse_kinematics(
    backend: Backend,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None = None,
    *,
    all_solutions: Literal[True],
    given: Mapping[str, float] | None = None,
    position_tolerance: ArrayLike = ...,
    rotation_tolerance: ArrayLike = ...,
) -> IKSolutions: ...


@overload
def inverse_kinematics(
    backend: Backend,
    target: ArrayLike | Mapping[str, ArrayLike] | Sequence[FrameTarget],
    frame: str | None = None,
    q0: ArrayLike | None = None,
    **options: Unpack[IKOptions],
) -> IKResult: ...


@spells_options
def inverse_kinematics(
    backend: Backend,
    target: ArrayLike | Mapping[str, ArrayLike] | Sequence[FrameTarget],
    frame: str | None = None,
    q0: ArrayLike | None = None,
    **options: Unpack[IKOptions],
) -> IKResult:
    """Find a configuration within limits that brings `frame` to `target`.

    **Target.** `target` is a pose T_world_target (..., 4, 4), or a position (..., 3) [m], which leaves the
    rotation free. With ``free="position"`` the target is a rotation (..., 3, 3), with ``free="rotation"`` a
    position. A pose is valid in both cases; dynx ignores its other part. For several frames at once, give
    ``target={"left_hand": T_left, ...}``, or a list of `FrameTarget`, each with its own options. Then `frame`
    is None.

    **Options.** `dynx.ik.options.Options` describes each option, with its unit. With `free`, `weights` or
    tolerances along axes, the frame need not reach the target in every direction. ``free="rotation_z"``
    leaves the rotation about the target's z axis free (a welding torch). ``free=("position_x", "rotation")``
    leaves free the position along the target's x axis, and the rotation.

    **Search.** The search starts at `q0` (..., nq), or at a random configuration if q0 is None. dynx moves a
    q0 outside the limits into the limits, and `IKResult.note` says so. Targets and q0 broadcast. The search
    gives up a start after `max_iterations` steps, or sooner if the error stagnates. Then it starts again at a
    random configuration, up to `max_restarts` times. If `rng` is a seed (the default), equal calls return
    equal results, and a sample of a batch has the same result as alone.

    Only the joints between root and frames move, and a floating base. All other joints stay at q0, or at the
    neutral configuration. If the range of an angle is a full turn, dynx returns the value nearest to q0.

    **Result.** dynx checks the result by forward kinematics. If the search does not reach a target, dynx
    raises no error, and the result has the best q found. The status is then one of these:

    - UNREACHABLE: the target is farther than the chain is long, so no configuration reaches it
      (`dynx.ik.reach`)
    - TIMED_OUT: `timeout` [s] stopped the search. Samples of a batch that were not begun have the start as q
      and NaN as errors
    - IN_COLLISION: every solution found is too close to an obstacle (see `avoid`)
    - NOT_FOUND: all other cases

    **Obstacles.** `avoid` is a scene or a result of `Scene.avoidance`. A solution then keeps the robot's
    links at least a margin from the obstacles and from one another, by certified distances (`dynx.distance`).
    If a solution is too close, dynx takes another solution of the closed form or of further starts, or moves
    redundant joints. With the status IN_COLLISION the message names the pair that is too close.

    **All solutions.** With ``all_solutions=True`` the result is an `IKSolutions`: every configuration within
    limits that reaches a pose, from the closed form (`dynx.ik.closed_form`), with the names of the branches.
    A closed form exists for six revolute joints with a spherical wrist or three parallel axes, and for many
    arms with prismatic joints. `given` has the positions [rad or m] of further joints between root and frame,
    such as one joint of seven. Angles are those nearest to q0, or to 0. `IKSolutions.with_full_turns` adds
    the other angles within the limits. The options of the search have no effect here.

    Raises UnknownNameError for the frame or the name of an option; ArgumentError (ShapeError, DTypeError,
    NotFiniteError) for an invalid argument, and for method ``"engine"`` if the backend has no solver of its
    own; NoClosedFormError if all solutions of an arm without a closed form are wanted, with what is missing.
    """
    try:
        compiles = backend.compiles
    except AttributeError:
        raise ArgumentError(
            f"the backend is of type {type(backend).__name__}; wanted a dynx.Backend, "
            "as dynx.backend(NAME, model) returns it"
        ) from None
    if not compiles:
        return _inverse_kinematics(backend, target, frame, q0, options)
    # A few microseconds for a single pose with options that were checked before.
    solvers = backend.kept(SOLVERS, _kernel_solvers)
    call = solvers.call(frame, options)
    if call is not None:
        found = call(target, q0)
        if found is not None:
            return found
    found = _inverse_kinematics(backend, target, frame, q0, options)
    if call is None and isinstance(frame, str):
        solvers.store_call(frame, options, backend)
    return found


def _kernel_solvers() -> KernelSolvers:
    """Return solvers for a new backend, which keeps them; only what compiles imports them."""
    from dynx.ik.kernels import KernelSolvers

    return KernelSolvers()


def _inverse_kinematics(
    backend: Backend, target: Any, frame: str | None, q0: ArrayLike | None, options: Mapping[str, Any]
) -> IKResult:
    """Check the arguments and return the result."""
    chosen = Options.of(options)
    if checked_bool("all_solutions", chosen.all_solutions):
        return _all_solutions(backend, target, frame, q0, chosen)
    if chosen.given is not None:
        raise ArgumentError(
            "given has no effect without all_solutions=True; lock joints when loading instead"
        )
    problem = checked_problem(backend.model, target, frame, q0, chosen)
    found = _solved(backend, problem, chosen.method)
    goal = None if problem.secondary is None else problem.secondary.nearest
    note = argument_note(backend.model, q0, problem.avoidance, goal)
    return replace(found, note=note) if note else found


def _solved(backend: Backend, problem: Problem, method: str) -> IKResult:
    """Return the result of a checked problem. Raises ArgumentError for an unknown method."""
    if not isinstance(method, str) or method not in METHODS:
        raise ArgumentError(f"method is {shown(method)}{nearest(method, METHODS)}")
    if method == "dynx":
        found = None
        if backend.compiles:
            with not_counted():
                from dynx.ik.kernels import kernel_solution

            found = kernel_solution(backend, problem)
        if found is None:
            found = _searched(backend, problem)
        if problem.secondary is None and problem.avoidance is None:
            return found
        with not_counted():
            from dynx.ik.refine import refined_solutions

        return refined_solutions(backend, problem, found)
    return _solved_by_engine(backend, problem)


def _searched(backend: Backend, problem: Problem) -> IKResult:
    """Search for each sample, one after the other."""
    search, starts = Search(backend.model, problem.coordinates, problem.limits), problem.starts()
    candidates: list[Candidate] = []
    for k, task in problem.tasks(backend):
        if k and problem.limits.time_limit.is_over():
            return _result(candidates, problem, backend)
        candidates.append(search.run(task, starts[k], problem.rng, begin_at_q0=problem.begins_at_q0))
    return _result(candidates, problem, backend)


def _solved_by_engine(backend: Backend, problem: Problem) -> IKResult:
    """Return the solutions of the engine's own solver, measured by forward kinematics."""
    targets = problem.targets
    is_pose = problem.is_plain and targets.positions is not None and targets.rotations is not None
    if not is_pose or problem.point is not None:
        raise ArgumentError("method 'engine' takes poses (..., 4, 4) of a frame only; use method 'dynx'")
    search, starts = Search(backend.model, problem.coordinates, problem.limits), problem.starts()
    candidates = []
    for (k, task), (position, rotation) in zip(
        problem.tasks(backend), targets.rows(problem.batch), strict=True
    ):
        if k and problem.limits.time_limit.is_over():
            break
        T, q = np.eye(4), starts[k]
        T[:3, :3], T[:3, 3] = rotation, position
        q_engine = backend.engine_inverse_kinematics(T, problem.frame, q)
        # If the engine diverged, its start is the best configuration known.
        within = search.within_limits(q_engine, q) if np.isfinite(q_engine).all() else q
        candidates.append(search.evaluate(within, task))
    return _result(candidates, problem, backend)


def _result(found: list[Candidate], problem: Problem, backend: Backend) -> IKResult:
    """Return the result of candidates; samples after the last were not begun before the time was over."""
    batch, begun, starts = problem.batch, len(found), problem.starts()
    found = found + [Candidate.not_begun(q, len(problem.requirements)) for q in starts[begun:]]
    success = np.array([one.success for one in found], dtype=np.bool_).reshape(batch)
    unreached = ~success.reshape(-1) & (np.arange(problem.count) < begun)
    proof = None
    if unreached.any():
        from dynx.ik.reach import proofs  # targets that are reached need none

        proof = proofs(problem, backend.model, unreached).reshape(batch)
    timed_out = np.array([one.timed_out for one in found], dtype=np.bool_).reshape(batch)
    return IKResult(
        q=np.array([one.q for one in found], dtype=np.float64).reshape(*batch, backend.model.nq),
        success=success,
        position_error=np.array([one.position_error for one in found]).reshape(batch),
        rotation_error=np.array([one.rotation_error for one in found]).reshape(batch),
        iterations=np.array([one.iterations for one in found], dtype=np.int64).reshape(batch),
        restarts=np.array([one.restarts for one in found], dtype=np.int64).reshape(batch),
        proof=proof,
        timed_out=timed_out if timed_out.any() else None,
        by_frame=problem.by_frame([one.by_frame for one in found]),
    )


def _all_solutions(
    backend: Backend, target: Any, frame: str | None, q0: ArrayLike | None, options: Options
) -> IKResult:
    """Return every solution of poses of one frame, from the closed form."""
    plain = Options(
        position_tolerance=options.position_tolerance, rotation_tolerance=options.rotation_tolerance
    )
    names = ("free", "point", "weights", "axes", "limit_margin", "nearest", "maximize", "avoid", "method")
    if frame is None or any(getattr(options, name) is not getattr(plain, name) for name in names):
        raise ArgumentError(
            f"all_solutions is True; it takes poses (..., 4, 4) of a frame, without "
            f"{', '.join(names[:-1])} or {names[-1]}"
        )
    backend.model.frame_index(frame)
    limits = options.search_limits()
    tolerances = (limits.position_tolerance, limits.rotation_tolerance)
    from dynx.ik.closed_forms.solver import all_solutions

    return all_solutions(backend, target, frame, q0, options.given, *tolerances)
