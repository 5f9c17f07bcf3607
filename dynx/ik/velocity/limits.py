"""Bounds on the velocity of one step, from limits of position, velocity and acceleration."""

from __future__ import annotations

import numpy as np

from dynx.model import Model
from dynx.spatial.scalar import Floats

OUTSIDE = 1e-6
"""Distance from a limit [rad or m] above which a joint outside is named; less is rounding of float32."""


def velocity_bounds(
    model: Model, q: Floats, dt: float, velocity_limit: Floats, acceleration_limit: Floats, v0: Floats | None
) -> tuple[Floats, Floats]:
    """Return the bounds (nv,) on a velocity that is kept for `dt` [s].

    The joints stay within their position limits, and within their acceleration limits can still stop before
    them: after a step of velocity v at a distance d from the limit, v^2 / (2 a) <= d - v dt, so that
    v <= sqrt((a dt)^2 + 2 a d) - a dt. With `v0` the change of velocity is at most a dt. A joint outside its
    limits returns as fast as these bounds allow, and arrives at the limit. Where bounds contradict each
    other, those of position and velocity count more than that of the change.
    """
    offset = 6 if model.floating else 0
    room_below, room_above = np.full(model.nv, np.inf), np.full(model.nv, np.inf)
    joints = q[7:] if model.floating else q
    lower, upper = (model.lower[7:], model.upper[7:]) if model.floating else (model.lower, model.upper)
    room_below[offset:] = joints - lower
    room_above[offset:] = upper - joints
    # The room is negative outside a limit, and so is the velocity towards it.
    low = -_towards(room_below, dt, velocity_limit, acceleration_limit)
    high = _towards(room_above, dt, velocity_limit, acceleration_limit)
    if v0 is not None:
        change = acceleration_limit * dt
        low, high = np.clip(v0 - change, low, high), np.clip(v0 + change, low, high)
    return low, high


def joints_outside(model: Model, q: Floats) -> str:
    """Return a sentence that names the joints whose position q is outside the limits, or an empty text."""
    beyond = np.maximum(model.lower - q, q - model.upper)
    offset = model.nq - len(model.joint_names)
    names = [
        f"{model.joint_names[k - offset]} by {beyond[k]:.6g}"
        for k in np.flatnonzero(beyond > OUTSIDE).tolist()
    ]
    return f"q is outside the position limits [rad or m]: {', '.join(names)}" if names else ""


def _towards(room: Floats, dt: float, velocity_limit: Floats, acceleration_limit: Floats) -> Floats:
    """Return the largest velocity in the direction of a limit at the signed distance `room`."""
    most = np.minimum(_most(np.abs(room), dt, acceleration_limit), velocity_limit)
    return np.where(room < 0.0, -most, most)


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
