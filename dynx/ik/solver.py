"""`inverse_kinematics`: checks arguments, broadcasts batches, runs a method and measures its result."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.ik.closed_form.checking import all_solutions as solve_closed_form
from dynx.ik.problem import Problem
from dynx.ik.residual import Residual
from dynx.ik.result import IKResult
from dynx.ik.search import Candidate, Kinematics, Search, SearchLimits
from dynx.ik.targets import checked_targets
from dynx.model import Model
from dynx.model.configuration import checked_q, checked_vector, whole_number
from dynx.spatial.scalar import Floats

ProblemSolver = Callable[[Problem], "IKResult | None"]
"""Method ``solve_inverse_kinematics`` of kinematics that solve many targets at once; it returns None for a
problem that it does not apply to."""

EngineSolver = Callable[[Floats, str, Floats], Floats]
"""Function from a pose T_world_target (4, 4), a frame and q0 (nq,) to the engine's solution q (nq,)."""


def inverse_kinematics(
    kinematics: Kinematics,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None = None,
    *,
    free: str | None = None,
    point: ArrayLike | None = None,
    position_tolerance: float = 1e-6,
    rotation_tolerance: float = 1e-6,
    max_iterations: int = 50,
    max_restarts: int = 200,
    rng: np.random.Generator | int | None = 0,
    method: str = "dynx",
    all_solutions: bool = False,
    given: Mapping[str, float] | None = None,
) -> IKResult:
    """Find a configuration within limits that brings `frame` to `target`.

    `target` is a pose T_world_target (..., 4, 4), or a position (..., 3) [m] with free rotation. With
    ``free="position"`` it is a rotation (..., 3, 3), or that of a pose; with ``free="rotation"`` a position,
    or that of a pose. `point` (3,) [m], in the axes of the frame, is the point that reaches the target
    position instead of the origin of the frame.

    The search starts at `q0` (..., nq), moved into the limits, or at a random configuration if q0 is None.
    Targets and q0 broadcast.

    A target counts as reached within `position_tolerance` [m] and `rotation_tolerance` [rad]. A start is
    abandoned after `max_iterations` steps, or sooner if it stagnates; the search then restarts at a random
    configuration, up to `max_restarts` times. `rng` is a seed or a generator. With a seed (the default) equal
    calls return equal results, and each sample of a batch has the result that it has alone.

    Only the joints between root and frame move, and a floating base; the others stay at q0 (or at the neutral
    configuration). Angles whose range is a full turn are returned nearest to q0.

    `method` is ``"dynx"`` (see `dynx.ik.search`) or ``"engine"``: the backend's own solver, without restarts.
    The result of either is checked by forward kinematics. If the target is not reached, no error is raised;
    the result has `success` False and the best q found.

    With ``all_solutions=True`` the result is an `IKSolutions` with every configuration within limits that
    reaches a pose, and the names of its branches, from the closed form (`dynx.ik.closed_form`). It exists for
    six revolute joints with a spherical wrist or three parallel axes; `given` holds positions [rad or m] of
    further joints between root and frame, such as one of seven. Angles are those nearest to q0, or to 0. The
    options of the search have no effect then.

    Raises UnknownNameError for the frame; ArgumentError (ShapeError, DTypeError, NotFiniteError) for an
    invalid argument, and for method ``"engine"`` if the backend has no solver of its own; NoClosedFormError
    if all solutions of an arm without a closed form are wanted, with what is missing.
    """
    model = kinematics.model
    model.frame_index(frame)
    if all_solutions:
        if free is not None or point is not None or method != "dynx":
            raise ArgumentError(
                "all_solutions takes poses (..., 4, 4) of a frame, without free, point or method"
            )
        # The tolerances are checked like those of a search.
        _checked_limits(position_tolerance, rotation_tolerance, max_iterations, max_restarts)
        return solve_closed_form(kinematics, target, frame, q0, given, position_tolerance, rotation_tolerance)
    if given is not None:
        raise ArgumentError(
            "given has no effect without all_solutions=True; lock joints when loading instead"
        )
    targets = checked_targets(target, free)
    limits = _checked_limits(position_tolerance, rotation_tolerance, max_iterations, max_restarts)
    rng = _checked_rng(rng)
    at = None if point is None else checked_vector("point", point)
    if at is not None and targets.positions is None:
        raise ArgumentError("point is given in addition to free='position', with which it has no effect")
    start = _start(model, q0)
    try:
        batch = np.broadcast_shapes(targets.batch, start.shape[:-1])
    except ValueError:
        raise ShapeError(
            f"leading axes do not broadcast: target has {targets.batch}, q0 has {start.shape[:-1]}"
        ) from None

    problem = Problem(frame, targets, at, start, q0 is not None, batch, limits, rng)
    if method == "dynx":
        solve_all: ProblemSolver | None = getattr(kinematics, "solve_inverse_kinematics", None)
        found = None if solve_all is None else solve_all(problem)
        if found is not None:
            return found
    search = Search(kinematics, frame, at, limits)
    if method == "dynx":

        def solve(position: Floats | None, rotation: Floats | None, q: Floats) -> Candidate:
            return search.run(position, rotation, q, rng, begin_at_q0=q0 is not None)

    elif method == "engine":
        is_pose = targets.positions is not None and targets.rotations is not None
        engine_solve = _engine_solver(kinematics, not is_pose or at is not None)

        def solve(position: Floats | None, rotation: Floats | None, q: Floats) -> Candidate:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = rotation, position
            q_engine = engine_solve(T, frame, q)
            # If the engine diverged, its start is the best configuration known.
            within = search.within_limits(q_engine, q) if np.isfinite(q_engine).all() else q
            return search.evaluate(within, Residual(position, rotation, None))

    else:
        raise ArgumentError(f"method is {shown(method)}; wanted 'dynx' or 'engine'")

    if not batch:
        one = solve(targets.positions, targets.rotations, start)
        errors = np.array((one.position_error, one.rotation_error))
        steps = np.array((one.iterations, one.restarts))
        return IKResult(
            one.q, np.asarray(one.success), errors[0, ...], errors[1, ...], steps[0, ...], steps[1, ...]
        )
    starts = np.broadcast_to(start, (*batch, model.nq)).reshape(math.prod(batch), model.nq)
    candidates = [solve(p, R, q) for (p, R), q in zip(targets.rows(batch), starts, strict=True)]
    return _result(candidates, batch, model.nq)


