"""Coriolis matrix of large robots: the algorithm of `dynx.rbd.coriolis` as calls of routines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.compiled.looped.routines import (
    INERTIA,
    JOINT_KINDS,
    LOADING,
    PLACING,
    POSE,
    SCALAR,
    VECTOR,
    Inputs,
    body_like,
    check_arguments,
    checking,
    kind,
    load_axes,
    pack_inertia,
    place_bodies,
    read_arguments,
    reading,
    unpack_inertia,
    unpack_pose,
)
from dynx.model.mechanism import ROOT, Body, Mechanism
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.coriolis import Composite, Response, ToParent, base_subspace, joint_subspace, step_to_child
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Routine, RoutineSet
from dynx.spatial.scalar import Array

C, DEFECT = 2, 3
"""Numbers of the results, after those of q and v."""

_COMPOSITE, _RESPONSE, _STEP = (22,), (15,), (15,)

_RAISED: Inputs = {
    "step": ("vectors", _STEP),
    "response": ("vectors", _RESPONSE),
    "omega": ("vectors", VECTOR),
}


def routines() -> RoutineSet:
    """Return the routines of the algorithm."""
    found = {
        **reading(2),
        **PLACING,
        **LOADING,
        **checking(DEFECT),
        "composite": Routine.of(
            _composite,
            {"inertia": ("constants", INERTIA), "omega": ("vectors", VECTOR)},
            {"composite": "vectors"},
        ),
        "add composite": Routine.of(
            _add_composite,
            {"step": ("vectors", _STEP), "own": ("vectors", _COMPOSITE), "parent": ("vectors", _COMPOSITE)},
            {"sum": "vectors"},
        ),
        "root": Routine.of(
            _root,
            {"composite": ("vectors", _COMPOSITE), "omega": ("vectors", VECTOR)},
            {f"row{k}": C for k in range(6)},
        ),
        "to root": Routine.of(_to_root, _RAISED, {"mirror": C, **{f"entry{k}": C for k in range(6)}}),
    }
    for name, revolute, axis in JOINT_KINDS:
        found[f"turn {name}"] = Routine.of(
            _turn(revolute=revolute),
            {
                "pose": ("vectors", POSE),
                "omega": ("vectors", VECTOR),
                "speed": ("vectors", SCALAR),
                **axis,
            },
            {"omega": "vectors", "dp": "vectors"},
        )
        found[f"response {name}"] = Routine.of(
            _response(revolute=revolute),
            {"composite": ("vectors", _COMPOSITE), "omega": ("vectors", VECTOR), **axis},
            {"response": "vectors", "diagonal": C},
        )
        found[f"to {name}"] = Routine.of(
            _to_joint(revolute=revolute),
            {**_RAISED, **axis},
            {"response": "vectors", "entry": C, "mirror": C},
        )
    return RoutineSet(found, 4, cleared=(C,))


def call_table(mechanism: Mechanism, routines: RoutineSet) -> CallTable:
    """Return the calls for one robot, in tree coordinates."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    base = nv - len(bodies)
    rows = read_arguments(calls, mechanism, 2)
    check_arguments(calls, mechanism, rows)
    q, v = (place for place, _ in rows)
    # The velocity of a body's origin follows its pose.
    steps = place_bodies(calls, mechanism, q, size=15)
    axes = load_axes(calls, bodies)
    omegas = [v + 3]
    if not mechanism.floating:
        omegas = [calls.reserve(3)]
        calls.call("load vector", calls.constants(np.zeros(3)), omegas[0])
    for index, body in enumerate(bodies):
        omegas.append(calls.reserve(3))
        calls.call(
            f"turn {kind(body)}",
            steps[index],
            omegas[body.parent + 1],
            v + base + index,
            *axes[index],
            omegas[index + 1],
            steps[index] + 12,
        )
    composites = []
    for inertia, omega in zip((mechanism.root, *(body.inertia for body in bodies)), omegas, strict=True):
        composites.append(calls.reserve(22))
        calls.call("composite", calls.constants(pack_inertia(inertia)), omega, composites[-1])
    for index in reversed(range(len(bodies))):
        parent = composites[bodies[index].parent + 1]
        calls.call("add composite", steps[index], composites[index + 1], parent, parent)
    response = calls.reserve(15)
    for index, body in enumerate(bodies):
        own = base + index
        calls.call(
            f"response {kind(body)}",
            composites[index + 1],
            omegas[index + 1],
            *axes[index],
            response,
            own * nv + own,
        )
        below, row = index, body.parent
        while row != ROOT:
            to, other = kind(bodies[row]), base + row
            entries = other * nv + own, own * nv + other
            calls.call(f"to {to}", steps[below], response, omegas[row + 1], *axes[row], response, *entries)
            below, row = row, bodies[row].parent
        if mechanism.floating:
            column = [k * nv + own for k in range(6)]
            calls.call("to root", steps[below], response, omegas[0], own * nv, *column)
    if mechanism.floating:
        calls.call("root", composites[0], omegas[0], *(k * nv for k in range(6)))
    return calls


