"""Derivatives of inverse dynamics of large robots: `dynx.rbd.derivatives` as calls of routines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.compiled.looped.routines import (
    FLOATING_ROOT,
    INERTIA,
    JOINT_KINDS,
    VECTOR,
    Inputs,
    body_like,
    joint_state,
    kind,
    load_axes,
    outward_inputs,
    pack_inertia,
    read_arguments,
    reading,
    unpack_inertia,
)
from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.derivatives import (
    Base,
    BodyMotion,
    JointMotion,
    Response,
    Subtree,
    base_block,
    base_wrenches,
    by_ancestor,
    by_base,
    fixed_root,
    move_child,
    of_ancestor,
    respond,
)
from dynx.rbd.placement import Placement
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Place, Routine, RoutineSet
from dynx.spatial.scalar import Array

MATRICES = BY_Q, BY_V, BY_A = 3, 4, 5
"""Numbers of the results, after those of q, v and a."""

_MOTION, _JOINT, _SUBTREE, _RESPONSE, _BASE = (24,), (18,), (28,), (21,), (9,)
_ROWS = ("by_q", "by_v", "by_a")


def routines() -> RoutineSet:
    """Return the routines of the algorithm."""
    response: Inputs = {"response": ("vectors", _RESPONSE)}
    base: Inputs = {"base": ("vectors", _BASE)}
    rows: dict[str, Place] = dict(zip(_ROWS, MATRICES, strict=True))
    found = {
        **reading(3),
        "fixed root": Routine.of(
            lambda gravity: {"motion": _pack_motion(fixed_root(gravity))},
            {"gravity": ("constants", VECTOR)},
            {"motion": "vectors"},
        ),
        "floating root": Routine.of(
            _floating_root,
            FLOATING_ROOT,
            {"motion": "vectors", "base": "vectors"},
        ),
        "root": Routine.of(
            lambda inertia, motion: {"subtree": _of_body(inertia, _unpack_motion(motion))},
            {"inertia": ("constants", INERTIA), "motion": ("vectors", _MOTION)},
            {"subtree": "vectors"},
        ),
        "add": Routine.of(
            lambda own, parent: {"sum": own + parent},
            {"own": ("vectors", _SUBTREE), "parent": ("vectors", _SUBTREE)},
            {"sum": "vectors"},
        ),
        "respond": Routine.of(
            _respond,
            {"subtree": ("vectors", _SUBTREE), "joint": ("vectors", _JOINT)},
            {"response": "vectors", **rows},
        ),
        "pair": Routine.of(
            _pair,
            {**response, "joint": ("vectors", _JOINT)},
            {**rows, **{f"mirror_{name}": place for name, place in rows.items()}},
        ),
        "by base": Routine.of(_by_base, {**response, **base}, rows),
        "base wrenches": Routine.of(
            _base_wrenches, response, {f"{name}{k}": rows[name] for name in _ROWS for k in range(6)}
        ),
        "base block": Routine.of(
            _base_block,
            {"subtree": ("vectors", _SUBTREE), **base},
            {f"{name}{k}": rows[name] for name in _ROWS for k in range(6)},
        ),
    }
    for name, revolute, axis in JOINT_KINDS:
        found[f"outward {name}"] = Routine.of(
            _outward(revolute=revolute),
            outward_inputs(_MOTION, "va", axis, inertia=True),
            {"motion": "vectors", "joint": "vectors", "subtree": "vectors"},
        )
    return RoutineSet(found, 6, cleared=MATRICES)


def call_table(mechanism: Mechanism, routines: RoutineSet) -> CallTable:
    """Return the calls for one robot, in tree coordinates."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    first = nv - len(bodies)
    rows = read_arguments(calls, mechanism, 3)
    q, v, a = (place for place, _ in rows)
    motions, subtrees, base = [calls.reserve(24)], [calls.reserve(28)], calls.reserve(9)
    gravity = calls.constants(mechanism.gravity)
    if mechanism.floating:
        calls.call("floating root", gravity, q, v, a, motions[0], base)
    else:
        calls.call("fixed root", gravity, motions[0])
    calls.call("root", calls.constants(pack_inertia(mechanism.root)), motions[0], subtrees[0])
    joints, axes = [], load_axes(calls, bodies)
    for index, body in enumerate(bodies):
        numbers = [calls.constants(x) for x in (body.R, body.p, pack_inertia(body.inertia))]
        state = joint_state(mechanism, index, q, v, a)
        places = calls.reserve(24), calls.reserve(18), calls.reserve(28)
        calls.call(f"outward {kind(body)}", *numbers, *state, motions[body.parent + 1], *axes[index], *places)
        motions.append(places[0])
        joints.append(places[1])
        subtrees.append(places[2])
    for index in reversed(range(len(bodies))):
        parent = subtrees[bodies[index].parent + 1]
        calls.call("add", subtrees[index + 1], parent, parent)
    response = calls.reserve(21)
    for index, body in enumerate(bodies):
        own = first + index
        calls.call("respond", subtrees[index + 1], joints[index], response, *[own * nv + own] * 3)
        row = body.parent
        while row != ROOT:
            other = first + row
            calls.call("pair", response, joints[row], *[own * nv + other] * 3, *[other * nv + own] * 3)
            row = bodies[row].parent
        if mechanism.floating:
            calls.call("by base", response, base, *[own * nv] * 3)
            calls.call("base wrenches", response, *[k * nv + own for k in range(6)] * 3)
    if mechanism.floating:
        calls.call("base block", subtrees[0], base, *[k * nv for k in range(6)] * 3)
    return calls


