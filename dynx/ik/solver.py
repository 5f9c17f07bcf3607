"""`inverse_kinematics`: arguments checked, batches broadcast, a method chosen, the answer measured."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.ik.residual import Residual
from dynx.ik.result import IKResult
from dynx.ik.search import Effort, Found, Kinematics, Search
from dynx.ik.targets import checked_targets
from dynx.model import Model
from dynx.model.configuration import checked_q, checked_vector
from dynx.spatial.scalar import Floats

EngineSolver = Callable[[Floats, str, Floats], Floats]
"""From a pose T_world_target (4, 4), a frame and q0 (nq,) to the engine's answer q (nq,)."""


def inverse_kinematics(
    kinematics: Kinematics,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None = None,
    *,
    point: ArrayLike | None = None,
    position_tolerance: float = 1e-6,
    rotation_tolerance: float = 1e-6,
    max_iterations: int = 50,
    max_restarts: int = 200,
    rng: np.random.Generator | int | None = 0,
    method: str = "dynx",
) -> IKResult:
    """The configuration within limits that brings `frame` to `target`.

    `target` is a pose T_world_target (..., 4, 4), or a position (..., 3) [m] with the rotation left
    free. `q0` (..., nq) is where the search begins (what lies outside the limits is moved to them);
    without it, it begins at random. Targets and q0 broadcast. `point` (3,) [m], in the axes of the
    frame, is what is to reach the target's position instead of the frame's origin.

    A target counts as reached within `position_tolerance` [m] and `rotation_tolerance` [rad]. A start
    is given up after `max_iterations` steps, or sooner if it stagnates; then the search begins again
    at random, up to `max_restarts` times. `rng`, a seed or a generator, makes that repeatable: with
    a seed (the default) equal calls give equal answers, and every sample of a batch the answer that
    it would get alone.

    Only joints between the root and the frame move, and a floating base; the rest stay at q0 (or at
    the neutral configuration). Angles that can turn a whole turn come out nearest to q0.

    `method` is ``"dynx"`` (see `dynx.ik.search`) or ``"engine"``: the backend's own solver, alone.
    Both answers are judged by forward kinematics: an unreached target is no error, but a result
    with ``success`` False and the best q that was found.

    Raises UnknownNameError for the frame, ArgumentError (ShapeError, DTypeError, NotFiniteError)
    for anything else that cannot be used, and for ``"engine"`` if the backend has no solver.
    """
    model = kinematics.model
    model.frame_index(frame)
    targets = checked_targets(target)
    effort = _checked_effort(position_tolerance, rotation_tolerance, max_iterations, max_restarts)
    rng = _checked_rng(rng)
    at = None if point is None else checked_vector("point", point)
    start = _start(model, q0)
    try:
        batch = np.broadcast_shapes(targets.batch, start.shape[:-1])
    except ValueError:
        raise ShapeError(
            f"leading axes do not broadcast: target has {targets.batch}, q0 has {start.shape[:-1]}"
        ) from None

    search = Search(kinematics, frame, at, effort)
    if method == "dynx":

        def solve(position: Floats, rotation: Floats | None, q: Floats) -> Found:
            return search.run(position, rotation, q, rng, begin_at_q0=q0 is not None)

    elif method == "engine":
        ask = _engine_solver(kinematics, targets.rotations is None or at is not None)

        def solve(position: Floats, rotation: Floats | None, q: Floats) -> Found:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = rotation, position
            answer = ask(T, frame, q)
            # An engine that diverged has no answer; where it began is then the best there is.
            within = search.within_limits(answer, q) if np.isfinite(answer).all() else q
            return search.measured(within, Residual(position, rotation, None))

    else:
        raise ArgumentError(f"method is {shown(method)}; wanted 'dynx' or 'engine'")

    if not batch:
        one = solve(targets.positions, targets.rotations, start)
        errors = np.array((one.position_error, one.rotation_error))
        steps = np.array((one.iterations, one.restarts))
        return IKResult(
            one.q, np.asarray(one.success), errors[0, ...], errors[1, ...], steps[0, ...], steps[1, ...]
        )
    positions = np.broadcast_to(targets.positions, (*batch, 3)).reshape(-1, 3)
    starts = np.broadcast_to(start, (*batch, model.nq)).reshape(len(positions), model.nq)
    if targets.rotations is None:
        found = [solve(p, None, q) for p, q in zip(positions, starts, strict=True)]
    else:
        rotations = np.broadcast_to(targets.rotations, (*batch, 3, 3)).reshape(-1, 3, 3)
        found = [solve(p, R, q) for p, R, q in zip(positions, rotations, starts, strict=True)]
    return _result(found, batch, model.nq)


def _result(found: list[Found], batch: tuple[int, ...], nq: int) -> IKResult:
    return IKResult(
        q=np.array([one.q for one in found], dtype=np.float64).reshape(*batch, nq),
        success=np.array([one.success for one in found], dtype=np.bool_).reshape(batch),
        position_error=np.array([one.position_error for one in found]).reshape(batch),
        rotation_error=np.array([one.rotation_error for one in found]).reshape(batch),
        iterations=np.array([one.iterations for one in found], dtype=np.int64).reshape(batch),
        restarts=np.array([one.restarts for one in found], dtype=np.int64).reshape(batch),
    )


def _start(model: Model, q0: ArrayLike | None) -> Floats:
    """q0, or the neutral configuration, within limits and with a quaternion of unit length."""
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
    ask: EngineSolver = solver
    return ask


def _checked_effort(
    position_tolerance: float, rotation_tolerance: float, max_iterations: int, max_restarts: int
) -> Effort:
    for name, tolerance in (
        ("position_tolerance", position_tolerance),
        ("rotation_tolerance", rotation_tolerance),
    ):
        if not (isinstance(tolerance, int | float | np.number) and 0.0 < tolerance < math.inf):
            raise ArgumentError(f"{name} is {shown(tolerance)}; wanted a positive number")
    for name, count in (("max_iterations", max_iterations), ("max_restarts", max_restarts)):
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 0:
            raise ArgumentError(f"{name} is {shown(count)}; wanted a whole number, at least 0")
    return Effort(
        float(position_tolerance), float(rotation_tolerance), int(max_iterations), int(max_restarts)
    )


def _checked_rng(rng: np.random.Generator | int | None) -> np.random.Generator | int | None:
    if rng is None or isinstance(rng, np.random.Generator):
        return rng
    if isinstance(rng, int | np.integer) and not isinstance(rng, bool) and rng >= 0:
        return int(rng)
    raise ArgumentError(f"rng is {shown(rng)}; wanted a generator, a seed (at least 0) or None")
