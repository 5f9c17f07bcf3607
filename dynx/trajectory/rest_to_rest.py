"""The fastest way along a straight line in joint space, from rest to rest, under limits.

Every coordinate is a multiple of one scalar s(t) from 0 to 1, so the joints start together, stop
together and stay on the line; the limits of s are the least over the joints. Closed forms of our own
for the trapezoidal profile and the double S (the profiles of Biagiotti and Melchiorri, Trajectory Planning
for Automatic Machines and Robots, sections 3.2 and 3.4, from rest to rest).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, TrajectoryError
from dynx.model import Model
from dynx.trajectory.base import LONGEST, SHORTEST, Trajectory, checked_duration
from dynx.trajectory.bounds import ROUNDING, along_line, checked_bound, refuse_standstill, velocity_bound
from dynx.trajectory.curve import PiecewisePolynomial, from_phases, one_polynomial
from dynx.trajectory.displacement import Ends, checked_ends


def trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    acceleration: ArrayLike,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    model: Model | None = None,
) -> Trajectory:
    """From rest at `q0` to rest at `q1`: constant acceleration, constant velocity, constant deceleration.

    `velocity` and `acceleration` are limits, one number or (nv,), infinity for none; without `velocity`
    it is that of the `model`. The motion is the shortest on the straight line, so that some joint is at a
    limit at any time, or takes `duration` [s] if that is longer (time is then stretched evenly). A
    floating base needs the `model` and moves along one screw.

    Raises ArgumentError for limits that are negative or bound nothing that moves, TrajectoryError for a
    limit of 0 on what has to move and for a duration that is too short.
    """
    ends = checked_ends(q0, q1, model)
    V = along_line("velocity", velocity_bound(velocity, ends), ends)
    A = along_line("acceleration", checked_bound("acceleration", acceleration, ends.nv), ends)
    if duration is None or ends.displacement.any():
        refuse_standstill(ends)
        _refuse_unbounded("acceleration", A)
        rise = min(V / A, math.sqrt(1.0 / A))
        top = A * rise
        spans, rates = (rise, max(0.0, 1.0 / top - rise), rise), (A, 0.0, -A)
        return _stretched(ends, spans, rates, 2, duration)
    return _standing(ends, duration)


def s_curve(
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    velocity: ArrayLike | None = None,
    duration: float | None = None,
    model: Model | None = None,
) -> Trajectory:
    """As `trapezoidal`, with the rate of the acceleration limited too (the double S, seven phases).

    `jerk` is a limit as the others are. The acceleration is continuous and 0 at both ends.
    """
    ends = checked_ends(q0, q1, model)
    V = along_line("velocity", velocity_bound(velocity, ends), ends)
    A = along_line("acceleration", checked_bound("acceleration", acceleration, ends.nv), ends)
    J = along_line("jerk", checked_bound("jerk", jerk, ends.nv), ends)
    if duration is None or ends.displacement.any():
        refuse_standstill(ends)
        _refuse_unbounded("jerk", J)
        # The time with jerk, of which the acceleration or the velocity may have enough, or the way.
        bend = min(A / J, math.sqrt(V / J), (0.5 / J) ** (1.0 / 3.0))
        # The time at constant acceleration: until the velocity is reached, or half the way is done.
        reached = V / (J * bend) - bend
        halfway = 0.5 * (math.sqrt(bend * bend + 4.0 / (J * bend)) - 3.0 * bend)
        steady = max(0.0, min(reached, halfway))
        top = J * bend * (bend + steady)
        cruise = max(0.0, 1.0 / top - (2.0 * bend + steady))
        spans = (bend, steady, bend, cruise, bend, steady, bend)
        return _stretched(ends, spans, (J, 0.0, -J, 0.0, -J, 0.0, J), 3, duration)
    return _standing(ends, duration)


def _stretched(
    ends: Ends, spans: tuple[float, ...], rates: tuple[float, ...], order: int, duration: float | None
) -> Trajectory:
    """The motion of these phases, slowed down evenly to take `duration`."""
    shortest = sum(spans)
    if not SHORTEST <= shortest <= LONGEST:
        raise TrajectoryError(
            f"within the limits it takes {shortest:g} s; wanted between {SHORTEST:g} and {LONGEST:g} s"
        )
    if duration is not None:
        T = checked_duration(duration)
        if T / shortest < 1.0 - ROUNDING:
            raise TrajectoryError(f"duration is {T:g}; within the limits it takes at least {shortest:.9g} s")
        factor = max(1.0, T / shortest)
        spans = tuple(span * factor for span in spans)
        rates = tuple(rate / factor**order for rate in rates)
    curve = from_phases(spans, rates, order).times(ends.displacement)
    T = float(curve.breaks[-1]) if duration is None else T
    return _at_rest(ends, T, PiecewisePolynomial(np.append(curve.breaks[:-1], T), curve.coefficients))


def _at_rest(ends: Ends, T: float, curve: PiecewisePolynomial) -> Trajectory:
    """v is exactly 0 at both ends; a is that of the first and the last phase there."""
    rest = np.zeros(ends.nv)
    change = 2.0 * curve.coefficients[0, 2]
    if curve.coefficients.shape[1] == 4:
        return ends.rest_to_rest(T, curve)
    return ends.trajectory(T, curve, (rest, change), (rest, -change))


def _standing(ends: Ends, duration: float) -> Trajectory:
    T = checked_duration(duration)
    return ends.rest_to_rest(T, one_polynomial(T, np.zeros(ends.nv)))


def _refuse_unbounded(name: str, bound: float) -> None:
    if bound == math.inf:
        raise ArgumentError(f"{name} is infinite for everything that moves; wanted a limit")
