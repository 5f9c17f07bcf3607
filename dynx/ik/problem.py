"""A checked problem of inverse kinematics: what `inverse_kinematics` passes to a solver of many targets."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, ShapeError, nearest, shown
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.descent import KernelTarget
from dynx.ik.options import AxisRequirement, Options, SearchLimits, checked_axes, frame_targets
from dynx.ik.search import FrameTask, SearchTask, SeveralTasks
from dynx.ik.step import TargetKind
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.elements import matrix_of_pair
from dynx.model.numbers import checked_vector, real_array
from dynx.model.targets import Targets, checked_targets
from dynx.spatial.scalar import Floats
from dynx.time_limit import TimeLimit, not_counted

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance, AvoidanceSource


SOLVERS = "ik.solvers"
"""Key under which a backend that compiles keeps its solvers (`dynx.ik.kernels.KernelSolvers`)."""

MAXIMA = ("manipulability", "limit_distance")
"""Values of the option `maximize`."""

Objective = Callable[[Floats], float]
"""Function of q (nq,) that is to become small."""


@dataclass(frozen=True, eq=False)
class Posture:
    """An objective that is a sum of squares: weights (n,) times squared distances of joints from a goal (n,)
    [rad or m]."""

    goal: Floats
    weights: Floats

    @property
    def inverse(self) -> Floats:
        """Inverse weights (n,), of mean 1; those of joints that do not count are 1."""
        found = np.where(self.weights > 0.0, 1.0 / np.where(self.weights > 0.0, self.weights, 1.0), 1.0)
        return np.asarray(found / found.mean())


@dataclass(frozen=True, eq=False)
class Secondary:
    """What a solution is chosen by."""

    nearest: Floats | None
    """Configurations (..., nq) to which solutions are to be near, or None."""
    maximize: str | None
    """One of `MAXIMA`, or None."""

    def posture(self, coordinates: FrameCoordinates) -> Posture | None:
        """Return the posture of one sample, or None if the objective is no sum of squared distances."""
        if self.nearest is not None:
            goal = coordinates.joint_values(self.nearest)
            return Posture(goal, np.ones(len(goal)))
        if self.maximize == "manipulability":
            return None
        low, high = coordinates.joint_limits
        bounded = np.isfinite(low) & np.isfinite(high)
        middle = np.where(bounded, 0.5 * (np.where(bounded, low, 0.0) + np.where(bounded, high, 0.0)), 0.0)
        half = np.where(bounded, 0.5 * (np.where(bounded, high, 0.0) - np.where(bounded, low, 0.0)), np.inf)
        return Posture(middle, np.where(bounded, 1.0 / np.maximum(half, 1e-12) ** 2, 0.0))

    def objective(self, coordinates: FrameCoordinates, task: SearchTask) -> Objective:
        """Return the objective of one sample."""
        posture = self.posture(coordinates)
        if posture is None:
            return lambda q: -_log_manipulability(task, q)
        goal, weights = posture.goal, posture.weights
        return lambda q: float(weights @ (coordinates.joint_values(q) - goal) ** 2)


def _log_manipulability(task: SearchTask, q: Floats) -> float:
    """Return the logarithm of Yoshikawa's measure sqrt(det(J J')) of the task at q."""
    values = np.linalg.svd(task.jacobian(q, task.error(q)), compute_uv=False)
    return float(np.log(np.maximum(values, 1e-12)).sum())


@dataclass(frozen=True, eq=False)
class Requirement:
    """Targets of one frame, and how they are to be reached."""

    frame: str
    targets: Targets
    point: Floats | None
    """Point (3,) of the frame that is placed, in its axes [m], or None for its origin."""
    axes: AxisRequirement | None
    """Weights and tolerances per axis, or None for bounds on both errors."""
    tolerances: SearchLimits
    """Bounds on the errors."""

    def task(
        self,
        backend: Backend,
        coordinates: FrameCoordinates,
        position: Floats | None,
        rotation: Floats | None,
    ) -> FrameTask:
        """Return the task of one target: a position (3,) [m] and a rotation (3, 3)."""
        kind = self.kind
        target = KernelTarget(kind, kind.rows(Targets(position, rotation), ())[0], tuple(self.optional))
        return FrameTask(backend, self.frame, self.point, coordinates, self.tolerances, target)

    def tasks(
        self, backend: Backend, coordinates: FrameCoordinates, batch: tuple[int, ...]
    ) -> Iterator[FrameTask]:
        """Yield the task of each target, broadcast to the leading axes `batch`."""
        kind, optional = self.kind, tuple(self.optional)
        for row in kind.rows(self.targets, batch):
            target = KernelTarget(kind, row, optional)
            yield FrameTask(backend, self.frame, self.point, coordinates, self.tolerances, target)

    @property
    def kind(self) -> TargetKind:
        """Kind of the targets."""
        return TargetKind.of(self.targets, self.point, self.axes)

    @property
    def optional(self) -> list[Floats]:
        """Values of what only some kinds have (`TargetKind.optional_values`)."""
        return self.kind.optional_values(self.point, self.axes)


@dataclass(frozen=True, eq=False)
class Problem:
    """Requirements on one frame or several, the starts, and the limits of the search, all checked."""

    requirements: tuple[Requirement, ...]
    coordinates: FrameCoordinates
    """The coordinates that move a frame, with their limits."""
    margin: Floats | None
    """Least distance (nq,) from the position limits [rad or m], or None."""
    q0: Floats
    """Configurations (..., nq) within limits."""
    begins_at_q0: bool
    """Whether the first start is q0, and not a start of the solver."""
    batch: tuple[int, ...]
    """Leading axes of targets and q0, broadcast."""
    limits: SearchLimits
    rng: np.random.Generator | int | None
    secondary: Secondary | None = None
    """What solutions are chosen by, if there is a choice."""
    avoidance: Avoidance | None = None
    """What solutions keep away from, or None."""

    @property
    def count(self) -> int:
        """Number of samples."""
        return math.prod(self.batch)

    @property
    def frame(self) -> str:
        """The first frame."""
        return self.requirements[0].frame

    @property
    def targets(self) -> Targets:
        """Targets of the first frame."""
        return self.requirements[0].targets

    @property
    def point(self) -> Floats | None:
        """Point of the first frame."""
        return self.requirements[0].point

    def sample(self, k: int) -> Problem:
        """Return the problem of sample number k alone."""
        index = np.unravel_index(k, self.batch)

        def at_index(array: Floats, axes: int) -> Floats:
            return np.asarray(np.broadcast_to(array, (*self.batch, *array.shape[array.ndim - axes :]))[index])

        def of_sample(targets: Targets) -> Targets:
            p, R = targets.positions, targets.rotations
            return Targets(None if p is None else at_index(p, 1), None if R is None else at_index(R, 2))

        requirements = tuple(replace(each, targets=of_sample(each.targets)) for each in self.requirements)
        return replace(self, requirements=requirements, q0=at_index(self.q0, 1), batch=())

    def by_frame(self, errors: Sequence[Sequence[tuple[float, float]]]) -> dict[str, tuple[Floats, Floats]]:
        """Return the position and rotation errors (...,) of each frame, if there are several, from those of
        each sample."""
        if len(self.requirements) == 1:
            return {}
        columns = np.array(errors, dtype=np.float64).reshape(*self.batch, len(self.requirements), 2)
        return {
            each.frame: (columns[..., k, 0], columns[..., k, 1]) for k, each in enumerate(self.requirements)
        }

    @property
    def is_plain(self) -> bool:
        """Whether there is one frame, without requirements per axis."""
        return len(self.requirements) == 1 and self.requirements[0].axes is None

    def starts(self) -> Floats:
        """Return the starts (count, nq) of all samples."""
        q0 = self.q0
        if not self.batch:
            return q0[None]
        return np.broadcast_to(q0, (*self.batch, q0.shape[-1])).reshape(self.count, q0.shape[-1])

    def tasks(self, backend: Backend) -> Iterator[tuple[int, SearchTask]]:
        """Yield the index of each sample, and what it has to reach."""
        of_frames = [each.tasks(backend, self.coordinates, self.batch) for each in self.requirements]
        for k, tasks in enumerate(zip(*of_frames, strict=True)):
            several = len(tasks) > 1
            yield (
                k,
                SeveralTasks(list(tasks), self.coordinates, self.limits.time_limit) if several else tasks[0],
            )


def checked_problem(
    model: Model, target: Any, frame: str | None, q0: ArrayLike | None, options: Options
) -> Problem:
    """Return the problem that arguments describe.

    Raises UnknownNameError for a frame; ArgumentError, ShapeError, DTypeError or NotFiniteError for other
    arguments.
    """
    wanted = frame_targets(target, frame, options)
    for name, _, _ in wanted:
        model.frame_index(name)
    limits, rng = options.search_limits(), options.checked_rng()
    requirements = tuple(_requirement(name, value, each, limits.time_limit) for name, value, each in wanted)
    margin = checked_margin(model, options.limit_margin)
    frames = tuple(requirement.frame for requirement in requirements)
    coordinates = stored_coordinates(model, frames, None if margin is None else tuple(margin.tolist()))
    secondary = _secondary(model, options)
    goal = None if secondary is None else secondary.nearest
    start = start_within_limits(model, goal if q0 is None else q0)
    if margin is not None:
        start = coordinates.clipped(start)
    shapes = [requirement.targets.batch for requirement in requirements]
    if goal is not None:
        shapes.append(goal.shape[:-1])
    try:
        batch = np.broadcast_shapes(*shapes, start.shape[:-1])
    except ValueError:
        of_targets = shapes[0] if len(shapes) == 1 else shapes
        raise ShapeError(
            f"leading axes do not broadcast: target has {of_targets}, q0 has {start.shape[:-1]}"
        ) from None
    if model.ball_joints and (secondary is not None or options.avoid is not None):
        from dynx.model.ball_joints import refuse_ball_joints  # most robots have none

        refuse_ball_joints(model, "inverse kinematics with nearest, maximize or avoid")
    avoidance = checked_avoidance(model, options.avoid)
    if avoidance is not None and options.method != "dynx":
        raise ArgumentError("avoid needs method 'dynx'")
    return Problem(
        requirements, coordinates, margin, start, q0 is not None, batch, limits, rng, secondary, avoidance
    )


def checked_avoidance(model: Model, avoid: AvoidanceSource | None) -> Avoidance | None:
    """Return what the robot is to avoid, or None. Raises ArgumentError.

    The hulls of a robot and its pairs, which a scene keeps, take no time from a search.
    """
    if avoid is None:
        return None
    with not_counted():
        return _avoidance(model, avoid)


def _avoidance(model: Model, avoid: AvoidanceSource) -> Avoidance:
    from dynx.distance.avoidance import AvoidanceSource

    if not isinstance(avoid, AvoidanceSource):
        raise ArgumentError(
            f"avoid is {shown(avoid)}; wanted a dynx.world.Scene or World, or its avoidance(...)"
        )
    return avoid.avoidance_for(model)


def _secondary(model: Model, options: Options) -> Secondary | None:
    """Return what solutions are chosen by, or None."""
    goal = options.nearest
    if goal is None and options.maximize is None:
        return None
    if goal is not None and options.maximize is not None:
        raise ArgumentError("nearest and maximize are both given; a choice has one objective")
    if options.method != "dynx":
        raise ArgumentError(f"nearest and maximize need method 'dynx', not {shown(options.method)}")
    if goal is None:
        if not isinstance(options.maximize, str) or options.maximize not in MAXIMA:
            raise ArgumentError(
                f"maximize is {shown(options.maximize)}{nearest(str(options.maximize), MAXIMA)}"
            )
        return Secondary(None, options.maximize)
    return Secondary(checked_q(model, goal, "nearest"), None)


def _requirement(frame: str, target: ArrayLike, options: Options, time_limit: TimeLimit) -> Requirement:
    """Return the checked target of one frame."""
    free, axes = checked_axes(
        options.free, options.weights, options.position_tolerance, options.rotation_tolerance, options.axes
    )
    targets: Targets = checked_targets(target, _part_read(target, options) if axes is not None else free)
    if axes is not None:
        axes = axes.for_targets(targets)
        if options.axes == "target" and targets.rotations is None and options.free != "rotation":
            _refuse_axes_of_position(options)
    point = None if options.point is None else checked_vector("point", options.point)
    placed = targets.positions is not None and (axes is None or any(axes.weights[:3]))
    if point is not None and not placed:
        raise ArgumentError("point is given in addition to free='position', with which it has no effect")
    tolerances = replace(options.search_limits(), time_limit=time_limit)
    return Requirement(frame, targets, point, axes, tolerances)


def _part_read(target: ArrayLike, options: Options) -> str | None:
    """Return what `free` says on how to read an array that may be positions or rotations."""
    names = (options.free,) if isinstance(options.free, str) else tuple(options.free or ())
    shape = np.shape(matrix_of_pair(target, "target"))
    if len(shape) >= 2 and shape[-2:] == (4, 4):
        return None
    return "position" if "position" in names else "rotation" if "rotation" in names else None


def _refuse_axes_of_position(options: Options) -> None:
    """Refuse rotation axes of a target that is a position."""
    names = (options.free,) if isinstance(options.free, str) else tuple(options.free or ())
    for name in names:
        if name.startswith("rotation_"):
            raise ArgumentError(
                f"free has {shown(name)}, but the target is a position (..., 3), whose rotation is free"
            )


def checked_margin(model: Model, margin: ArrayLike) -> Floats | None:
    """Return the margin (nq,) [rad or m], or None if it is 0."""
    if isinstance(margin, float) and margin == 0.0:
        return None
    array = real_array("limit_margin", margin)
    if array.shape not in ((), (model.nq,)):
        raise ShapeError(f"limit_margin has shape {array.shape}; wanted a number, or ({model.nq},)")
    if not (np.isfinite(array).all() and (array >= 0.0).all()):
        raise ArgumentError(f"limit_margin is {shown(margin)}; wanted a number of at least 0 [rad or m]")
    return np.broadcast_to(array, (model.nq,)).copy() if array.any() else None


def checked_velocity_limit(name: str, bound: ArrayLike, model: Model) -> Floats:
    """Return a bound (nv,) on velocities or accelerations, given as one number or (nv,), at least 0.

    Raises ShapeError, DTypeError or ArgumentError.
    """
    array = real_array(name, bound)
    if array.shape not in ((), (model.nv,)):
        raise ShapeError(f"{name} has shape {array.shape}; wanted one number, or ({model.nv},)")
    if not (array >= 0.0).all():
        raise ArgumentError(f"{name} has the least entry {np.min(array):g}; wanted at least 0")
    return np.array(np.broadcast_to(array, (model.nv,)))


def start_within_limits(model: Model, q0: ArrayLike | None) -> Floats:
    """Return q0, or the neutral configuration, moved into the limits and with a unit quaternion."""
    q = model.neutral() if q0 is None else checked_q(model, q0, "q0")
    if model.ball_joints:
        return model.clip(q)
    q = np.minimum(np.maximum(q, model.lower), model.upper)
    if model.floating:
        q[..., 3:7] /= np.linalg.norm(q[..., 3:7], axis=-1, keepdims=True)
    return q


def argument_note(
    model: Model, q0: ArrayLike | None, avoidance: Avoidance | None, nearest: ArrayLike | None = None
) -> str:
    """Return sentences on a q0 that was moved into the limits, on what the avoidance leaves out, and on a
    configuration `nearest` (nq,) that is far beyond the limits."""
    notes = ["" if q0 is None else start_note(model, q0), "" if avoidance is None else avoidance.note]
    if nearest is not None and np.ndim(nearest) == 1:
        from dynx.model.unlikely_inputs import position_notes

        notes += position_notes(model, np.asarray(nearest, dtype=np.float64), "nearest")
    return "; ".join(filter(None, notes))


def start_note(model: Model, q0: ArrayLike) -> str:
    """Return a sentence if a q0 (..., nq) that was checked is outside the limits, otherwise an empty text."""
    q = np.asarray(q0, dtype=np.float64)
    outside = (q < model.lower) | (q > model.upper)
    if not outside.any():
        return ""
    offset, names = 7 if model.floating else 0, model.position_names
    if q.ndim > 1:
        columns = np.flatnonzero(outside.any(axis=tuple(range(q.ndim - 1))))
        joints = ", ".join(names[k - offset] for k in columns.tolist())
        count, size = int(outside.any(axis=-1).sum()), q[..., 0].size
        return f"{count} of {size} q0 were outside the limits and moved into them ({joints})"
    from dynx.model.unlikely_inputs import in_other_unit

    moved = []
    for k in np.flatnonzero(outside).tolist():
        x, lower, upper = (float(each[k]) for each in (q, model.lower, model.upper))
        meant = in_other_unit(model.joint(names[k - offset]), x, lower, upper)
        moved.append(
            f"{names[k - offset]} from {x:.6g} to {min(max(x, lower), upper):.6g}{meant and f' ({meant})'}"
        )
    return f"q0 was outside the limits and moved into them: {', '.join(moved)}"


@lru_cache(maxsize=64)
def stored_coordinates(
    model: Model, frames: tuple[str, ...], margin: tuple[float, ...] | None = None
) -> FrameCoordinates:
    """Return the coordinates that move frames, the same object for equal arguments."""
    return FrameCoordinates(model, frames, None if margin is None else np.array(margin))
