"""Tracking of one path: continuation from sample to sample, and what is done where that fails.

A follower solves the samples one after the other, each within `StepBounds.reach` of the one before. Where it
does not reach a sample:

1. The way from the present pose to the target is divided into 2, 4, ... `MAX_DIVISIONS` parts, whose poses
   are followed in turn: the predictor of a continuation method with a step that adapts (Allgower and Georg,
   Introduction to numerical continuation methods, section 6.1). A sample whose parts are all reached
   is continuous, however far the joints had to turn.
2. Otherwise, if the path may jump, the nearest of the solutions that descents from many starts find.
3. Otherwise the configuration within reach that has the least error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.files.pages import html_table
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.problem import Requirement
from dynx.ik.result import largest_error
from dynx.ik.step import rotation_between
from dynx.ik.tracking.followers import Followed, Follower, StepBounds
from dynx.model.targets import Targets
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, quat_from_rotation, quat_log, rotation_from_quat

MAX_DIVISIONS = 64
"""Most parts into which the way from one sample to the next is divided."""

AT_BOUND = 1e-9
"""Distance from a bound [rad or m] below which a coordinate is at it."""

PRESSING = 1e-6
"""Cosine between the error and the motion of a coordinate above which its bound keeps the error large."""


class TrackStatus(IntEnum):
    """Status of one sample of a path."""

    OK = 0
    """The target is reached, and q is continuous with the sample before."""
    LIMITED = 1
    """The target is not reached: a position limit, its margin or a velocity limit holds the robot back."""
    HELD = 2
    """The target is not reached, and no limit is the cause: it is out of reach, singular or in collision. Of
    the configurations continuous with the sample before, q has the least error."""
    JUMPED = 3
    """The target is reached, but only by a configuration that is not continuous with the sample before."""
    TIMED_OUT = 4
    """`timeout` ended the search before the target was reached: q is the best found so far. If the search did
    not begin, q is that of the sample before, with NaN as errors."""


@dataclass(frozen=True, eq=False)
class TrackResult:
    """Configurations along a path of n targets, with their errors by forward kinematics; leading axes are
    batch, one path each."""

    q: Floats
    """Configurations (..., n, nq), within the position limits."""
    status: NDArray[np.int8]
    """Status (..., n), values of `TrackStatus`."""
    position_error: Floats
    """Distance from the target (..., n) [m]; 0 if the position is free."""
    rotation_error: Floats
    """Angle to the target (..., n) [rad], between 0 and pi; 0 if the rotation is free."""
    jump: Floats
    """Largest change of a joint from the sample before (..., n) [rad or m] where the status is JUMPED,
    otherwise 0."""
    iterations: NDArray[np.int64]
    """Number of solver steps (..., n)."""
    dt: float | None
    """Time between two samples [s], if velocity limits were kept."""
    reason: str = ""
    """Reason why the first sample that is not OK failed; empty if all are OK, and for several paths."""
    note: str = ""
    """Sentence on a q0 that was moved into the limits, and on what `avoid` leaves out; empty otherwise."""

    @property
    def ok(self) -> NDArray[np.bool_]:
        """True where the status is OK (..., n)."""
        return np.asarray(self.status == TrackStatus.OK)

    @property
    def fraction(self) -> Floats:
        """Fraction of each path (...,) that is OK from its start without interruption, from 0 to 1."""
        leading = np.logical_and.accumulate(self.ok, axis=-1)
        return np.asarray(leading.mean(axis=-1))

    @property
    def message(self) -> str:
        """One sentence that summarises the result, for a log or a terminal."""
        n = self.status.size
        counts = [(status, int((self.status == status).sum())) for status in TrackStatus]
        found = ", ".join(f"{count} {status.name}" for status, count in counts if count and count < n)
        whole = next((status.name for status, count in counts if count == n), found)
        worst = (
            f"at most {largest_error(self.position_error):.3g} m "
            f"and {largest_error(self.rotation_error):.3g} rad off"
        )
        text = f"{n} samples {whole if whole != found else f'({found})'}, {worst}"
        if self.status.ndim == 1 and not self:
            first = int(np.argmin(self.ok))
            text += f"; the first that is not OK is number {first}, {TrackStatus(self.status[first]).name}"
            text += f": {self.reason}" if self.reason else ""
        return f"{text}; {self.note}" if self.note else text

    def __repr__(self) -> str:
        return f"<TrackResult {self.message}>"

    def _repr_html_(self) -> str:
        return html_table("tracking", {"result": self.message, "q": self.q.shape})

    def __bool__(self) -> bool:
        """Return whether every sample is OK."""
        return bool(self.ok.all())


@dataclass(frozen=True, eq=False)
class TrackLimits:
    """Bounds of a path, for the coordinates that move the frame (n,) [rad or m]."""

    lower: Floats
    upper: Floats
    max_step: Floats
    """Largest change in one descent."""
    per_sample: Floats
    """Largest change from one sample to the next, by the velocity limits; infinite without them."""

    @property
    def direct(self) -> StepBounds:
        """Bounds of a descent from one sample to the next."""
        return StepBounds(self.lower, self.upper, np.minimum(self.max_step, self.per_sample))

    @property
    def unbounded_steps(self) -> StepBounds:
        """Bounds of a descent that may move any distance."""
        return StepBounds(self.lower, self.upper, np.full(len(self.lower), np.inf))

    @property
    def divisible(self) -> bool:
        """Whether several descents may change a coordinate by more than one."""
        return bool((self.per_sample > self.max_step).any())


@dataclass(eq=False)
class TrackedPath:
    """Arrays of one path of n samples, filled from the start (see `TrackResult`)."""

    q: Floats
    status: Floats
    position_error: Floats
    rotation_error: Floats
    jump: Floats
    iterations: Floats
    before_failure: Floats | None = None
    """Configuration before the first sample that is not OK."""

    @classmethod
    def empty(cls, n: int, nq: int) -> TrackedPath:
        """Make a path of which nothing is filled."""
        return cls(np.empty((n, nq)), *(np.zeros(n) for _ in range(5)))

    def leave(self, first: int, q: Floats) -> None:
        """Write samples from number `first`, for which no time is left, at the configuration q (nq,)."""
        self.q[first:], self.status[first:] = q, TrackStatus.TIMED_OUT
        self.position_error[first:] = self.rotation_error[first:] = np.nan

    @property
    def leading(self) -> int:
        """Number of samples that are OK from the start without interruption."""
        wrong = np.flatnonzero(self.status != TrackStatus.OK)
        return int(wrong[0]) if wrong.size else len(self.status)

    def is_ok_before(self, k: int) -> bool:
        """Return whether the sample before number k is reached; the start counts as reached."""
        return k == 0 or self.status[k - 1] in (TrackStatus.OK, TrackStatus.JUMPED)

    def fill(self, first: int, found: Followed) -> None:
        """Write samples from number `first`, as OK."""
        to = slice(first, first + len(found))
        self.q[to] = found.q
        self.position_error[to], self.rotation_error[to] = found.position_error, found.rotation_error
        self.iterations[to] += found.iterations


class PathTracker:
    """Tracker of paths of one frame."""

    def __init__(
        self,
        backend: Backend,
        follower: Follower,
        requirement: Requirement,
        coordinates: FrameCoordinates,
        limits: TrackLimits,
        starts: Floats,
    ) -> None:
        """`starts` (k, n) are values of the joints, at which searches for another solution begin."""
        self._backend, self._requirement = backend, requirement
        self._follower, self._limits, self._starts = follower, limits, starts
        self.coordinates, self.time_limit = coordinates, requirement.tolerances.time_limit

    def track(self, q: Floats, targets: Targets, *, jumps: bool) -> TrackedPath:
        """Track targets (n,) from the configuration q (nq,) before the first, within the limits."""
        limits, n = self._limits, targets.batch[0]
        path = TrackedPath.empty(n, len(q))
        bounds, before = limits.direct, q
        # With velocity limits nothing more can be done for a sample that is not reached.
        stop = jumps or limits.divisible
        time_limit = self.time_limit
        done = 0
        while done < n:
            found = self._follower.follow(q, targets[done:n], bounds, stop=stop)
            path.fill(done, found)
            failed = done + np.flatnonzero(~found.reached)
            for k in failed.tolist():
                start = path.q[k - 1] if k else before
                if time_limit.is_over():
                    path.status[k] = TrackStatus.TIMED_OUT
                    continue
                recovered = stop and self._recover(path, k, start, targets, jumps)
                if not recovered and time_limit.is_over():
                    path.status[k] = TrackStatus.TIMED_OUT
                elif not recovered:
                    limited = self.limiting(path.q[k], start, targets, k).any()
                    path.status[k] = TrackStatus.LIMITED if limited else TrackStatus.HELD
                if path.before_failure is None and path.status[k] != TrackStatus.OK:
                    path.before_failure = start.copy()
            done += len(found)
            q = path.q[done - 1]
            if time_limit.is_over():
                path.leave(done, q)
                break
        return path

    def solutions(self, q: Floats, target: Targets) -> Floats:
        """Return configurations (k, nq) that reach a target (1,), each once; other joints are those of q."""
        starts = np.tile(q, (len(self._starts) + 1, 1))
        starts[1:, self.coordinates.indices] = self._starts
        if self.coordinates.balls:
            drawn = self._backend.model.random(0, len(self._starts))
            starts[1:] = self.coordinates.with_balls_of(starts[1:], drawn)
        copies = target[np.zeros(len(starts), dtype=np.intp)]
        found = self._follower.descend(starts, copies, self._limits.unbounded_steps)
        within: list[Floats] = []
        for solution in found.q[found.reached]:
            near = self.coordinates.nearest(solution, q)
            if self._is_within_limits(near) and not any(self._distance(near, x) < AT_BOUND for x in within):
                within.append(near)
        return np.array(within).reshape(-1, len(q))

    def _recover(self, path: TrackedPath, k: int, q: Floats, targets: Targets, jumps: bool) -> bool:
        """Reach sample k from q over poses between, or by a jump; return whether that succeeded."""
        target = targets[k : k + 1]
        limits = self._limits
        if limits.divisible and (path.is_ok_before(k) or self._is_out_of_reach(q, path.q[k])):
            found = self._divided(q, target)
            if found is not None:
                path.iterations[k] = 0.0
                path.fill(k, found)
                return True
        if not jumps:
            return False
        others = self.solutions(q, target)
        if not len(others):
            return False
        distances = [self._distance(q, other) for other in others]
        nearest = int(np.argmin(distances))
        found = self._follower.descend(others[nearest : nearest + 1], target, limits.unbounded_steps)
        if not found.reached[0]:
            return False
        path.fill(k, found)
        path.status[k], path.jump[k] = TrackStatus.JUMPED, self._distance(q, found.q[0])
        return True

    def _divided(self, q: Floats, target: Targets) -> Followed | None:
        """Return the target's solution by continuation over poses between, or None."""
        coordinates, limits = self.coordinates, self._limits
        x = np.array(coordinates.values(q))
        bounds = StepBounds(limits.lower, limits.upper, limits.per_sample).within_reach_of(x, limits.max_step)
        between = _Between(
            self._backend.forward_kinematics(q, self._requirement.frame), self._requirement, target
        )
        parts, steps = 2, 0
        time_limit = self.time_limit
        while parts <= MAX_DIVISIONS and not time_limit.is_over():
            found = self._follower.follow(q, between.targets(parts), bounds, stop=True)
            steps += int(found.iterations.sum())
            if found.reached.all() and len(found) == parts:
                return replace(found.part(slice(-1, None)), iterations=np.array([steps]))
            parts *= 2
        return None

    def limiting(self, q: Floats, before: Floats, targets: Targets, k: int) -> NDArray[np.bool_]:
        """Return the coordinates (n,) that the error at q presses against a limit."""
        coordinates, limits = self.coordinates, self._limits
        ((position, rotation),) = targets[k : k + 1].rows((1,))
        task = self._requirement.task(self._backend, coordinates, position, rotation)
        at_q = task.error(q)
        error, J = np.array(at_q.vector), task.jacobian(q, at_q)
        pressure = error @ J / (np.linalg.norm(J, axis=0) * np.linalg.norm(error) + 1e-300)
        x, x_before = np.array(coordinates.values(q)), np.array(coordinates.values(before))
        bounds = StepBounds(limits.lower, limits.upper, limits.per_sample)
        lower, upper = bounds.around(x_before)
        limited: NDArray[np.bool_] = ((x <= lower + AT_BOUND) & (pressure < -PRESSING)) | (
            (x >= upper - AT_BOUND) & (pressure > PRESSING)
        )
        return limited

    def _is_out_of_reach(self, q: Floats, found: Floats) -> bool:
        """Return whether a descent from q ended because a coordinate changed by as much as it may."""
        x, x_found = (np.array(self.coordinates.values(one)) for one in (q, found))
        return bool((np.abs(x_found - x) >= self._limits.direct.reach - AT_BOUND).any())

    def _distance(self, a: Floats, b: Floats) -> float:
        """Return the largest difference of a joint [rad or m]."""
        indices, turned = self.coordinates.indices, self.coordinates.rotations(a, b)
        return float(np.max(np.abs([*(a[indices] - b[indices]), *turned]), initial=0.0))

    def _is_within_limits(self, q: Floats) -> bool:
        x = np.array(self.coordinates.values(q))
        return bool(((x >= self._limits.lower) & (x <= self._limits.upper)).all())


