"""One step of a descent within limits, in array code for any scalar: the error, the step, what follows from
it.

On symbols it is the text of the kernels (`dynx.ik.iterations`, with the poses of `dynx.rbd` in front of it;
`dynx.ik.descent`, with the pose and the Jacobian of any engine as inputs), and on floats it is evaluated
where no kernel applies.

The step is that of Levenberg-Marquardt with a damping proportional to the remaining squared error: robust far
from the target and quadratically convergent near it, whether or not the target can be reached and the
Jacobian has full rank (Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt
method, IEEE Trans. Robotics 27(5), 2011, eq. 13). Limits are kept by projection (Bertsekas, Projected Newton
methods for optimization problems with simple constraints, SIAM J. Control and Optimization 20(2), 1982): a
coordinate at a limit does not move if the error would decrease beyond it, the step is solved for the others,
and then clipped to the limits.

What follows differs. A *search* accepts every step, and abandons a start when the squared error has not
fallen enough over a few steps; this criterion is independent of scale and works at a bound, at a singularity
and in a local minimum alike. A *refinement* and a *tracking* end in a local minimum: where the error stays
large the full step overshoots, so a step that does not reduce it is rejected and the damping raised
(Marquardt 1963).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.hooks import cholesky_solver
from dynx.ik.options import AxisRequirement, SearchLimits
from dynx.model.targets import Targets
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.iteration_status import GIVEN_UP, REACHED, RUNNING
from dynx.spatial.scalar import Array, Floats, arctan, less, less_equal, maximum, minimum, select, sqrt
from dynx.spatial.so3 import cross, rotate

# Chosen on UR5, Panda, iiwa and a Talos arm for the fewest evaluations; a factor of 3 in either
# direction, or a window of 2 to 6 steps, costs at most a third more.
DAMPING = 0.1
"""Damping per unit of squared error (half the squared norm of the error)."""
MIN_DAMPING = 1e-9
"""Damping that keeps the system definite at a singular configuration on the target."""
WINDOW = 3
"""Number of steps over which progress is measured."""
REQUIRED_REDUCTION = 0.6
"""A start is abandoned unless the squared error falls below this fraction of itself over the window."""
MIN_RELATIVE_GAIN = 1e-12
"""A descent to a local minimum ends when a step changes the squared error by a smaller fraction."""
MIN_CHANGE = 1e-13
"""A tracking ends when a step changes no coordinate by more [rad or m]."""
ACCEPTED_FACTOR, REJECTED_FACTOR = 0.3, 4.0
"""Factors of the damping after a step that reduces the error, and after one that does not."""

INSIDE = 0.99
"""Fraction of a tolerance along an axis at which its error begins to count: the search ends within it."""

SMALL_SINE = 1e-12
"""Sine of the angle between two directions below which their cross product does not give an axis."""

_SMALL_SINE = 1e-7
"""Twice the sine of an angle below which the antisymmetric part of a rotation does not give its axis."""

_RELATIVE_RIDGE = 1e-10
"""Extra damping, relative to the largest diagonal entry, for a matrix that rounding made indefinite."""

HUGE_ERROR = 1e300
"""Squared error before the first step."""


@dataclass(frozen=True)
class FrameError:
    """Error vector (m,), the distance [m] and the angle [rad]; a part that is free has no rows."""

    vector: Array
    distance: Any
    angle: Any
    within: Any = 1.0
    """1 where every component is within its own bound."""
    bounds_distance: bool = True
    bounds_angle: bool = True
    """Whether the tolerances bound the distance and the angle; otherwise the bounds of components do."""

    def reached(self, position_tolerance: Any, rotation_tolerance: Any) -> Any:
        """Return 1 where the error is within the tolerances, otherwise 0."""
        within = self.within
        if self.bounds_distance:
            within = within * less_equal(self.distance, position_tolerance)
        return within * less_equal(self.angle, rotation_tolerance) if self.bounds_angle else within

    @property
    def squared(self) -> Any:
        """Half the squared norm of the vector."""
        first, *others = self.vector
        return 0.5 * (sum(x * x for x in others) + first * first)


@dataclass(frozen=True)
class TargetKind:
    """Parts of a target that are prescribed, whether a point of the frame is placed, and which requirements
    there are per axis."""

    position: bool
    rotation: bool
    point: bool
    axes: AxisKind | None = None

    @classmethod
    def of(cls, targets: Targets, point: Floats | None, axes: AxisRequirement | None) -> TargetKind:
        """Return the kind of targets, whose point and requirements per axis may be None."""
        return cls(
            targets.positions is not None,
            targets.rotations is not None,
            point is not None,
            None if axes is None else AxisKind.of(axes),
        )

    @property
    def optional_sizes(self) -> dict[str, int]:
        """Sizes of the arrays that only some kinds have: ``point`` and ``axes`` (weights and bounds)."""
        sizes = {"point": 3} if self.point else {}
        return sizes if self.axes is None else {**sizes, "axes": N_AXIS_VALUES}

    def optional_values(self, point: Floats | None, axes: AxisRequirement | None) -> list[Floats]:
        """Return those arrays, in order."""
        placed = [] if point is None else [point]
        return placed if axes is None else [*placed, axis_values(axes)]

    @property
    def size(self) -> int:
        """Number of entries of a target."""
        return 3 * self.position + 9 * self.rotation

    def parts(self, target: Array) -> tuple[Array | None, Array | None]:
        """Return position (3,) and rotation (3, 3) of a target, or None for a part that is free."""
        if self.position and self.rotation:
            rows = target.reshape(3, 4)
            return rows[:, 3], rows[:, :3]
        return (target, None) if self.position else (None, target.reshape(3, 3))

    def rows(self, targets: Targets, batch: tuple[int, ...]) -> Floats:
        """Return targets, broadcast to the leading axes `batch`, as rows (n, size)."""
        positions, rotations = targets.positions, targets.rotations
        if positions is not None and rotations is not None:
            array = np.empty((*targets.batch, 3, 4))
            array[..., :3], array[..., 3] = rotations, positions
        else:
            array = np.asarray(rotations if positions is None else positions)
        flat = array.reshape(*targets.batch, self.size)
        return np.ascontiguousarray(np.broadcast_to(flat, (*batch, self.size))).reshape(-1, self.size)


POSES = TargetKind(position=True, rotation=True, point=False)
"""Kind of the targets that are poses of the frame itself."""


@dataclass(frozen=True)
class AxisKind:
    """Axes that are not free, parts whose components are bounded one by one, and whose axes they are."""

    used: tuple[bool, ...]
    """Whether each of position x, y, z and rotation x, y, z has a weight above 0."""
    bounds_position: bool
    bounds_rotation: bool
    of_target: bool
    free_rotation: int | None

    @classmethod
    def of(cls, axes: AxisRequirement) -> AxisKind:
        """Return the kind of a requirement."""
        return cls(
            tuple(weight != 0.0 for weight in axes.weights),
            axes.position_tolerances is not None,
            axes.rotation_tolerances is not None,
            axes.of_target,
            axes.free_rotation,
        )

    def bounded(self, component: int) -> bool:
        """Return whether a component has a bound of its own."""
        return self.bounds_position if component < 3 else self.bounds_rotation


N_AXIS_VALUES = 12
"""Number of weights and bounds."""


def axis_values(axes: AxisRequirement) -> Floats:
    """Return the weights (6,), then the bounds (6,), 0 where there is none."""
    bounds = [*(axes.position_tolerances or (0.0,) * 3), *(axes.rotation_tolerances or (0.0,) * 3)]
    return np.array([*axes.weights, *(bound if bound < math.inf else 0.0 for bound in bounds)])


def frame_error(
    kind: TargetKind,
    frame: tuple[Array, Array, Array],
    target: Array,
    point: Array | None = None,
    axes: Array | None = None,
) -> tuple[FrameError, Array]:
    """Return the error of a frame with respect to a target (`TargetKind`), and its Jacobian rows (m, n).

    `frame` is the rotation (3, 3), the position (3,) and the Jacobian (6, n) in world axes; `point` (3,) of
    the frame is placed; `axes` are weights and bounds (`axis_values`).
    """
    R, p, J = frame
    if point is not None:
        lever = rotate(R, point)
        p = p + lever
        J = np.concatenate([J[:3] + np.cross(J[3:].T, lever).T, J[3:]])
    position, rotation = kind.parts(target)
    if kind.axes is not None and axes is not None:
        return axis_error(kind.axes, (R, p, J), position, rotation, axes)
    parts: list[Array] = []
    distance: Any = 0.0
    angle: Any = 0.0
    if position is not None:
        parts.append(position - p)
        distance = root(squared_length(parts[0]))
    if rotation is not None:
        vector, angle = rotation_vector(rotation @ R.T)
        parts.append(vector)
    return FrameError(np.concatenate(parts), distance, angle), J[
        0 if kind.position else 3 : 6 if kind.rotation else 3
    ]


def axis_error(
    kind: AxisKind,
    frame: tuple[Array, Array, Array],
    position: Array | None,
    rotation: Array | None,
    values: Array,
) -> tuple[FrameError, Array]:
    """Return the weighted error (m,) of a frame (R, p, J) with respect to its target, and its Jacobian."""
    R, p, J = frame
    of_target = kind.of_target and rotation is not None

    def along(a: Array) -> Array:
        """Return vectors (3, ...) along the axes that count."""
        assert not of_target or rotation is not None
        return np.asarray(rotation.T @ a) if of_target and rotation is not None else a

    errors: list[Any] = [0.0] * 6
    rows: list[Array] = [J[0]] * 6
    if position is not None:
        errors[:3], rows[:3] = along(position - p), list(along(J[:3]))
    if rotation is not None:
        turning = J[3:]
        if kind.free_rotation is None:
            vector, _ = rotation_vector(rotation @ R.T)
        else:
            k = kind.free_rotation
            direction = rotation[:, k] if of_target else np.eye(3)[k]
            current = np.asarray(R[:, k] if of_target else R @ rotation[k])
            vector = rotation_between(current, direction)
            turning = turning - current[:, None] * (current @ turning)[None]
        errors[3:], rows[3:] = along(vector), list(along(turning))
    weighted: list[Any] = []
    counted: list[Array] = []
    within: Any = 1.0
    for k in (k for k in range(6) if kind.used[k]):
        excess, counts = errors[k], values[k]
        if kind.bounded(k):
            size, bound = abs(errors[k]), values[6 + k]
            over = maximum(size - INSIDE * bound, 0.0)
            excess = select(less(errors[k], 0.0), -over, over)
            # An error within its tolerance restricts nothing.
            counts = counts * less(0.0, over)
            within = within * less_equal(size, bound)
        weighted.append(counts * excess)
        counted.append(counts * rows[k])
    distance, angle = (
        root(sum((errors[k] * errors[k] for k in part if kind.used[k]), start=0.0 * values[0]))
        for part in (range(3), range(3, 6))
    )
    residual = FrameError(
        np.array(weighted), distance, angle, within,
        not kind.bounds_position, not kind.bounds_rotation,
    )  # fmt: skip
    return residual, np.array(counted)


def rotation_vector(R: Array) -> tuple[Array, Any]:
    """Return the rotation vector of R (3, 3) and its norm in [0, pi] [rad] (Siciliano et al., eq. 2.27)."""
    axial = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    twice_sine = root(squared_length(axial))
    twice_cosine = R[0, 0] + R[1, 1] + R[2, 2] - 1.0
    obtuse = less(twice_cosine, 0.0)
    # tan(angle / 2), or that of pi - angle, so that its denominator is at least 2.
    half = np.asarray(arctan(twice_sine / (abs(twice_cosine) + 2.0)))[()]
    angle = select(obtuse, math.pi - 2.0 * half, 2.0 * half)
    # At an angle of pi the antisymmetric part vanishes: R + 1 = 2 a a'.
    columns = list((R + np.eye(3)).T)
    longest, square = columns[0], squared_length(columns[0])
    for column in columns[1:]:
        other = squared_length(column)
        longer = less(square, other)
        longest = np.array([select(longer, a, b) for a, b in zip(column, longest, strict=True)])
        square = select(longer, other, square)
    small = less(twice_sine, _SMALL_SINE)
    straight = small * obtuse
    divisor = select(straight, root(square), maximum(twice_sine, _SMALL_SINE))
    scale = select(small * (1.0 - obtuse), 0.5, angle / divisor)
    vector = [scale * select(straight, a, b) for a, b in zip(longest, axial, strict=True)]
    return np.array(vector), angle


def rotation_between(a: Array, b: Array) -> Array:
    """Return the smallest rotation vector (3,) [rad] that turns the unit vector a to b."""
    normal = np.asarray(cross(a, b))
    sine, cosine = root(squared_length(normal)), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    obtuse = less(cosine, 0.0)
    half = np.asarray(arctan(sine / (abs(cosine) + 1.0)))[()]
    angle = select(obtuse, math.pi - 2.0 * half, 2.0 * half)
    small = less(sine, SMALL_SINE)
    scale = select(small, 1.0, angle / maximum(sine, SMALL_SINE))
    # Opposite directions: any axis perpendicular to them, here across the smallest component of b.
    squares = [b[k] * b[k] for k in range(3)]
    first = less_equal(squares[0], squares[1]) * less_equal(squares[0], squares[2])
    second = (1.0 - first) * less_equal(squares[1], squares[2])
    least = np.array([first, second, 1.0 - first - second])
    across = least - b * (least @ b)
    length = maximum(root(squared_length(across)), SMALL_SINE)
    opposite = small * obtuse
    return np.array(
        [select(opposite, math.pi * x / length, scale * y) for x, y in zip(across, normal, strict=True)]
    )


def bounded_step(
    J: Array, error: Array, x: Iterable[Any], lower: Iterable[Any], upper: Iterable[Any], damping: Any
) -> list[Any]:
    """Return the coordinates (n,) after a projected step, from the error (m,) with its Jacobian (m, n)."""
    m, n = J.shape
    gradient = error @ J
    free: list[Any] = []
    for value, slope, low, high in zip(x, gradient, lower, upper, strict=True):
        moves: Any = 1.0
        if _bounds(low):
            moves = 1.0 - less_equal(value, low) * less(slope, 0.0)
        if _bounds(high):
            moves = moves * (1.0 - less_equal(high, value) * less(0.0, slope))
        free.append(moves)
    masked = J * np.array(free)
    if m <= n:
        dx = _solved(masked @ J.T + damping * np.eye(m), error) @ masked
    else:
        dx = _solved(masked.T @ masked + damping * np.eye(n), error @ masked)
    return [
        within_bounds(value + change, low, high)
        for value, change, low, high in zip(x, dx, lower, upper, strict=True)
    ]


def within_bounds(x: Any, low: Any, high: Any) -> Any:
    """Return x moved into bounds, which may be infinite."""
    bounded = maximum(low, x) if _bounds(low) else x
    return minimum(high, bounded) if _bounds(high) else bounded


def _bounds(bound: Any) -> bool:
    """Check whether a bound is a symbol or a finite number."""
    return not isinstance(bound, float) or math.isfinite(bound)


def _solved(A: Array, b: Array) -> Array:
    """Return x with A x = b for a positive definite A (k, k): floats by LAPACK, other scalars by L D L'."""
    if A.dtype == object:
        return solve_positive_definite(A, b)
    _, found, indefinite = cholesky_solver()(A, b)
    if indefinite:
        ridge = _RELATIVE_RIDGE * float(A.diagonal().max())
        _, found, indefinite = cholesky_solver()(A + ridge * np.eye(len(A)), b)
    return np.zeros_like(b) if indefinite else np.asarray(found)


