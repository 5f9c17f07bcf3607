"""`track`: checks arguments, chooses the start of each path, tracks paths one by one, and says why a sample
of a path is not reached continuously.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.options import SearchLimits, checked_axes, checked_rng
from dynx.ik.problem import (
    Requirement,
    argument_note,
    checked_avoidance,
    checked_margin,
    checked_velocity_limit,
    start_within_limits,
)
from dynx.ik.reach import proof_of
from dynx.ik.tracking.followers import AvoidingFollower, Follower, SampleFollower, path_follower
from dynx.ik.tracking.path import AT_BOUND, PathTracker, TrackedPath, TrackLimits, TrackResult, TrackStatus
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.elements import matrix_of_pair
from dynx.model.numbers import checked_vector, is_real, positive_seconds, whole_number
from dynx.model.targets import Targets, checked_targets
from dynx.option_names import checks_option_names
from dynx.spatial.scalar import Floats
from dynx.time_limit import TimeLimit

if TYPE_CHECKING:
    from dynx.distance.avoidance import Avoidance, AvoidanceSource


MAX_NAMES = 4
"""Most joints that are named."""

SINGULAR = 1e-3
"""Singular value of the Jacobian [m or rad] below which a configuration is called singular."""


@dataclass(frozen=True, eq=False)
class FailureExplainer:
    """What is needed to say why a sample of one path is not OK."""

    backend: Backend
    tracker: PathTracker
    follower: Follower
    """Follower that avoids nothing."""
    requirement: Requirement
    """Targets (n,) of the path, and how they are to be reached."""
    limits: TrackLimits
    avoidance: Avoidance | None

    def reason(self, path: TrackedPath) -> str:
        """Return why the first sample that is not OK is so; empty if all are."""
        k = path.leading
        if k < len(path.status) and path.status[k] == TrackStatus.TIMED_OUT:
            return self.requirement.tolerances.time_limit.sentence
        if path.before_failure is None or k == len(path.status):
            return ""
        before, q = path.before_failure, path.q[k]
        proof = proof_of(self.backend.model, self.requirement, k)
        out_of_reach = f"out of reach: {proof}" if proof else ""
        if path.status[k] == TrackStatus.JUMPED:
            return f"no continuous configuration was found; a joint changes by {path.jump[k]:.3g}"
        if path.status[k] == TrackStatus.LIMITED:
            limited = self._limiting_joints(q, before, k)
            return f"{limited}; {out_of_reach}" if proof else limited
        return out_of_reach or self._collision(before, k) or self._singularity(q) + self._later_proof(path, k)

    def _later_proof(self, path: TrackedPath, k: int) -> str:
        """Return the proof for the sample that is off the most, if there is one: bounds on the reach are not
        exact, and the first sample that is out of reach may lie within them."""
        farthest = int(np.argmax(path.position_error + path.rotation_error))
        proof = proof_of(self.backend.model, self.requirement, farthest) if farthest > k else ""
        return f"; number {farthest} is out of reach: {proof}" if proof else ""

    def _limiting_joints(self, q: Floats, before: Floats, k: int) -> str:
        """Name the joints that the error presses against a limit."""
        coordinates, limits, model = self.tracker.coordinates, self.limits, self.backend.model
        pressed = self.tracker.limiting(q, before, self.requirement.targets, k)
        x = np.array(coordinates.values(q))
        at_position = (x <= limits.lower + AT_BOUND) | (x >= limits.upper - AT_BOUND)
        joint_offset = len(x) - len(coordinates.indices)
        base = 7 if model.floating else 0
        position: list[str] = []
        velocity: list[str] = []
        for number in np.flatnonzero(pressed).tolist():
            index = number - joint_offset
            name = "the base" if index < 0 else model.position_names[coordinates.indices[index] - base]
            (position if at_position[number] else velocity).append(name)
        found = [
            f"{', '.join(dict.fromkeys(names[:MAX_NAMES]))}{more} at {kind} limit"
            for names, kind in ((position, "the position"), (velocity, "the velocity"))
            if names
            for more in [f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""]
        ]
        return " and ".join(found)

    def _collision(self, before: Floats, k: int) -> str:
        """Say which bodies are too close where the target would be reached, or return an empty text."""
        if self.avoidance is None:
            return ""
        target = self.requirement.targets[k : k + 1]
        found = self.follower.follow(before, target, self.limits.direct, stop=True)
        if not found.reached[0]:
            found = self.follower.descend(before[None], target, self.limits.unbounded_steps)
        violated = self.avoidance.violated(self.backend, found.q[0]) if found.reached[0] else []
        if not violated:
            return ""
        from dynx.distance.avoidance import pair_sentence

        worst = max(violated, key=lambda each: each.pair.margin - each.separation.lower)
        return f"in collision: where the target is reached, {pair_sentence(self.avoidance, worst)}"

    def _singularity(self, q: Floats) -> str:
        """Say how close q is to a singular configuration, where no motion of the joints reduces the error."""
        coordinates, targets = self.tracker.coordinates, self.requirement.targets
        ((position, rotation),) = targets[:1].rows((1,))
        task = self.requirement.task(self.backend, coordinates, position, rotation)
        J = task.jacobian(q, task.error(q))
        if J.shape[1] < J.shape[0]:
            return f"the frame has {J.shape[0]} coordinates, and {J.shape[1]} joints move it"
        least = float(np.linalg.svd(J, compute_uv=False)[-1])
        value = f"least singular value of the Jacobian {least:.3g}"
        if least <= SINGULAR:
            return f"at a singular configuration ({value}), where no motion of the joints reduces the error"
        return f"no motion of the joints from the sample before reduces the error further ({value})"


MAX_STEPS = 60
"""Most steps of the solver to one target."""


@runtime_checkable
class TimedMotion(Protocol):
    """A motion of all coordinates over time, such as a `dynx.trajectory.Trajectory`."""

    @property
    def duration(self) -> float:
        """Duration [s]."""

    def __call__(self, t: ArrayLike, /) -> tuple[Floats, Floats, Floats]:
        """Return q, v and a at times t [s]."""


@checks_option_names
def track(
    backend: Backend,
    targets: ArrayLike | TimedMotion,
    frame: str,
    q0: ArrayLike | None = None,
    *,
    dt: float | None = None,
    velocity_limit: ArrayLike | None = None,
    free: str | Sequence[str] | None = None,
    point: ArrayLike | None = None,
    position_tolerance: float = 1e-6,
    rotation_tolerance: float = 1e-6,
    limit_margin: ArrayLike = 0.0,
    max_step: float = 0.2,
    jumps: bool | None = None,
    max_starts: int = 32,
    rng: np.random.Generator | int = 0,
    avoid: AvoidanceSource | None = None,
    timeout: float | None = None,
) -> TrackResult:
    """Follow a path of targets by a continuous sequence of configurations within limits.

    `targets` are n poses T_world_target (..., n, 4, 4), n positions (..., n, 3) [m] whose rotation is free,
    or with ``free="position"`` n rotations (..., n, 3, 3). `free` (also single axes of poses, such as
    ``"rotation_z"`` of a welding torch) and `point` (3,) [m] are as in `inverse_kinematics`. Leading axes are
    paths of their own. `targets` may also be a motion of this robot, such as a `dynx.trajectory.Trajectory`,
    whose poses of `frame` are taken every `dt` [s].

    `q0` (..., nq) is the configuration before the first sample, moved into the limits (`TrackResult.note`
    says so). So you can track a path in pieces, each from the last q of the piece before. Without q0, `track`
    chooses the start among up to `max_starts` configurations that reach the first target. It takes the one
    farthest from position limits from which the whole path is OK. If there is none, it takes the one from
    which the path is OK longest.

    With `dt` [s], the time between two samples, no coordinate moves faster than `velocity_limit` (one number
    or (nv,) [rad/s or m/s], by default the model's limits). Samples that would need a higher velocity are
    LIMITED. The position limits are kept with `limit_margin` [rad or m], one number or (nq,).

    A sample counts as reached within `position_tolerance` [m] and `rotation_tolerance` [rad]. A sample is
    continuous with the one before if a descent from there reaches it and moves no coordinate by more than
    `max_step` [rad or m]. It is also continuous if that holds between up to 64 poses on the straight line to
    it. If no continuous configuration reaches the target, q jumps to the nearest of the solutions found from
    `max_starts` random starts, and the status is JUMPED. If there is no such solution, or with
    ``jumps=False`` (the default with `dt`), q is the continuous configuration with the least error. The
    status LIMITED or HELD names the cause. Equal calls with a seed `rng` return equal results.

    With `avoid`, a scene or the result of `Scene.avoidance`, samples that are OK or JUMPED keep bodies apart.
    The motion between two samples is not checked. Redundant joints move around bodies that are in the way. If
    no continuous configuration is clear, the path jumps, or the sample is HELD at a clear configuration.

    With `timeout` [s] the search ends after that time, to within 10 %: samples that are not reached then are
    TIMED_OUT. Compiling or loading the kernels of a robot, once, does not count.

    Raises UnknownNameError for the frame; ArgumentError (ShapeError, DTypeError, NotFiniteError) for an
    invalid argument.
    """
    model = backend.model
    model.frame_index(frame)
    if model.ball_joints and avoid is not None:
        refuse_ball_joints(model, "track with avoid")
    seconds = None if dt is None else positive_seconds("dt", dt)
    for name, number in (
        ("position_tolerance", position_tolerance),
        ("rotation_tolerance", rotation_tolerance),
    ):
        if not (is_real(number) and 0.0 < number < math.inf):
            raise ArgumentError(f"{name} is {shown(number)}; wanted a positive number")
    if not (is_real(max_step) and 0.0 < max_step <= math.pi):
        raise ArgumentError(f"max_step is {shown(max_step)}; wanted a number above 0, at most pi")
    whole_number("max_starts", max_starts, 1)
    at = None if point is None else checked_vector("point", point)
    part, axes = checked_axes(free, None, position_tolerance, rotation_tolerance, "target")
    path = _checked_path(backend, targets, frame, part, seconds)
    if axes is not None and path.rotations is None:
        raise ArgumentError(f"free is {shown(free)}, an axis of poses (..., n, 4, 4); targets are positions")
    if at is not None and path.positions is None:
        raise ArgumentError("point is given in addition to free='position', with which it has no effect")
    coordinates = FrameCoordinates(model, frame, checked_margin(model, limit_margin))
    may_jump = seconds is None if jumps is None else jumps
    if not isinstance(may_jump, bool):
        raise ArgumentError(f"jumps is {shown(jumps)}; wanted True, False or None")
    if may_jump and seconds is not None:
        raise ArgumentError("jumps=True is given with dt, whose velocity limits a jump would violate")
    limits = _limits(model, coordinates, max_step, seconds, velocity_limit)
    settings = SearchLimits(
        float(position_tolerance), float(rotation_tolerance), MAX_STEPS, 0, TimeLimit(timeout)
    )
    requirement = Requirement(frame, path, at, axes, settings)
    follower: Follower | None = None
    if axes is None:
        follower = path_follower(backend, coordinates, frame, path, at, settings)
    if follower is None:
        follower = SampleFollower(backend, requirement)
    plain, avoidance = follower, checked_avoidance(model, avoid)
    if avoidance is not None:
        follower = AvoidingFollower(follower, backend, requirement, coordinates, avoidance)
    draws = coordinates.starts(np.random.default_rng(checked_rng(rng)), max_starts)
    offset = coordinates.count - len(coordinates.indices)
    starts = np.clip(draws, limits.lower[offset:], limits.upper[offset:])
    tracker = PathTracker(backend, follower, requirement, coordinates, limits, starts)
    explainer = FailureExplainer(backend, tracker, plain, requirement, limits, avoidance)

    n = path.batch[-1]
    start = coordinates.clipped(start_within_limits(model, q0))
    try:
        batch = np.broadcast_shapes(path.batch[:-1], start.shape[:-1])
    except ValueError:
        raise ShapeError(
            f"leading axes do not broadcast: targets have {path.batch[:-1]}, q0 has {start.shape[:-1]}"
        ) from None
    count = math.prod(batch)
    flat_starts = np.broadcast_to(start, (*batch, model.nq)).reshape(count, model.nq)
    paths = path.flattened(batch, n)
    found: list[TrackedPath] = []
    for k in range(count):
        of_path = paths[k]
        if k and settings.time_limit.is_over():
            found.append(TrackedPath.empty(n, model.nq))
            found[-1].leave(0, flat_starts[k])
        elif q0 is None:
            found.append(_from_best_start(tracker, flat_starts[k], of_path, limits, may_jump))
        else:
            found.append(tracker.track(flat_starts[k], of_path, jumps=may_jump))

    def gathered(name: str, *trailing: int) -> Floats:
        return np.array([getattr(one, name) for one in found]).reshape(*batch, n, *trailing)

    return TrackResult(
        gathered("q", model.nq),
        gathered("status").astype(np.int8),
        gathered("position_error"),
        gathered("rotation_error"),
        gathered("jump"),
        gathered("iterations").astype(np.int64),
        seconds,
        "" if batch else explainer.reason(found[0]),
        argument_note(model, q0, avoidance),
    )


def _from_best_start(
    tracker: PathTracker, q: Floats, targets: Targets, limits: TrackLimits, jumps: bool
) -> TrackedPath:
    """Track from the solution of the first target from which most samples are OK."""
    starts = tracker.solutions(q, targets[:1])
    indices = tracker.coordinates.indices
    offset = len(limits.lower) - len(indices)
    low, high = limits.lower[offset:], limits.upper[offset:]
    with np.errstate(invalid="ignore"):
        extent = np.where(high > low, high - low, 1.0)
        x = starts[:, indices]
        clearance = np.min(np.minimum((x - low), (high - x)) / np.where(np.isfinite(extent), extent, 1.0),
                           axis=-1, initial=0.5)  # fmt: skip
    best: tuple[int, Floats, TrackedPath | None] = (-1, q, None)
    time_limit = tracker.time_limit
    for k in np.argsort(-clearance, kind="stable").tolist():
        path = tracker.track(starts[k], targets, jumps=False)
        if path.leading == targets.batch[0]:
            return path
        if path.leading > best[0]:
            best = path.leading, starts[k], path
        if time_limit.is_over():
            break
    _, start, path_or_none = best
    if path_or_none is None or (jumps and not time_limit.is_over()):
        return tracker.track(start, targets, jumps=jumps)
    return path_or_none


def _checked_path(
    backend: Backend, targets: ArrayLike | TimedMotion, frame: str, free: str | None, dt: float | None
) -> Targets:
    """Return targets (..., n), n at least 1."""
    if isinstance(targets, TimedMotion):
        if dt is None:
            raise ArgumentError("targets are a motion over time; give dt, the time between two samples [s]")
        count = math.floor(targets.duration / dt * (1.0 + 1e-12)) + 1
        q = np.asarray(targets(np.minimum(np.arange(count) * dt, targets.duration))[0])
        if q.shape[-1] != backend.model.nq:
            raise ShapeError(
                f"the motion has {q.shape[-1]} coordinates; wanted {backend.model.nq}, those of the robot"
            )
        poses: ArrayLike = backend.forward_kinematics(q, frame)
    else:
        poses = matrix_of_pair(targets, "targets")
    path = checked_targets(poses, free)
    if not path.batch or not path.batch[-1]:
        raise ShapeError(
            f"targets have shape {np.shape(poses)}; wanted a path, such as (..., n, 4, 4) with n at least 1"
        )
    return path


def _limits(
    model: Model,
    coordinates: FrameCoordinates,
    max_step: float,
    dt: float | None,
    velocity_limit: ArrayLike | None,
) -> TrackLimits:
    offset, n = coordinates.count - len(coordinates.indices), coordinates.count
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    ranges = np.array([coordinates.limits(k) for k in range(n - offset)]).reshape(-1, 2)
    lower[offset:], upper[offset:] = ranges[:, 0], ranges[:, 1]
    per_sample = np.full(n, np.inf)
    if dt is None and velocity_limit is not None:
        raise ArgumentError("velocity_limit is given without dt, the time between two samples [s]")
    if dt is not None:
        speed = model.velocity_limit if velocity_limit is None else velocity_limit
        per_sample = checked_velocity_limit("velocity_limit", speed, model)[coordinates.columns] * dt
    steps = np.full(n, float(max_step))
    first = 6 if coordinates.floating else 0
    steps[:first] = np.inf
    if np.isfinite(per_sample[first:offset]).any():
        refuse_ball_joints(model, "track with velocity limits of its coordinates")
    return TrackLimits(lower, upper, steps, per_sample)
