"""Inertial regressor of large robots: the algorithm of `dynx.rbd.regressor` as calls of routines."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from dynx.compiled.looped.routines import (
    JOINT_KINDS,
    MATRIX,
    SCALAR,
    VECTOR,
    Inputs,
    body_like,
    check_arguments,
    checking,
    joint_state,
    kind,
    load_axes,
    read_arguments,
    reading,
)
from dynx.model.mechanism import ROOT, Mechanism, joint_motion
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.regressor import (
    BodyState,
    assemble_wrench_regressor,
    child_acceleration,
    fixed_point_acceleration,
    moment_matrices,
)
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Routine, RoutineSet
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import cross, rotate, rotate_back, rotation_from_quat

Y, DEFECT = 3, 4
"""Numbers of the results, after those of q, v and a."""

_STATE, _LINK = (24,), (42,)
"""Shapes of the state of a body (`_pack_state`) and of the wrench regressor of a link with its pose."""


def routines() -> RoutineSet:
    """Return the routines of the algorithm."""
    frame: Inputs = {"R_own": ("constants", MATRIX), "p_own": ("constants", VECTOR)}
    found = {
        **reading(3),
        **checking(DEFECT),
        "world": Routine.of(_world, {"p": ("constants", VECTOR)}, {"state": "vectors"}),
        "floating base": Routine.of(
            _floating_base,
            {"q": ("vectors", (7,)), "v": ("vectors", (6,)), "a": ("vectors", (6,))},
            {"state": "vectors"},
        ),
        "link": Routine.of(
            _link,
            {**frame, "gravity": ("constants", VECTOR), "state": ("vectors", _STATE)},
            {"link": "vectors"},
        ),
        "base columns": Routine.of(
            _base_columns,
            {"state": ("vectors", _STATE), "link": ("vectors", _LINK)},
            {f"row{k}": Y for k in range(6)},
        ),
    }
    for name, revolute, axis in JOINT_KINDS:
        joint: Inputs = dict.fromkeys(("q", "v", "a"), ("vectors", SCALAR))
        found[f"outward {name}"] = Routine.of(
            _outward(revolute=revolute),
            {**frame, **joint, "parent": ("vectors", _STATE), **axis},
            {"state": "vectors"},
        )
        found[f"column {name}"] = Routine.of(
            _column(revolute=revolute),
            {"state": ("vectors", _STATE), "link": ("vectors", _LINK)},
            {"row": Y},
        )
    return RoutineSet(found, 5, cleared=(Y,))


def call_table(mechanism: Mechanism, routines: RoutineSet, frames: Sequence[int]) -> CallTable:
    """Return the calls for rigid bodies fixed to `frames` of one robot, in tree coordinates."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    base, width = nv - len(bodies), 10 * len(frames)
    rows = read_arguments(calls, mechanism, 3)
    q, v, a = (place for place, _ in rows)
    check_arguments(calls, mechanism, rows)
    states, axes = [calls.reserve(24)], load_axes(calls, bodies)
    if mechanism.floating:
        calls.call("floating base", q, v, a, states[0])
    else:
        calls.call("world", calls.constants(np.zeros(3)), states[0])
    for index, body in enumerate(bodies):
        states.append(calls.reserve(24))
        values = joint_state(mechanism, index, q, v, a)
        pose = calls.constants(body.R), calls.constants(body.p)
        calls.call(
            f"outward {kind(body)}", *pose, *values, states[body.parent + 1], *axes[index], states[index + 1]
        )
    gravity, link = calls.constants(mechanism.gravity), calls.reserve(42)
    for number, index in enumerate(frames):
        frame = mechanism.frames[index]
        if frame.body == ROOT and not mechanism.floating:
            continue
        pose = calls.constants(frame.R), calls.constants(frame.p)
        calls.call("link", *pose, gravity, states[frame.body + 1], link)
        row = frame.body
        while row != ROOT:
            column = (base + row) * width + 10 * number
            calls.call(f"column {kind(bodies[row])}", states[row + 1], link, column)
            row = bodies[row].parent
        if mechanism.floating:
            calls.call("base columns", states[0], link, *(k * width + 10 * number for k in range(6)))
    return calls


