"""Periodic excitation for identification: a Fourier series that starts and ends at rest.

    x_j(t) = sum over k of A_jk sin(k w t) + B_jk (cos(k w t) - 1),   w = 2 pi / T

with sum k A_jk = 0 and sum k^2 B_jk = 0, so that displacement, velocity and acceleration are zero at t = 0
and, the series being periodic, at T (Swevers, Ganseman, Tükel, De Schutter and Van Brussel, Optimal robot
excitation and identification, IEEE Trans. Robotics and Automation 13(5), 1997, with the conditions at the
ends added). Coefficients are random; the motion of each joint is scaled until it reaches one of its limits.

Limits hold at all times, not only at the evaluated ones: a trigonometric polynomial of degree N with
magnitude at most r at M > 2 N evenly spaced points of its period is nowhere larger than r / cos(pi N / M)
(Ehlich and Zeller, Schwankung von Polynomen zwischen Gitterpunkten, 1964).

A motion is judged by its condition number for identification. Torque is linear in the inertial parameters,
tau = Y pi; the stacked samples of a motion form a least-squares problem whose condition number bounds how
much the noise of the torque is amplified in the parameters (Swevers et al. 1997). Only some linear
combinations of parameters affect the torque: as many as the rank of Y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends import backend as make_backend
from dynx.errors import ArgumentError, ShapeError, TrajectoryError
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.numbers import checked_generator, read_only, whole_number
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory, checked_duration
from dynx.trajectory.curve import Curve
from dynx.trajectory.displacement import Ends, configuration
from dynx.trajectory.motion_limits import LIMIT_MARGIN, checked_limit

SAMPLES = 200
"""Default number of samples of a motion."""


@checks_types
class Identifiability:
    """Condition number of the inertial regressor along motions of one robot.

    It holds a backend: close it after use, or use it in a ``with`` statement.
    """

    def __init__(self, model: Model, *, backend: str = DEFAULT_ENGINE, samples: int = SAMPLES) -> None:
        self._samples = whole_number("samples", samples, 1)
        refuse_ball_joints(model, "a trajectory")
        self._engine = make_backend(backend, model)
        rng = np.random.default_rng(0)
        v, a = rng.standard_normal((2, SAMPLES, model.nv))
        Y = self._engine.inertial_regressor(model.random(rng, SAMPLES), v, a)
        _, singular_values, directions = np.linalg.svd(_stack_samples(Y), full_matrices=False)
        # Bound of numpy.linalg.matrix_rank; identifiable combinations are many orders of magnitude above it.
        least = singular_values[0] * max(SAMPLES * model.nv, Y.shape[-1]) * np.finfo(np.float64).eps
        self.identifiable = int(np.sum(singular_values > least))
        """Number of identifiable combinations of parameters."""
        self._combinations = directions[: self.identifiable].T

    @checks_types
    def condition_number(self, trajectory: Trajectory) -> float:
        """Return the ratio of the largest to the smallest singular value of Y at evenly spaced times.

        Only identifiable combinations of parameters are considered. Units are SI, with the ten parameters of
        each link about its frame (`Backend.inertial_regressor`). Returns infinity if the motion does not
        excite all identifiable combinations.
        """
        model = self._engine.model
        if (trajectory.nq, trajectory.nv) != (model.nq, model.nv):
            raise ShapeError(f"the trajectory has nq {trajectory.nq}; {model.name} has {model.nq}")
        Y = self._engine.inertial_regressor(*trajectory(np.linspace(0.0, trajectory.duration, self._samples)))
        regressor = _stack_samples(Y) @ self._combinations
        singular_values = np.linalg.svd(regressor, compute_uv=False)
        if len(singular_values) < self.identifiable or not singular_values[-1] > 0.0:
            return float("inf")
        return float(singular_values[0] / singular_values[-1])

    def close(self) -> None:
        """Release the backend."""
        self._engine.close()

    def __enter__(self) -> Identifiability:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _stack_samples(Y: Floats) -> Floats:
    """Return the rows of all samples as one matrix."""
    return Y.reshape(-1, Y.shape[-1])


MAX_HARMONICS = 10_000
"""Largest number of harmonics of an excitation: its points fill the memory."""

MAX_CANDIDATES = 1_000_000
"""Largest number of candidates of an excitation, which are held at once."""

POINTS_PER_HARMONIC = 128
"""Points per harmonic at which the series is evaluated: its extremes are then known to 0.03 %."""

DEFAULT_RANGE = {"prismatic": 1.0}
"""Largest displacement [m] of a prismatic joint without limits from q0; for angles it is pi [rad]."""


@dataclass(frozen=True, eq=False)
class FourierSeries(Curve):
    """The series x(t) of the module; `sines` and `cosines` (N, k) are A and B, harmonic by harmonic."""

    duration: float
    sines: Floats
    cosines: Floats

    @property
    def knots(self) -> Floats:
        return np.array([0.0, self.duration])

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the series and its derivatives, harmonic by harmonic."""
        x, v, a = np.zeros((3, len(t), self.sines.shape[1]))
        for k, (A, B) in enumerate(zip(self.sines, self.cosines, strict=True), start=1):
            w = 2.0 * np.pi * k / self.duration
            # Reduce the phase to one period first: w t for a large t would lose digits of the angle.
            phase = 2.0 * np.pi * np.remainder(k * (t / self.duration), 1.0)
            s, c, half = (f[:, None] for f in (np.sin(phase), np.cos(phase), np.sin(0.5 * phase)))
            x += A * s - 2.0 * B * (half * half)
            v += w * (A * c - B * s)
            a -= w * w * (A * s + B * c)
        return x, v, a


