"""Arithmetic of configurations with quaternions, for any scalar and without branches.

A configuration is that of a floating base (position and quaternion, if there is one), then those of the
joints: a quaternion (x, y, z, w) of a ball joint, one number of any other. `balls` are the indices in q at
which the quaternions of ball joints begin, in order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np

from dynx.spatial.branchless import ARRAYS, components, moved, quat_exp, quat_log, twist_between
from dynx.spatial.scalar import Array, append_axis, sqrt
from dynx.spatial.so3 import quat_product, rotate, rotation_from_quat


def integrate(q: Array, v: Array, *, floating: bool, balls: Sequence[int] = ()) -> Array:
    """Return `Model.integrate`: q (..., nq) moved by v (..., nv) for unit time."""
    parts = []
    for kind, of_q, of_v in coordinate_runs(q.shape[-1], floating=floating, balls=balls):
        start, step = q[..., of_q], v[..., of_v]
        if kind == "base":
            parts.append(np.stack(moved(components(start), components(step), ARRAYS), axis=-1))
        else:
            parts.append(turn(start, step) if kind == "ball" else start + step)
    return _joined(parts)


def displace(q: Array, d: Array, *, floating: bool, balls: Sequence[int] = ()) -> Array:
    """Return q (+) d (..., nq), `Model.integrate` to first order in d (..., nv).

    Derivatives with respect to a configuration are taken with respect to d: a quaternion has one entry more
    than a velocity. Value and first derivatives are exact at d = 0. A floating base translates by R d[:3] and
    rotates by the quaternion product of q with (d[3:6] / 2, 1).
    """
    parts = []
    for kind, of_q, of_v in coordinate_runs(q.shape[-1], floating=floating, balls=balls):
        start, step = q[..., of_q], d[..., of_v]
        if kind == "base":
            parts.append(start[..., :3] + rotate(rotation_from_quat(start[..., 3:]), step[..., :3]))
            start, step = start[..., 3:], step[..., 3:]
        parts.append(start + step if kind == "joints" else start + quat_rate(start, step))
    return _joined(parts)


def difference(q0: Array, q1: Array, *, floating: bool, balls: Sequence[int] = ()) -> Array:
    """Return `Model.difference`: the v (..., nv) with integrate(q0, v) = q1."""
    parts = []
    for kind, of_q, _ in coordinate_runs(q0.shape[-1], floating=floating, balls=balls):
        start, end = q0[..., of_q], q1[..., of_q]
        if kind == "base":
            parts.append(np.stack(twist_between(components(start), components(end), ARRAYS), axis=-1))
        else:
            parts.append(turn_between(start, end) if kind == "ball" else end - start)
    return _joined(parts)


def coordinate_runs(
    nq: int, *, floating: bool, balls: Sequence[int] = ()
) -> Iterator[tuple[Literal["base", "ball", "joints"], slice, slice]]:
    """Yield the kind and the entries in q and in v of a floating base, of each ball joint, and of each run of
    joints with one coordinate."""
    in_q, in_v = (7, 6) if floating else (0, 0)
    if floating:
        yield "base", slice(0, 7), slice(0, 6)
    for ball in (*balls, nq):
        if ball > in_q:
            yield "joints", slice(in_q, ball), slice(in_v, in_v + ball - in_q)
        if ball < nq:
            in_v += ball - in_q
            yield "ball", slice(ball, ball + 4), slice(in_v, in_v + 3)
            in_q, in_v = ball + 4, in_v + 3


def turn(quat_xyzw: Array, rotation_vector: Array) -> Array:
    """Return the unit quaternion (..., 4) turned by a rotation vector [rad] (..., 3) in its own axes."""
    turned = quat_product(quat_xyzw, quat_exp(rotation_vector))
    return np.asarray(turned / append_axis(sqrt(np.sum(turned * turned, axis=-1))))


def turn_between(start: Array, end: Array) -> Array:
    """Return the rotation vector [rad] (..., 3), of norm at most pi, with `turn(start, vector)` = `end`, for
    quaternions (..., 4)."""
    back = np.concatenate([-start[..., :3], start[..., 3:]], axis=-1)
    return quat_log(quat_product(back, end))


def quat_rate(quat_xyzw: Array, omega: Array) -> Array:
    """Return the time derivative (..., 4) of a quaternion, at the angular velocity (..., 3) in its own
    axes."""
    x, y, z, w = components(quat_xyzw)
    a, b, c = components(omega)
    change = [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c]
    return np.stack(change, axis=-1) * 0.5


def _joined(parts: list[Array]) -> Array:
    return np.asarray(parts[0]) if len(parts) == 1 else np.concatenate(parts or [np.zeros(0)], axis=-1)
