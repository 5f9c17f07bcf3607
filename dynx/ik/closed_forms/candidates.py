"""Branches of the solutions, and their candidates: polished, and reviewed for which are solutions.

Branches of the solutions: eight choices of three signs, with names that state their geometry.

With h_i the axes of the joints as they stand at the solution, a chain whose wrist is spherical (or whose axes
2, 3 and 4 are parallel) has the branches

- shoulder right, if the wrist centre (the point where axes 5 and 6 meet) lies on that side of axis 1 to which
h_1 x h_2 points, and otherwise shoulder left;
- elbow up, if axis 3 passes the line from axis 2 to the wrist centre (to axis 4) on the side of h_1. If the
line points to the left for shoulder right, or to the right for shoulder left, up and down are exchanged;
- wrist unflipped, if h_5' (h_4 x h_6) > 0, and otherwise wrist flipped.

For the inverse chain (the first three axes meet, or axes 3, 4 and 5 are parallel) read 6, 5, ..., 1 for 1, 2,
..., 6 and exchange the words shoulder and wrist. If axes 1 and 2 are parallel, elbow and forearm take the
place of shoulder and elbow: elbow right, if the wrist centre lies to the right of the line from axis 1 to
axis 2 (on the side of that direction x h_2), and forearm up, if the height of the wrist centre along h_2
rises with q_3. If axes 1, 2 and 3 are parallel, the wrists have numbers, in no order, and elbow right says
that axis 2 passes to the right of the line from axis 1 to axis 3, seen against h_1. If a quartic is solved,
its roots have numbers, in no order, as have arms with prismatic joints before a spherical wrist; of three
parallel axes alone elbow right says the same as for axes 1, 2 and 3. Other branches change only at a
singularity.

Newton's method on the chain itself, in array code for any scalar: closed forms hold for an idealised one.

The axes of real files meet, or are parallel, only to some digits. A solution for exact axes is near one of
the chain, which a few steps reach. The steps are those of Gauss and Newton with a damping so small that it
matters only at singular configurations. They multiply cosines and sines by rotations, so that no angle needs
to be computed in between.

One candidate of a branch and its errors, in array code for any scalar: a kernel, or NumPy for batches.

Review of candidates by NumPy: which are solutions, and which of those are distinct.

A candidate is a solution if it reaches the pose and lies within the limits. Few need a second look: those
near a singularity, where Newton's method takes more steps and two branches may be one, and those at a limit.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from dynx.ik.closed_forms.chain import Chain
from dynx.ik.closed_forms.parallel_axes import OuterParallelAxes, ParallelAxes
from dynx.ik.closed_forms.recognition import Geometry, Recognised
from dynx.ik.closed_forms.sliding_arms import ParallelArm, SlidingArm, ThreeSlides
from dynx.ik.closed_forms.spherical_wrist import SphericalWrist
from dynx.ik.closed_forms.subproblems import Angle, Coordinate, Slide, dot
from dynx.ik.coordinates import FULL_TURN
from dynx.rbd.linear import ldl_factors, solve_ldl
from dynx.spatial.scalar import Array, Floats, append_axis, arctan2, clamp, cos, sin, sqrt, where_less
from dynx.spatial.so3 import cross, rotate, rotate_back

SIGNS: Floats = np.array(list(product((1.0, -1.0), repeat=3)))
"""Signs (8, 3) that select the solutions."""

N_BRANCHES = len(SIGNS)


def branch_names(recognised: Recognised) -> tuple[str, ...]:
    """Return the names of the eight branches, in the order of `SIGNS`."""
    first, last = ("wrist", "shoulder") if recognised.inverted else ("shoulder", "wrist")
    found = []
    for number, signs in enumerate(SIGNS.tolist()):
        if isinstance(recognised.geometry, OuterParallelAxes):
            arm, elbow, wrist = signs
            right = (elbow > 0.0) == (float(recognised.geometry.axes[0] @ recognised.geometry.axes[1]) > 0.0)
            place = 1 + 2 * (arm < 0.0) + (wrist < 0.0)
            found.append(f"{last} {place}, elbow {'right' if right else 'left'}")
            continue
        if isinstance(recognised.geometry, ThreeSlides | ParallelArm | SlidingArm):
            found.append(_with_slides(recognised.geometry, signs, last))
            continue
        arm, unflipped = _sides(recognised.geometry, signs)
        flip = f"{last} {'unflipped' if unflipped else 'flipped'}"
        found.append(f"{arm.format(first=first, number=number // 2 + 1)}, {flip}")
    return tuple(found)


def _with_slides(geometry: ThreeSlides | ParallelArm | SlidingArm, signs: list[float], last: str) -> str:
    """Return the name of a branch of an arm with prismatic joints. Signs that select nothing are 1."""
    arm, elbow, wrist = signs
    place = 1 + 2 * (arm < 0.0) + (elbow < 0.0)
    if isinstance(geometry, ParallelArm):
        plane = geometry.plane.axes
        right = (elbow > 0.0) == (float(plane[0] @ plane[1]) > 0.0)
        return f"elbow {'right' if right else 'left'}"
    flip = f"{last} {'unflipped' if wrist > 0.0 else 'flipped'}"
    return flip if isinstance(geometry, ThreeSlides) else f"arm {place}, {flip}"


def _sides(geometry: SphericalWrist | ParallelAxes, signs: list[float]) -> tuple[str, bool]:
    """Return the name of the arm's branch, and whether the wrist is unflipped."""
    h, (arm, elbow, wrist) = geometry.axes, signs
    if isinstance(geometry, SphericalWrist):
        right, unflipped = arm > 0.0, wrist > 0.0
        if geometry.case == "parallel_1_2":
            return (
                f"elbow {'right' if right else 'left'}, forearm {'down' if elbow > 0.0 else 'up'}",
                unflipped,
            )
    else:
        right, unflipped = arm < 0.0, wrist * float(h[1] @ h[3]) > 0.0
    up = (elbow < 0.0) == (right == (float(h[1] @ h[2]) >= 0.0))
    if geometry.case == "general":
        if isinstance(geometry, SphericalWrist):
            return "arm {number}", unflipped
        return f"{{first}} and wrist {{number}}, elbow {'up' if elbow < 0.0 else 'down'}", unflipped
    return f"{{first}} {'right' if right else 'left'}, elbow {'up' if up else 'down'}", unflipped


