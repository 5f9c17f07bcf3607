"""Errors of frames, one bounded step that reduces them, and the search for a target from several starts.

One damped least-squares step within bounds: Levenberg-Marquardt with an active set.

The step minimises ``|error - J (y - x)|^2 + damping |y - x|^2`` over ``lower <= y <= upper`` (Levenberg 1944;
Marquardt 1963). A coordinate that the step would move beyond a bound is fixed at that bound, its contribution
to the error is subtracted, and the step is solved again for the others. Every call starts with all
coordinates free, so a coordinate leaves its bound as soon as that reduces the error.

Error between a frame and its target, in plain floats.

Array code does not pay for one sample of six numbers: this arithmetic on floats takes a third of the time of
its NumPy equivalent. It is evaluated at every step of the solver.

Error between a frame and its target along given axes, with weights and tolerances for each of them.

What the search reduces: the errors of one frame or of several, with their Jacobian rows.

Descent from one start, and restarts from random configurations until the target is reached.

The descent is Levenberg-Marquardt with a damping proportional to the remaining squared error: robust far from
the target and quadratically convergent near it, whether or not the target can be reached and the Jacobian has
full rank (Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, IEEE Trans.
Robotics 27(5), 2011, eq. 13). Every step respects the limits and is accepted. A start is abandoned when the
squared error has not fallen enough over a few steps; this criterion is independent of scale and works at a
bound, at a singularity and in a local minimum alike. If no start reaches the target, the best configuration
is refined to a local minimum.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from operator import gt
from typing import Any, NamedTuple, Protocol

import numpy as np

from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.options import AxisRequirement, SearchLimits
from dynx.model import Model
from dynx.spatial.scalar import Floats

_RELATIVE_RIDGE = 1e-10
"""Extra damping, relative to the largest diagonal entry, for a matrix that rounding made indefinite."""


class BoundedStep:
    """The step for fixed bounds on n coordinates; bounds may be infinite."""

    __slots__ = ("_dposv", "_lower", "_upper")

    def __init__(self, lower: Sequence[float], upper: Sequence[float]) -> None:
        # Imported here because scipy.linalg is slow to import and importing dynx must be fast.
        from scipy.linalg.lapack import dposv

        self._dposv = dposv
        self._lower = lower
        self._upper = upper

    def __call__(self, J: Floats, error: Sequence[float], x: Sequence[float], damping: float) -> list[float]:
        """Return the new coordinates y (n,), from J (m, n), error (m,), x (n,) within bounds, damping > 0."""
        residual = np.array(error)
        displacement = self._displacement(J, residual, damping).tolist()
        y = [a + b for a, b in zip(x, displacement, strict=True)]
        if not any(map(gt, self._lower, y)) and not any(map(gt, y, self._upper)):
            return y
        fixed: dict[int, float] = {}
        while True:
            violated = {
                k: low if value < low else high
                for k, (value, low, high) in enumerate(zip(y, self._lower, self._upper, strict=True))
                if value < low or value > high
            }
            if not violated:
                return y
            fixed |= violated
            columns = list(fixed)
            free = J.copy()
            free[:, columns] = 0.0
            fixed_error = J[:, columns].dot([fixed[k] - x[k] for k in columns])
            displacement = self._displacement(free, residual - fixed_error, damping).tolist()
            y = [fixed.get(k, a + b) for k, (a, b) in enumerate(zip(x, displacement, strict=True))]

    def _displacement(self, J: Floats, error: Floats, damping: float) -> Floats:
        # Solve the smaller of two equivalent systems: J'(J J' + d)^-1 e = (J'J + d)^-1 J'e.
        m, n = J.shape
        if m <= n:
            displacement: Floats = self._solve(J.dot(J.T), error, damping).dot(J)
            return displacement
        return self._solve(J.T.dot(J), error.dot(J), damping)

    def _solve(self, A: Floats, b: Floats, damping: float) -> Floats:
        diagonal = A.reshape(-1)[:: len(A) + 1]
        diagonal += damping
        _, solution, not_definite = self._dposv(A, b)
        if not_definite:
            diagonal += _RELATIVE_RIDGE * float(diagonal.max())
            _, solution, not_definite = self._dposv(A, b)
        found: Floats = np.zeros_like(b) if not_definite else solution
        return found


Triple = tuple[float, float, float]


class Residual:
    """Error from a frame to one target: position [m], then rotation vector [rad], in world axes.

    A part of the target that is None is free: it has no rows.
    """

    __slots__ = ("_point", "_position", "_rotation", "rows")

    def __init__(self, position: Floats | None, rotation: Floats | None, point: Floats | None) -> None:
        x, y, z = (0.0, 0.0, 0.0) if position is None else position.tolist()
        self._position: Triple | None = None if position is None else (x, y, z)
        self._rotation = rotation
        self._point = point
        self.rows = slice(3 if position is None else 0, 3 if rotation is None else 6)
        """Rows of the Jacobian that change the error."""

    def __call__(self, T_world_frame: Floats) -> tuple[tuple[float, ...], float, float]:
        """Return (residual (6,), or (3,) if a part is free; position error [m]; rotation error [rad])."""
        rx = ry = rz = angle = 0.0
        if self._rotation is not None:
            rx, ry, rz, angle = rotation_vector(self._rotation.dot(T_world_frame[:3, :3].T))
        if self._position is None:
            return (rx, ry, rz), 0.0, angle
        if self._point is None:
            px, py, pz, _ = T_world_frame[:, 3].tolist()
        else:
            px, py, pz = (T_world_frame[:3, :3].dot(self._point) + T_world_frame[:3, 3]).tolist()
        x, y, z = self._position
        x, y, z = x - px, y - py, z - pz
        distance = math.sqrt(x * x + y * y + z * z)
        if self._rotation is None:
            return (x, y, z), distance, 0.0
        return (x, y, z, rx, ry, rz), distance, angle


def rotation_vector(R: Floats) -> tuple[float, float, float, float]:
    """Return the rotation vector of R (3, 3) and its norm in [0, pi] [rad] (Siciliano et al., eq. 2.27)."""
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = R.tolist()
    x, y, z = r21 - r12, r02 - r20, r10 - r01
    twice_sine = math.sqrt(x * x + y * y + z * z)
    twice_cosine = r00 + r11 + r22 - 1.0
    angle = math.atan2(twice_sine, twice_cosine)
    if twice_sine > 1e-7:
        scale = angle / twice_sine
    elif twice_cosine > 0.0:
        scale = 0.5
    else:
        # At an angle of pi the antisymmetric part vanishes: R + 1 = 2 a a'.
        a, b, c = max(
            (r00 + 1.0, r10, r20), (r01, r11 + 1.0, r21), (r02, r12, r22 + 1.0), key=_squared_length
        )
        scale = angle / math.sqrt(_squared_length((a, b, c)))
        x, y, z = a, b, c
    return x * scale, y * scale, z * scale, angle


def _squared_length(a: Triple) -> float:
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


INSIDE = 0.99
"""Fraction of a tolerance along an axis at which its error begins to count: the search ends within it."""

SMALL_SINE = 1e-12
"""Sine of the angle between two directions below which their cross product does not give an axis."""


class AxisResidual:
    """Weighted error from a frame to one target along the axes of the target or of the world.

    With a tolerance for each axis the target is a region: an error within it does not count.
    """

    def __init__(
        self, position: Floats | None, rotation: Floats | None, point: Floats | None, axes: AxisRequirement
    ) -> None:
        self._position, self._rotation, self._point = position, rotation, point
        weights = np.array(axes.weights)
        self._rows = np.flatnonzero(weights)
        self._weights = weights[self._rows]
        self._used = weights != 0.0
        self._bounds = np.full(6, np.inf)
        """Tolerance of each component; infinite where the norm of the part is bounded."""
        self.bounds_position, self.bounds_rotation = axes.position_tolerances, axes.rotation_tolerances
        if axes.position_tolerances is not None:
            self._bounds[:3] = axes.position_tolerances
        if axes.rotation_tolerances is not None:
            self._bounds[3:] = axes.rotation_tolerances
        self._slack = np.where(np.isfinite(self._bounds), INSIDE * self._bounds, 0.0)
        self._axes = rotation if axes.of_target and rotation is not None else np.eye(3)
        k = axes.free_rotation
        self._direction: Floats | None = None
        self._in_frame = np.zeros(3)
        if k is not None and rotation is not None:
            self._direction = self._axes[:, k]
            self._in_frame = rotation.T @ self._direction

    def __call__(self, T_world_frame: Floats) -> tuple[Floats, float, float, bool, Floats]:
        """Return (weighted error (m,); position error [m]; rotation error [rad]; whether every error is
        within its own tolerance; L (m, 6) with rows L J for a Jacobian J in world axes)."""
        R, p = T_world_frame[:3, :3], T_world_frame[:3, 3]
        error, L = np.zeros(6), np.zeros((6, 6))
        to_axes = self._axes.T
        if self._position is not None:
            placed = p if self._point is None else R @ self._point + p
            error[:3], L[:3, :3] = to_axes @ (self._position - placed), to_axes
        if self._rotation is not None:
            if self._direction is None:
                error[3:], L[3:, 3:] = to_axes @ rotation_vector(self._rotation @ R.T)[:3], to_axes
            else:
                current = R @ self._in_frame
                error[3:] = to_axes @ rotation_between(current, self._direction)
                L[3:, 3:] = to_axes @ (np.eye(3) - np.outer(current, current))
        error = np.where(self._used, error, 0.0)
        distance, angle = float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:]))
        within = bool((np.abs(error) <= self._bounds).all())
        excess = np.sign(error) * np.maximum(np.abs(error) - self._slack, 0.0)
        # An error within its tolerance restricts nothing.
        counts = self._weights * ((excess != 0.0) | (self._slack == 0.0))[self._rows]
        return counts * excess[self._rows], distance, angle, within, counts[:, None] * L[self._rows]


def rotation_between(a: Floats, b: Floats) -> Floats:
    """Return the smallest rotation vector (3,) [rad] that turns the unit vector a to b."""
    x, y, z = a
    u, v, w = b
    normal = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    sine, cosine = float(np.linalg.norm(normal)), float(a @ b)
    if sine > SMALL_SINE:
        return normal * (math.atan2(sine, cosine) / sine)
    if cosine > 0.0:
        return normal
    # Opposite directions: any axis perpendicular to them.
    across = np.eye(3)[int(np.argmin(np.abs(b)))]
    perpendicular = across - b * float(across @ b)
    return np.asarray(perpendicular * (math.pi / float(np.linalg.norm(perpendicular))))


class Backend(Protocol):
    """Methods of a backend that the solver uses, for one sample and a frame by name."""

    @property
    def model(self) -> Model:
        """The robot."""

    def forward_kinematics(self, q: Floats, frame: str) -> Floats:
        """Return T_world_frame (4, 4)."""

    def jacobian(self, q: Floats, frame: str, *, point: Floats | None = None) -> Floats:
        """Return J (6, nv), linear rows first, at the frame (or a point of it) in world axes."""


class TaskError(NamedTuple):
    """Error of a task at one configuration."""

    vector: tuple[float, ...]
    """Weighted error (m,)."""
    position: float
    """Position error [m], the largest of several frames."""
    rotation: float
    """Rotation error [rad], the largest of several frames."""
    reached: bool
    rows: Any
    """How the Jacobian rows of the error follow from those of the frame."""


_MAKE = tuple.__new__


class Tolerances(Protocol):
    """Bounds on the norms of errors."""

    @property
    def position_tolerance(self) -> float:
        """Bound on the position error [m]."""

    @property
    def rotation_tolerance(self) -> float:
        """Bound on the rotation error [rad]."""


class Task(Protocol):
    """Errors to reduce."""

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian (m, n) of the error at q, with the sign of a velocity of the frame."""