SETTINGS = ("position_tolerance", "rotation_tolerance", "max_iterations", "max_restarts")
"""Settings of searches and refinements, in order."""

TRACKING_SETTINGS = ("position_tolerance", "rotation_tolerance", "max_iterations", "stops", "abandons")
"""Settings of a tracking, in order: the last two are 1 to return at a target that is not reached, and to
abandon descents without progress."""


def tracking_settings(limits: SearchLimits, *, stops: bool = False, abandons: bool = False) -> list[float]:
    """Return the settings of a tracking, in the order of `TRACKING_SETTINGS`."""
    tolerances = limits.position_tolerance, limits.rotation_tolerance
    return [*tolerances, float(limits.max_iterations), float(stops), float(abandons)]


@dataclass(frozen=True, kw_only=True, eq=False)
class DescentLayout:
    """Layout of the memory of a descent: the best coordinates (n,), then numbers, then vectors (n,)."""

    numbers: tuple[float, ...]
    """Numbers of a new task: distance, angle, success and iterations, then others."""
    results: int
    """Number of entries of `numbers`, the first ones, that are results of the task."""
    vectors: int = 0

    def initial(self, n: int) -> Floats:
        """Return the memory of a new task with n coordinates."""
        return np.array([0.0] * n + [*self.numbers] + [0.0] * (n * self.vectors))


