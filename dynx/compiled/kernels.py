"""Kernels of quantities: the algorithms of `dynx.rbd`, traced for one robot and compiled.

A kernel has the arguments of its quantity as inputs and two outputs: the result, and a ``defect``. The defect
is below `MAX_DEFECT` exactly if the arguments are finite and not too large, quaternions have unit length, and
a result that could be infinite is finite. So arguments are checked while in the processor's registers.

Mimic joints are part of the traced program: inputs are coordinates of the model. For coordinates of the tree
the mechanism is given without its coupling.

In kernels of frame placements the frames are constants, because most programs use one frame. Kernels of other
quantities of frames are shared by many frames (`dynx.compiled.frames`). The call alone determines the kernel,
so no result depends on earlier calls.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields, replace
from functools import cache, partial
from hashlib import sha256
from math import prod
from typing import Any

import numpy as np

import dynx.backends.quantities
import dynx.compiled.defect
import dynx.compiled.model_coordinates
import dynx.compiled.simplification
import dynx.model.mechanism
import dynx.model.numbers
import dynx.rbd
import dynx.spatial
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.compiled import frames as compiled_frames
from dynx.compiled.defect import argument_defect, result_defect
from dynx.compiled.frames import BodyChain, on_chain
from dynx.compiled.model_coordinates import (
    argument_shapes,
    reduce_columns,
    reduce_rows,
    tree_coordinates,
)
from dynx.compiled.table_kernels import TABLE_QUANTITIES
from dynx.model import Mechanism
from dynx.rbd import coriolis
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.kinematics import Poses, ancestry, frame_placement
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.cache import load_kernel, source_version
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array

MAX_COMPILE_SECONDS = 7.0
"""Longest predicted time of a compilation (`compile_seconds`). Quantities that would take longer are
evaluated by routines or by NumPy."""

MAX_SECONDS_BESIDE_ROUTINES = 3.0
"""Longest predicted time of a compilation of a matrix that routines can evaluate instead: they are half as
fast, but need no compilation for the robot."""

UNOPTIMISED_SHARE = 0.5
"""Largest share of the predicted time that a long program takes, because it is not optimised
(`dynx.simd.emit`). It counts for quantities without routines, which NumPy would have to evaluate."""

SECONDS_OF_OPERATION, SECONDS_OF_RESULT = 1.5e-4, 3e-4
"""Time to trace and compile an operation, and to compile the store of a number of the result."""

OPERATIONS_OF_BODY = {"forward_dynamics": 460, "mass_matrix": 150, "coriolis_matrix": 350}
"""Operations for each body of some quantities; 250 of all others."""

OPERATIONS_OF_LINK = {"joint_wrenches": 350, "base_wrench": 320}
"""Operations for each link of quantities that count links one by one."""

SEGMENT_OF_CUBIC_CODE = 600
"""Length of the segments (`dynx.simd.emit`) of code that grows with the cube of the number of joints.
Shorter segments save a third of the compile time and cost at most an eighth of the speed."""

ON_CHAINS = frozenset({"jacobian", "jacobian_derivative", "frame_velocity", "frame_acceleration"})
"""Quantities whose kernels serve many frames."""

Computation = Callable[..., Array]


def _all_placements(mechanism: Mechanism, poses: Poses, *frames: int) -> Array:
    """Return T_world_frame (..., n, 4, 4) of n frames."""
    found = [frame_placement(mechanism, poses, frame) for frame in frames]
    shape = np.broadcast_shapes(*(T.shape for T in found))
    return np.stack([np.broadcast_to(T, shape) for T in found], axis=-3) if found else np.zeros((0, 4, 4))


_PLACEMENT = QUANTITIES["forward_kinematics"]
_PLACEMENTS = {
    "frame_placement": _PLACEMENT,
    "frame_placements": replace(_PLACEMENT, algorithm=_all_placements, shape=("n_frames", 4, 4)),
}
"""Entries of forward kinematics for one frame and for several, by the names of their hooks."""

_WITH_BASE_PARAMETERS = frozenset({"inverse_dynamics", "bias_torque", "gravity_torque"})
"""Quantities that take fewer operations when they are computed from the base inertial parameters."""


def kernel_quantity(name: str) -> Quantity:
    """Return the table's entry for a quantity, by the name of its hook without the underscore."""
    return _PLACEMENTS.get(name) or QUANTITIES[name]


