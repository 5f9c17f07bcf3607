"""Velocity inverse kinematics as a bounded quadratic programme: tasks, limits, dampers and the solver.

The programme is solved by DAQP (Arnstrom, Bemporad and Axehill, A dual active-set solver for embedded
quadratic programming using recursive LDL' updates, IEEE Trans. Automatic Control 67(8), 2022).

Velocity dampers bound how fast bodies that are near may approach one another. For a pair at the distance d,
d' >= -gain (d - margin) lets d fall to the margin no faster than exponentially, and grow back to it where it
is below (Faverjon and Tournassoud, A local based approach for path planning of manipulators with a high
number of degrees of freedom, IEEE ICRA 1987; as rows of a quadratic programme: Kanoun, Lamiraux and Wieber,
IEEE Trans. Robotics 27(4), 2011). Where faces meet, several points are nearest, and the rate of one says
nothing of the others. So the end of the step is examined too: a pair that it brings too close adds a row,
linearised there, and the programme is solved again (Kelley, The cutting-plane method for solving convex
programs, J. SIAM 8(4), 1960).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.argument_types import is_listed
from dynx.backends.base import Backend
from dynx.errors import ArgumentError, ShapeError, importing, shown
from dynx.ik.descent import ErrorCall, KernelTarget
from dynx.ik.problem import checked_avoidance, checked_velocity_limit
from dynx.ik.step import TargetKind
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.configuration import checked_q
from dynx.model.numbers import checked_array, checked_vector, is_real, positive_seconds, real_array
from dynx.model.targets import checked_targets
from dynx.option_names import checks_field_names, checks_option_names
from dynx.spatial.scalar import Floats
from dynx.time_limit import TimeLimit, not_counted

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance, AvoidanceSource, NearPair, Pair


@checks_field_names()
@dataclass(frozen=True, eq=False)
class VelocityTask:
    """The velocity of one frame, its weights, and whether it must be met.

    With neither a velocity nor a target the frame holds still: its velocity is 0.
    """

    frame: str
    velocity: ArrayLike | None = None
    """Velocity (6,) of the frame's origin [m/s], then angular velocity [rad/s], in world axes; None is 0."""
    target: ArrayLike | None = None
    """Pose T_world_target (4, 4) or `dynx.Pose`, or position (3,) [m] with free rotation, that the frame
    moves towards: `gain` times the error is added to `velocity`."""
    gain: float = 1.0
    """Velocity per error [1/s]: the error falls by exp(-gain t)."""
    weights: ArrayLike = 1.0
    """Weight of each component of the velocity, one number or (6,), at least 0. For a hard task a weight
    above 0 only selects the component. With a position as the target and no `velocity`, the angular
    components have weight 0."""
    hard: bool = False
    """Whether components with a weight above 0 are met exactly, before all tasks that are not hard."""
    point: ArrayLike | None = None
    """Point (3,) [m] of the frame, in its axes, that has the velocity instead of the origin."""

    def rows(self, backend: Backend, q: Floats) -> tuple[Floats, Floats]:
        """Return the weighted Jacobian (m, nv) and the weighted velocity (m,) at q.

        A component of weight 0 has no row; the weights of a hard task only select components. Raises
        UnknownNameError, ArgumentError, ShapeError, DTypeError or NotFiniteError.
        """
        backend.model.frame_index(self.frame)
        point = None if self.point is None else checked_vector("point", self.point)
        velocity = (
            np.zeros(6) if self.velocity is None else checked_array("velocity", self.velocity, 6).copy()
        )
        if velocity.shape != (6,):
            raise ShapeError(f"velocity has shape {velocity.shape}; wanted (6,)")
        weights = real_array("weights", self.weights)
        if weights.shape not in ((), (6,)):
            raise ShapeError(f"weights have shape {weights.shape}; wanted one number, or (6,)")
        if not (np.isfinite(weights).all() and (weights >= 0.0).all()):
            raise ArgumentError(f"weights are {shown(self.weights)}; wanted finite numbers of at least 0")
        weights = np.array(np.broadcast_to(weights, (6,)))
        if self.target is not None:
            if not (is_real(self.gain) and 0.0 <= self.gain < np.inf):
                raise ArgumentError(f"gain is {shown(self.gain)}; wanted a number of at least 0 [1/s]")
            targets = checked_targets(self.target)
            if targets.batch:
                raise ShapeError(f"target has shape {np.shape(self.target)}; wanted (4, 4) or (3,)")
            kind = TargetKind.of(targets, point, None)
            target = KernelTarget(kind, kind.rows(targets, ())[0], tuple(kind.optional_values(point, None)))
            error, *_ = ErrorCall(target, (0.0, 0.0))(backend.forward_kinematics(q, self.frame))
            velocity[: len(error)] += self.gain * np.array(error)
            if targets.rotations is None and self.velocity is None:
                weights[3:] = 0.0
        chosen = weights > 0.0
        J = backend.jacobian(q, self.frame, point=point)[chosen]
        scale = np.ones(int(chosen.sum())) if self.hard else weights[chosen]
        return scale[:, None] * J, scale * velocity[chosen]