@dataclass(frozen=True, kw_only=True, eq=False)
class Descent(DescentLayout):
    """A text of a step, with its settings and the layout of its memory."""

    step: Callable[..., dict[str, Any]]
    settings: tuple[str, ...]
    least: int
    """Place of the least squared error among the numbers."""


def search_step(
    error: FrameError,
    J: Array,
    x: Array,
    memory: Array,
    settings: Array,
    lower: Sequence[Any],
    upper: Sequence[Any],
) -> dict[str, Any]:
    """Return x (n,) after a step of a search, its `DescentLayout`, the status, and 1 where it restarts."""
    n, squared = len(x), error.squared
    new = bounded_step(J, error.vector, x, lower, upper, DAMPING * squared + MIN_DAMPING)
    position_tolerance, rotation_tolerance, max_iterations, max_restarts = settings
    iterations, restarts, least = memory[n + 3 : n + 6]
    recent, own_steps = list(memory[n + 6 : n + 6 + WINDOW]), memory[-1]
    reached = error.reached(position_tolerance, rotation_tolerance)
    better = maximum(less(squared, least), reached)
    found = [*x, error.distance, error.angle]
    best = [select(better, a, b) for a, b in zip(found, memory[: n + 2], strict=True)]
    least = select(better, squared, least)
    stagnant = less(REQUIRED_REDUCTION * recent[0], squared)
    ends = maximum(stagnant, less_equal(max_iterations, own_steps))
    exhausted = less_equal(max_restarts, restarts)
    again = ends * (1.0 - exhausted) * (1.0 - reached)
    status = select(reached, REACHED, select(ends * exhausted, GIVEN_UP, RUNNING))
    goes_on = 1.0 - maximum(ends, reached)
    recent = [select(again, HUGE_ERROR, value) for value in (*recent[1:], squared)]
    own_steps = select(again, 0.0, own_steps + 1.0)
    after = [
        *best, reached, iterations + goes_on, restarts + again, least, *recent, own_steps
    ]  # fmt: skip
    return {"x": np.array(new), "memory": np.array(after), "status": status, "again": again}


