"""Routines that several quantities of large robots share, and the mechanism as operands of routines.

Each routine is a step of an algorithm of `dynx.rbd`, traced with the numbers of a body as inputs. Routines
are compiled once for all robots; the numbers of a robot are constants of its table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from dynx.compiled.defect import quaternion_defect, result_defect, sum_by_pairs
from dynx.model.mechanism import ROOT, Body, Mechanism
from dynx.rbd.base_parameters import Z_AXIS
from dynx.rbd.placement import Placement
from dynx.rbd.rnea import Motion, root_motion
from dynx.simd.call_table import CallTable
from dynx.simd.routines import Place, Routine
from dynx.spatial.inertia import RigidInertia, symmetric_from_upper
from dynx.spatial.scalar import Array

Inputs = Mapping[str, tuple[Place, tuple[int, ...]]]

VECTOR, MATRIX, SCALAR = (3,), (3, 3), ()
INERTIA = (10,)
"""Shape of mass, first moment and the upper triangle of the rotational inertia."""

JOINT_KINDS: tuple[tuple[str, bool, Inputs], ...] = (
    ("revolute", True, {}),
    ("prismatic", False, {"axis": ("constants", VECTOR)}),
)
"""Types of joints by which routines are named: the name, whether it is revolute, and the input for its axis,
which is z for revolute joints."""

UPPER = np.triu_indices(3)
"""Rows and columns of the upper triangle of a matrix (3, 3)."""

_MASSLESS = RigidInertia(np.asarray(0.0), np.zeros(3), np.zeros((3, 3)))


def outward_inputs(parent: tuple[int, ...], rates: str, axis: Inputs, *, inertia: bool) -> Inputs:
    """Return the inputs of a routine that continues motion from the body's parent, of that shape.

    They are the body's numbers, with its `inertia` or without, and the state of its joint: its position and
    the `rates` v, a.
    """
    return {
        "R": ("constants", MATRIX),
        "p": ("constants", VECTOR),
        **({"inertia": ("constants", INERTIA)} if inertia else {}),
        **dict.fromkeys(("q", *rates), ("vectors", SCALAR)),
        "parent": ("vectors", parent),
        **axis,
    }


def joint_state(mechanism: Mechanism, index: int, q: int, *rates: int) -> tuple[int, ...]:
    """Return the places of a joint's position and rates, from those of q and of vectors of nv."""
    n = len(mechanism.bodies)
    return (q + mechanism.nq - n + index, *(place + mechanism.nv - n + index for place in rates))


def unpack_symmetric(upper: Array) -> Array:
    """Return the symmetric matrix (3, 3) with this upper triangle (6,)."""
    full = np.zeros((3, 3), dtype=upper.dtype)
    full[UPPER] = upper
    return symmetric_from_upper(full)


def pack_inertia(inertia: RigidInertia) -> Array:
    """Return the ten parameters (10,) of an inertia."""
    tensor = [inertia.rotational_inertia[i, j] for i, j in zip(*UPPER, strict=True)]
    return np.array([np.asarray(inertia.mass)[()], *inertia.first_moment, *tensor])


def unpack_inertia(packed: Array) -> RigidInertia:
    """Return the inertia with ten parameters (10,)."""
    return RigidInertia(np.asarray(packed[0]), packed[1:4], unpack_symmetric(packed[4:]))


def body_like(revolute: bool, R: Array, p: Array, axis: Array) -> Body:
    """Return a body with these numbers, for the algorithms that take one."""
    return Body("", ROOT, revolute, R, p, Z_AXIS if revolute else axis, _MASSLESS)


def at(R: Array, p: Array) -> Placement:
    """Return the placement with this pose in the parent."""
    return Placement(R, p, R, None)


def reading(n_inputs: int) -> dict[str, Routine]:
    """Return the routines that copy columns of the inputs to the workspace, four or one at a time."""
    return {
        f"read {width} of {k}": Routine.of(lambda x: {"x": x}, {"x": (k, (width,))}, {"x": "vectors"})
        for k in range(n_inputs)
        for width in (1, 4)
    }


