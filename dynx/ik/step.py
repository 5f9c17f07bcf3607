"""One step of Levenberg-Marquardt within limits, traced for one frame: the iteration of the IK kernel.

The descent is that of `dynx.ik.search`: the damping is proportional to the squared error (Sugihara 2011), and
a start is abandoned when the squared error has not fallen enough over a few steps. Limits are kept by
projection (Bertsekas, Projected Newton methods for optimization problems with simple constraints, SIAM J.
Control and Optimization 20(2), 1982): a coordinate at a limit does not move if the error would decrease
beyond it, the step is solved for the others, and then clipped to the limits.

A kernel is compiled for what is prescribed, weighted and bounded (`TargetKind`, `AxisKind`); the weights and
bounds are its inputs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.ik.coordinates import FULL_TURN, FrameCoordinates
from dynx.ik.options import AxisRequirement
from dynx.ik.problem import Problem
from dynx.ik.search import DAMPING, INSIDE, MIN_DAMPING, REQUIRED_REDUCTION, SMALL_SINE, WINDOW
from dynx.model.mechanism import Mechanism
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, frame_jacobian
from dynx.rbd.kinematics import ancestry, body_poses, frame_pose
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.inlining import less, less_equal, maximum, minimum, select
from dynx.simd.iteration import GIVEN_UP, NO_RESTART, REACHED, RUNNING, Iteration
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, arctan, sqrt
from dynx.spatial.so3 import cross, rotate

_SMALL_SINE = 1e-7
"""Twice the sine of an angle below which the antisymmetric part of a rotation does not give its axis."""


@dataclass(frozen=True)
class TracedResidual:
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

    @classmethod
    def of(cls, position: Array | None, rotation: Array | None) -> TracedResidual:
        """Make the error from the displacement (3,) to the target and the rotation (3, 3) to it, in world
        axes."""
        parts: list[Array] = []
        distance: Any = 0.0
        angle: Any = 0.0
        if position is not None:
            parts.append(position)
            distance = root(squared_length(position))
        if rotation is not None:
            vector, angle = rotation_vector(rotation)
            parts.append(vector)
        return cls(np.concatenate(parts), distance, angle)


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


def squared_length(a: Array) -> Any:
    """Return a' a for a vector (3,)."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


def root(x: Any) -> Any:
    """Return the square root of a symbol."""
    return np.asarray(sqrt(np.asarray(x)))[()]


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


def axis_residual(
    kind: AxisKind,
    frame: tuple[Array, Array, Array],
    position: Array | None,
    rotation: Array | None,
    values: Array,
) -> tuple[TracedResidual, Array]:
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
            vector = _turn_between(current, direction)
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
    residual = TracedResidual(
        np.array(weighted, dtype=object), distance, angle, within,
        not kind.bounds_position, not kind.bounds_rotation,
    )  # fmt: skip
    return residual, np.array(counted, dtype=object)


def _turn_between(a: Array, b: Array) -> Array:
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
    least = np.array([first, second, 1.0 - first - second], dtype=object)
    across = least - b * (least @ b)
    length = maximum(root(squared_length(across)), SMALL_SINE)
    opposite = small * obtuse
    return np.array(
        [select(opposite, math.pi * x / length, scale * y) for x, y in zip(across, normal, strict=True)],
        dtype=object,
    )


_ROUNDING_SHIFT = 6755399441055744.0
"""1.5 * 2^52: adding it to a double and subtracting it again rounds the double to an integer."""

HUGE_ERROR = 1e300
"""Squared error before the first step."""

SETTINGS = ("position_tolerance", "rotation_tolerance", "max_iterations", "max_restarts")
"""Constants of the kernel, in order."""