def refinement_step(
    error: FrameError,
    J: Array,
    x: Array,
    memory: Array,
    settings: Array,
    lower: Sequence[Any],
    upper: Sequence[Any],
) -> dict[str, Any]:
    """Return x (n,) after a step of a refinement, the memory and the status.

    A rejected step is followed by an evaluation of the best configuration, from which the next step starts.
    """
    n, squared = len(x), error.squared
    position_tolerance, rotation_tolerance, max_iterations, _ = settings
    iterations, least, factor, at_best = memory[n + 3 : n + 7]
    trial = 1.0 - at_best
    iterations = iterations + trial
    gain = least - squared
    accepted = maximum(at_best, less(0.0, gain))
    reached = error.reached(position_tolerance, rotation_tolerance)
    found = [*x, error.distance, error.angle, reached]
    best = [select(accepted, a, b) for a, b in zip(found, memory[: n + 3], strict=True)]
    factor = select(at_best, factor, factor * select(accepted, ACCEPTED_FACTOR, REJECTED_FACTOR))
    converged = trial * less_equal(abs(gain), MIN_RELATIVE_GAIN * least)
    ends = maximum(converged, less_equal(max_iterations, iterations))
    stepped = bounded_step(J, error.vector, x, lower, upper, factor * squared + MIN_DAMPING)
    new = [select(accepted, a, b) for a, b in zip(stepped, memory[:n], strict=True)]
    after = [*best, iterations, select(accepted, squared, least), factor, 1.0 - accepted]
    status = select(reached * accepted, REACHED, select(ends, GIVEN_UP, RUNNING))
    return {"x": np.array(new), "memory": np.array(after), "status": status}


