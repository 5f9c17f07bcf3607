"""What a program means: it is evaluated operation by operation with NumPy.

This is the oracle of the compiler, not a fast way to run anything. Its operations are those that
`Graph` documents; its sine and cosine are the C library's, and like its other elementary functions, which
are NumPy's, they can be given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dynx.simd.expr import Op
from dynx.simd.program import Program
from dynx.spatial.scalar import Floats

Function = Callable[[Floats], Floats]


def _each(function: Callable[[float], float]) -> Function:
    """A function of the C library, one number after the other. NaN where it is not defined."""

    def one(x: float) -> float:
        return function(x) if math.isfinite(x) else math.nan

    return lambda x: np.array([one(entry) for entry in x.tolist()])


sine: Final[Function] = _each(math.sin)
cosine: Final[Function] = _each(math.cos)


def _chosen(first: NDArray[np.bool_], a: Floats, b: Floats) -> Floats:
    return np.where(first, a, b)


_MEANING: dict[Op, Callable[..., Floats]] = {
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
    # Not NumPy's: the second one if either is NaN, and of two zeros the second.
    "min": lambda a, b: _chosen(a < b, a, b),
    "max": lambda a, b: _chosen(a > b, a, b),
}


def interpret(
    program: Program, inputs: Sequence[Floats], functions: Mapping[Op, Function] | None = None
) -> list[Floats]:
    """The outputs (n, port size) for the inputs (n, port size), port after port.

    `functions` take the place of elementary functions, by the name of the operation.
    """
    n = len(inputs[0]) if inputs else 1
    columns = [array[:, column] for array in inputs for column in range(array.shape[1])]
    meaning = {**_MEANING, **(functions or {})}
    values: list[Floats] = []
    with np.errstate(all="ignore"):
        for node in program.nodes:
            if node.op == "input":
                values.append(columns[node.slot])
            elif node.op == "constant":
                values.append(np.full(n, node.value))
            else:
                values.append(meaning[node.op](*(values[arg] for arg in node.args)))
    outputs, first = [], 0
    for port in program.outputs:
        out = np.empty((n, port.size))
        for column in range(port.size):
            out[:, column] = values[program.results[first + column]]
        outputs.append(out)
        first += port.size
    return outputs