def _world(p: Array) -> dict[str, Array]:
    zero = 0 * p
    return {"state": _pack_state(np.eye(3), BodyState(p, zero, zero, zero), zero)}


def _floating_base(q: Array, v: Array, a: Array) -> dict[str, Array]:
    R = rotation_from_quat(q[3:])
    linear, omega = rotate(R, v[:3]), rotate(R, v[3:])
    acceleration = rotate(R, a[:3]) + cross(omega, linear)
    return {"state": _pack_state(R, BodyState(q[:3], omega, acceleration, rotate(R, a[3:])), 0 * omega)}


def _outward(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def outward(
        R_own: Array, p_own: Array, q: Array, v: Array, a: Array, parent: Array, axis: Array = Z_AXIS
    ) -> dict[str, Array]:
        body = body_like(revolute, R_own, p_own, axis)
        R_parent, state, _ = _unpack_state(parent)
        R_joint, p_joint = joint_motion(body, q)
        R, p = R_parent @ R_joint, state.p + rotate(R_parent, p_joint)
        z = rotate(R, body.axis)
        omega = state.omega + z * v if revolute else state.omega
        acceleration, alpha = child_acceleration(state, p, z * v, z * a, revolute=revolute)
        return {"state": _pack_state(R, BodyState(p, omega, acceleration, alpha), z)}

    return outward


def _link(R_own: Array, p_own: Array, gravity: Array, state: Array) -> dict[str, Array]:
    R_body, body, _ = _unpack_state(state)
    R, p = R_body @ R_own, body.p + rotate(R_body, p_own)
    acceleration = body.acceleration + fixed_point_acceleration(body.omega, body.alpha, p - body.p)
    d = rotate_back(R, acceleration - gravity)
    U, moments = moment_matrices(rotate_back(R, body.omega), rotate_back(R, body.alpha))
    return {"link": np.concatenate([R.ravel(), p, d, U.ravel(), moments.ravel()])}


def _column(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def column(state: Array, link: Array) -> dict[str, Array]:
        R, p, wrench = _unpack_link(link)
        _, body, axis = _unpack_state(state)
        if revolute:
            return {"row": _row(R, cross(axis, p - body.p), axis, wrench)}
        return {"row": rotate_back(R, axis) @ wrench[:3]}

    return column


def _base_columns(state: Array, link: Array) -> dict[str, Array]:
    R, p, wrench = _unpack_link(link)
    R_base, base, _ = _unpack_state(state)
    rows = [rotate_back(R, axis) @ wrench[:3] for axis in R_base.T]
    rows += [_row(R, cross(axis, p - base.p), axis, wrench) for axis in R_base.T]
    return {f"row{k}": row for k, row in enumerate(rows)}


def _row(R: Array, linear: Array, angular: Array, wrench: Array) -> Array:
    """Return the row of the regressor for the motion (3,) and (3,) of the link, in world axes."""
    return np.concatenate([rotate_back(R, linear), rotate_back(R, angular)]) @ wrench


def _pack_state(R: Array, state: BodyState, axis: Array) -> Array:
    """Return rotation, position, angular velocity, acceleration, angular acceleration and joint axis."""
    parts = (R.ravel(), state.p, state.omega, state.acceleration, state.alpha, axis)
    return np.concatenate([np.asarray(part, dtype=object) for part in parts])


def _unpack_state(packed: Array) -> tuple[Array, BodyState, Array]:
    return packed[:9].reshape(3, 3), BodyState(*packed[9:21].reshape(4, 3)), packed[21:]


def _unpack_link(packed: Array) -> tuple[Array, Array, Array]:
    """Return the pose of a link and its wrench regressor (6, 10)."""
    U, moments = packed[15:24].reshape(3, 3), packed[24:].reshape(3, 6)
    return packed[:9].reshape(3, 3), packed[9:12], assemble_wrench_regressor(packed[12:15], U, moments)