OUTSIDE = 1e-6
"""Distance from a limit [rad or m] above which a joint outside is named; less is rounding of float32."""


def velocity_bounds(
    model: Model, q: Floats, dt: float, velocity_limit: Floats, acceleration_limit: Floats, v0: Floats | None
) -> tuple[Floats, Floats]:
    """Return the bounds (nv,) on a velocity that is kept for `dt` [s].

    The joints stay within their position limits, and within their acceleration limits can still stop before
    them: after a step of velocity v at a distance d from the limit, v^2 / (2 a) <= d - v dt, so that
    v <= sqrt((a dt)^2 + 2 a d) - a dt. With `v0` the change of velocity is at most a dt. A joint outside its
    limits returns as fast as these bounds allow, and arrives at the limit. Where bounds contradict each
    other, those of position and velocity count more than that of the change. Arguments are not checked.
    """
    room_below, room_above = np.full(model.nv, np.inf), np.full(model.nv, np.inf)
    ones = [joint.name for joint in model.coordinate_joints if joint.type != "ball"]
    in_q, in_v = (
        [model.position_index(each) for each in ones],
        [model.coordinate_index(each) for each in ones],
    )
    room_below[in_v] = q[in_q] - model.lower[in_q]
    room_above[in_v] = model.upper[in_q] - q[in_q]
    # The room is negative outside a limit, and so is the velocity towards it.
    low = -_towards(room_below, dt, velocity_limit, acceleration_limit)
    high = _towards(room_above, dt, velocity_limit, acceleration_limit)
    if v0 is not None:
        change = acceleration_limit * dt
        low, high = np.clip(v0 - change, low, high), np.clip(v0 + change, low, high)
    return low, high


def joints_outside(model: Model, q: Floats) -> str:
    """Return a sentence that names the joints whose position q is outside the limits, or an empty text."""
    beyond = np.maximum(model.lower - q, q - model.upper)
    offset = 7 if model.floating else 0
    names = [
        f"{model.position_names[k - offset]} by {beyond[k]:.6g}"
        for k in np.flatnonzero(beyond > OUTSIDE).tolist()
    ]
    return f"q is outside the position limits [rad or m]: {', '.join(names)}" if names else ""


def _towards(room: Floats, dt: float, velocity_limit: Floats, acceleration_limit: Floats) -> Floats:
    """Return the largest velocity in the direction of a limit at the signed distance `room`."""
    most = np.minimum(_largest_speed(np.abs(room), dt, acceleration_limit), velocity_limit)
    return np.where(room < 0.0, -most, most)


def _largest_speed(room: Floats, dt: float, acceleration: Floats) -> Floats:
    """Return the largest velocity towards a limit at the distance `room`, for each coordinate."""
    found: Floats = room / dt
    brakes = np.isfinite(acceleration) & np.isfinite(room)
    a = acceleration[brakes]
    # The difference of nearly equal numbers, written as a quotient.
    root = np.sqrt((a * dt) ** 2 + 2.0 * a * room[brakes]) + a * dt
    braking = np.divide(2.0 * a * room[brakes], root, out=np.zeros(len(a)), where=root > 0.0)
    found[brakes] = np.minimum(found[brakes], braking)
    return found


Names = tuple[tuple[str, str], ...]
"""Names of the two bodies of each pair."""

FREE_SPEED = 1.0
"""Speed of approach [m/s] that the damper of a pair allows where it begins to count."""