DAMPING = 1e-13
"""Term added to the diagonal of J' J, with lengths relative to that of the chain."""

MAX_HALF_STEP = 0.1
"""Bound on the tangent of half the change of an angle in one step."""

_SNAP = 4e-16
"""Entries of constant rotations within this distance of 0, 1 or -1 are replaced by it."""


@dataclass(frozen=True, eq=False)
class AxisFrames:
    """Frames of the chain with z along each axis: the pose of each in the one before, and of the tool."""

    R: tuple[Floats, ...]
    p: tuple[Floats, ...]

    @classmethod
    def of(cls, chain: Chain) -> AxisFrames:
        """Return the frames of a chain."""
        Rs, ps = [], []
        R_before, p_before = np.eye(3), np.zeros(3)
        for axis, point in zip(chain.axes, chain.points, strict=True):
            R = _frame_along(axis, R_before)
            Rs.append(_snapped(R_before.T @ R))
            ps.append(_snapped(R_before.T @ (point - p_before)))
            R_before, p_before = R, point
        Rs.append(_snapped(R_before.T @ chain.T_zero[:3, :3]))
        ps.append(_snapped(R_before.T @ (chain.T_zero[:3, 3] - p_before)))
        return cls(tuple(Rs), tuple(ps))


def polished(
    frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate], steps: int
) -> list[Coordinate]:
    """Return the angles after some steps towards the pose (R, p)."""
    for _ in range(steps):
        _, error, J = _error_and_jacobian(frames, R, p, angles)
        columns = np.stack(J, axis=-1)
        A = np.asarray(np.swapaxes(columns, -1, -2) @ columns + DAMPING * np.eye(len(angles), dtype=int))
        b = np.asarray((np.swapaxes(columns, -1, -2) @ error[..., None])[..., 0])
        step = (
            solve_ldl(*ldl_factors(A), b) if A.dtype == object else np.linalg.solve(A, b[..., None])[..., 0]
        )
        angles = [_moved(q, step[..., k]) for k, q in enumerate(angles)]
    return angles


def errors_of(frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate]) -> tuple[Array, Array]:
    """Return the distance from the position p (...,), relative to the length of the chain, and twice the sine
    of half the angle from the rotation R (...,), which is the angle [rad] to third order."""
    chord, error, _ = _error_and_jacobian(frames, R, p, angles)
    position = error[..., :3]
    return sqrt(dot(position, position)), sqrt(chord)