@checks_types
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
    backend: str = DEFAULT_ENGINE,
) -> Trajectory:
    """Return one period of a random Fourier series around `q0` (nq,), from rest to rest, in `duration` [s].

    `harmonics` (3 to `MAX_HARMONICS`) is the number of multiples of 1 / duration [Hz] in the series. The
    motion of every joint is scaled until it reaches a limit: the model's limits of position and velocity
    (`velocity` replaces the latter), and `acceleration`, if given; one number or (nv,). `q0` is by default
    the middle of the position limits, or 0 for a joint without limits, which moves at most pi [rad] or 1 m
    from there.

    `candidates` (1 to `MAX_CANDIDATES`) series are drawn with `rng`, a seed or a generator. The series with
    the smallest condition number of the inertial regressor is returned, because its samples determine the
    inertial parameters best (`dynx.trajectory.Identifiability`, evaluated by `backend`). Only for a fixed
    base.

    Raises ArgumentError for invalid arguments, TrajectoryError for a limit of 0 or a q0 outside the limits.
    """
    ends = _ends_around(model, q0)
    T = checked_duration(duration)
    harmonics = whole_number("harmonics", harmonics, 3, MAX_HARMONICS)
    candidates = whole_number("candidates", candidates, 1, MAX_CANDIDATES)
    generator = checked_generator(rng)
    bounds = _MotionLimits(ends, velocity, acceleration)
    drawn = [
        ends.rest_to_rest(T, bounds.scale(_random_series(generator, T, harmonics, ends.nv)))
        for _ in range(candidates)
    ]
    if len(drawn) == 1:
        return drawn[0]
    with Identifiability(model, backend=backend) as measure:
        return min(drawn, key=measure.condition_number)


class _MotionLimits:
    """Limits of each joint's displacement from q0 in both directions, velocity and acceleration."""

    def __init__(self, ends: Ends, velocity: ArrayLike | None, acceleration: ArrayLike | None) -> None:
        model = ends.model
        assert model is not None
        default_range = np.array(
            [DEFAULT_RANGE.get(joint.type, math.pi) for joint in model.coordinate_joints]
        )
        above, below = model.upper - ends.q0, ends.q0 - model.lower
        self.above = np.where(np.isfinite(above), above, default_range)
        self.below = np.where(np.isfinite(below), below, default_range)
        self.velocity = model.velocity_limit
        if velocity is not None:
            self.velocity = checked_limit("velocity", velocity, ends.nv)
        self.acceleration = np.full(ends.nv, np.inf)
        if acceleration is not None:
            self.acceleration = checked_limit("acceleration", acceleration, ends.nv)
        for name, margin in (
            ("upper position", self.above),
            ("lower position", self.below),
            ("velocity", self.velocity),
            ("acceleration", self.acceleration),
        ):
            blocked = np.flatnonzero(~(margin > 0.0))
            if blocked.size:
                k = int(blocked[0])
                raise TrajectoryError(
                    f"{ends.name(k)} cannot move: at q0 = {ends.q0[k]:g} its {name} limit leaves "
                    f"{margin[k]:g}"
                )

    def scale(self, series: FourierSeries) -> FourierSeries:
        """Return the series with each joint scaled until it reaches the first of its limits."""
        harmonics = len(series.sines)
        points = POINTS_PER_HARMONIC * harmonics
        x, v, a = series(np.arange(0.0, points) * (series.duration / points))
        bound_factor = 1.0 / math.cos(math.pi * harmonics / points)
        centre, radius = 0.5 * (x.max(axis=0) + x.min(axis=0)), 0.5 * bound_factor * np.ptp(x, axis=0)
        scale = np.min(
            [
                self.above / (centre + radius),
                self.below / (radius - centre),
                self.velocity / (bound_factor * np.abs(v).max(axis=0)),
                self.acceleration / (bound_factor * np.abs(a).max(axis=0)),
            ],
            axis=0,
        ) * (1.0 - LIMIT_MARGIN)
        return FourierSeries(
            series.duration, read_only(series.sines * scale), read_only(series.cosines * scale)
        )


def _random_series(rng: np.random.Generator, T: float, harmonics: int, nv: int) -> FourierSeries:
    """Draw coefficients uniformly on a sphere within the subspace of the two conditions at the ends."""
    k = np.arange(1.0, harmonics + 1.0)[:, None]
    sines, cosines = rng.standard_normal((2, harmonics, nv)) / k
    for coefficients, weights in ((sines, k), (cosines, k * k)):
        coefficients -= weights * (np.sum(weights * coefficients, axis=0) / np.sum(weights * weights))
    return FourierSeries(T, sines, cosines)


def _ends_around(model: Model, q0: ArrayLike | None) -> Ends:
    refuse_ball_joints(model, "a trajectory")
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