def _result(found: list[Candidate], batch: tuple[int, ...], nq: int) -> IKResult:
    return IKResult(
        q=np.array([one.q for one in found], dtype=np.float64).reshape(*batch, nq),
        success=np.array([one.success for one in found], dtype=np.bool_).reshape(batch),
        position_error=np.array([one.position_error for one in found]).reshape(batch),
        rotation_error=np.array([one.rotation_error for one in found]).reshape(batch),
        iterations=np.array([one.iterations for one in found], dtype=np.int64).reshape(batch),
        restarts=np.array([one.restarts for one in found], dtype=np.int64).reshape(batch),
    )


def _start(model: Model, q0: ArrayLike | None) -> Floats:
    """Return q0, or the neutral configuration, moved into the limits and with a unit quaternion."""
    q = model.neutral() if q0 is None else checked_q(model, q0, "q0")
    q = np.minimum(np.maximum(q, model.lower), model.upper)
    if model.floating:
        q[..., 3:7] /= np.linalg.norm(q[..., 3:7], axis=-1, keepdims=True)
    return q


def _engine_solver(kinematics: Kinematics, restricted: bool) -> EngineSolver:
    solver = getattr(kinematics, "engine_inverse_kinematics", None)
    if solver is None:
        raise ArgumentError(
            f"method 'engine': {kinematics!r} has no solver of its own; use method 'dynx', "
            "or the backend 'pybullet'"
        )
    if restricted:
        raise ArgumentError("method 'engine' takes poses (..., 4, 4) of a frame only; use method 'dynx'")
    engine_solve: EngineSolver = solver
    return engine_solve


def _checked_limits(
    position_tolerance: float, rotation_tolerance: float, max_iterations: int, max_restarts: int
) -> SearchLimits:
    for name, tolerance in (
        ("position_tolerance", position_tolerance),
        ("rotation_tolerance", rotation_tolerance),
    ):
        if not (isinstance(tolerance, int | float | np.number) and 0.0 < tolerance < math.inf):
            raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number")
    counts = whole_number("max_iterations", max_iterations, 0), whole_number("max_restarts", max_restarts, 0)
    return SearchLimits(float(position_tolerance), float(rotation_tolerance), *counts)


def _checked_rng(rng: np.random.Generator | int | None) -> np.random.Generator | int | None:
    if rng is None or isinstance(rng, np.random.Generator):
        return rng
    if isinstance(rng, int | np.integer) and not isinstance(rng, bool) and rng >= 0:
        return int(rng)
    raise ArgumentError(f"rng is {shown(rng)}; wanted a generator, a seed (at least 0) or None")