def _error_and_jacobian(
    frames: AxisFrames, R: Array, p: Array, angles: list[Coordinate]
) -> tuple[Array, Array, list[Array]]:
    """Return the square of the rotation error's chord, the twist to the pose, and the columns of J."""
    axes, origins = [], []
    R_here, p_here = frames.R[0], frames.p[0]
    for q, R_next, p_next in zip(angles, frames.R[1:], frames.p[1:], strict=True):
        x, y, z = R_here[..., :, 0], R_here[..., :, 1], R_here[..., :, 2]
        axes.append(z)
        origins.append(p_here)
        if isinstance(q, Slide):
            p_here = p_here + z * append_axis(q.value) + rotate(R_here, p_next)
            R_here = R_here @ R_next
            continue
        c, s = append_axis(q.cos), append_axis(q.sin)
        turned = np.stack(np.broadcast_arrays(c * x + s * y, c * y - s * x, z + 0.0 * c), axis=-1)
        p_here = p_here + rotate(turned, p_next)
        R_here = turned @ R_next
    difference = R - R_here
    chord = 0.5 * np.sum(np.sum(difference * difference, axis=-1), axis=-1)
    rotation = 0.5 * sum(cross(R_here[..., :, k], R[..., :, k]) for k in range(3))
    error = np.concatenate(np.broadcast_arrays(p - p_here, rotation), axis=-1)
    J = []
    for q, axis, origin in zip(angles, axes, origins, strict=True):
        none = 0.0 * p_here
        linear, angular = (axis, none) if isinstance(q, Slide) else (cross(axis, p_here - origin), axis)
        J.append(np.concatenate(np.broadcast_arrays(linear + none, angular + none), axis=-1))
    return np.asarray(chord), error, J


def _moved(q: Coordinate, step: Array) -> Coordinate:
    """Return the coordinate increased by a small step, an angle by Cayley's formula for its half."""
    if isinstance(q, Slide):
        return replace(q, value=q.value + step)
    half = clamp(0.5 * step, MAX_HALF_STEP)
    w = 1.0 + half * half
    c, s = (1.0 - half * half) / w, 2.0 * half / w
    return replace(q, cos=q.cos * c - q.sin * s, sin=q.sin * c + q.cos * s)


def _frame_along(axis: Floats, R_before: Floats) -> Floats:
    """Return a rotation with z along the axis, and x along an axis of the frame before as nearly as possible.

    For parallel and normal axes its entries in the frame before are 0, 1 and -1, and cost nothing.
    """
    k = int(np.argmin(np.abs(R_before.T @ axis)))
    x = R_before[:, k] - axis * float(axis @ R_before[:, k])
    x = x / np.linalg.norm(x)
    return np.stack([x, cross(axis, x), axis], axis=-1)


def _snapped(a: Floats) -> Floats:
    nearest = np.round(a)
    snapped: Floats = np.where(np.abs(a - nearest) < _SNAP, nearest, a)
    return snapped


POSITION, ROTATION, VIOLATION, SEPARATION, ARBITRARY = range(5)
"""Columns of the measures of a candidate."""

N_MEASURES = 5


