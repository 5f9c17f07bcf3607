"""Mass matrix of large robots: the composite-rigid-body algorithm of `dynx.rbd.crba` as calls of routines.

The walk from a body to the root transforms the momentum of the body's subtree from body to parent and takes
an entry of the matrix from it at each joint.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.compiled.looped.routines import (
    INERTIA,
    JOINT_KINDS,
    LOADING,
    PLACING,
    POSE,
    Inputs,
    check_arguments,
    checking,
    inertias_in_workspace,
    kind,
    load_axes,
    pack_inertia,
    place_bodies,
    read_arguments,
    reading,
    unpack_inertia,
    unpack_pose,
)
from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.base_parameters import Z_AXIS
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Routine, RoutineSet
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import skew

M, DEFECT = 1, 2
"""Numbers of the results, after that of q."""


def routines() -> RoutineSet:
    """Return the routines of the algorithm."""
    found = {
        **reading(1),
        **PLACING,
        **LOADING,
        **checking(DEFECT),
        "add composite": Routine.of(
            _add_composite,
            {"pose": ("vectors", POSE), "own": ("vectors", INERTIA), "parent": ("vectors", INERTIA)},
            {"sum": "vectors"},
        ),
        "root": Routine.of(_root, {"composite": ("vectors", INERTIA)}, {f"row{k}": M for k in range(6)}),
        "to root": Routine.of(_to_root, _WALK, {"row": M, **{f"entry{k}": M for k in range(6)}}),
    }
    for name, revolute, axis in JOINT_KINDS:
        found[f"momentum {name}"] = Routine.of(
            _momentum(revolute=revolute),
            {"composite": ("vectors", INERTIA), **axis},
            {"wrench": "vectors", "diagonal": M},
        )
        found[f"to {name}"] = Routine.of(
            _to_joint(revolute=revolute), {**_WALK, **axis}, {"wrench": "vectors", "entry": M, "mirror": M}
        )
    return RoutineSet(found, 3, cleared=(M,))


_WALK: Inputs = {"pose": ("vectors", POSE), "wrench": ("vectors", (6,))}


def call_table(mechanism: Mechanism, routines: RoutineSet) -> CallTable:
    """Return the calls for one robot, in tree coordinates."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    rows = read_arguments(calls, mechanism, 1)
    check_arguments(calls, mechanism, rows)
    q, _ = rows[0]
    poses = place_bodies(calls, mechanism, q)
    composites = inertias_in_workspace(calls, mechanism)
    for index in reversed(range(len(bodies))):
        parent = composites[bodies[index].parent + 1]
        calls.call("add composite", poses[index], composites[index + 1], parent, parent)
    wrench, base = calls.reserve(6), nv - len(bodies)
    axes = load_axes(calls, bodies)
    for index, body in enumerate(bodies):
        own = base + index
        calls.call(f"momentum {kind(body)}", composites[index + 1], *axes[index], wrench, own * nv + own)
        below, row = index, body.parent
        while row != ROOT:
            to, column = kind(bodies[row]), base + row
            entries = own * nv + column, column * nv + own
            calls.call(f"to {to}", poses[below], wrench, *axes[row], wrench, *entries)
            below, row = row, bodies[row].parent
        if mechanism.floating:
            calls.call("to root", poses[below], wrench, own * nv, *(k * nv + own for k in range(6)))
    if mechanism.floating:
        calls.call("root", composites[0], *(k * nv for k in range(6)))
    return calls


def _add_composite(pose: Array, own: Array, parent: Array) -> dict[str, Array]:
    moved = unpack_pose(pose).inertia_to_parent(unpack_inertia(own))
    return {"sum": pack_inertia(unpack_inertia(parent) + moved)}


def _momentum(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def momentum(composite: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        no_motion = 0 * axis
        twist = (no_motion, axis) if revolute else (axis, no_motion)
        force, moment = unpack_inertia(composite).momentum(*twist)
        return {
            "wrench": np.concatenate([force, moment]),
            "diagonal": np.sum(axis * (moment if revolute else force)),
        }

    return momentum


def _to_joint(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def step(pose: Array, wrench: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        force, moment = unpack_pose(pose).wrench_to_parent(wrench[:3], wrench[3:])
        entry = np.sum(axis * (moment if revolute else force))
        return {"wrench": np.concatenate([force, moment]), "entry": entry, "mirror": entry}

    return step


def _to_root(pose: Array, wrench: Array) -> dict[str, Array]:
    entries = np.concatenate(unpack_pose(pose).wrench_to_parent(wrench[:3], wrench[3:]))
    return {"row": entries, **{f"entry{k}": entry for k, entry in enumerate(entries)}}


def _root(composite: Array) -> dict[str, Array]:
    inertia = unpack_inertia(composite)
    coupling = skew(inertia.first_moment)
    top = np.concatenate([np.eye(3, dtype=int) * inertia.mass, coupling.T], axis=-1)
    bottom = np.concatenate([coupling, inertia.rotational_inertia], axis=-1)
    return {f"row{k}": row for k, row in enumerate(np.concatenate([top, bottom]))}
