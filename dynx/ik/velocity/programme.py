"""`velocity_ik`: joint velocities by weighted least squares within bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.ik.velocity.dampers import dampers
from dynx.ik.velocity.library import solve_programme
from dynx.ik.velocity.limits import joints_outside, velocity_bounds
from dynx.ik.velocity.tasks import VelocityTask
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.numbers import checked_array, is_real, positive_seconds, real_array
from dynx.option_names import checks_option_names
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from dynx.distance.avoidance import AvoidanceSource

RELAXED_WEIGHT = 1e4
"""Weight of hard tasks that cannot all be met within the bounds."""

DAMPER_WEIGHT = 1e5
"""Weight of the rates of distances that cannot all be kept within the bounds."""

AT_BOUND = 1e-9
"""Distance from a bound [rad/s or m/s] below which a velocity is at it."""


@dataclass(frozen=True, eq=False)
class VelocityResult:
    """Velocity of one step; `success` says whether all hard tasks are met."""

    v: Floats
    """Velocity (nv,) [rad/s or m/s], within the bounds."""
    success: bool
    """False if the hard tasks cannot all be met within the bounds; they are then met as well as possible."""
    errors: tuple[Floats, ...]
    """For each task the weighted error J v - velocity (m,), of its components with a weight above 0."""
    limited: NDArray[np.bool_]
    """Coordinates (nv,) whose velocity is at a bound."""
    held_back: tuple[tuple[str, str], ...] = ()
    """With `avoid` the pairs of bodies that approach one another as fast as they may."""
    too_fast: tuple[tuple[str, str], ...] = ()
    """Pairs of bodies that approach faster than they may, because no velocity within the bounds prevents it;
    empty otherwise."""
    note: str = ""
    """Sentences that name joints of q outside their limits, which are brought back, and the links that
    `avoid` keeps nothing from; empty without them."""

    def __bool__(self) -> bool:
        """Return whether all hard tasks are met."""
        return self.success


@checks_option_names
def velocity_ik(
    backend: Backend,
    q: ArrayLike,
    tasks: VelocityTask | Sequence[VelocityTask],
    *,
    dt: float,
    damping: float = 1e-6,
    posture: ArrayLike | None = None,
    posture_weight: float = 1e-2,
    posture_gain: float = 1.0,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    avoid: AvoidanceSource | None = None,
    avoid_gain: float = 5.0,
) -> VelocityResult:
    """Find the velocity v (nv,) at q (nq,) that meets tasks best and keeps the limits for `dt` [s].

    v minimises the sum of ``|W (J v - velocity)|^2`` of the tasks that are not hard, of ``posture_weight^2
    |v - posture_gain (posture - q)|^2`` over the joints if a `posture` (nq,) is given, and of ``damping
    |v|^2`` (damping > 0), under the hard tasks and the bounds: ``q + dt v`` is within the position limits,
    |v| within `velocity_limit` (one number or (nv,), by default the model's), and with `acceleration_limit`
    [rad/s^2 or m/s^2] the joints can stop before their limits; with `v0` (nv,), the velocity before, the
    change is at most ``acceleration_limit dt``. A joint outside its position limits returns to them as fast
    as the other bounds allow, before all tasks, and `note` names it. A base that floats has no bounds but
    those given.

    With `avoid`, a scene or what `Scene.avoidance` returns, the distance d of each pair of bodies that is
    near changes by at least ``-avoid_gain (d - margin)`` [m/s], before all tasks: d does not fall below the
    margin but by what the linear rate neglects, of the order ``dt^2``, and where it is below, it grows back.
    `avoid_gain` [1/s] is at most ``1 / dt``. Pairs count from where 1 m/s is allowed (``1 / avoid_gain`` m).

    If the hard tasks contradict each other or the bounds, they count as soft ones of a large weight, and
    `success` is False. The quadratic programme is solved by DAQP (extra ``qp``). Siciliano et al., section
    3.5, with inequalities as in Kanoun, Lamiraux and Wieber, IEEE Trans. Robotics 27(4), 2011.

    Raises NotInstalledError without the extra; UnknownNameError for a frame; ArgumentError (ShapeError,
    DTypeError, NotFiniteError) for an invalid argument.
    """
    model = backend.model
    seconds = positive_seconds("dt", dt)
    position = checked_q(model, q, "q")
    if position.ndim != 1:
        raise ShapeError(f"q has shape {position.shape}; wanted ({model.nq},)")
    wanted = _checked_tasks(tasks)
    for name, number, least in (
        ("damping", damping, "above 0"),
        ("posture_weight", posture_weight, ""),
        ("posture_gain", posture_gain, ""),
    ):
        if not (is_real(number) and 0.0 <= number < math.inf and (number > 0.0 or not least)):
            raise ArgumentError(f"{name} is {shown(number)}; wanted a number {least or 'of at least 0'}")
    speed, acceleration = model.velocity_limit, np.full(model.nv, math.inf)
    if velocity_limit is not None:
        speed = _limit("velocity_limit", velocity_limit, model)
    if acceleration_limit is not None:
        acceleration = _limit("acceleration_limit", acceleration_limit, model)
    if v0 is not None and acceleration_limit is None:
        raise ArgumentError("v0 is given without acceleration_limit, with which alone it has an effect")
    before = None if v0 is None else checked_array("v0", v0, model.nv)
    if before is not None and before.ndim != 1:
        raise ShapeError(f"v0 has shape {before.shape}; wanted ({model.nv},)")
    lower, upper = velocity_bounds(model, position, seconds, speed, acceleration, before)

    rows = [task.rows(backend, position) for task in wanted]
    soft = [pair for task, pair in zip(wanted, rows, strict=True) if not task.hard]
    hard = [pair for task, pair in zip(wanted, rows, strict=True) if task.hard]
    if posture is not None:
        goal = checked_q(model, posture, "posture")
        if goal.ndim != 1:
            raise ShapeError(f"posture has shape {goal.shape}; wanted ({model.nq},)")
        offset = 6 if model.floating else 0
        select = np.eye(model.nv)[offset:]
        error = (goal - position)[7 if model.floating else 0 :]
        soft.append((posture_weight * select, posture_weight * posture_gain * error))
    A, b = _stacked(hard, model.nv)
    near = dampers(backend, position, avoid, avoid_gain, seconds)
    G, rates = near.J, near.bound
    v = solve_programme(*_quadratic(soft, damping, model.nv), lower, upper, A, b, G, rates)
    success = v is not None
    if v is None:
        soft += [(RELAXED_WEIGHT * J, RELAXED_WEIGHT * velocity) for J, velocity in hard]
        v = solve_programme(*_quadratic(soft, damping, model.nv), lower, upper, A[:0], b[:0], G, rates)
    if v is None:
        # Bodies that are too close cannot part as fast as they should: they count before the tasks, and those
        # that are not are kept as far as the bounds permit.
        close = rates > 0.0
        soft.append((DAMPER_WEIGHT * G[close], DAMPER_WEIGHT * rates[close]))
        H, g = _quadratic(soft, damping, model.nv)
        v = solve_programme(H, g, lower, upper, A[:0], b[:0], G[~close], rates[~close])
        if v is None:
            soft.append((DAMPER_WEIGHT * G[~close], DAMPER_WEIGHT * np.zeros(int((~close).sum()))))
            H, g = _quadratic(soft, damping, model.nv)
            v = solve_programme(H, g, lower, upper, A[:0], b[:0], G[:0], rates[:0])
    assert v is not None
    at_bound = (v <= lower + AT_BOUND) | (v >= upper - AT_BOUND)
    errors = tuple(J @ v - velocity for J, velocity in rows)
    return VelocityResult(
        v, success, errors, at_bound, near.active(v, AT_BOUND), near.missed(v, AT_BOUND),
        "; ".join(filter(None, (joints_outside(model, position), near.note))),
    )  # fmt: skip


def _checked_tasks(tasks: VelocityTask | Sequence[VelocityTask]) -> list[VelocityTask]:
    if isinstance(tasks, VelocityTask):
        return [tasks]
    if isinstance(tasks, str) or not isinstance(tasks, Iterable):
        raise ArgumentError(
            f"tasks is {shown(tasks)}; wanted dynx.ik.velocity.VelocityTask, or a list of them"
        )
    wanted = list(tasks)
    for task in wanted:
        if not isinstance(task, VelocityTask):
            raise ArgumentError(f"tasks has {shown(task)}; wanted dynx.ik.velocity.VelocityTask")
    return wanted


def _quadratic(soft: list[tuple[Floats, Floats]], damping: float, nv: int) -> tuple[Floats, Floats]:
    """Return H (nv, nv) and g (nv,) of the weighted squares."""
    J, velocity = _stacked(soft, nv)
    return J.T @ J + damping * np.eye(nv), -J.T @ velocity


def _stacked(rows: list[tuple[Floats, Floats]], nv: int) -> tuple[Floats, Floats]:
    if not rows:
        return np.zeros((0, nv)), np.zeros(0)
    return np.concatenate([J for J, _ in rows]), np.concatenate([velocity for _, velocity in rows])


def _limit(name: str, bound: ArrayLike, model: Model) -> Floats:
    array = real_array(name, bound)
    if array.shape not in ((), (model.nv,)):
        raise ShapeError(f"{name} has shape {array.shape}; wanted one number, or ({model.nv},)")
    if not (array >= 0.0).all():
        raise ArgumentError(f"{name} has the least entry {np.min(array):g}; wanted at least 0")
    return np.array(np.broadcast_to(array, (model.nv,)))