def compile_seconds(mechanism: Mechanism, name: str) -> float:
    """Return about how long it takes to trace and compile a quantity [s], on an AMD EPYC (Zen 3)."""
    operations, results = code_size(mechanism, name)
    return SECONDS_OF_OPERATION * operations + SECONDS_OF_RESULT * results


def code_size(mechanism: Mechanism, name: str) -> tuple[float, int]:
    """Return an upper estimate of the operations of a quantity's program, and its number of results."""
    quantity, bodies = kernel_quantity(name), len(mechanism.bodies)
    base = 6 if mechanism.floating else 0
    pairs = sum(len(ancestry(mechanism, body)) + base for body in range(bodies))
    frames = len(mechanism.frames)
    extents = {
        "nv": mechanism.nv,
        "10 n_links": 10 * frames,
        "n_frames": frames,
        "n_joints": len(mechanism.links) - 1,
    }
    results = prod(n if isinstance(n, int) else extents[n] for n in quantity.shape)
    operations, dense = 300.0 + OPERATIONS_OF_BODY.get(name, 250) * bodies, _pose_density(mechanism)
    if name in OPERATIONS_OF_LINK:
        operations = 300.0 + OPERATIONS_OF_LINK[name] * len(mechanism.links)
    if name == "frame_placements":
        operations += 60 * frames
    if quantity.growth == "cubic":
        operations += dense * 170 * frames * pairs / max(1, bodies)
    elif quantity.growth == "pairs" or (quantity.solves and mechanism.coupling is not None):
        operations += dense * (110 if name == "coriolis_matrix" else 45) * pairs
    if quantity.solves and mechanism.coupling is not None:
        operations += mechanism.nv**3 / 3
    return operations, results


def _pose_density(mechanism: Mechanism) -> float:
    """Return the share of the poses' numbers that are not zero: operations with zeros are not compiled."""
    numbers = [x for body in mechanism.bodies for x in (body.R, body.p)]
    return sum(np.count_nonzero(x) for x in numbers) / max(1, sum(x.size for x in numbers))


def compiles(mechanism: Mechanism, name: str) -> bool:
    """Check whether a quantity of this mechanism is compiled, rather than evaluated by routines that are
    compiled for all robots (`dynx.compiled.table_loops`) or by NumPy."""
    has_routines = routines_evaluate(mechanism, name)
    matrix = has_routines and kernel_quantity(name).growth != "joints"
    limit = MAX_SECONDS_BESIDE_ROUTINES if matrix else MAX_COMPILE_SECONDS
    if not has_routines:
        limit /= UNOPTIMISED_SHARE
    return compile_seconds(mechanism, name) <= limit


def routines_evaluate(mechanism: Mechanism, name: str) -> bool:
    """Check whether routines can evaluate a quantity: they solve no equations that mimic joints reduce, and
    have no ball joints."""
    if mechanism.balls or name not in TABLE_QUANTITIES:
        return False
    return not (kernel_quantity(name).solves and mechanism.coupling is not None)


def evaluate_quantity(
    mechanism: Mechanism, name: str, details: tuple[Any, ...], q: Array, *rates: Array
) -> Array:
    """Evaluate a quantity on arrays (..., nq) and (..., nv) of numbers or of symbols.

    They are in the coordinates of the model; for a mechanism without coupling those are its own.
    """
    quantity = kernel_quantity(name)
    if quantity.solves and mechanism.coupling is not None:
        # With mimic joints the reduced equations are not those of a tree.
        v, tau = rates
        M = evaluate_quantity(mechanism, "mass_matrix", (), q)
        return np.asarray(
            solve_positive_definite(M, tau - evaluate_quantity(mechanism, "bias_torque", (), q, v))
        )

    def in_tree(q: Array, *rates: Array) -> Array:
        if name == "coriolis_matrix":
            return coriolis.coriolis_matrix_at(mechanism, q, *rates)
        numbers = regroup_inertias(mechanism) if name in _WITH_BASE_PARAMETERS else mechanism
        return quantity.evaluate(numbers, q, *rates, *details)

    return _reduced(mechanism, quantity, in_tree, q, *rates)