def _floating_root(gravity: Array, q: Array, v: Array, a: Array) -> dict[str, Array]:
    base = Base.of(q, v, gravity)
    return {"motion": _pack_motion(base.motion(a)), "base": np.concatenate(base)}


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
        motion, joint = move_child(body, Placement.of(body, q), _unpack_motion(parent), v, a)
        packed = np.concatenate([*joint.S, *joint.first, *joint.second])
        return {"motion": _pack_motion(motion), "joint": packed, "subtree": _of_body(inertia, motion)}

    return outward


def _of_body(inertia: Array, motion: BodyMotion) -> Array:
    found = Subtree.of_body(unpack_inertia(inertia), motion)
    return np.concatenate([pack_inertia(found.inertia), found.momentum, found.E.ravel(), *found.wrench])


def _respond(subtree: Array, joint: Array) -> dict[str, Array]:
    own = _unpack_joint(joint)
    found = respond(_unpack_subtree(subtree), own)
    packed = np.concatenate([*found.IS, found.BS, *found.by_q, *found.by_v])
    return {"response": packed, **by_ancestor(found, own)._asdict()}


def _pair(response: Array, joint: Array) -> dict[str, Array]:
    found, other = _unpack_response(response), _unpack_joint(joint)
    mirrored = of_ancestor(found, other)._asdict()
    # The mass matrix is symmetric to the last bit.
    entries = by_ancestor(found, other)._replace(by_a=mirrored["by_a"])
    return {**entries._asdict(), **{f"mirror_{name}": entry for name, entry in mirrored.items()}}


def _by_base(response: Array, base: Array) -> dict[str, Array]:
    found = _unpack_response(response)
    return by_base(found.IS, found.BS, _unpack_base(base))._asdict()


def _base_wrenches(response: Array) -> dict[str, Array]:
    entries = base_wrenches(_unpack_response(response))._asdict()
    return {f"{name}{k}": entries[name][k] for name in _ROWS for k in range(6)}


def _base_block(subtree: Array, base: Array) -> dict[str, Array]:
    rows = [row._asdict() for row in base_block(_unpack_subtree(subtree), _unpack_base(base))]
    return {f"{name}{k}": rows[k][name] for name in _ROWS for k in range(6)}


def _pack_motion(motion: BodyMotion) -> Array:
    parts = (motion.R.ravel(), motion.p, *motion.velocity, *motion.acceleration)
    return np.concatenate([np.asarray(part, dtype=object) for part in parts])


def _unpack_motion(packed: Array) -> BodyMotion:
    parts = packed[9:].reshape(5, 3)
    return BodyMotion(packed[:9].reshape(3, 3), parts[0], (parts[1], parts[2]), (parts[3], parts[4]))


def _unpack_joint(packed: Array) -> JointMotion:
    parts = packed.reshape(6, 3)
    return JointMotion((parts[0], parts[1]), (parts[2], parts[3]), (parts[4], parts[5]))


def _unpack_subtree(packed: Array) -> Subtree:
    wrench = packed[22:25], packed[25:]
    return Subtree(unpack_inertia(packed[:10]), packed[10:13], packed[13:22].reshape(3, 3), wrench)


def _unpack_response(packed: Array) -> Response:
    parts = packed.reshape(7, 3)
    return Response((parts[0], parts[1]), parts[2], (parts[3], parts[4]), (parts[5], parts[6]))


def _unpack_base(packed: Array) -> Base:
    return Base(*packed.reshape(3, 3))
