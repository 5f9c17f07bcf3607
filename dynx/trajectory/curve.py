"""Curves: vector functions of time and their first two derivatives, in closed form.

A curve is independent of robots; `dynx.trajectory.displacement` turns curves into motions. Evaluation is
element by element, without matrix products, whose rounding would depend on the number of times. A path with a
time scaling is q(t) = path(s(t)) (Lynch and Park, Modern Robotics, section 9.1).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynx.errors import ArgumentError, ShapeError
from dynx.model.numbers import read_only
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory, read_only_setpoint


class Curve(ABC):
    """A function x(t) of time with k components."""

    @property
    @abstractmethod
    def knots(self) -> Floats:
        """Times (n,), ascending, between which the curve is smooth; the first and the last are its ends."""

    @abstractmethod
    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return (x, dx/dt, d2x/dt2), each (n, k), at times (n,)."""


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial(Curve):
    """Piecewise polynomial: in piece i, with s = t - breaks[i], x = sum over p of coefficients[i, p] s^p.

    `breaks` (m + 1,) ascend; `coefficients` is (m, degree + 1, k).
    """

    breaks: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "breaks", read_only(self.breaks))
        object.__setattr__(self, "coefficients", read_only(self.coefficients))

    @property
    def knots(self) -> Floats:
        return self.breaks

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Return (x, dx/dt, d2x/dt2) by Horner's scheme; at a break the piece after it applies."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.coefficients) - 1)
        s = (t - self.breaks[piece])[:, None]
        x_terms = [self.coefficients[piece, p] for p in range(self.coefficients.shape[1])]
        v_terms = [p * term for p, term in enumerate(x_terms)][1:]
        a_terms = [p * term for p, term in enumerate(v_terms)][1:]
        x, v, a = np.zeros((3, len(t), self.coefficients.shape[2]))
        for sums, terms in ((x, x_terms), (v, v_terms), (a, a_terms)):
            for term in reversed(terms):
                sums *= s
                sums += term
        return x, v, a

    def along(self, direction: Floats) -> PiecewisePolynomial:
        """Return the curve x(t) `direction`, for a curve of one component and a direction (k,)."""
        return PiecewisePolynomial(self.breaks, self.coefficients * direction)


def single_polynomial(duration: float, *coefficients: Floats) -> PiecewisePolynomial:
    """Return a polynomial over [0, duration] with coefficients (k,) of s^0, s^1, ..."""
    return PiecewisePolynomial(np.array([0.0, duration]), np.stack(coefficients)[None])


def polynomial_from_phases(
    durations: Sequence[float], rates: Sequence[float], order: int
) -> PiecewisePolynomial:
    """Return a curve of one component, from rest at 0, whose derivative of `order` is constant in each phase.

    Phases of zero duration are left out.
    """
    breaks, pieces = [0.0], []
    state = [0.0] * order
    for span, rate in zip(durations, rates, strict=True):
        if not span > 0.0:
            continue
        piece = [*state, rate]
        pieces.append([value / _FACTORIAL[p] for p, value in enumerate(piece)])
        # Taylor's formula for every derivative at the end of the phase.
        state = [
            sum(piece[p + n] * span**n / _FACTORIAL[n] for n in range(order - p + 1)) for p in range(order)
        ]
        breaks.append(breaks[-1] + span)
    return PiecewisePolynomial(np.array(breaks), np.array(pieces)[..., None])


_FACTORIAL = (1.0, 1.0, 2.0, 6.0)


_LAW_SAMPLES = 1000
"""Number of times at which a motion law is checked."""


@dataclass(frozen=True, eq=False, repr=False)
class TimeScaledTrajectory(Trajectory):
    """`path`, a curve in s over [0, 1], followed with the motion law s(t), a trajectory of one coordinate."""

    path: Curve
    law: Trajectory

    @property
    def knots(self) -> Floats:
        """The knots of the motion law; the path is C2 at its own knots."""
        return self.law.knots

    def inside(self, t: Floats) -> Setpoint:
        """Return q, q' ds/dt and q'' (ds/dt)^2 + q' d2s/dt2 (the chain rule)."""
        s, s_dot, s_ddot = self.law.inside(t)
        q, slope, curvature = self.path(np.clip(s[:, 0], 0.0, 1.0))
        return Setpoint(q, slope * s_dot, curvature * s_dot * s_dot + slope * s_ddot)


def end_setpoints(path: Curve, law: Trajectory, q0: Floats, q1: Floats) -> tuple[Setpoint, Setpoint]:
    """Return the setpoints at both ends of a path from q0 to q1 followed with the motion law `law`."""
    _, slope, curvature = path(np.array([0.0, 1.0]))
    return (
        read_only_setpoint(
            q0, slope[0] * law.start.v, curvature[0] * law.start.v**2 + slope[0] * law.start.a
        ),
        read_only_setpoint(q1, slope[1] * law.end.v, curvature[1] * law.end.v**2 + slope[1] * law.end.a),
    )


def checked_law(law: Trajectory) -> Trajectory:
    """Return `law`; raise an error unless it is a trajectory of one coordinate from 0 to 1, within [0, 1]."""
    if not isinstance(law, Trajectory):
        raise ArgumentError(f"law is of type {type(law).__name__}; wanted a Trajectory from [0] to [1]")
    if (law.nq, law.nv) != (1, 1):
        raise ShapeError(f"law has nq {law.nq}; wanted a trajectory of one coordinate, from [0] to [1]")
    if law.start.q[0] != 0.0 or law.end.q[0] != 1.0:
        raise ArgumentError(f"law goes from {law.start.q[0]:g} to {law.end.q[0]:g}; wanted from 0 to 1")
    s = law(np.linspace(0.0, law.duration, _LAW_SAMPLES)).q
    # Rounding errors are clipped later; a motion law that leaves [0, 1] has no position on the path.
    if s.min() < -1e-12 or s.max() > 1.0 + 1e-12:
        raise ArgumentError(f"law goes from {s.min():g} to {s.max():g}; wanted within 0 and 1")
    return law
