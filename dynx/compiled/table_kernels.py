"""Kernels of large robots: algorithms of `dynx.rbd` as calls of routines (`dynx.compiled.table_loops`).

The first calls of a table copy the arguments to the workspace and compute their defect
(`dynx.compiled.defect`). The routines are those of two robots that stand for all: both have every type of
joint, one has a floating base.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np

import dynx.compiled.defect
import dynx.compiled.table_loops
import dynx.model.mechanism
import dynx.model.numbers
import dynx.rbd
import dynx.spatial
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.defect import quaternion_defect, result_defect, sum_by_pairs
from dynx.compiled.model_coordinates import argument_shapes
from dynx.compiled.table_loops import MASSLESS, ArgumentRow, StepRoutines, TableLoops
from dynx.model.mechanism import ROOT, Body, BodyFrame, Mechanism
from dynx.rbd import aba, coriolis, crba, derivatives, regressor, rnea
from dynx.simd.cache import source_version
from dynx.simd.call_table import CallTable, RoutineCode, TableKernel, load_routines
from dynx.simd.program import Port
from dynx.simd.routines import Routine, RoutineSet


@dataclass(frozen=True)
class _TableAlgorithm:
    """An algorithm of tree coordinates that takes `Loops`, and its results."""

    function: Callable[..., Any]
    arguments: str
    results: tuple[str, ...] = ("result", "defect")
    """Names of the results; the arguments are checked if the last is their defect."""
    sparse: bool = False
    """True if not every entry of a result is written."""
    solves: bool = False

    @property
    def matrices(self) -> tuple[int, ...]:
        """Numbers of the arrays that must be zero at first."""
        n = len(self.results) - self.checks
        return tuple(range(len(self.arguments), len(self.arguments) + n)) if self.sparse else ()

    @property
    def checks(self) -> bool:
        """True if the defect of the arguments is computed."""
        return self.results[-1] == "defect"

    @property
    def n_arrays(self) -> int:
        """Number of arguments and results."""
        return len(self.arguments) + len(self.results)


_DERIVATIVES = "derivatives of inverse dynamics"
_MATRICES_OF_DERIVATIVES = "dtau_dq", "dtau_dv", "dtau_da"
_ALGORITHMS = {
    "mass_matrix": _TableAlgorithm(crba.mass_matrix, "q", sparse=True),
    "coriolis_matrix": _TableAlgorithm(coriolis.coriolis_matrix_at, "qv", sparse=True),
    "inverse_dynamics": _TableAlgorithm(rnea.inverse_dynamics, "qva"),
    "bias_torque": _TableAlgorithm(rnea.bias_torque, "qv"),
    "gravity_torque": _TableAlgorithm(rnea.gravity_torque, "q"),
    "forward_dynamics": _TableAlgorithm(aba.forward_dynamics, "qvt", solves=True),
    "inertial_regressor": _TableAlgorithm(regressor.inertial_regressor_at, "qva", sparse=True),
    _DERIVATIVES: _TableAlgorithm(
        derivatives.inverse_dynamics_derivatives, "qva", _MATRICES_OF_DERIVATIVES, sparse=True
    ),
}

TABLE_QUANTITIES = frozenset(_ALGORITHMS) - {_DERIVATIVES}
"""Quantities that are available as calls of routines."""


def table_kernel(mechanism: Mechanism, name: str, details: tuple[Any, ...]) -> TableKernel:
    """Return the kernel of a quantity in tree coordinates; the outputs are the result and the defect."""
    quantity = QUANTITIES[name]
    extents = {"nv": mechanism.nv, "10 n_links": 10 * len(details[0]) if details else 0}
    shape = tuple(extents[str(extent)] for extent in quantity.shape)
    return _kernel(mechanism, name, quantity.arguments, (shape, (1,)), details)


def derivatives_kernel(mechanism: Mechanism) -> TableKernel:
    """Return the kernel of q, v and a with the outputs dtau_dq, dtau_dv and dtau_da, in tree coordinates."""
    return _kernel(mechanism, _DERIVATIVES, "qva", ((mechanism.nv, mechanism.nv),) * 3)


def _kernel(
    mechanism: Mechanism,
    name: str,
    arguments: Sequence[str],
    shapes: tuple[tuple[int, ...], ...],
    details: tuple[Any, ...] = (),
) -> TableKernel:
    algorithm, code = _ALGORITHMS[name], _code(name)
    table = CallTable(code.routines)
    _run(algorithm, mechanism, code.steps, table, details)
    inputs = [Port(*port) for port in argument_shapes(mechanism, arguments).items()]
    outputs = [Port(*port) for port in zip(algorithm.results, shapes, strict=True)]
    return TableKernel(table, inputs, outputs, code.machine_code)


class _AlgorithmCode(NamedTuple):
    """Routines of an algorithm and their machine code, which all robots of the process share."""

    steps: StepRoutines
    routines: RoutineSet
    machine_code: RoutineCode


@cache
def _code(name: str) -> _AlgorithmCode:
    algorithm = _ALGORITHMS[name]
    n = len(algorithm.arguments)
    steps = StepRoutines(_reading(n) | (_checking(algorithm.n_arrays - 1) if algorithm.checks else {}))
    for floating in (False, True):
        mechanism = _every_joint_type(floating)
        details = (range(len(mechanism.frames)),) if name == "inertial_regressor" else ()
        _run(algorithm, mechanism, steps, None, details)
    steps.complete = True
    routines = RoutineSet(steps.routines, algorithm.n_arrays, algorithm.matrices)
    return _AlgorithmCode(steps, routines, load_routines(f"{name} {_sources()}".encode(), routines))


@cache
def _sources() -> str:
    """Return the hash of the source of everything that is traced."""
    modules = (dynx.model.numbers, dynx.model.mechanism, dynx.compiled.defect)
    loops = dynx.compiled.table_loops
    return source_version(dynx.rbd, dynx.spatial, loops, *modules, sys.modules[__name__])


def _every_joint_type(floating: bool) -> Mechanism:
    """Return a robot with a joint of each type in the place of a starting joint and of its ancestor."""
    body = partial(Body, R=np.eye(3), p=np.zeros(3), axis=np.array([0, 0, 1]), inertia=MASSLESS)
    bodies = tuple(body(joint="", parent=k - 1, revolute=k != 1) for k in range(3))
    frames = tuple(BodyFrame("", k, np.eye(3), np.zeros(3)) for k in range(ROOT, 3))
    return Mechanism("", floating, np.zeros(3), MASSLESS, bodies, frames, None)


def _run(
    algorithm: _TableAlgorithm,
    mechanism: Mechanism,
    steps: StepRoutines,
    table: CallTable | None,
    details: tuple[Any, ...],
) -> None:
    """Make the calls of a robot; without a table only the routines."""
    loops = TableLoops(mechanism, steps, table, len(algorithm.arguments), keeps_solution=algorithm.solves)
    sizes = [mechanism.nq, *[mechanism.nv] * (len(algorithm.arguments) - 1)]
    rows = [_read_row(loops, array, size) for array, size in enumerate(sizes)]
    if algorithm.checks and not algorithm.solves:
        _check(loops, rows)
    algorithm.function(mechanism, *rows, *details, loops=loops)
    if algorithm.solves:
        _check(loops, rows)
    loops.append_calls()


# -- arguments --------------------------------------------------------------------------------------


def _reading(n_inputs: int) -> dict[str, Routine]:
    """Return the routines that copy columns of the inputs to the workspace, four or one at a time."""
    return {
        f"read {width} of {k}": Routine.of(lambda x: {"x": x}, {"x": (k, (width,))}, {"x": "vectors"})
        for k in range(n_inputs)
        for width in (1, 4)
    }


def _read_row(loops: TableLoops, array: int, size: int) -> ArgumentRow:
    """Copy a row of an input to the workspace."""
    row = ArgumentRow(loops.table.reserve(size), size)
    for column, width in _runs(size):
        loops.call(f"read {width} of {array}", column, row.place + column)
    return row


def _runs(size: int) -> list[tuple[int, int]]:
    """Divide a row into runs of four columns, and single ones at the end: first columns and widths."""
    whole = size // 4 * 4
    return [*((column, 4) for column in range(0, whole, 4)), *((column, 1) for column in range(whole, size))]


def _checking(defect: int) -> dict[str, Routine]:
    """Return the routines that compute the defect of the arguments, output number `defect`."""
    found = {
        f"squares of {size}": Routine.of(
            lambda x, total: {"total": total + sum_by_pairs([entry * entry for entry in x])},
            {"x": ("vectors", (size,)), "total": ("vectors", ())},
            {"total": "vectors"},
        )
        for size in (1, 4)
    }
    for name, function, size in (("quaternion", quaternion_defect, 4), ("magnitude", result_defect, 1)):
        found[name] = Routine.of(
            lambda x, total, function=function: {"total": total + function(x)},
            {"x": ("vectors", (size,)), "total": ("vectors", ())},
            {"total": "vectors"},
        )
    found["zero"] = Routine.of(lambda: {"total": np.asarray(0.0)}, {}, {"total": "vectors"})
    found["defect"] = Routine.of(
        lambda total: {"defect": total}, {"total": ("vectors", ())}, {"defect": defect}
    )
    return found


def _check(loops: TableLoops, rows: Sequence[ArgumentRow]) -> None:
    """Compute the defect of the arguments, q first, and of the solution of an equation."""
    total = loops.table.reserve(1)
    loops.call("zero", total)
    for row in rows:
        for column, width in _runs(row.shape[0]):
            loops.call(f"squares of {width}", row.place + column, total, total)
    if loops.mechanism.floating:
        loops.call("quaternion", rows[0].place + 3, total, total)
    for place in loops.solution:
        loops.call("magnitude", place, total, total)
    loops.call("defect", total, 0)
