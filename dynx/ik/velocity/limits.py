"""Bounds on the velocity of one step, from limits of position, velocity and acceleration."""

from __future__ import annotations

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats


def velocity_bounds(
    model: Model, q: Floats, dt: float, velocity_limit: Floats, acceleration_limit: Floats, v0: Floats | None
) -> tuple[Floats, Floats]:
    """Return the bounds (nv,) on a velocity that is kept for `dt` [s].

    The joints stay within their position limits, and within their acceleration limits can still stop before
    them: after a step of velocity v at a distance d from the limit, v^2 / (2 a) <= d - v dt, so that
    v <= sqrt((a dt)^2 + 2 a d) - a dt. With `v0` the change of velocity is at most a dt. A joint outside its
    limits may only move towards them. Where bounds contradict each other, those of position and velocity
    count more than that of the change.
    """
    offset = 6 if model.floating else 0
    room_below, room_above = np.full(model.nv, np.inf), np.full(model.nv, np.inf)
    joints = q[7:] if model.floating else q
    lower, upper = (model.lower[7:], model.upper[7:]) if model.floating else (model.lower, model.upper)
    room_below[offset:] = np.maximum(joints - lower, 0.0)
    room_above[offset:] = np.maximum(upper - joints, 0.0)
    low = -np.minimum(_most(room_below, dt, acceleration_limit), velocity_limit)
    high = np.minimum(_most(room_above, dt, acceleration_limit), velocity_limit)
    if v0 is not None:
        change = acceleration_limit * dt
        low, high = np.clip(v0 - change, low, high), np.clip(v0 + change, low, high)
    return low, high


def _most(room: Floats, dt: float, acceleration: Floats) -> Floats:
    """Return the largest velocity towards a limit at the distance `room`, for each coordinate."""
    found: Floats = room / dt
    brakes = np.isfinite(acceleration) & np.isfinite(room)
    a = acceleration[brakes]
    # The difference of nearly equal numbers, written as a quotient.
    root = np.sqrt((a * dt) ** 2 + 2.0 * a * room[brakes]) + a * dt
    braking = np.divide(2.0 * a * room[brakes], root, out=np.zeros(len(a)), where=root > 0.0)
    found[brakes] = np.minimum(found[brakes], braking)
    return found