def _turn(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def turn(pose: Array, omega: Array, speed: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        placement = unpack_pose(pose)
        body = body_like(revolute, placement.R, placement.p, axis)
        own, step = step_to_child(body, placement, omega, speed)
        return {"omega": own, "dp": step.dp}

    return turn


def _composite(inertia: Array, omega: Array) -> dict[str, Array]:
    return {"composite": _pack(Composite.of_rigid_body(unpack_inertia(inertia), omega))}


def _add_composite(step: Array, own: Array, parent: Array) -> dict[str, Array]:
    return {"sum": _pack(_unpack(parent) + _unpack(own).to_parent(_unpack_step(step)))}


def _response(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def respond(composite: Array, omega: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        subspace = joint_subspace(_on_axis(axis, revolute=revolute), 0, omega)
        response = _unpack(composite).response(subspace)
        return {"response": _pack_response(response), "diagonal": response.entries(subspace)[0][0, 0]}

    return respond


def _to_joint(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def raise_to(step: Array, response: Array, omega: Array, axis: Array = Z_AXIS) -> dict[str, Array]:
        raised = _unpack_response(response).to_parent(_unpack_step(step))
        block, mirror = raised.entries(joint_subspace(_on_axis(axis, revolute=revolute), 0, omega))
        return {"response": _pack_response(raised), "entry": block[0, 0], "mirror": mirror[0, 0]}

    return raise_to


def _to_root(step: Array, response: Array, omega: Array) -> dict[str, Array]:
    raised = _unpack_response(response).to_parent(_unpack_step(step))
    block, mirror = raised.entries(base_subspace(omega))
    return {"mirror": mirror[0], **{f"entry{k}": block[k, 0] for k in range(6)}}


def _root(composite: Array, omega: Array) -> dict[str, Array]:
    subspace = base_subspace(omega)
    block, _ = _unpack(composite).response(subspace).entries(subspace)
    return {f"row{k}": row for k, row in enumerate(block)}


def _on_axis(axis: Array, *, revolute: bool) -> Body:
    return body_like(revolute, np.eye(3), np.zeros(3), axis)


def _pack(composite: Composite) -> Array:
    return np.concatenate([pack_inertia(composite.inertia), composite.f, composite.E.ravel()])


def _unpack(packed: Array) -> Composite:
    return Composite(unpack_inertia(packed[:10]), packed[10:13], packed[13:].reshape(3, 3))


def _unpack_step(step: Array) -> ToParent:
    return ToParent(unpack_pose(step[:12]), step[12:])


def _pack_response(response: Response) -> Array:
    parts = (
        response.momentum,
        response.angular_momentum,
        response.force,
        response.moment,
        response.couple,
    )
    return np.concatenate([part[:, 0] for part in parts])


def _unpack_response(packed: Array) -> Response:
    return Response(*(packed[k : k + 3, None] for k in range(0, 15, 3)))