class _Between:
    """Targets on the straight way from the present pose to a target, at a constant rotation axis."""

    def __init__(self, T: Floats, requirement: Requirement, target: Targets) -> None:
        self._target, point = target, requirement.point
        if target.positions is not None:
            self._position = T[:3, 3] if point is None else T[:3, 3] + T[:3, :3] @ point
            self._displacement = target.positions[0] - self._position
        if target.rotations is not None:
            self._rotation = T[:3, :3]
            axes = requirement.axes
            k = None if axes is None else axes.free_rotation
            if k is None:
                self._vector = quat_log(quat_from_rotation(self._rotation.T @ target.rotations[0]))
            else:
                turn = rotation_between(self._rotation[:, k], target.rotations[0][:, k])
                self._vector = self._rotation.T @ turn

    def targets(self, parts: int) -> Targets:
        """Return the ends of this many equal parts; the last is exactly the target."""
        s = np.linspace(0.0, 1.0, parts + 1)[1:, None]
        positions = rotations = None
        if self._target.positions is not None:
            positions = self._position + s * self._displacement
            positions[-1] = self._target.positions[0]
        if self._target.rotations is not None:
            rotations = self._rotation @ rotation_from_quat(quat_exp(s * self._vector))
            rotations[-1] = self._target.rotations[0]
        return Targets(positions, rotations)