@dataclass(frozen=True)
class TargetKind:
    """Parts of a target that are prescribed, whether a point of the frame is placed, and which requirements
    there are per axis."""

    position: bool
    rotation: bool
    point: bool
    axes: AxisKind | None = None

    @classmethod
    def of(cls, problem: Problem) -> TargetKind:
        """Return the kind of the targets of a problem."""
        targets = problem.targets
        axes = problem.requirements[0].axes
        return cls(
            targets.positions is not None,
            targets.rotations is not None,
            problem.point is not None,
            None if axes is None else AxisKind.of(axes),
        )

    @property
    def optional_sizes(self) -> dict[str, int]:
        """Sizes of the arrays that only some kinds have: ``point`` and ``axes`` (weights and bounds)."""
        sizes = {"point": 3} if self.point else {}
        return sizes if self.axes is None else {**sizes, "axes": N_AXIS_VALUES}

    def optional_values(self, problem: Problem) -> list[Floats]:
        """Return those arrays for a problem, in order."""
        axes = problem.requirements[0].axes
        point = [] if problem.point is None else [problem.point]
        return point if axes is None else [*point, axis_values(axes)]

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

    def rows(self, problem: Problem) -> Floats:
        """Return the targets (n, size) of all samples of a problem."""
        positions, rotations = problem.targets.positions, problem.targets.rotations
        if positions is not None and rotations is not None:
            targets = np.empty((*problem.targets.batch, 3, 4))
            targets[..., :3], targets[..., 3] = rotations, positions
        else:
            targets = np.asarray(rotations if positions is None else positions)
        flat = targets.reshape(*problem.targets.batch, self.size)
        return np.ascontiguousarray(np.broadcast_to(flat, (*problem.batch, self.size))).reshape(-1, self.size)


POSES = TargetKind(position=True, rotation=True, point=False)
"""Kind of the targets that are poses of the frame itself."""


@dataclass(frozen=True)
class Memory:
    """Layout of the variables of a task: result, then what the next steps need."""

    n: int
    """Number of coordinates."""

    @property
    def n_results(self) -> int:
        """Size of the result: coordinates, distance, angle, success, iterations, restarts, squared error."""
        return self.n + 6

    @property
    def initial(self) -> Floats:
        """Variables of a new task."""
        return np.array([0.0] * (self.n + 5) + [HUGE_ERROR] * (1 + WINDOW) + [0.0])


def solver_iteration(
    mechanism: Mechanism, frame: int, coordinates: FrameCoordinates, kind: TargetKind
) -> Iteration:
    """Return the iteration that solves for the coordinates that move frame number `frame`.

    Tasks have the arrays ``x``, the first start (n,); ``memory`` (`Memory`); ``target``, the first three rows
    of a pose (12,), a position (3,) or a rotation (9,); ``near`` (n,), to which periodic angles are shifted;
    ``cell``, the first row of starts near the target; ``point`` (3,) if there is one; and ``axes`` (12,),
    weights and bounds per axis, if there are such. The constants are those of `SETTINGS`, then the numbers
    that the rows of starts follow from (`dynx.ik.starts`).
    """
    n = coordinates.count
    path = FramePath.of(mechanism, frame, coordinates)

    def step(
        x: Array,
        memory: Array,
        target: Array,
        near: Array,
        cell: Array,
        settings: Array,
        starts: Array,
        point: Array | None = None,
        axes: Array | None = None,
    ) -> dict[str, Any]:
        residual, rows, squared = traced_residual(path, kind, x, target, point, axes)
        new = bounded_step(rows, residual.vector, x, coordinates, DAMPING * squared + MIN_DAMPING)
        next_x = shifted_to(new, near, coordinates)
        return {
            "x": next_x,
            **_bookkeeping(x, memory, residual, squared, settings, _row(memory, cell, starts)),
        }

    sizes = {"x": n, "memory": len(Memory(n).initial), "target": kind.size, "near": n}
    sizes |= {"cell": 1, "settings": len(SETTINGS), "starts": 3} | kind.optional_sizes
    shapes = {name: (size,) for name, size in sizes.items()}
    return Iteration(trace(step, shapes), ("settings", "starts"), Memory(n).n_results)


def traced_residual(
    path: FramePath, kind: TargetKind, x: Array, target: Array, point: Array | None, axes: Array | None = None
) -> tuple[TracedResidual, Array, Any]:
    """Return the error of the frame at x (n,), its Jacobian rows (m, n), and half its squared norm."""
    R, p, J = path.pose(x)
    if point is not None:
        lever = rotate(R, point)
        p = p + lever
        J = np.concatenate([J[:3] + np.cross(J[3:].T, lever).T, J[3:]])
    position, rotation = kind.parts(target)
    if kind.axes is not None and axes is not None:
        residual, rows = axis_residual(kind.axes, (R, p, J), position, rotation, axes)
        return residual, rows, 0.5 * _dot(residual.vector, residual.vector)
    residual = TracedResidual.of(
        None if position is None else position - p, None if rotation is None else rotation @ R.T
    )
    rows = J[0 if kind.position else 3 : 6 if kind.rotation else 3]
    return residual, rows, 0.5 * _dot(residual.vector, residual.vector)