@dataclass(frozen=True, eq=False)
class Dampers:
    """Rows J v >= bound, one or several for each pair that is near."""

    J: Floats
    """Derivatives (m, nv) of the distances."""
    bound: Floats
    """Least rates (m,) of the distances [m/s]; positive for a pair that is closer than its margin."""
    is_close: NDArray[np.bool_]
    """Whether the pair (m,) is closer than its margin."""
    names: Names
    """Names of the bodies of each pair."""

    @classmethod
    def none(cls, nv: int) -> Dampers:
        """Return no rows."""
        return cls(np.zeros((0, nv)), np.zeros(0), np.zeros(0, dtype=np.bool_), ())

    def joined(self, other: Dampers) -> Dampers:
        """Return the rows of both."""
        J, bound = np.concatenate([self.J, other.J]), np.concatenate([self.bound, other.bound])
        return Dampers(J, bound, np.append(self.is_close, other.is_close), (*self.names, *other.names))

    def missed(self, v: Floats, tolerance: float) -> Names:
        """Return the pairs that approach faster than they may, by more than `tolerance` [m/s]."""
        return self._names(self.bound - self.J @ v > tolerance)

    def active(self, v: Floats, tolerance: float) -> Names:
        """Return the pairs that approach as fast as they may, or faster."""
        return self._names(self.J @ v - self.bound <= tolerance)

    def _names(self, chosen: NDArray[np.bool_]) -> Names:
        """Return the names of some rows, each once."""
        return tuple(dict.fromkeys(self.names[k] for k in np.flatnonzero(chosen).tolist()))


CLEARANCE = 1e-8
"""Distance [m] beyond what is required that a repeated step aims at, so that rounding does not decide."""

DRIFT = 1e-9
"""Distance [m] by which a step may bring a pair closer that is closer than its margin: rounding."""


class SafeStep:
    """A step from q (nq,) over `dt` [s], which keeps pairs of bodies apart."""

    def __init__(self, backend: Backend, avoidance: Avoidance, q: Floats, gain: float, dt: float) -> None:
        self._backend, self._avoidance, self._q, self._dt = backend, avoidance, q, dt
        near = avoidance.near(backend, q, FREE_SPEED / gain)
        # What is too close already is only not to come closer.
        self._required = {each.pair: each.separation.lower - DRIFT for each in near if not each.is_clear}
        room = np.array([each.separation.lower - each.pair.margin for each in near])
        self.dampers = self._rows(q, near, -gain * room)
        """Rows of the pairs that are near at q; `gain` [1/s] is at most 1 / dt, so that a step does not pass
        the margin by its linear rate."""

    def too_close(self, v: Floats) -> list[NearPair]:
        """Return the pairs that a step of velocity v (nv,) brings too close, at its end."""
        after = self._avoidance.violated(self._backend, self._end(v))
        return [each for each in after if each.separation.lower < self._least(each.pair)]

    def cuts(self, v: Floats, violated: Sequence[NearPair]) -> Dampers:
        """Return rows that keep those pairs apart at the end of a step, linearised at that of v."""
        lacks = np.array([self._least(each.pair) + CLEARANCE - each.separation.lower for each in violated])
        found = self._rows(self._end(v), violated, lacks / self._dt)
        return replace(found, bound=found.bound + found.J @ v)

    def names(self, pairs: Sequence[NearPair]) -> Names:
        """Return the names of the bodies of pairs."""
        return tuple(self._avoidance.names(each.pair) for each in pairs)

    def _end(self, v: Floats) -> Floats:
        return np.asarray(self._backend.model.integrate(self._q, self._dt * v))

    def _least(self, pair: Pair) -> float:
        return self._required.get(pair, pair.margin)

    def _rows(self, q: Floats, near: Sequence[NearPair], bound: Floats) -> Dampers:
        is_close = np.array([each.pair in self._required for each in near], dtype=np.bool_)
        J = self._avoidance.gradients(self._backend, q, near)
        return Dampers(J, bound, is_close, self.names(near))


_UNLIMITED = 1e30
"""Bound from which on DAQP takes a constraint as absent."""

_EQUALITY = 5
"""Kind of a constraint whose two bounds are one value."""

PRIMAL_TOLERANCE = 1e-11
"""Violation of a constraint that counts as rounding, relative to constraints of norm 1."""

_SOLVED = 1