class FrameTask:
    """Pose, position or rotation of one frame."""

    __slots__ = (
        "_forward_kinematics", "_frame", "_jacobian", "_part", "_point", "_residual", "_tolerances"
    )  # fmt: skip

    def __init__(
        self,
        backend: Backend,
        frame: str,
        point: Floats | None,
        coordinates: FrameCoordinates,
        tolerances: Tolerances,
        position: Floats | None,
        rotation: Floats | None,
    ) -> None:
        self._forward_kinematics, self._jacobian = backend.forward_kinematics, backend.jacobian
        self._frame, self._point = frame, point
        self._tolerances = (tolerances.position_tolerance, tolerances.rotation_tolerance)
        self._residual = Residual(position, rotation, point)
        self._part = (self._residual.rows, coordinates.columns)

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""
        residual = self._residual
        vector, distance, angle = residual(self._forward_kinematics(q, self._frame))
        position_tolerance, rotation_tolerance = self._tolerances
        reached = distance <= position_tolerance and angle <= rotation_tolerance
        # Faster than the call of the class, which is written in Python.
        return _MAKE(TaskError, (vector, distance, angle, reached, None))

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobian rows at q."""
        if self._point is None:
            return self._jacobian(q, self._frame)[self._part]
        return self._jacobian(q, self._frame, point=self._point)[self._part]


class AxisTask:
    """Pose of one frame with requirements per axis."""

    def __init__(
        self,
        backend: Backend,
        frame: str,
        point: Floats | None,
        coordinates: FrameCoordinates,
        tolerances: Tolerances,
        position: Floats | None,
        rotation: Floats | None,
        axes: AxisRequirement,
    ) -> None:
        self._backend, self._frame, self._point = backend, frame, point
        self._columns = coordinates.columns
        self._residual = AxisResidual(position, rotation, point, axes)
        # A tolerance for each axis replaces that of the norm.
        self._position = tolerances.position_tolerance if axes.position_tolerances is None else np.inf
        self._rotation = tolerances.rotation_tolerance if axes.rotation_tolerances is None else np.inf

    def error(self, q: Floats) -> TaskError:
        """Return the error at q (nq,)."""
        T = self._backend.forward_kinematics(q, self._frame)
        vector, distance, angle, within, rows = self._residual(T)
        reached = within and distance <= self._position and angle <= self._rotation
        return TaskError(tuple(vector.tolist()), distance, angle, reached, rows)

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the weighted Jacobian at q along the axes."""
        J = frame_jacobian(self._backend, q, self._frame, self._point)[:, self._columns]
        return np.asarray(error.rows @ J)


