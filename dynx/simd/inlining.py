"""Evaluation of a finished program on arrays of symbols, within another trace, or on arrays of numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.simd.program import Program, scalar_ranges
from dynx.spatial.scalar import (
    Array,
    arctan,
    cos,
    equal,
    exp,
    less,
    less_equal,
    maximum,
    minimum,
    select,
    sin,
    sqrt,
    tanh,
)


def inline(program: Program, inputs: Mapping[str, Array]) -> dict[str, Array]:
    """Return the outputs of `program` by name, given one array for every input.

    The arrays hold symbols of one trace, plain numbers, or both; operations on numbers alone are computed
    at once. Arrays of mpmath's numbers are evaluated in its precision. Outputs have their ports' shapes.
    """
    slots = [entry for port in program.inputs for entry in np.asarray(inputs[port.name]).ravel().tolist()]
    values: list[Any] = []
    for node in program.nodes:
        if node.op == "input":
            values.append(slots[node.slot])
        elif node.op == "constant":
            values.append(node.value)
        else:
            values.append(_OPERATIONS[node.op](*(values[arg] for arg in node.args)))
    outputs = {}
    for port, scalars in scalar_ranges(program.outputs):
        entries = np.empty(port.size, dtype=object)
        entries[:] = [values[program.results[k]] for k in scalars]
        outputs[port.name] = entries.reshape(port.shape)
    return outputs


def _elementary(function: Callable[[Array], Array]) -> Callable[[Any], Any]:
    def evaluate(x: Any) -> Any:
        entry = np.empty((), dtype=object)
        entry[()] = x
        return function(entry)[()]

    return evaluate


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "neg": lambda a: -a,
    "abs": abs,
    "sqrt": _elementary(sqrt),
    "sin": _elementary(sin),
    "cos": _elementary(cos),
    "exp": _elementary(exp),
    "tanh": _elementary(tanh),
    "arctan": _elementary(arctan),
    "min": minimum,
    "max": maximum,
    "less": less,
    "less_equal": less_equal,
    "equal": equal,
    "select": select,
}
