"""Hypothesis strategies for trajectories of every kind."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from hypothesis import strategies as st

import dynx
from dynx import trajectory
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory import Trajectory
from dynx.trajectory.waypoints import End, Kind

Draw = st.DrawFn

REACH = np.array([0.4, -1.2, 1.5, -1.0, -1.57, 0.3])
"""A posture of UR5 away from singularities."""


class Motion(NamedTuple):
    """A trajectory with its requested start and end; `model` if its base floats."""

    trajectory: Trajectory
    q0: Floats
    q1: Floats
    model: Model | None = None


def hundredths(low: float, high: float) -> st.SearchStrategy[float]:
    """Draw numbers with two decimals, which neither underflow nor shrink badly."""
    return st.integers(round(100 * low), round(100 * high)).map(lambda n: n / 100)


def vectors(n: int, reach: float = 3.0) -> st.SearchStrategy[Floats]:
    """Draw vectors (n,)."""
    return st.lists(hundredths(-reach, reach), min_size=n, max_size=n).map(np.array)


def bounds(n: int) -> st.SearchStrategy[Floats]:
    """Draw positive limits (n,)."""
    return st.lists(hundredths(0.1, 5.0), min_size=n, max_size=n).map(np.array)


@st.composite
def displacements(draw: Draw, n: int) -> tuple[Floats, Floats]:
    """Draw two different configurations (n,)."""
    q0, displacement = draw(vectors(n)), draw(vectors(n))
    displacement[draw(st.integers(0, n - 1))] = draw(hundredths(0.1, 3.0))
    return q0, q0 + displacement


@st.composite
def in_given_time(draw: Draw) -> Motion:
    """Draw cycloidal, cubic and quintic motions."""
    n = draw(st.integers(1, 3))
    q0, q1 = draw(displacements(n))
    duration = draw(hundredths(0.2, 5.0))
    v0, v1, a0, a1 = (draw(vectors(n)) for _ in range(4))
    kind = draw(st.sampled_from(["cycloidal", "cubic", "quintic"]))
    if kind == "cycloidal":
        return Motion(trajectory.cycloidal(q0, q1, duration), q0, q1)
    if kind == "cubic":
        return Motion(trajectory.cubic(q0, q1, duration, v0=v0, v1=v1), q0, q1)
    return Motion(trajectory.quintic(q0, q1, duration, v0=v0, v1=v1, a0=a0, a1=a1), q0, q1)


@st.composite
def within_limits(draw: Draw) -> Motion:
    """Draw trapezoidal and S-curve motions, of the shortest or a longer duration."""
    n = draw(st.integers(1, 3))
    q0, q1 = draw(displacements(n))
    v, a, j = draw(bounds(n)), draw(bounds(n)), draw(bounds(n))
    longer = draw(st.sampled_from([None, 1.0, 1.7]))

    def made(duration: float | None) -> Trajectory:
        if smooth:
            return trajectory.s_curve(q0, q1, velocity=v, acceleration=a, jerk=j, duration=duration)
        return trajectory.trapezoidal(q0, q1, velocity=v, acceleration=a, duration=duration)

    smooth = draw(st.booleans())
    motion = made(None)
    return Motion(motion if longer is None else made(longer * motion.duration), q0, q1)


@st.composite
def through_waypoints(draw: Draw) -> Motion:
    """Draw splines of every kind and end condition."""
    n, count = draw(st.integers(1, 2)), draw(st.integers(6, 8))
    steps = draw(st.lists(hundredths(0.2, 2.0), min_size=count - 1, max_size=count - 1))
    points = np.array([draw(vectors(n)) for _ in range(count)])
    ends: tuple[End, ...] = ("clamped", "natural", "periodic")
    kinds: tuple[Kind, ...] = ("cubic", "quintic")
    end = draw(st.sampled_from(ends))
    if end == "periodic":
        points[-1] = points[0]
    times = np.cumsum([0.0, *steps])
    kind = draw(st.sampled_from(kinds))
    return Motion(trajectory.spline(times, points, kind=kind, end=end), points[0], points[-1])


@st.composite
def of_a_floating_base(draw: Draw) -> Motion:
    """Draw motions of a floating base along a screw axis."""
    model = floating()
    q0, q1 = model.random(draw(st.integers(0, 1000)), 2)
    joints = [0.0] * 6 + [1.0] * (model.nv - 6)
    kind = draw(st.sampled_from(["cycloidal", "quintic", "s_curve"]))
    if kind == "cycloidal":
        return Motion(trajectory.cycloidal(q0, q1, 2.0, model=model), q0, q1, model)
    if kind == "quintic":
        return Motion(trajectory.quintic(q0, q1, 2.0, v0=joints, a1=joints, model=model), q0, q1, model)
    return Motion(trajectory.s_curve(q0, q1, acceleration=2.0, jerk=9.0, model=model), q0, q1, model)


@st.composite
def one_after_another(draw: Draw) -> Motion:
    """Draw two motions from rest to rest, concatenated."""
    one = draw(within_limits())
    q1 = one.q1 + draw(vectors(len(one.q1)))
    return Motion(trajectory.concatenate(one.trajectory, trajectory.cycloidal(one.q1, q1, 1.3)), one.q0, q1)


def motions() -> st.SearchStrategy[Motion]:
    """Draw a motion of any kind."""
    return st.one_of(
        in_given_time(),
        within_limits(),
        through_waypoints(),
        of_a_floating_base(),
        one_after_another(),
        st.deferred(lambda: st.sampled_from(slow_motions())),
    )


@lru_cache(maxsize=1)
def ur5() -> Model:
    """Load the UR5."""
    return dynx.load("ur5")


@lru_cache(maxsize=1)
def floating() -> Model:
    """Build a robot of two joints on a floating base."""
    return dynx.load("double_pendulum", base="floating")


@lru_cache(maxsize=1)
def slow_motions() -> tuple[Motion, ...]:
    """Build the motions that take long to compute: a line, an excitation and, with TOPP-RA, a path."""
    with dynx.backend("pinocchio", ur5()) as engine:
        target = engine.forward_kinematics(REACH, "tool0") @ turned(0.5)
    target[:3, 3] += (0.05, 0.1, -0.1)
    line = trajectory.line(ur5(), "tool0", REACH, target, 1.5)
    series = trajectory.excitation(ur5(), 6.0, q0=REACH)
    made = Motion(line, REACH, line.end.q), Motion(series, REACH, REACH)
    if find_spec("toppra") is None:
        return made
    points = REACH + np.linspace(0.0, 1.0, 4)[:, None] * np.sin(np.arange(24.0).reshape(4, 6))
    path = trajectory.time_optimal_path(points, acceleration=4.0, model=ur5())
    return *made, Motion(path, points[0], points[-1])


def turned(angle: float) -> Floats:
    """Return the rotation about z as a transform (4, 4)."""
    T = np.eye(4)
    c, s = np.cos(angle), np.sin(angle)
    T[:2, :2] = [[c, -s], [s, c]]
    return T