@dataclass(frozen=True, eq=False)
class Candidates:
    """Function from a pose and a branch to the coordinates of one chain."""

    geometry: Geometry
    inverted: bool
    frames: AxisFrames
    R_zero: Floats
    p_zero: Floats
    """Pose of the frame at the zero configuration; lengths are relative."""
    lower: Floats
    upper: Floats
    """Limits (n,) [rad or m]."""
    revolute: tuple[bool, ...]
    """Whether each joint turns; the others slide."""
    length: float
    """Length [m] of the chain."""
    steps: int
    """Number of Newton steps."""

    def __call__(self, pose: Array, signs: Array) -> dict[str, Array]:
        """Return the coordinates `q` (..., n) [rad or m] and `measures` (..., 5) for poses (..., 3, 4), with
        relative lengths, and signs (..., 3).

        The measures are the errors of position (relative) and rotation (`polish.errors_of`), the violation of
        the limits [rad or m], the least separation of the branches (`subproblems.Angle`), and the sum of 2^k
        for the entries k of `geometry.arbitrary` whose angles are arbitrary.
        """
        R, p = pose[..., :3], pose[..., 3]
        return self._measured(R, p, self._closed_form(R, p, signs), self.steps)

    def measured(self, pose: Array, q: Array, steps: int) -> dict[str, Array]:
        """Return the same for coordinates q (..., n), after some Newton steps; the separation is 1."""
        angles = [
            Angle(cos(q[..., k]), sin(q[..., k])) if turns else Slide(q[..., k] / self.length)
            for k, turns in enumerate(self.revolute)
        ]
        return self._measured(pose[..., :3], pose[..., 3], angles, steps)

    @property
    def content(self) -> tuple[object, ...]:
        """Numbers and cases that determine the function."""
        values = [
            getattr(part, field.name) for part in (self.geometry, self.frames, self) for field in fields(part)
        ]
        arrays = [each for value in values for each in (value if isinstance(value, tuple) else (value,))]
        numbers = [each.tolist() if isinstance(each, np.ndarray) else str(each) for each in arrays]
        return type(self.geometry).__name__, *numbers

    def _measured(self, R: Array, p: Array, angles: list[Coordinate], steps: int) -> dict[str, Array]:
        angles = polished(self.frames, R, p, angles, steps)
        position, rotation = errors_of(self.frames, R, p, angles)
        within = [
            _slide_within(q.value * self.length, float(low), float(high))
            if isinstance(q, Slide)
            else _within(arctan2(q.sin, q.cos), float(low), float(high))
            for q, low, high in zip(angles, self.lower, self.upper, strict=True)
        ]
        violation = within[0][1]
        for _, each in within[1:]:
            violation = where_less(violation, each, each, violation)
        separation = np.asarray(angles[0].separation)
        for q in angles[1:]:
            separation = where_less(q.separation, separation, q.separation, separation)
        joints = (
            [len(angles) - 1 - k for k in self.geometry.arbitrary]
            if self.inverted
            else self.geometry.arbitrary
        )
        arbitrary = sum(2.0**place * np.asarray(angles[k].arbitrary) for place, k in enumerate(joints))
        measures = np.broadcast_arrays(position, rotation, violation, separation, np.asarray(arbitrary))
        return {
            "q": np.stack(np.broadcast_arrays(*(value for value, _ in within)), axis=-1),
            "measures": np.stack(measures, axis=-1),
        }

    def _closed_form(self, R: Array, p: Array, signs: Array) -> list[Coordinate]:
        R_G = R @ self.R_zero.T
        p_G = p - rotate(R_G, self.p_zero)
        if not self.inverted:
            return [*self.geometry.angles(R_G, p_G, signs)]
        return [*self.geometry.angles(np.swapaxes(R_G, -1, -2), -rotate_back(R_G, p_G), signs)][::-1]


