"""One step of Levenberg-Marquardt within limits, traced for one frame: the iteration of the IK kernel.

The descent is that of `dynx.ik.search`: the damping is proportional to the squared error (Sugihara 2011), and
a start is abandoned when the squared error has not fallen enough over a few steps. Limits are kept by
projection (Bertsekas, Projected Newton methods for optimization problems with simple constraints, SIAM J.
Control and Optimization 20(2), 1982): a coordinate at a limit does not move if the error would decrease
beyond it, the step is solved for the others, and then clipped to the limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.ik.coordinates import FULL_TURN, FrameCoordinates
from dynx.ik.kernels.axis_residual import N_AXIS_VALUES, AxisKind, axis_residual, axis_values
from dynx.ik.kernels.residual import TracedResidual
from dynx.ik.problem import Problem
from dynx.ik.search import DAMPING, MIN_DAMPING, REQUIRED_REDUCTION, WINDOW
from dynx.model.mechanism import Mechanism
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, frame_jacobian
from dynx.rbd.kinematics import ancestry, body_poses, frame_pose
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.inlining import less, less_equal, maximum, minimum, select
from dynx.simd.iteration import GIVEN_UP, NO_RESTART, REACHED, RUNNING, Iteration
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import rotate

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
    that the rows of starts follow from (`dynx.ik.kernels.starts`).
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