def read_row(table: CallTable, array: int, size: int) -> int:
    """Copy a row of an input to the workspace; return its place."""
    place = table.reserve(size)
    for column in range(0, size - 3, 4):
        table.call(f"read 4 of {array}", column, place + column)
    for column in range(size // 4 * 4, size):
        table.call(f"read 1 of {array}", column, place + column)
    return place


def read_arguments(table: CallTable, mechanism: Mechanism, n: int) -> list[tuple[int, int]]:
    """Copy the first n inputs, q and then vectors of nv, to the workspace; return their places and sizes."""
    sizes = [mechanism.nq, *[mechanism.nv] * (n - 1)]
    return [(read_row(table, array, size), size) for array, size in enumerate(sizes)]


def _place_body(*, revolute: bool) -> Routine:
    def pose(R: Array, p: Array, axis: Array, q: Array) -> dict[str, Array]:
        return {"pose": pack_pose(Placement.of(body_like(revolute, R, p, axis), q))}

    inputs: Inputs = {
        "R": ("constants", MATRIX),
        "p": ("constants", VECTOR),
        "axis": ("constants", VECTOR),
        "q": ("vectors", SCALAR),
    }
    return Routine.of(pose, inputs, {"pose": "vectors"})


POSE = (12,)
"""Shape of a rotation and a position."""


def pack_pose(placement: Placement) -> Array:
    """Return a rotation and a position (12,)."""
    return np.concatenate([placement.R.ravel(), placement.p])


def unpack_pose(pose: Array) -> Placement:
    """Return the placement with a rotation and a position (12,)."""
    return at(pose[:9].reshape(3, 3), pose[9:])


PLACING = {"place revolute": _place_body(revolute=True), "place prismatic": _place_body(revolute=False)}
"""Routines that compute the pose of a body in its parent from the position of its joint."""


def kind(body: Body) -> str:
    """Return the type of a joint, by which routines are named."""
    return "revolute" if body.revolute else "prismatic"


def load_axes(table: CallTable, bodies: Sequence[Body]) -> list[tuple[int, ...]]:
    """Return the operands of routines for the axis of each body's joint: its place, and none for z."""
    return [() if body.revolute else (table.constants(body.axis),) for body in bodies]


def place_bodies(table: CallTable, mechanism: Mechanism, q: int, *, size: int = 12) -> list[int]:
    """Compute the poses of all bodies in their parents from the configuration at `q`; return their places.

    `size` vectors are reserved at each place, of which a pose takes 12.
    """
    places = []
    for index, body in enumerate(mechanism.bodies):
        pose = table.reserve(size)
        R, p, axis = (table.constants(x) for x in (body.R, body.p, body.axis))
        table.call(f"place {kind(body)}", R, p, axis, *joint_state(mechanism, index, q), pose)
        places.append(pose)
    return places


def inertias_in_workspace(table: CallTable, mechanism: Mechanism) -> list[int]:
    """Copy the inertia of the root and of every body to the workspace; return their places."""
    places = []
    for inertia in (mechanism.root, *(body.inertia for body in mechanism.bodies)):
        place = table.reserve(10)
        table.call("load inertia", table.constants(pack_inertia(inertia)), place)
        places.append(place)
    return places


LOADING = {
    "load inertia": Routine.of(lambda x: {"x": x}, {"x": ("constants", INERTIA)}, {"x": "vectors"}),
    "load vector": Routine.of(lambda x: {"x": x}, {"x": ("constants", VECTOR)}, {"x": "vectors"}),
}


def checking(defect: int) -> dict[str, Routine]:
    """Return the routines that compute the defect of the arguments, output number `defect`."""
    found = {
        f"squares of {size}": Routine.of(
            lambda x, total: {"total": total + sum_by_pairs([entry * entry for entry in x])},
            {"x": ("vectors", (size,)), "total": ("vectors", SCALAR)},
            {"total": "vectors"},
        )
        for size in (1, 4)
    }
    found["quaternion"] = Routine.of(
        lambda x, total: {"total": total + quaternion_defect(x)},
        {"x": ("vectors", (4,)), "total": ("vectors", SCALAR)},
        {"total": "vectors"},
    )
    found["zero"] = Routine.of(lambda: {"total": np.asarray(0.0)}, {}, {"total": "vectors"})
    found["magnitude"] = Routine.of(
        lambda x, total: {"total": total + result_defect(x)},
        {"x": ("vectors", (1,)), "total": ("vectors", SCALAR)},
        {"total": "vectors"},
    )
    found["defect"] = Routine.of(
        lambda total: {"defect": total}, {"total": ("vectors", SCALAR)}, {"defect": defect}
    )
    return found


def check_arguments(
    table: CallTable, mechanism: Mechanism, rows: Sequence[tuple[int, int]], results: Sequence[int] = ()
) -> None:
    """Compute the defect of the arguments, whose `rows` (place, size) are in the workspace, q first, and of
    the `results` of an equation at these places."""
    total = table.reserve(1)
    table.call("zero", total)
    for place, size in rows:
        for column in range(0, size - 3, 4):
            table.call("squares of 4", place + column, total, total)
        for column in range(size // 4 * 4, size):
            table.call("squares of 1", place + column, total, total)
    if mechanism.floating:
        table.call("quaternion", rows[0][0] + 3, total, total)
    for place in results:
        table.call("magnitude", place, total, total)
    table.call("defect", total, 0)


MOTION, WRENCH = (9,), (6,)
"""Shapes of a motion (angular velocity, angular acceleration, proper acceleration) and of a wrench."""


def pack_motion(motion: Motion) -> Array:
    """Return a motion (9,)."""
    return np.concatenate([motion.omega, motion.alpha, motion.proper_acceleration])


def unpack_motion(packed: Array) -> Motion:
    """Return the motion in an array (9,)."""
    return Motion(packed[:3], packed[3:6], packed[6:])


def _root_motion(*, floating: bool) -> Callable[..., dict[str, Array]]:
    def motion(gravity: Array, **state: Array) -> dict[str, Array]:
        root = Mechanism("", floating, gravity, _MASSLESS, (), (), None)
        none = np.zeros(0)
        found = root_motion(root, state.get("q", none), state.get("v", none), state.get("a", none))
        return {"motion": pack_motion(found)}

    return motion


FLOATING_ROOT: Inputs = {
    "gravity": ("constants", VECTOR),
    "q": ("vectors", (7,)),
    "v": ("vectors", (6,)),
    "a": ("vectors", (6,)),
}
"""Inputs of a routine that computes the motion of a floating root."""

ROOT_MOTION = {
    "fixed root": Routine.of(
        _root_motion(floating=False), {"gravity": ("constants", VECTOR)}, {"motion": "vectors"}
    ),
    "floating root": Routine.of(_root_motion(floating=True), FLOATING_ROOT, {"motion": "vectors"}),
    "zeros": Routine.of(lambda: {"x": np.zeros(6)}, {}, {"x": "vectors"}),
}
"""Routines that compute the motion of the root, from which gravity is subtracted, and six zeros."""


def compute_root_motion(table: CallTable, mechanism: Mechanism, q: int, v: int, a: int) -> int:
    """Compute the motion of the root from the places of q, v and a; return its place."""
    place, gravity = table.reserve(9), table.constants(mechanism.gravity)
    if mechanism.floating:
        table.call("floating root", gravity, q, v, a, place)
    else:
        table.call("fixed root", gravity, place)
    return place