def _daqp() -> Any:
    with not_counted(), importing("velocity_ik needs daqp: pip install 'dynx[qp]'"):
        import daqp
    return daqp


def solve_programme(
    H: Floats, g: Floats, lower: Floats, upper: Floats, A: Floats, b: Floats, G: Floats, least: Floats
) -> Floats | None:
    """Return the x (n,) that minimises x'Hx / 2 + g'x over lower <= x <= upper, A x = b and G x >= least.

    H (n, n) is positive definite. Returns None if no x satisfies the constraints. Raises NotInstalledError
    without DAQP.
    """
    daqp = _daqp()
    # Rows of norm 1 give the tolerance one meaning for all constraints.
    rows, values = np.concatenate([A, G]), np.concatenate([b, least])
    norms = np.linalg.norm(rows, axis=1, keepdims=True)
    norms[norms == 0.0] = 1.0
    rows, values = rows / norms, values / norms[:, 0]
    equal, count = slice(len(upper), len(upper) + len(A)), len(A)
    high = np.concatenate([np.minimum(upper, _UNLIMITED), values[:count], np.full(len(G), _UNLIMITED)])
    low = np.concatenate([np.maximum(lower, -_UNLIMITED), values])
    kinds = np.zeros(len(high), dtype=np.int32)
    kinds[equal] = _EQUALITY
    kinds[: len(upper)][lower == upper] = _EQUALITY
    found: tuple[Floats, float, int, Any] = daqp.solve(
        np.ascontiguousarray(H), np.ascontiguousarray(g), np.ascontiguousarray(rows), high, low, kinds,
        primal_tol=PRIMAL_TOLERANCE,
    )  # fmt: skip
    x, _, outcome, _ = found
    # The bounds hold exactly, not only within the tolerance.
    return np.clip(np.asarray(x), lower, upper) if outcome == _SOLVED else None


AT_BOUND = 1e-9
"""Distance from a bound [rad/s or m/s] below which a velocity is at it."""


RELAXED_WEIGHT = 1e4
"""Weight of hard tasks that cannot all be met within the bounds."""

DAMPER_WEIGHT = 1e5
"""Weight of the rates of distances that cannot all be kept within the bounds."""

MAX_CUTS = 12
"""Most times that a step is found again because pairs come too close at its end."""

SHORTENED = (0.5, 0.25, 0.125, 0.0625, 0.0)
"""Fractions of a step that are tried where that is not enough."""

Rows = list[tuple[Floats, Floats]]
"""Weighted Jacobians (m, nv) and velocities (m,) of tasks."""


@dataclass(frozen=True, eq=False)
class Programme:
    """Tasks and bounds of one step."""

    soft: Rows
    hard: Rows
    damping: float
    lower: Floats
    upper: Floats

    def solve(self, dampers: Dampers) -> tuple[Floats, int]:
        """Return the best velocity (nv,), and what had to be relaxed: 0 nothing; 1 the hard tasks; 2 also the
        rates of pairs that are too close, which cannot part as fast as they should; 3 those of all pairs,
        which are kept as far as the bounds permit."""
        G, rates, close = dampers.J, dampers.bound, dampers.is_close
        relaxed = [
            *self.soft,
            *((RELAXED_WEIGHT * J, RELAXED_WEIGHT * velocity) for J, velocity in self.hard),
        ]
        parting = (DAMPER_WEIGHT * G[close], DAMPER_WEIGHT * rates[close])
        held = (DAMPER_WEIGHT * G[~close], DAMPER_WEIGHT * np.maximum(rates[~close], 0.0))
        every = np.ones(len(rates), dtype=np.bool_)
        stages: tuple[tuple[Rows, Rows, NDArray[np.bool_]], ...] = (
            (self.soft, self.hard, every),
            (relaxed, [], every),
            ([*relaxed, parting], [], ~close),
            ([*relaxed, parting, held], [], ~every),
        )
        nv = len(self.lower)
        for stage, (soft, hard, kept) in enumerate(stages):
            J, velocity = _stacked(soft, nv)
            H, g = J.T @ J + self.damping * np.eye(nv), -J.T @ velocity
            v = solve_programme(H, g, self.lower, self.upper, *_stacked(hard, nv), G[kept], rates[kept])
            if v is not None:
                return v, stage
        raise AssertionError("bounds alone can be kept")

    def solve_safely(self, step: SafeStep, time_limit: TimeLimit) -> tuple[Floats, int, Names, Names, bool]:
        """Return the best velocity whose step keeps pairs apart, what had to be relaxed, and the names of the
        pairs that hold it back and of those that it brings too close because no velocity prevents that; and
        whether the time was over before it was found."""
        dampers = step.dampers
        v, stage = self.solve(dampers)
        violated = step.too_close(v)
        first, late = (v, stage, dampers, violated), False
        for _ in range(MAX_CUTS):
            late = bool(violated) and time_limit.is_over()
            if late or not violated:
                break
            more = dampers.joined(step.cuts(v, violated))
            again, relaxed = self.solve(more)
            if relaxed > max(stage, 1):
                break
            v, stage, dampers, violated = again, relaxed, more, step.too_close(again)
        blockers = step.names(violated)
        # Where no time is left, the standstill is tried at once.
        late = late or (bool(violated) and time_limit.is_over())
        for fraction in SHORTENED[-1 if late else 0 :] if violated else ():
            shorter = np.clip(fraction * v, self.lower, self.upper)
            violated = step.too_close(shorter)
            if not violated:
                v, stage = shorter, max(stage, 1) if self.hard else stage
                break
        if violated:
            v, stage, dampers, violated = first
        held_back = dict.fromkeys([*dampers.active(v, AT_BOUND), *blockers])
        too_fast = dict.fromkeys([*dampers.missed(v, AT_BOUND), *step.names(violated)])
        return v, stage, tuple(held_back), tuple(too_fast), late


