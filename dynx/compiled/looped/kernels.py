"""Kernels of large robots: quantities as calls of routines that are compiled once for all robots.

The code of a matrix of a large robot is too long to compile, and reading it from memory would take longer
than computing. Routines loop over the joints instead, and every robot is only a table of their calls.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any, NamedTuple

import dynx.compiled.defect
import dynx.compiled.looped
import dynx.model.mechanism
import dynx.model.numbers
import dynx.rbd
import dynx.spatial
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.looped import (
    coriolis_matrix,
    forward_dynamics,
    inertial_regressor,
    inverse_dynamics,
    inverse_dynamics_derivatives,
    mass_matrix,
)
from dynx.compiled.model_coordinates import argument_shapes
from dynx.model import Mechanism
from dynx.simd.cache import load_routines, source_version
from dynx.simd.call_table import CallTable, RoutineCode, TableKernel
from dynx.simd.program import Port
from dynx.simd.routines import RoutineSet


class _Looped(NamedTuple):
    """Routines of a quantity, and the function that makes the table of a mechanism from them and the details
    of the quantity."""

    routines: Callable[[], RoutineSet]
    call_table: Callable[..., CallTable]


_LOOPED = {
    "mass_matrix": _Looped(mass_matrix.routines, mass_matrix.call_table),
    "coriolis_matrix": _Looped(coriolis_matrix.routines, coriolis_matrix.call_table),
    "inverse_dynamics": _Looped(partial(inverse_dynamics.routines, 3), inverse_dynamics.call_table),
    "bias_torque": _Looped(partial(inverse_dynamics.routines, 2), inverse_dynamics.call_table),
    "gravity_torque": _Looped(partial(inverse_dynamics.routines, 1), inverse_dynamics.call_table),
    "forward_dynamics": _Looped(forward_dynamics.routines, forward_dynamics.call_table),
    "inertial_regressor": _Looped(inertial_regressor.routines, inertial_regressor.call_table),
}

LOOPED = frozenset(_LOOPED)
"""Quantities that are available as calls of routines."""

_DERIVATIVES = "derivatives of inverse dynamics"
_ALL = {
    **_LOOPED,
    _DERIVATIVES: _Looped(inverse_dynamics_derivatives.routines, inverse_dynamics_derivatives.call_table),
}


def looped_kernel(mechanism: Mechanism, name: str, details: tuple[Any, ...]) -> TableKernel:
    """Return the kernel of a quantity in tree coordinates; the outputs are the result and the defect."""
    routines, code = _code(name)
    table = _LOOPED[name].call_table(mechanism, routines, *details)
    quantity = QUANTITIES[name]
    inputs = [Port(*port) for port in argument_shapes(mechanism, quantity.arguments).items()]
    extents = {"nv": mechanism.nv, "10 n_links": 10 * len(details[0]) if details else 0}
    shape = tuple(extents[str(extent)] for extent in quantity.shape)
    return TableKernel(table, inputs, [Port("result", shape), Port("defect", (1,))], code)


def looped_derivatives(mechanism: Mechanism) -> TableKernel:
    """Return the kernel of q, v and a with the outputs dtau_dq, dtau_dv and dtau_da, in tree coordinates."""
    routines, code = _code(_DERIVATIVES)
    table = inverse_dynamics_derivatives.call_table(mechanism, routines)
    inputs = [Port(*port) for port in argument_shapes(mechanism, "qva").items()]
    shape = (mechanism.nv, mechanism.nv)
    return TableKernel(table, inputs, [Port(name, shape) for name in ("dtau_dq", "dtau_dv", "dtau_da")], code)


@cache
def _code(name: str) -> tuple[RoutineSet, RoutineCode]:
    """Return the routines of a quantity and their machine code, which all robots of the process share."""
    routines = _ALL[name].routines()
    return routines, load_routines(f"{name} {_algorithms()}".encode(), routines)


@cache
def _algorithms() -> str:
    """Return the hash of the source of everything that is traced."""
    modules = (dynx.model.numbers, dynx.model.mechanism, dynx.compiled.defect)
    return source_version(dynx.rbd, dynx.spatial, dynx.compiled.looped, *modules)