def tracking_step(
    error: FrameError,
    J: Array,
    x: Array,
    memory: Array,
    settings: Array,
    lower: Sequence[Any],
    upper: Sequence[Any],
) -> dict[str, Any]:
    """Return x (n,) after a step of a tracking, the memory and the status."""
    n, squared = len(x), error.squared
    best, (steps, least, factor), recent = memory[:n], memory[n + 3 : n + 6], list(memory[n + 6 :])
    better, accepted = less(squared, least), less_equal(squared, least)
    factor = select(better, ACCEPTED_FACTOR * factor, select(accepted, factor, REJECTED_FACTOR * factor))
    new = bounded_step(J, error.vector, x, lower, upper, factor * squared + MIN_DAMPING)
    position_tolerance, rotation_tolerance, max_iterations, stops, abandons = settings
    reached = error.reached(position_tolerance, rotation_tolerance)
    change: Any = 0.0
    for a, b in zip(new, x, strict=True):
        change = maximum(change, abs(a - b))
    converged = accepted * maximum(
        less_equal(change, MIN_CHANGE), less_equal(least - squared, MIN_RELATIVE_GAIN * least) * better
    )
    stagnant = abandons * less(REQUIRED_REDUCTION * recent[0], squared)
    ended = maximum(maximum(reached, converged), maximum(stagnant, less_equal(max_iterations, steps)))
    # A kernel returns at a task that is "reached".
    status = select(ended, select(reached, GIVEN_UP, select(stops, REACHED, GIVEN_UP)), RUNNING)
    kept = maximum(better, reached)
    measured = [*x, error.distance, error.angle, reached]
    result = [select(kept, a, b) for a, b in zip(measured, memory[: n + 3], strict=True)]
    after = [*result, steps + 1.0 - ended, select(kept, squared, least), factor, *recent[1:], squared]
    following = [select(accepted, a, b) for a, b in zip(new, best, strict=True)]
    return {"x": np.array(following), "memory": np.array(after), "status": status}


