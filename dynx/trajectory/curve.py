"""Curves: numbers that vary with time, and their first two derivatives, in closed form.

A curve knows nothing of robots; `dynx.trajectory.displacement` makes motions of them. Evaluation is
element by element: no matrix product, whose rounding would depend on how many times are asked for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.trajectory.base import frozen


class Curve(ABC):
    """x(t), a function of time with k components."""

    @property
    @abstractmethod
    def knots(self) -> Floats:
        """Times (n,), ascending, between which the curve is smooth; its ends are the first and the last."""

    @abstractmethod
    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """(x, dx/dt, d2x/dt2), each (n, k), at times (n,)."""


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial(Curve):
    """In piece i, with s = t - breaks[i], x = sum over p of coefficients[i, p] s^p.

    `breaks` (m + 1,) ascend; `coefficients` (m, degree + 1, k).
    """

    breaks: Floats
    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "breaks", frozen(self.breaks))
        object.__setattr__(self, "coefficients", frozen(self.coefficients))

    @property
    def knots(self) -> Floats:
        """The breaks."""
        return self.breaks

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """(x, dx/dt, d2x/dt2) by Horner's scheme; at a break, what the piece after it says."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.coefficients) - 1)
        s = (t - self.breaks[piece])[:, None]
        parts = [self.coefficients[piece, p] for p in range(self.coefficients.shape[1])]
        rates = [p * part for p, part in enumerate(parts)][1:]
        changes = [p * rate for p, rate in enumerate(rates)][1:]
        x, v, a = np.zeros((3, len(t), self.coefficients.shape[2]))
        for sums, terms in ((x, parts), (v, rates), (a, changes)):
            for term in reversed(terms):
                sums *= s
                sums += term
        return x, v, a

    def times(self, direction: Floats) -> PiecewisePolynomial:
        """The curve x(t) `direction`, for a curve of one component and a direction (k,)."""
        return PiecewisePolynomial(self.breaks, self.coefficients * direction)


def one_polynomial(duration: float, *coefficients: Floats) -> PiecewisePolynomial:
    """A single piece over [0, duration] with coefficients (k,) of s^0, s^1, ..."""
    return PiecewisePolynomial(np.array([0.0, duration]), np.stack(coefficients)[None])


def from_phases(durations: Sequence[float], rates: Sequence[float], order: int) -> PiecewisePolynomial:
    """A curve of one component from rest at 0 whose derivative of `order` is constant in each phase.

    Phases of no duration are left out.
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