class SeveralTasks:
    """Errors of several frames at once, one below the other."""

    def __init__(self, tasks: list[Task]) -> None:
        self._tasks = tasks

    def error(self, q: Floats) -> TaskError:
        """Return the errors at q (nq,), and the largest of each kind."""
        errors = [task.error(q) for task in self._tasks]
        return TaskError(
            tuple(value for error in errors for value in error.vector),
            max(error.position for error in errors),
            max(error.rotation for error in errors),
            all(error.reached for error in errors),
            errors,
        )

    def jacobian(self, q: Floats, error: TaskError) -> Floats:
        """Return the Jacobians at q, one below the other."""
        parts = [task.jacobian(q, part) for task, part in zip(self._tasks, error.rows, strict=True)]
        return np.concatenate(parts)


def frame_jacobian(backend: Backend, q: Floats, frame: str, point: Floats | None) -> Floats:
    """Return J (6, nv) of a frame, or of a point of it, in world axes."""
    return backend.jacobian(q, frame) if point is None else backend.jacobian(q, frame, point=point)


# Chosen on UR5, Panda, iiwa and a Talos arm for the fewest evaluations; a factor of 3 in either
# direction, or a window of 2 to 6 steps, costs at most a third more.
DAMPING = 0.1
"""Damping per unit of squared error (half the squared norm of the residual)."""
MIN_DAMPING = 1e-9
"""Damping that keeps the system definite at a singular configuration on the target."""
WINDOW = 3
"""Number of steps over which progress is measured."""
REQUIRED_REDUCTION = 0.6
"""A start is abandoned unless the squared error falls below this fraction of itself over the window."""
MIN_RELATIVE_GAIN = 1e-12
"""Refinement of an unreached target ends when a step changes the squared error by a smaller fraction."""