NO_RESULT = (0.0, 0.0, 0.0, 0.0)
"""Distance, angle, success and iterations of a new task."""

SEARCH = Descent(
    step=search_step,
    settings=SETTINGS,
    numbers=(*NO_RESULT, 0.0, *[HUGE_ERROR] * (1 + WINDOW), 0.0),
    results=6,
    least=5,
)
"""Further numbers: restarts and squared error, both results; recent errors; the steps of this start."""

REFINEMENT = Descent(
    step=refinement_step,
    settings=SETTINGS,
    numbers=(*NO_RESULT, HUGE_ERROR, DAMPING, 1.0),
    results=4,
    least=4,
)
"""Further numbers: squared error, damping factor, and whether x is the best configuration."""

TRACKING = Descent(
    step=tracking_step,
    settings=TRACKING_SETTINGS,
    numbers=(*NO_RESULT, HUGE_ERROR, DAMPING / ACCEPTED_FACTOR, *[HUGE_ERROR] * WINDOW),
    results=4,
    least=4,
)
"""Further numbers: squared error, damping factor, recent errors."""


def squared_length(a: Array) -> Any:
    """Return a' a for a vector (3,)."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


def root(x: Any) -> Any:
    """Return the square root of a number."""
    return np.asarray(sqrt(np.asarray(x)))[()]