def _reduced(
    mechanism: Mechanism, quantity: Quantity, in_tree: Computation, q: Array, *rates: Array
) -> Array:
    """Evaluate `in_tree`, which computes a quantity in tree coordinates, in those of the model."""
    result = in_tree(*tree_coordinates(mechanism, q, *rates))
    if quantity.reduces_columns:
        result = reduce_columns(mechanism, result)
    return np.asarray(reduce_rows(mechanism, result) if quantity.reduces_rows else result)


def quantity_kernel(mechanism: Mechanism, name: str, details: tuple[Any, ...]) -> Kernel:
    """Return the kernel of a quantity, from the cache if it was compiled before."""

    def result(q: Array, *rates: Array) -> Array:
        return evaluate_quantity(mechanism, name, details, q, *rates)

    recipe = _recipe(mechanism, name, details)
    lanes = host().lanes
    cubic = kernel_quantity(name).growth == "cubic"
    settings = Settings(lanes, segment=SEGMENT_OF_CUBIC_CODE) if cubic else Settings(lanes)
    return load_kernel(recipe, lambda: _program(mechanism, name, result), settings=settings)


def chain_kernel(mechanism: Mechanism, name: str, chain: BodyChain) -> Kernel:
    """Return the kernel of a quantity for the frames of a chain; its last input is the place of one."""

    def result(q: Array, *rates_and_place: Array) -> Array:
        *rates, place = rates_and_place
        in_tree = partial(on_chain, mechanism, name, chain, place)
        return _reduced(mechanism, kernel_quantity(name), in_tree, q, *rates)

    recipe = _recipe(mechanism, name, chain)
    return load_kernel(recipe, lambda: _program(mechanism, name, result, place=(chain.place_size,)))


def _recipe(mechanism: Mechanism, name: str, details: object) -> bytes:
    return repr((_algorithms(), _fingerprint(mechanism), name, details)).encode()


def _program(mechanism: Mechanism, name: str, result: Computation, **more: tuple[int, ...]) -> Program:
    """Return the program of `result`, whose inputs are the quantity's arguments and the inputs `more`,
    which are not checked."""
    quantity = kernel_quantity(name)

    def result_and_defect(**inputs: Array) -> dict[str, Array]:
        found = result(*inputs.values())
        defect = argument_defect(mechanism, *(inputs[argument] for argument in quantity.arguments))
        if quantity.solves:
            defect = defect + result_defect(found)
        return {"result": found, "defect": defect}

    return trace(result_and_defect, {**argument_shapes(mechanism, quantity.arguments), **more})


@cache
def _algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    return source_version(
        dynx.rbd,
        dynx.spatial,
        dynx.model.numbers,
        dynx.model.mechanism,
        dynx.backends.quantities,
        dynx.compiled.defect,
        dynx.compiled.model_coordinates,
        dynx.compiled.simplification,
        compiled_frames,
        sys.modules[__name__],
    )


def _fingerprint(mechanism: Mechanism) -> str:
    """Return the hash of every field of a mechanism, numbers to the last bit."""
    digest = sha256()

    def feed(value: Any) -> None:
        if isinstance(value, (np.ndarray, np.generic)):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(value.tobytes())
        elif isinstance(value, (bool, int, float, str)) or value is None:
            digest.update(f"{type(value).__name__} {value!r};".encode())
        elif isinstance(value, tuple):
            digest.update(b"(%d" % len(value))
            for each in value:
                feed(each)
        else:
            # A field of another kind raises here, so that none is left out.
            for field in fields(value):
                feed(getattr(value, field.name))

    feed(mechanism)
    return digest.hexdigest()