def _within(value: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return an angle from -pi to pi moved by a full turn into its limits where possible, and by how much it
    violates them."""
    if low <= -np.pi and high >= np.pi:
        # The angle itself is within the limits.
        return value, 0.0 * value
    shifts = [s for s in (FULL_TURN, -FULL_TURN) if low <= np.pi + s and high >= s - np.pi]
    turns = [value, *(value + shift for shift in shifts)]
    found, least = turns[0], _excess(turns[0], low, high)
    for each in turns[1:]:
        excess = _excess(each, low, high)
        found, least = where_less(excess, least, each, found), where_less(excess, least, excess, least)
    return found, least


def _slide_within(value: Array, low: float, high: float) -> tuple[Array, Array]:
    """Return a position and by how much it violates its limits."""
    return value, _excess(value, low, high)


def _excess(value: Array, low: float, high: float) -> Array:
    below = low - value if np.isfinite(low) else -1.0 + 0.0 * value
    above = value - high if np.isfinite(high) else -1.0 + 0.0 * value
    most = where_less(below, above, above, below)
    return where_less(0.0, most, most, 0.0)


ACCURACY = 1e-11
"""Largest error of a solution: of the position relative to the length of the chain, and of the rotation
[rad]."""

ROUNDING = 1e-14
"""Error up to which a candidate is a solution at once; above it, it is polished further."""

AT_LIMIT = 1e-8
"""Violation [rad or m] of a limit that counts as rounding: the solution is moved to the limit if it still
reaches the pose."""

_SAME = 1e-6
"""Difference [rad or m] up to which two candidates are one solution. At a singularity rounding moves a
solution by the square root of its error."""

_FURTHER_STEPS = 3, 17
"""Newton steps for rough candidates, and for those that are rough after them."""

_CHUNK = 4096
"""Number of poses that NumPy evaluates at once, so that its intermediate arrays stay in the cache."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Reviewed:
    """Candidates of n poses, and which of them are solutions."""

    angles: Floats
    """Coordinates (n, 8, joints) [rad or m]."""
    measures: Floats
    """Measures (n, 8, 5) of `Candidates`."""
    found: Mask
    """Distinct solutions (n, 8)."""


@dataclass(frozen=True, eq=False)
class Review:
    """Function from poses to their solutions, for one chain."""

    candidates: Candidates
    nearness: float
    """Error above which a candidate is not near a solution."""
    separation: float
    """Separation of two branches below which they may be one solution."""
    repeats: bool
    """True if different branches may be one solution anywhere."""

    def __call__(self, pose: Floats, ignore_limits: bool) -> Reviewed:
        """Return all candidates of poses (n, 3, 4), whose lengths are relative, polished."""
        n = len(pose)
        angles = np.empty((n, N_BRANCHES, len(self.candidates.lower)))
        measures = np.empty((n, N_BRANCHES, N_MEASURES))
        found = np.empty((n, N_BRANCHES), dtype=np.bool_)
        for first in range(0, n, _CHUNK):
            rows = slice(first, first + _CHUNK)
            result = self.candidates(pose[rows, None], SIGNS)
            angles[rows], measures[rows] = result["q"], result["measures"]
            found[rows] = self._found(pose[rows], angles[rows], measures[rows], ignore_limits)
        return Reviewed(angles, measures, found)

    def _found(self, pose: Floats, angles: Floats, measures: Floats, ignore_limits: bool) -> Mask:
        """Return which candidates (n, 8) are distinct solutions; polish those that need it, in place."""
        error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
        rough = (error > ROUNDING) & (error < self.nearness)
        if rough.any():
            self._polish(pose, angles, measures, error, rough)
        found: Mask = error <= ACCURACY
        if not ignore_limits:
            violation = measures[..., VIOLATION]
            at_limit = found & (violation > 0.0) & (violation <= AT_LIMIT)
            if at_limit.any():
                self._move_to_limits(pose, angles, measures, at_limit)
                error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
            found &= (measures[..., VIOLATION] <= 0.0) & (error <= ACCURACY)
        doubtful = found if self.repeats else found & (measures[..., SEPARATION] < self.separation)
        poses = np.flatnonzero(doubtful.any(axis=1) & (found.sum(axis=1) > 1))
        if poses.size:
            found[poses] = _distinct(angles[poses], found[poses], self.candidates.revolute)
        return found

    def _polish(self, pose: Floats, angles: Floats, measures: Floats, error: Floats, rough: Mask) -> None:
        """Polish the candidates `rough` further, where that reduces their error."""
        rows = np.nonzero(rough)
        first, more = _FURTHER_STEPS
        result = self.candidates.measured(pose[rows[0]], angles[rows], first)
        after = result["measures"]
        reached = np.maximum(after[..., POSITION], after[..., ROTATION])
        remaining = np.flatnonzero(reached > ROUNDING)
        if remaining.size:
            again = self.candidates.measured(pose[rows[0][remaining]], result["q"][remaining], more)
            result["q"][remaining], after[remaining] = again["q"], again["measures"]
            reached = np.maximum(after[..., POSITION], after[..., ROTATION])
        better = reached < error[rows]
        rows = tuple(each[better] for each in rows)
        after = after[better]
        after[..., SEPARATION:] = measures[rows][..., SEPARATION:]
        angles[rows], measures[rows], error[rows] = result["q"][better], after, reached[better]

    def _move_to_limits(self, pose: Floats, angles: Floats, measures: Floats, at_limit: Mask) -> None:
        rows = np.nonzero(at_limit)
        angles[rows] = np.clip(angles[rows], self.candidates.lower, self.candidates.upper)
        after = self.candidates.measured(pose[rows[0]], angles[rows], 0)["measures"]
        after[..., SEPARATION:] = measures[rows][..., SEPARATION:]
        after[..., VIOLATION] = 0.0
        measures[rows] = after


def near_to(
    angles: Floats, start: Floats, limits: tuple[Floats, Floats] | None, revolute: tuple[bool, ...]
) -> Floats:
    """Return coordinates with angles shifted by full turns to be near `start`, and within limits if they
    are."""
    turns = np.array(revolute)
    start = np.where(turns, start, angles)
    near = np.asarray(start + np.remainder(angles - start + np.pi, FULL_TURN) - np.pi)
    if limits is None:
        return near
    low, high = limits
    near += FULL_TURN * (turns & (near < low - AT_LIMIT))
    near -= FULL_TURN * (turns & (near > high + AT_LIMIT))
    clipped = np.clip(near, low, high)
    return np.asarray(np.where(np.abs(near - clipped) <= AT_LIMIT, clipped, angles))


def _distinct(angles: Floats, found: Mask, revolute: tuple[bool, ...]) -> Mask:
    """Return `found` (n, 8) without solutions that repeat an earlier one."""
    found = found.copy()
    for later in range(1, N_BRANCHES):
        for earlier in range(later):
            difference = angles[:, later] - angles[:, earlier]
            difference -= FULL_TURN * np.round(difference / FULL_TURN) * revolute
            same = np.abs(difference).max(axis=-1) < _SAME
            found[:, later] &= ~(same & found[:, earlier])
    return found
