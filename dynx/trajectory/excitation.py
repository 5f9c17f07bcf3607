"""Periodic motion that shows a robot's inertial parameters: a Fourier series that begins and ends at rest.

    x_j(t) = sum over k of A_jk sin(k w t) + B_jk (cos(k w t) - 1),   w = 2 pi / T

with sum k A_jk = 0 and sum k^2 B_jk = 0, so that position, velocity and acceleration are zero
displacement and rest at t = 0 and, being periodic, at T (Swevers, Ganseman, Tükel, De Schutter and Van
Brussel, Optimal robot excitation and identification, IEEE Trans. Robotics and Automation 13(5), 1997, with
the conditions at the ends added). Coefficients are random; each joint is scaled until a limit is touched.

Limits are kept at all times and not only where they are looked at: a trigonometric polynomial of
degree N whose size is at most r at M > 2 N evenly spaced points of its period is nowhere larger than
r / cos(pi N / M) (Ehlich and Zeller, Schwankung von Polynomen zwischen Gitterpunkten, 1964).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, TrajectoryError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, checked_duration, frozen
from dynx.trajectory.bounds import ROUNDING, checked_bound
from dynx.trajectory.curve import Curve
from dynx.trajectory.displacement import Ends, configuration
from dynx.trajectory.identification import Identifiability

POINTS = 128
"""Points for each harmonic at which the series is measured: its extremes are then known to 0.03 %."""

REACH = {"prismatic": 1.0}
"""How far [m] what has no limits goes from q0 at most; for angles it is pi [rad]."""


@dataclass(frozen=True, eq=False)
class FourierSeries(Curve):
    """x(t) as above; `sines` and `cosines` (N, k) are A and B, harmonic by harmonic."""

    duration: float
    sines: Floats
    cosines: Floats

    @property
    def knots(self) -> Floats:
        """The two ends."""
        return np.array([0.0, self.duration])

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """The series and its derivatives, harmonic by harmonic."""
        x, v, a = np.zeros((3, len(t), self.sines.shape[1]))
        for k, (A, B) in enumerate(zip(self.sines, self.cosines, strict=True), start=1):
            w = 2.0 * np.pi * k / self.duration
            # The phase in turns is reduced first: w t for a late t would lose digits of the angle.
            phase = 2.0 * np.pi * np.remainder(k * (t / self.duration), 1.0)
            s, c, half = (f[:, None] for f in (np.sin(phase), np.cos(phase), np.sin(0.5 * phase)))
            x += A * s - 2.0 * B * (half * half)
            v += w * (A * c - B * s)
            a -= w * w * (A * s + B * c)
        return x, v, a


def excitation(
    model: Model,
    duration: float,
    *,
    harmonics: int = 5,
    q0: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    rng: np.random.Generator | int | None = 0,
    candidates: int = 1,
    backend: str = "pinocchio",
) -> Trajectory:
    """One period of a random Fourier series around `q0` (nq,), from rest to rest there, in `duration` [s].

    `harmonics` (at least 3) are the multiples of 1 / duration [Hz] that it holds. Every joint goes as far
    as a limit lets it: of position and velocity those of the model (`velocity` replaces the latter), and
    `acceleration`, if given; one number or (nv,). `q0` is by default the middle of the position limits, 0 for
    a joint that has none; such a joint goes at most pi [rad] or 1 m from there.

    Of `candidates` series that are drawn with `rng`, a seed or a generator, the one is taken whose samples
    determine the inertial parameters best: that with the least condition number of the inertial regressor
    (`dynx.trajectory.Identifiability`, by `backend`). Only for a fixed base.

    Raises ArgumentError for what cannot be used, TrajectoryError for a limit of 0 or a q0 that is not
    between the limits.
    """
    ends = _around(model, q0)
    T = checked_duration(duration)
    for name, count, least in (("harmonics", harmonics, 3), ("candidates", candidates, 1)):
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < least:
            raise ArgumentError(f"{name} is {shown(count)}; wanted a whole number, at least {least}")
    generator = np.random.default_rng(rng)
    bounds = _Room(ends, velocity, acceleration)
    drawn = [
        ends.rest_to_rest(T, bounds.filled(_random_series(generator, T, int(harmonics), ends.nv)))
        for _ in range(candidates)
    ]
    if len(drawn) == 1:
        return drawn[0]
    with Identifiability(model, backend=backend) as measure:
        return min(drawn, key=measure.condition_number)


class _Room:
    """How far each joint may go from q0 either way, how fast, and how fast that may change."""

    def __init__(self, ends: Ends, velocity: ArrayLike | None, acceleration: ArrayLike | None) -> None:
        model = ends.model
        assert model is not None
        reach = np.array([REACH.get(joint.type, math.pi) for joint in model.coordinate_joints])
        above, below = model.upper - ends.q0, ends.q0 - model.lower
        self.above = np.where(np.isfinite(above), above, reach)
        self.below = np.where(np.isfinite(below), below, reach)
        self.velocity = model.velocity_limit
        if velocity is not None:
            self.velocity = checked_bound("velocity", velocity, ends.nv)
        self.acceleration = np.full(ends.nv, np.inf)
        if acceleration is not None:
            self.acceleration = checked_bound("acceleration", acceleration, ends.nv)
        for name, room in (
            ("upper position", self.above),
            ("lower position", self.below),
            ("velocity", self.velocity),
            ("acceleration", self.acceleration),
        ):
            shut = np.flatnonzero(~(room > 0.0))
            if shut.size:
                k = int(shut[0])
                raise TrajectoryError(
                    f"{ends.name(k)} cannot move: at q0 = {ends.q0[k]:g} its {name} limit leaves {room[k]:g}"
                )

    def filled(self, series: FourierSeries) -> FourierSeries:
        """The series with each joint scaled until the first of its limits is touched."""
        harmonics = len(series.sines)
        points = POINTS * harmonics
        x, v, a = series(np.arange(0.0, points) * (series.duration / points))
        growth = 1.0 / math.cos(math.pi * harmonics / points)
        centre, radius = 0.5 * (x.max(axis=0) + x.min(axis=0)), 0.5 * growth * np.ptp(x, axis=0)
        scale = np.min(
            [
                self.above / (centre + radius),
                self.below / (radius - centre),
                self.velocity / (growth * np.abs(v).max(axis=0)),
                self.acceleration / (growth * np.abs(a).max(axis=0)),
            ],
            axis=0,
        ) * (1.0 - ROUNDING)
        return FourierSeries(series.duration, frozen(series.sines * scale), frozen(series.cosines * scale))


def _random_series(rng: np.random.Generator, T: float, harmonics: int, nv: int) -> FourierSeries:
    """Coefficients uniform on a sphere, but for the two conditions that hold at the ends."""
    k = np.arange(1.0, harmonics + 1.0)[:, None]
    sines, cosines = rng.standard_normal((2, harmonics, nv)) / k
    for coefficients, weights in ((sines, k), (cosines, k * k)):
        coefficients -= weights * (np.sum(weights * coefficients, axis=0) / np.sum(weights * weights))
    return FourierSeries(T, sines, cosines)


def _around(model: Model, q0: ArrayLike | None) -> Ends:
    if not isinstance(model, Model):
        raise ArgumentError(f"model is of type {type(model).__name__}; wanted a Model")
    if model.floating or not model.nv:
        why = "a floating base" if model.floating else "no joint that moves"
        raise ArgumentError(f"{model.name} has {why}; excitation needs joints on a fixed base")
    if q0 is None:
        bounded = np.isfinite(model.lower) & np.isfinite(model.upper)
        low, high = (np.where(bounded, limit, 0.0) for limit in (model.lower, model.upper))
        q = model.clip(0.5 * (low + high))
    else:
        q = configuration("q0", q0, model)
    return Ends(q, q, np.zeros(model.nv), model)
