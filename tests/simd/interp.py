"""Reference interpreter: evaluates a program operation by operation with NumPy.

It defines the semantics against which compiled kernels are tested, and is slow. Its operations are those that
`Graph` documents. Sine and cosine come from the C library, the other elementary functions from NumPy; the
caller may replace them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dynx.simd.expr import Op
from dynx.simd.program import Program, scalar_ranges
from dynx.spatial.scalar import Floats

Function = Callable[[Floats], Floats]


def _map_scalars(function: Callable[[float], float]) -> Function:
    """Apply a function of the C library to each element; the result is NaN for an infinite argument."""

    def evaluate(x: float) -> float:
        return function(x) if math.isfinite(x) else math.nan

    return lambda x: np.array([evaluate(entry) for entry in x.tolist()])


sine: Final[Function] = _map_scalars(math.sin)
cosine: Final[Function] = _map_scalars(math.cos)


def _select(first: NDArray[np.bool_], a: Floats, b: Floats) -> Floats:
    return np.where(first, a, b)


_OPERATIONS: dict[Op, Callable[..., Floats]] = {
    "add": np.add,
    "sub": np.subtract,
    "mul": np.multiply,
    "div": np.divide,
    "neg": np.negative,
    "abs": np.abs,
    "sqrt": np.sqrt,
    "sin": sine,
    "cos": cosine,
    "exp": np.exp,
    "tanh": np.tanh,
    "arctan": np.arctan,
    # Unlike NumPy's, these return the second argument if either is NaN, or if both are zero.
    "min": lambda a, b: _select(a < b, a, b),
    "max": lambda a, b: _select(a > b, a, b),
    "less": lambda a, b: _select(a < b, np.ones_like(a), np.zeros_like(a)),
    "less_equal": lambda a, b: _select(a <= b, np.ones_like(a), np.zeros_like(a)),
    "equal": lambda a, b: _select(a == b, np.ones_like(a), np.zeros_like(a)),
    "select": lambda c, a, b: _select(c != 0.0, a, b),
}


def interpret(
    program: Program, inputs: Sequence[Floats], functions: Mapping[Op, Function] | None = None
) -> list[Floats]:
    """Evaluate a program: return the outputs (n, port size) for the inputs (n, port size), port by port.

    `functions` replace elementary functions, by the name of the operation.
    """
    n = len(inputs[0]) if inputs else 1
    columns = [array[:, column] for array in inputs for column in range(array.shape[1])]
    operations = {**_OPERATIONS, **(functions or {})}
    values: list[Floats] = []
    with np.errstate(all="ignore"):
        for node in program.nodes:
            if node.op == "input":
                values.append(columns[node.slot])
            elif node.op == "constant":
                values.append(np.full(n, node.value))
            else:
                values.append(operations[node.op](*(values[arg] for arg in node.args)))
    outputs = []
    for port, scalars in scalar_ranges(program.outputs):
        out = np.empty((n, port.size))
        for column, k in enumerate(scalars):
            out[:, column] = values[program.results[k]]
        outputs.append(out)
    return outputs
