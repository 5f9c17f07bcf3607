"""Forward dynamics of large robots: the algorithm of `dynx.rbd.aba` as calls of routines."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dynx.compiled.looped.routines import (
    INERTIA,
    JOINT_KINDS,
    MOTION,
    POSE,
    ROOT_MOTION,
    SCALAR,
    UPPER,
    VECTOR,
    WRENCH,
    Inputs,
    body_like,
    check_arguments,
    checking,
    compute_root_motion,
    joint_state,
    kind,
    load_axes,
    outward_inputs,
    pack_inertia,
    pack_pose,
    read_arguments,
    reading,
    unpack_inertia,
    unpack_motion,
    unpack_pose,
    unpack_symmetric,
)
from dynx.model.mechanism import Mechanism
from dynx.rbd.aba import ArticulatedInertia, accelerate_joint, eliminate_joint
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.linear import solve_positive_definite
from dynx.rbd.placement import Placement, SpatialVector
from dynx.rbd.rnea import Motion, add_spatial, body_wrench, child_motion
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Routine, RoutineSet
from dynx.spatial.scalar import Array

A, DEFECT = 3, 4
"""Numbers of the results, after those of q, v and tau."""

_ARTICULATED, _SPATIAL = (21,), (6,)


def routines() -> RoutineSet:
    """Return the routines of the algorithm."""
    inertia: Inputs = {"inertia": ("constants", INERTIA)}
    found = {
        **reading(3),
        **checking(DEFECT),
        **ROOT_MOTION,
        "body": Routine.of(
            lambda inertia, omega: _body(inertia, omega),
            {**inertia, "omega": ("vectors", VECTOR)},
            {"articulated": "vectors", "bias": "vectors"},
        ),
        "fixed base": Routine.of(
            lambda motion: {"acceleration": np.concatenate([motion[6:], motion[3:6]])},
            {"motion": ("vectors", MOTION)},
            {"acceleration": "vectors"},
        ),
        "floating base": Routine.of(
            _floating_base,
            {
                "motion": ("vectors", MOTION),
                "articulated": ("vectors", _ARTICULATED),
                "bias": ("vectors", WRENCH),
                "tau": ("vectors", WRENCH),
            },
            {"acceleration": "vectors", "found": "vectors", "a": A},
        ),
    }
    for name, revolute, axis in JOINT_KINDS:
        found[f"outward {name}"] = Routine.of(
            _outward(revolute=revolute),
            outward_inputs(VECTOR, "v", axis, inertia=False),
            {"pose": "vectors", "omega": "vectors", "velocity_product": "vectors"},
        )
        found[f"inward {name}"] = Routine.of(
            _inward(revolute=revolute),
            {
                "pose": ("vectors", POSE),
                "own": ("vectors", _ARTICULATED),
                "bias": ("vectors", WRENCH),
                "velocity_product": ("vectors", _SPATIAL),
                "tau": ("vectors", SCALAR),
                "parent": ("vectors", _ARTICULATED),
                "parent_bias": ("vectors", WRENCH),
                **axis,
            },
            {"terms": "vectors", "articulated": "vectors", "total": "vectors"},
        )
        found[f"accelerate {name}"] = Routine.of(
            _accelerate(revolute=revolute),
            {
                "pose": ("vectors", POSE),
                "velocity_product": ("vectors", _SPATIAL),
                "terms": ("vectors", (7,)),
                "parent": ("vectors", _SPATIAL),
                **axis,
            },
            {"acceleration": "vectors", "found": "vectors", "a": A},
        )
    return RoutineSet(found, 5)


def call_table(mechanism: Mechanism, routines: RoutineSet) -> CallTable:
    """Return the calls for one robot without mimic joints."""
    calls, bodies, nv = CallTable(routines), mechanism.bodies, mechanism.nv
    base = nv - len(bodies)
    rows = read_arguments(calls, mechanism, 3)
    q, v, tau = (place for place, _ in rows)
    zeros = calls.reserve(6)
    calls.call("zeros", zeros)
    root = compute_root_motion(calls, mechanism, q, v, zeros)
    axes = load_axes(calls, bodies)
    omegas, poses, products = [root], [], []
    for index, body in enumerate(bodies):
        places = calls.reserve(12), calls.reserve(3), calls.reserve(6)
        numbers = calls.constants(body.R), calls.constants(body.p)
        state = joint_state(mechanism, index, q, v)
        calls.call(f"outward {kind(body)}", *numbers, *state, omegas[body.parent + 1], *axes[index], *places)
        poses.append(places[0])
        omegas.append(places[1])
        products.append(places[2])
    inertias = (mechanism.root, *(body.inertia for body in bodies))
    articulated, bias = [], []
    for inertia, omega in zip(inertias, omegas, strict=True):
        articulated.append(calls.reserve(21))
        bias.append(calls.reserve(6))
        calls.call("body", calls.constants(pack_inertia(inertia)), omega, articulated[-1], bias[-1])
    terms = [calls.reserve(7) for _ in bodies]
    for index in reversed(range(len(bodies))):
        body = bodies[index]
        parent = articulated[body.parent + 1], bias[body.parent + 1]
        own = poses[index], articulated[index + 1], bias[index + 1], products[index], tau + base + index
        calls.call(f"inward {kind(body)}", *own, *parent, *axes[index], terms[index], *parent)
    accelerations, found = [calls.reserve(6)], calls.reserve(nv)
    if mechanism.floating:
        calls.call("floating base", root, articulated[0], bias[0], tau, accelerations[0], found, 0)
    else:
        calls.call("fixed base", root, accelerations[0])
    for index, body in enumerate(bodies):
        accelerations.append(calls.reserve(6))
        given = poses[index], products[index], terms[index], accelerations[body.parent + 1]
        results = accelerations[-1], found + base + index, base + index
        calls.call(f"accelerate {kind(body)}", *given, *axes[index], *results)
    check_arguments(calls, mechanism, rows, [found + k for k in range(nv)])
    return calls


def _outward(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def outward(
        R: Array, p: Array, q: Array, v: Array, parent: Array, axis: Array = Z_AXIS
    ) -> dict[str, Array]:
        body, still = body_like(revolute, R, p, axis), np.zeros(3)
        placement = Placement.of(body, q)
        motion = child_motion(body, placement, Motion(parent, still, still), v, np.asarray(0.0))
        return {
            "pose": pack_pose(placement),
            "omega": motion.omega,
            "velocity_product": np.concatenate([motion.proper_acceleration, motion.alpha]),
        }

    return outward


def _body(inertia: Array, omega: Array) -> dict[str, Array]:
    own, still = unpack_inertia(inertia), np.zeros(3)
    bias = body_wrench(own, Motion(omega, still, still))
    return {
        "articulated": _pack(ArticulatedInertia.of_rigid_body(own)),
        "bias": np.concatenate(bias),
    }


def _inward(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def inward(
        pose: Array,
        own: Array,
        bias: Array,
        velocity_product: Array,
        tau: Array,
        parent: Array,
        parent_bias: Array,
        axis: Array = Z_AXIS,
    ) -> dict[str, Array]:
        body, placement = body_like(revolute, np.eye(3), np.zeros(3), axis), unpack_pose(pose)
        joint = eliminate_joint(body, _unpack(own), _split(bias), tau, _split(velocity_product))
        total = add_spatial(_split(parent_bias), placement.wrench_to_parent(*joint.wrench))
        return {
            "terms": np.concatenate([*joint.K, joint.u_over_D.reshape(1)]),
            "articulated": _pack(_unpack(parent) + joint.apparent.to_parent(placement)),
            "total": np.concatenate(total),
        }

    return inward


def _floating_base(motion: Array, articulated: Array, bias: Array, tau: Array) -> dict[str, Array]:
    acceleration = solve_positive_definite(_unpack(articulated).matrix(), tau - bias)
    # The motion of the root is that without acceleration of its coordinates.
    proper = unpack_motion(motion).proper_acceleration
    a = np.concatenate([acceleration[:3] - proper, acceleration[3:]])
    return {"acceleration": acceleration, "found": a, "a": a}


def _accelerate(*, revolute: bool) -> Callable[..., dict[str, Array]]:
    def accelerate(
        pose: Array, velocity_product: Array, terms: Array, parent: Array, axis: Array = Z_AXIS
    ) -> dict[str, Array]:
        body = body_like(revolute, np.eye(3), np.zeros(3), axis)
        moved = unpack_pose(pose).motion_to_child(*_split(parent))
        acceleration, joint = accelerate_joint(body, _split(terms), terms[6], moved, _split(velocity_product))
        return {"acceleration": np.concatenate(acceleration), "found": joint, "a": joint}

    return accelerate


def _split(packed: Array) -> SpatialVector:
    return packed[:3], packed[3:6]


def _pack(inertia: ArticulatedInertia) -> Array:
    return np.concatenate([inertia.M[UPPER], inertia.C.ravel(), inertia.J[UPPER]])


def _unpack(packed: Array) -> ArticulatedInertia:
    M, J = unpack_symmetric(packed[:6]), unpack_symmetric(packed[15:])
    return ArticulatedInertia(M, packed[6:15].reshape(3, 3), J)