@dataclass
class Candidate:
    """A configuration and its errors with respect to the target."""

    q: Floats
    position_error: float
    rotation_error: float
    squared_error: float
    success: bool
    iterations: int = 0
    restarts: int = 0


class Search:
    """Search for configurations that reduce the error of a task to its tolerances."""

    def __init__(self, model: Model, coordinates: FrameCoordinates, limits: SearchLimits) -> None:
        self._model, self._limits, self._coordinates = model, limits, coordinates
        self._step = BoundedStep(coordinates.lower, coordinates.upper)

    def run(
        self, task: Task, q0: Floats, rng: np.random.Generator | int | None, *, begin_at_q0: bool
    ) -> Candidate:
        """Reach the target from q0 (nq,) within limits, or from a random start; return the best result."""
        if self._coordinates.count == 0:
            return self.evaluate(q0, task)
        start, best, iterations = q0, None, 0
        for restarts in range(self._limits.max_restarts + 1):
            if restarts or not begin_at_q0:
                # Created when first needed, since that takes longer than a step.
                rng = np.random.default_rng(rng)
                start = self._coordinates.random(q0, rng)
            q, steps = self.descend(start, task)
            iterations += steps
            found = self.evaluate(self._coordinates.nearest(q, q0), task)
            if best is None or found.squared_error < best.squared_error or found.success:
                best = found
            best.iterations, best.restarts = iterations, restarts
            if best.success:
                return best
        assert best is not None
        return self.improve(best, q0, task)

    def improve(self, best: Candidate, q0: Floats, task: Task) -> Candidate:
        """Return the local minimum near the best configuration of all starts, or that if it is no better."""
        q, steps = self._refine(best.q, task)
        refined = self.evaluate(self._coordinates.nearest(q, q0), task)
        refined.iterations, refined.restarts = best.iterations + steps, best.restarts
        if refined.success or refined.squared_error <= best.squared_error:
            return refined
        best.iterations = refined.iterations
        return best

    def within_limits(self, q: Floats, q0: Floats) -> Floats:
        """Return q with angles shifted by full turns to be near q0, then clipped to the limits."""
        return self._coordinates.clipped(self._model.clip(self._coordinates.nearest(q, q0)))

    def evaluate(self, q: Floats, task: Task) -> Candidate:
        """Measure the errors at q by forward kinematics."""
        error = task.error(q)
        return Candidate(q, error.position, error.rotation, _half_square(error.vector), error.reached)

    def descend(self, q: Floats, task: Task) -> tuple[Floats, int]:
        """Descend from one start; return (the best configuration found, the number of steps)."""
        error_at, jacobian_at = task.error, task.jacobian
        coordinates, max_iterations = self._coordinates, self._limits.max_iterations
        best, least = q, float("inf")
        recent: deque[float] = deque(maxlen=WINDOW)
        for steps in range(max_iterations + 1):
            error = error_at(q)
            if error.reached:
                return q, steps
            vector = error.vector
            squared_error = 0.5 * sum([x * x for x in vector])
            if squared_error < least:
                best, least = q, squared_error
            stagnant = len(recent) == WINDOW and squared_error > REQUIRED_REDUCTION * recent[0]
            if stagnant or steps == max_iterations:
                break
            recent.append(squared_error)
            damping = DAMPING * squared_error + MIN_DAMPING
            y = self._step(jacobian_at(q, error), vector, coordinates.values(q), damping)
            q = coordinates.with_values(q, y)
        return best, steps

    def _refine(self, q: Floats, task: Task) -> tuple[Floats, int]:
        """Descend to a local minimum near q; return (the best configuration, the number of steps).

        Where the error stays large the full step overshoots, so a step that does not reduce the error is
        rejected and the damping raised (Marquardt 1963).
        """
        error = task.error(q)
        squared_error, factor, steps = _half_square(error.vector), DAMPING, 0
        while steps < self._limits.max_iterations:
            steps += 1
            trial = self._step_from(q, task, error, factor * squared_error + MIN_DAMPING)
            trial_error = task.error(trial)
            trial_square = _half_square(trial_error.vector)
            gain = squared_error - trial_square
            if gain > 0.0:
                q, error, squared_error = trial, trial_error, trial_square
                factor *= 0.3
            else:
                factor *= 4.0
            if abs(gain) <= MIN_RELATIVE_GAIN * squared_error:
                break
        return q, steps

    def _step_from(self, q: Floats, task: Task, error: TaskError, damping: float) -> Floats:
        """Return the configuration after one step from q."""
        coordinates = self._coordinates
        y = self._step(task.jacobian(q, error), error.vector, coordinates.values(q), damping)
        return coordinates.with_values(q, y)


def _half_square(residual: tuple[float, ...]) -> float:
    return 0.5 * sum([x * x for x in residual])