@dataclass(frozen=True, eq=False)
class VelocityResult:
    """Velocity of one step; `success` says whether the bounds, the dampers and the hard tasks are all
    kept."""

    v: Floats
    """Velocity (nv,) [rad/s or m/s], within the bounds."""
    success: bool
    """False if no velocity satisfies the bounds, the dampers of `avoid` and the hard tasks together, even if
    no task is hard. Hard tasks are then met as well as possible."""
    errors: tuple[Floats, ...]
    """For each task the weighted error J v - velocity (m,), of its components with a weight above 0."""
    limited: NDArray[np.bool_]
    """Coordinates (nv,) whose velocity is at a bound."""
    held_back: Names = ()
    """With `avoid` the pairs of bodies that approach one another as fast as they may."""
    too_fast: Names = ()
    """Pairs of bodies that approach faster than they may, because no velocity within the bounds prevents it;
    empty otherwise."""
    note: str = ""
    """Sentences that name joints of q outside their limits, which are brought back, and the links that
    `avoid` keeps nothing from; empty without them."""
    timed_out: bool = False
    """Whether `timeout` ended the search for a step that keeps all pairs apart: v is then a shorter one."""

    def __bool__(self) -> bool:
        """Return `success`."""
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
    timeout: float | None = None,
) -> VelocityResult:
    """Find the joint velocity v (nv,) at q (nq,) that meets tasks best and keeps the limits for `dt` [s].

    v minimises the sum of these terms:

    - ``|W (J v - velocity)|^2`` of each task that is not hard
    - ``posture_weight^2 |v - posture_gain (posture - q)|^2`` over the joints, if a `posture` (nq,) is given
    - ``damping |v|^2``, with damping > 0

    v meets the hard tasks, and keeps these bounds:

    - ``q + dt v`` is within the position limits
    - |v| is within `velocity_limit`: one number or (nv,), by default the limit of the model
    - with `acceleration_limit` [rad/s^2 or m/s^2], the joints can still stop before their position limits
    - with the previous velocity `v0` (nv,), the change of the velocity is at most ``acceleration_limit dt``

    A joint outside its position limits returns as fast as the other bounds allow, and `note` names the joint.
    A floating base has only the bounds that you give.

    **Obstacles.** `avoid` is a scene or a result of `Scene.avoidance`. The distance d of a pair of near
    bodies then changes by at least ``-avoid_gain (d - margin)`` [m/s]. This bound is the *damper* of the
    pair. It keeps d above the margin, and makes a smaller d grow. `avoid_gain` [1/s] is at most ``1 / dt``.
    Bodies are near if d - margin is at most ``1 / avoid_gain`` m. There the damper allows 1 m/s. dynx
    certifies the distances at ``model.integrate(q, dt v)`` (`dynx.distance`). If a pair does not keep its
    margin there, dynx solves again with this pair as a further constraint. If that is not enough, dynx
    shortens the step. `too_fast` names the pairs for which no velocity suffices. After `timeout` [s] dynx
    seeks no further step: the robot stands still unless the last step found is clear.

    **Order.** The bounds always hold. Next come the dampers, then the hard tasks, then the other tasks. If
    the hard tasks contradict each other, the bounds or the dampers, they count as soft tasks of a large
    weight, and `success` is False. If the dampers contradict the bounds, `success` is False, too.

    DAQP solves the quadratic programme (extra ``qp``). Siciliano et al., section 3.5, with inequalities as in
    Kanoun, Lamiraux and Wieber, IEEE Trans. Robotics 27(4), 2011.

    Raises NotInstalledError without the extra; UnknownNameError for a frame; ArgumentError (ShapeError,
    DTypeError, NotFiniteError) for an invalid argument.
    """
    model = backend.model
    if any(joint.limits.upper < math.pi for joint in model.ball_joints):
        refuse_ball_joints(model, "velocity_ik, as long as it has a largest angle,")
    seconds, time_limit = positive_seconds("dt", dt), TimeLimit(timeout)
    position = checked_q(model, q, "q")
    if position.ndim != 1:
        raise ShapeError(f"q has shape {position.shape}; wanted ({model.nq},)")
    wanted = _checked_tasks(tasks)
    for name, number, positive in (
        ("damping", damping, True),
        ("posture_weight", posture_weight, False),
        ("posture_gain", posture_gain, False),
    ):
        if not (is_real(number) and 0.0 <= number < math.inf and (number > 0.0 or not positive)):
            least = "above 0" if positive else "of at least 0"
            raise ArgumentError(f"{name} is {shown(number)}; wanted a number {least}")
    speed, acceleration = model.velocity_limit, np.full(model.nv, math.inf)
    if velocity_limit is not None:
        speed = checked_velocity_limit("velocity_limit", velocity_limit, model)
    if acceleration_limit is not None:
        acceleration = checked_velocity_limit("acceleration_limit", acceleration_limit, model)
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
        error = model.difference(position, goal)[offset:]
        soft.append((posture_weight * select, posture_weight * posture_gain * error))
    programme = Programme(soft, hard, damping, lower, upper)
    avoidance = checked_avoidance(model, avoid)
    held_back: Names = ()
    too_fast: Names = ()
    late = False
    if avoidance is None:
        v, stage = programme.solve(Dampers.none(model.nv))
    elif not (is_real(avoid_gain) and 0.0 < avoid_gain * seconds <= 1.0):
        most = f"{1.0 / seconds:.6g} [1/s]"
        raise ArgumentError(
            f"avoid_gain is {shown(avoid_gain)}; wanted a number above 0, at most 1 / dt = {most}"
        )
    else:
        step = SafeStep(backend, avoidance, position, avoid_gain, seconds)
        v, stage, held_back, too_fast, late = programme.solve_safely(step, time_limit)
    at_bound = (v <= lower + AT_BOUND) | (v >= upper - AT_BOUND)
    errors = tuple(J @ v - velocity for J, velocity in rows)
    stopped = f"{time_limit.sentence}: a shorter step than the best" if late else ""
    notes = joints_outside(model, position), "" if avoidance is None else avoidance.note, stopped
    note = "; ".join(filter(None, notes))
    return VelocityResult(v, stage == 0, errors, at_bound, held_back, too_fast, note, late)


def _checked_tasks(tasks: VelocityTask | Sequence[VelocityTask]) -> list[VelocityTask]:
    if isinstance(tasks, VelocityTask):
        return [tasks]
    if not is_listed(tasks):
        raise ArgumentError(
            f"tasks is {shown(tasks)}; wanted dynx.ik.velocity.VelocityTask, or a list of them"
        )
    wanted = list(tasks)
    for task in wanted:
        if not isinstance(task, VelocityTask):
            raise ArgumentError(f"tasks has {shown(task)}; wanted dynx.ik.velocity.VelocityTask")
    return wanted


def _stacked(rows: Rows, nv: int) -> tuple[Floats, Floats]:
    if not rows:
        return np.zeros((0, nv)), np.zeros(0)
    return np.concatenate([J for J, _ in rows]), np.concatenate([velocity for _, velocity in rows])
