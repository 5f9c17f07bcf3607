"""Inverse dynamics, bias and gravity torque of large robots: `dynx.rbd.rnea` as calls of routines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.compiled.looped.routines import (
    INERTIA,
    JOINT_KINDS,
    MOTION,
    POSE,
    ROOT_MOTION,
    WRENCH,
    body_like,
    check_arguments,
    checking,
    compute_root_motion,
    joint_state,
    kind,
    load_axes,
    outward_inputs,
    pack_inertia,
    pack_motion,
    pack_pose,
    read_arguments,
    reading,
    unpack_inertia,
    unpack_motion,
    unpack_pose,
)
from dynx.model.mechanism import Mechanism
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.placement import Placement
from dynx.rbd.rnea import add_spatial, body_wrench, child_motion
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Routine, RoutineSet
from dynx.spatial.scalar import Array


def routines(n_inputs: int) -> RoutineSet:
    """Return the routines for the first `n_inputs` of q, v and a; the others are zero."""
    tau = n_inputs
    found = {
        **reading(n_inputs),
        **checking(tau + 1),
        **ROOT_MOTION,
        "wrench": Routine.of(
            lambda inertia, motion: {"wrench": _wrench(inertia, motion)},
            {"inertia": ("constants", INERTIA), "motion": ("vectors", MOTION)},
            {"wrench": "vectors"},
        ),
        "write wrench": Routine.of(lambda x: {"x": x}, {"x": ("vectors", WRENCH)}, {"x": tau}),
    }
    for name, revolute, axis in JOINT_KINDS:
        found[f"outward {name}"] = Routine.of(
            _outward(revolute=revolute),
            outward_inputs(MOTION, "va", axis, inertia=True),
            {"pose": "vectors", "motion": "vectors", "wrench": "vectors"},
        )
        found[f"inward {name}"] = Routine.of(
            _inward(revolute=revolute),
            {"pose": ("vectors", POSE), "own": ("vectors", WRENCH), "parent": ("vectors", WRENCH), **axis},
            {"sum": "vectors", "torque": tau},
        )
    return RoutineSet(found, n_inputs + 2)


def call_table(mechanism: Mechanism, routines: RoutineSet) -> CallTable:
    """Return the calls for one robot, in tree coordinates."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    base, n_inputs = nv - len(bodies), routines.n_arrays - 2
    rows = read_arguments(calls, mechanism, n_inputs)
    check_arguments(calls, mechanism, rows)
    zeros = calls.reserve(6)
    calls.call("zeros", zeros)
    q, *rates = (place for place, _ in rows)
    # A rate that is no argument is zero: one number for every joint, six for the base.
    starts = [*rates, *[zeros] * (2 - len(rates))]
    v, a = ([start + k if start != zeros else zeros for k in range(nv)] for start in starts)
    motions = [compute_root_motion(calls, mechanism, q, *starts)]
    wrenches = [calls.reserve(6)]
    calls.call("wrench", calls.constants(pack_inertia(mechanism.root)), motions[0], wrenches[0])
    poses = []
    axes = load_axes(calls, bodies)
    for index, body in enumerate(bodies):
        numbers = [calls.constants(x) for x in (body.R, body.p, pack_inertia(body.inertia))]
        state = *joint_state(mechanism, index, q), v[base + index], a[base + index]
        places = calls.reserve(12), calls.reserve(9), calls.reserve(6)
        calls.call(f"outward {kind(body)}", *numbers, *state, motions[body.parent + 1], *axes[index], *places)
        poses.append(places[0])
        motions.append(places[1])
        wrenches.append(places[2])
    for index in reversed(range(len(bodies))):
        body, parent = bodies[index], wrenches[bodies[index].parent + 1]
        own = poses[index], wrenches[index + 1], parent
        calls.call(f"inward {kind(body)}", *own, *axes[index], parent, base + index)
    if mechanism.floating:
        calls.call("write wrench", wrenches[0], 0)
    return calls


def _outward(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def outward(
        R: Array,
        p: Array,
        inertia: Array,
        q: Array,
        v: Array,
        a: Array,
        parent: Array,
        axis: Array = Z_AXIS,
    ) -> dict[str, Array]:
        body = body_like(revolute, R, p, axis)
        placement = Placement.of(body, q)
        motion = pack_motion(child_motion(body, placement, unpack_motion(parent), v, a))
        return {"pose": pack_pose(placement), "motion": motion, "wrench": _wrench(inertia, motion)}

    return outward


def _inward(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def inward(pose: Array, own: Array, parent: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        force, moment = own[:3], own[3:]
        reaction = unpack_pose(pose).wrench_to_parent(force, moment)
        total = np.concatenate(add_spatial((parent[:3], parent[3:]), reaction))
        return {"sum": total, "torque": np.sum(axis * (moment if revolute else force))}

    return inward


def _wrench(inertia: Array, motion: Array) -> Array:
    return np.concatenate(body_wrench(unpack_inertia(inertia), unpack_motion(motion)))
