"""Motions by a formula q(t): piecewise Chebyshev interpolation, which gives the derivatives.

The duration is halved until the Chebyshev coefficients of each piece fall to rounding (Trefethen,
Approximation Theory and Approximation Practice, chapters 3 and 8), so that q is the formula to 1e-13 of its
largest value, and v and a are exact derivatives of the interpolant. Differences of the formula itself would
lose half of the digits of v and two thirds of those of a.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial.chebyshev import chebder
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ShapeError, TrajectoryError
from dynx.model import Model
from dynx.spatial.manifold import coordinate_runs
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, quat_product, rotate_back, rotation_from_quat
from dynx.trajectory.base import Setpoint, Trajectory, checked_duration, read_only_setpoint
from dynx.trajectory.curve import Curve
from dynx.trajectory.displacement import configuration

DEGREE = 16
"""Degree of the polynomial on each piece."""

RESOLVED = 2.0**-48
"""Largest last coefficients of a piece, in largest values of the coordinate: a few rounding errors of it."""

FIRST_PIECES, MAX_PIECES, MAX_HALVINGS = 4, 4096, 14
"""Number of pieces at first and at most; number of halvings after which a formula counts as not smooth."""

VELOCITY_JUMP = 1e-7
"""Largest jump of the velocity between pieces, in largest velocities: far above that of smooth formulas."""

_NODES = np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)[::-1]
_CHECKS = np.array([-0.71, 0.13, 0.57])
"""Places in a piece, from -1 to 1, at which the interpolant is compared with the formula."""

_TO_COEFFICIENTS = np.linalg.inv(np.polynomial.chebyshev.chebvander(_NODES, DEGREE))


@dataclass(frozen=True, eq=False)
class ChebyshevPieces(Curve):
    """Piecewise polynomial in Chebyshev form: `coefficients` (m, n + 1, 3, k) of x, dx/dt and d2x/dt2 between
    `breaks` (m + 1,)."""

    breaks: Floats
    coefficients: Floats

    @property
    def knots(self) -> Floats:
        return self.breaks

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return (x, dx/dt, d2x/dt2) by Clenshaw's recurrence; at a break the piece after it applies."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.coefficients) - 1)
        low, high = self.breaks[piece], self.breaks[piece + 1]
        u = (((t - low) - (high - t)) / (high - low))[:, None, None]
        first, *others = (self.coefficients[piece, p] for p in range(self.coefficients.shape[1]))
        later, latest = np.zeros((2, *first.shape))
        for term in reversed(others):
            later, latest = term + 2.0 * u * later - latest, later
        value = first + u * later - latest
        return value[:, 0], value[:, 1], value[:, 2]


@dataclass(frozen=True, eq=False, repr=False)
class FormulaTrajectory(Trajectory):
    """A configuration along a curve (k = nq); `floating` if its first seven coordinates are those of a base;
    `balls` are the indices at which quaternions of ball joints begin."""

    curve: Curve
    floating: bool
    balls: tuple[int, ...] = ()

    @property
    def knots(self) -> Floats:
        return self.curve.knots

    def inside(self, t: Floats) -> Setpoint:
        """Return q of the curve, and v and a by its derivatives."""
        return _setpoint(*self.curve(t), floating=self.floating, balls=self.balls)


def _setpoint(q: Floats, dq: Floats, ddq: Floats, *, floating: bool, balls: tuple[int, ...]) -> Setpoint:
    """Return the setpoint with velocity and acceleration of a base, and of the children of ball joints, in
    their own axes.

    omega = 2 conj(quat) dquat and, since conj(dquat) dquat is a scalar, alpha = 2 conj(quat) ddquat.
    """
    if not floating and not balls:
        return Setpoint(q, dq, ddq)
    velocities, accelerations = [], []
    for kind, of_q, _ in coordinate_runs(q.shape[1], floating=floating, balls=balls):
        value, rate, second = q[:, of_q], dq[:, of_q], ddq[:, of_q]
        if kind != "joints":
            back = value[:, -4:] * [-1.0, -1.0, -1.0, 1.0]
            omega, alpha = (2.0 * quat_product(back, each[:, -4:])[:, :3] for each in (rate, second))
        if kind == "base":
            R = rotation_from_quat(value[:, 3:])
            velocity = rotate_back(R, rate[:, :3])
            acceleration = rotate_back(R, second[:, :3]) - cross(omega, velocity)
            rate, second = np.hstack([velocity, omega]), np.hstack([acceleration, alpha])
        elif kind == "ball":
            rate, second = omega, alpha
        velocities.append(rate)
        accelerations.append(second)
    return Setpoint(q, np.hstack(velocities), np.hstack(accelerations))


@checks_types
def from_function(
    f: Callable[[float], ArrayLike], duration: float, *, model: Model | None = None
) -> Trajectory:
    """Return the motion q = f(t) [rad or m] over ``0 <= t <= duration`` [s], with its derivatives.

    `f` takes one time and returns one configuration (nq,); it is called here and never again, so the
    trajectory can be pickled whatever `f` is. Velocity and acceleration are those of an interpolant that
    equals `f` to 1e-13 of the largest value of each coordinate. If `model` is given, dynx checks the
    configurations. For a floating base and for ball joints `model` is required, and quaternions must not
    change their signs.

    Raises TrajectoryError, with the time, where `f` is not smooth: join smooth motions by `concatenate`, or
    give velocity and acceleration yourself by a class with `Trajectory.inside`. Raises ShapeError,
    DTypeError, NotFiniteError or ArgumentError for a value of `f` that is no configuration.
    """
    seconds = checked_duration(duration)
    first = configuration("f(0)", f(0.0), model)
    floating = model is not None and model.floating
    balls = () if model is None else model.ball_places

    def values(times: Floats) -> Floats:
        found = [configuration(f"f({t:.6g})", f(t), model) for t in times.tolist()]
        for t, q in zip(times.tolist(), found, strict=True):
            if q.shape != first.shape:
                raise ShapeError(
                    f"f({t:.6g}) has shape {q.shape}, and f(0) has {first.shape}; wanted the same"
                )
        return np.array(found)

    curve = _interpolated(values, seconds)
    ends = [_setpoint(*curve(np.array([t])), floating=floating, balls=balls) for t in (0.0, seconds)]
    last = values(np.array([seconds]))[0]
    start, end = (
        read_only_setpoint(q, each.v[0], each.a[0]) for q, each in zip((first, last), ends, strict=True)
    )
    return FormulaTrajectory(seconds, start, end, curve, floating, balls)


def _interpolated(values: Callable[[Floats], Floats], duration: float) -> ChebyshevPieces:
    """Interpolate a function of times (n,) with values (n, k)."""
    scale = np.abs(values(np.linspace(0.0, duration, 4 * DEGREE))).max(axis=0)
    edges = duration * np.arange(FIRST_PIECES + 1) / FIRST_PIECES
    left = [(low, high, 0) for low, high in pairwise(edges.tolist())][::-1]
    breaks, pieces = [0.0], []
    while left:
        low, high, halvings = left.pop()
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        times = _times(low, high, _NODES)
        at_nodes = values(times)
        # A time is rounded, too, as is a phase of the formula: by as much as the formula moves meanwhile.
        rates = np.abs(np.diff(at_nodes, axis=0) / np.diff(times)[:, None]).max(axis=0)
        noise = RESOLVED * scale + 4.0 * np.finfo(np.float64).eps * high * rates
        x = _coefficients(at_nodes, noise)
        if x is not None:
            wanted = values(_times(low, high, _CHECKS))
            found = np.polynomial.chebyshev.chebval(_CHECKS, x).T
            if (np.abs(found - wanted) <= 32.0 * noise).all():
                breaks.append(high)
                pieces.append(np.stack([x, *_derivatives(x, half)], axis=1))
                continue
        if halvings == MAX_HALVINGS or len(left) + len(pieces) >= MAX_PIECES:
            raise TrajectoryError(
                f"f is not smooth near t = {middle:.6g} s, or oscillates too fast there: join smooth motions "
                "by trajectory.concatenate, or derive from trajectory.Trajectory and give v and a yourself",
                at=middle / duration,
            )
        left += [(middle, high, halvings + 1), (low, middle, halvings + 1)]
    curve = ChebyshevPieces(np.array(breaks), np.array(pieces))
    _require_velocity_without_jumps(curve)
    return curve


def _times(low: float, high: float, places: Floats) -> Floats:
    """Return the times in a piece at `places` from -1 to 1; those at the ends are exact."""
    return np.asarray(0.5 * (low * (1.0 - places) + high * (1.0 + places)))


def _coefficients(values: Floats, noise: Floats) -> Floats | None:
    """Return Chebyshev coefficients (n + 1, k) without those at the end that are `noise` (k,); None where the
    last two are more."""
    x = _TO_COEFFICIENTS @ values
    rounding = np.abs(x) <= noise
    if not rounding[-2:].all():
        return None
    x[np.logical_and.accumulate(rounding[::-1], axis=0)[::-1]] = 0.0
    return np.asarray(x)


def _derivatives(x: Floats, half: float) -> tuple[Floats, Floats]:
    """Return the coefficients of the first two derivatives by time, padded with zeros."""
    v, a = np.zeros_like(x), np.zeros_like(x)
    v[:-1] = chebder(x, scl=1.0 / half)
    a[:-2] = chebder(v[:-1], scl=1.0 / half)
    return v, a


def _require_velocity_without_jumps(curve: ChebyshevPieces) -> None:
    """Raise TrajectoryError where a kink of the formula lies between two pieces."""
    signs = (-1.0) ** np.arange(DEGREE + 1)
    velocity = curve.coefficients[:, :, 1]
    at_starts, at_ends = np.einsum("p,mpk->mk", signs, velocity), velocity.sum(axis=1)
    largest = np.maximum(np.abs(at_starts), np.abs(at_ends)).max(axis=0)
    # Rounding of the formula makes a velocity that is none.
    noise = np.abs(curve.coefficients[:, :, 0]).max(axis=(0, 1)) / np.diff(curve.breaks).min()
    jumps = np.abs(at_starts[1:] - at_ends[:-1]) > VELOCITY_JUMP * largest + 1e-11 * noise
    if jumps.any():
        t = curve.breaks[1:-1][jumps.any(axis=1)][0]
        raise TrajectoryError(
            f"the velocity of f jumps at t = {t:.6g} s: join smooth motions by trajectory.concatenate",
            at=float(t / curve.breaks[-1]),
        )
