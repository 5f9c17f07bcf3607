"""Coordinates that move one or several frames: their indices, bounds, and the periodicity of angles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats

FULL_TURN = 2.0 * math.pi

_FULL_TURN_TOLERANCE = 1e-8
"""Amount [rad] by which a range may be below 2 pi and still count as a full turn: files round limits."""

_DEFAULT_RANGE = {"prismatic": 1.0}
"""Half the range [m] searched for a prismatic joint without limits; for angles it is pi [rad]."""

Columns = slice | list[int]


class FrameCoordinates:
    """The coordinates of the model that move one of the frames, as variables of the solver.

    Their values are a list of floats: first the six of a floating base, if there is one, as the body twist
    that reaches its pose from the current one in unit time; then three of each ball joint between root and
    frames, the rotation vector that reaches its attitude from the current one; then those of the other joints
    there, in the order of q. Angles whose range is a full turn have infinite bounds here; after the search
    they are shifted by full turns into their limits, as near as possible to the initial configuration. A ball
    joint is turned back to its largest angle after each step. Coordinates of other branches of the tree never
    change.
    """

    def __init__(self, model: Model, frames: str | Sequence[str], margin: Floats | None = None) -> None:
        """`margin` (nq,) [rad or m] is the least distance from the position limits.

        Raises ArgumentError if it leaves a joint no range, UnsupportedFeatureError for a margin of a robot
        with ball joints.
        """
        if margin is not None and model.ball_joints:
            from dynx.model.ball_joints import refuse_ball_joints  # most robots have none

            refuse_ball_joints(model, "inverse kinematics with limit_margin")
        self._model = model
        self.floating = model.floating
        """Whether the first six coordinates are those of a floating base."""
        self._base = 7 if model.floating else 0
        names = [frames] if isinstance(frames, str) else frames
        moving = sorted({k for frame in names for k in _joints_on_path(model, frame)})
        kinds = [model.coordinate_joints[k] for k in moving]
        self.balls = [joint for joint in kinds if joint.type == "ball"]
        """Ball joints among the joints."""
        kinds = [joint for joint in kinds if joint.type != "ball"]
        self.indices = [model.position_index(joint.name) for joint in kinds]
        """Indices in q of the joints with one coordinate."""
        self._in_q = _as_slice(self.indices)
        offset = 6 if model.floating else 0
        in_v = [model.coordinate_index(joint.name) for joint in kinds]
        turning = [model.coordinate_index(joint.name) + k for joint in self.balls for k in range(3)]
        self._turning = [*range(offset), *turning]
        self.columns: Columns = _as_slice([*self._turning, *in_v])
        """The columns of the Jacobian, in the order of the coordinates."""
        self.count = len(self._turning) + len(in_v)
        """Number of coordinates; 0 if nothing moves the frame."""
        self.relative = bool(self._turning)
        """True if some coordinates count from the current configuration: those of quaternions."""

        self._low, self._high = model.lower[self._in_q], model.upper[self._in_q]
        if margin is not None:
            self._low, self._high = _reduced_range(model, self.indices, margin)
        drivers = {joint.mimic.joint for joint in model.joints if joint.mimic is not None}
        # A joint that drives mimic joints is not periodic, because those keep moving.
        rotates = np.array([j.type != "prismatic" and j.name not in drivers for j in kinds], dtype=bool)
        full_range = self._high - self._low >= FULL_TURN - _FULL_TURN_TOLERANCE
        self.periodic: list[int] = np.flatnonzero(rotates & full_range).tolist()
        """Positions, among the joints, of angles whose range is a full turn."""

        lower, upper = self._low.tolist(), self._high.tolist()
        for k in self.periodic:
            lower[k], upper[k] = -math.inf, math.inf
        self.lower: list[float] = [-math.inf] * len(self._turning) + lower
        """Lower bounds of the search."""
        self.upper: list[float] = [math.inf] * len(self._turning) + upper
        """Upper bounds of the search."""
        limited = np.isfinite(self._low) & np.isfinite(self._high)
        self._span = self._high - self._low if limited.all() else None
        self.is_all = self.indices == list(range(model.nq))
        """Whether they are all coordinates of q, in order."""
        self._default_range = np.array([_DEFAULT_RANGE.get(joint.type, math.pi) for joint in kinds])

    def limits(self, k: int) -> tuple[float, float]:
        """Return the position limits of joint number k of the path, which may be infinite."""
        return float(self._low[k]), float(self._high[k])

    def initial(self) -> Floats:
        """Return the neutral configuration (nq,), moved into the limits."""
        return self.clipped(self._model.clip(self._model.neutral()))

    def clipped(self, q: Floats) -> Floats:
        """Return configurations (..., nq) with these joints moved into their limits."""
        q = self._model.clip(q) if self.balls else np.array(q)
        q[..., self._in_q] = np.clip(q[..., self._in_q], self._low, self._high)
        return q

    def values(self, q: Floats) -> list[float]:
        """Return the coordinates at configuration q (nq,)."""
        joints: list[float] = q.tolist() if self.is_all else q[self._in_q].tolist()
        return [0.0] * len(self._turning) + joints

    def with_values(self, q: Floats, to: list[float]) -> Floats:
        """Return the configuration q (nq,) with these coordinates set to `to`."""
        if self.is_all:
            return np.array(to)
        if self.relative:
            v, n = np.zeros(self._model.nv), len(self._turning)
            v[self._turning] = to[:n]
            q = self._model.integrate(q, v)
            if self.balls:
                q = self._model.clip(q)
            to = to[n:]
        changed: Floats = q.copy()
        changed[self._in_q] = to
        return changed

    def moving(self, frame: str | None) -> frozenset[int]:
        """Return which of these coordinates, by their indices in q, move a frame; none moves the world.

        The base of a floating robot counts as number -1.
        """
        if frame is None:
            return frozenset()
        names = [self._model.joint_names[k] for k in _joints_on_path(self._model, frame)]
        moved = {self._model.position_index(name) for name in names} & set(self.indices)
        return frozenset(moved | {-1}) if self.floating else frozenset(moved)

    @property
    def joint_limits(self) -> tuple[Floats, Floats]:
        """Lower and upper limits of the joints, which may be infinite."""
        return self._low, self._high

    def joint_values(self, q: Floats) -> Floats:
        """Return the values of the joints at configuration q (nq,)."""
        return q[self._in_q]

    def with_joints_of(self, q: Floats, other: Floats) -> Floats:
        """Return the configuration q (nq,) with these joints at their values in `other`, within limits."""
        changed: Floats = q.copy()
        changed[self._in_q] = np.clip(other[self._in_q], self._low, self._high)
        return changed

    def random(self, q0: Floats, rng: np.random.Generator) -> Floats:
        """Return q0 with its joints drawn uniformly within their limits; the base does not move.

        A joint without limits is drawn from within pi [rad] or 1 m of its value in q0.
        """
        drawn: Floats = q0.copy()
        if self.balls:
            drawn = self.with_balls_of(drawn, self._model.random(rng))
        if self._span is not None:
            drawn[self._in_q] = self._low + self._span * rng.random(len(self._low))
            return drawn
        current, default = q0[self._in_q], self._default_range
        low = np.where(np.isfinite(self._low), self._low, np.minimum(current, self._high) - default)
        high = np.where(np.isfinite(self._high), self._high, np.maximum(current, self._low) + default)
        drawn[self._in_q] = low + (high - low) * rng.random(len(low))
        return drawn

    def with_balls_of(self, q: Floats, other: Floats) -> Floats:
        """Return configurations q (..., nq) with the attitudes of these ball joints in `other`."""
        changed: Floats = q.copy()
        for joint in self.balls:
            k = self._model.position_index(joint.name)
            changed[..., k : k + 4] = other[..., k : k + 4]
        return changed

    def rotations(self, a: Floats, b: Floats) -> Floats:
        """Return the rotation vectors (n,) [rad] by which ball joints turn from configuration a to b (nq,),
        three for each."""
        if not self.balls:
            return np.zeros(0)
        return self._model.difference(a, b)[self._turning[6 if self.floating else 0 :]]

    def starts(self, rng: np.random.Generator, count: int) -> Floats:
        """Return values of the joints (count, n_joints), drawn uniformly within their limits.

        Joint values are drawn one configuration after the other. A joint without limits is drawn from within
        pi [rad] or 1 m of zero, or of its only limit.
        """
        default = self._default_range
        low = np.where(np.isfinite(self._low), self._low, np.minimum(0.0, self._high) - default)
        high = np.where(np.isfinite(self._high), self._high, np.maximum(0.0, self._low) + default)
        return np.asarray(low + (high - low) * rng.random((count, len(low))))

    def nearest(self, q: Floats, q0: Floats) -> Floats:
        """Return q with its periodic angles shifted by full turns, within their limits and nearest to q0."""
        if not self.periodic:
            return q
        values, start = q[self._in_q].tolist(), q0[self._in_q].tolist()
        for k in self.periodic:
            low, high = float(self._low[k]), float(self._high[k])
            value = start[k] + math.remainder(values[k] - start[k], FULL_TURN)
            value += FULL_TURN if value < low else -FULL_TURN if value > high else 0.0
            values[k] = min(max(value, low), high)
        q = q.copy()
        q[self._in_q] = values
        return q


def _reduced_range(model: Model, indices: list[int], margin: Floats) -> tuple[Floats, Floats]:
    """Return the limits of the coordinates in q, moved inwards by the margin (nq,)."""
    low, high = model.lower[indices] + margin[indices], model.upper[indices] - margin[indices]
    for k in np.flatnonzero(low > high).tolist():
        at = indices[k]
        joint = model.coordinate_joints[at - (7 if model.floating else 0)]
        unit = "m" if joint.type == "prismatic" else "rad"
        raise ArgumentError(
            f"limit_margin {margin[at]:.6g} {unit} leaves joint {shown(joint.name)} no range: its limits are "
            f"{model.lower[at]:.6g} and {model.upper[at]:.6g} {unit}; wanted at most half of what is between"
        )
    return low, high


def _joints_on_path(model: Model, frame: str) -> list[int]:
    """Return the ascending indices in `joint_names` of the joints (or drivers) between root and frame."""
    link = model.frames[model.frame_index(frame)].link
    number = {name: k for k, name in enumerate(model.joint_names)}
    found: set[int] = set()
    # In reversed depth-first order a joint precedes its ancestors.
    for joint in reversed(model.joints):
        if joint.child == link:
            link = joint.parent
            if joint.moves:
                found.add(number[joint.name if joint.mimic is None else joint.mimic.joint])
    return sorted(found)


def _as_slice(numbers: list[int]) -> Columns:
    """Return consecutive indices as a slice, which indexes without a copy, and others unchanged."""
    if numbers == list(range(numbers[0], numbers[-1] + 1) if numbers else ()):
        return slice(numbers[0], numbers[-1] + 1) if numbers else slice(0, 0)
    return numbers