def _bookkeeping(
    x: Array, memory: Array, residual: TracedResidual, squared: Any, settings: Array, next_row: Any
) -> dict[str, Any]:
    """Return the memory after a step, the status and the restart."""
    n = len(x)
    position_tolerance, rotation_tolerance, max_iterations, max_restarts = settings
    iterations, restarts, least = memory[n + 3 : n + 6]
    recent, own_steps = list(memory[n + 6 : n + 6 + WINDOW]), memory[-1]
    reached = residual.reached(position_tolerance, rotation_tolerance)
    better = maximum(less(squared, least), reached)
    found = [*x, residual.distance, residual.angle]
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
    restart = select(again, next_row, NO_RESTART)
    return {"memory": np.array(after, dtype=object), "status": status, "restart": restart}


def _row(memory: Array, cell: Array, starts: Array) -> Any:
    """Return the row of the next start."""
    near, offset, base = starts
    number = memory[-WINDOW - 3] + 1.0
    turned = number + offset
    turned = turned - near * less_equal(near, turned)
    return select(less(number, near), cell[0] + turned, base + number)


def bounded_step(J: Array, error: Array, x: Array, coordinates: FrameCoordinates, damping: Any) -> list[Any]:
    """Return the coordinates (n,) after a projected step."""
    m, n = J.shape
    gradient = error @ J
    free: list[Any] = []
    for k in range(n):
        low, high = coordinates.lower[k], coordinates.upper[k]
        moves: Any = 1.0
        if np.isfinite(low):
            moves = 1.0 - less_equal(x[k], low) * less(gradient[k], 0.0)
        if np.isfinite(high):
            moves = moves * (1.0 - less_equal(high, x[k]) * less(0.0, gradient[k]))
        free.append(moves)
    masked = J * np.array(free, dtype=object)
    if m <= n:
        dx = solve_positive_definite(masked @ J.T + damping * np.eye(m), error) @ masked
    else:
        dx = solve_positive_definite(masked.T @ masked + damping * np.eye(n), error @ masked)
    found: list[Any] = []
    for value, low, high in zip(x + dx, coordinates.lower, coordinates.upper, strict=True):
        bounded = maximum(low, value) if np.isfinite(low) else value
        found.append(minimum(high, bounded) if np.isfinite(high) else bounded)
    return found


def shifted_to(x: Sequence[Any], near: Array, coordinates: FrameCoordinates) -> Array:
    """Return x with its periodic angles shifted by full turns, within their limits and nearest to `near`."""
    shifted = list(x)
    for k in coordinates.periodic:
        turns = (x[k] - near[k]) * (1.0 / FULL_TURN)
        value = x[k] - FULL_TURN * ((turns + _ROUNDING_SHIFT) - _ROUNDING_SHIFT)
        low, high = coordinates.limits(k)
        if np.isfinite(low):
            value = value + FULL_TURN * less(value, low)
        if np.isfinite(high):
            value = value - FULL_TURN * less(high, value)
        if np.isfinite(low):
            value = maximum(low, value)
        shifted[k] = minimum(high, value) if np.isfinite(high) else value
    return np.array(shifted, dtype=object)


@dataclass(frozen=True)
class FramePath:
    """The bodies between root and frame, and their joint positions as an affine map of the coordinates."""

    mechanism: Mechanism
    A: Floats
    b: Floats

    @classmethod
    def of(cls, mechanism: Mechanism, frame: int, coordinates: FrameCoordinates) -> FramePath:
        placed = mechanism.frames[frame]
        bodies = tuple(reversed(ancestry(mechanism, placed.body)))
        chain = tuple(replace(mechanism.bodies[body], parent=k - 1) for k, body in enumerate(bodies))
        path = replace(mechanism, bodies=chain, frames=(replace(placed, body=len(chain) - 1),), coupling=None)
        n = len(mechanism.bodies)
        if mechanism.coupling is None:
            A, b = np.eye(n), np.zeros(n)
        else:
            A, b = mechanism.coupling.affine_map()
        return cls(path, A[np.ix_(bodies, coordinates.indices)], b[list(bodies)])

    def pose(self, x: Array) -> tuple[Array, Array, Array]:
        """Return rotation, position and Jacobian (6, n) of the frame in world axes."""
        poses = body_poses(self.mechanism, self.A @ x + self.b)
        R, p = frame_pose(self.mechanism, poses, 0)
        J = frame_jacobian(self.mechanism, poses, 0, LOCAL_WORLD_ALIGNED) @ self.A
        return np.asarray(R), np.asarray(p), np.asarray(J)


def _dot(a: Array, b: Array) -> Any:
    return sum(u * v for u, v in zip(a[1:], b[1:], strict=True)) + a[0] * b[0]
