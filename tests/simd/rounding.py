"""How far rounding may take a program's results from those in real arithmetic.

Running error analysis (Higham, Accuracy and Stability of Numerical Algorithms, section 3.3): every
operation adds half a unit in the last place of its result to what its arguments bring along.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.simd.interp import interpret
from dynx.simd.program import Port, Program
from dynx.spatial.scalar import Floats

UNIT = 2.0**-53
TINY = 2.0**-1074
SINE = 4 * UNIT
"""Two units in the last place."""


def bounds(program: Program, inputs: Sequence[Floats], *, any_order: bool = False) -> list[Floats]:
    """For every output (n, port size), the largest error; infinite where there is no bound.

    A constant may itself be the rounded result of one operation. With `any_order` sums may be taken in
    another order than the program's, as NumPy does: all terms count with their sizes.
    """
    everything = Port("all", (len(program.nodes),))
    whole = Program(program.nodes, program.inputs, (everything,), tuple(range(len(program.nodes))))
    values = interpret(whole, inputs)[0].T
    found: list[Floats] = []
    sizes: list[Floats] = []
    with np.errstate(all="ignore"):
        for node, value in zip(program.nodes, values, strict=True):
            e, s = [found[arg] for arg in node.args], [sizes[arg] for arg in node.args]
            size = np.abs(value)
            if any_order and node.op in ("add", "sub"):
                size = s[0] + s[1]
            elif any_order and node.op == "mul":
                size = s[0] * s[1]
            elif any_order and node.op == "div":
                size = s[0] / np.abs(values[node.args[1]])
            elif any_order and node.op == "neg":
                size = s[0]
            fresh = UNIT * size + TINY
            error: Floats
            if node.op == "input":
                error = np.zeros_like(value)
            elif node.op == "constant":
                error = fresh
            elif node.op in ("add", "sub"):
                error = e[0] + e[1] + fresh
            elif node.op == "mul":
                error = s[0] * e[1] + s[1] * e[0] + e[0] * e[1] + fresh
            elif node.op == "div":
                divisor = np.abs(values[node.args[1]])
                error = (e[0] + size * e[1]) / np.maximum(divisor - e[1], 0.0) + fresh
            elif node.op == "sqrt":
                error = e[0] / (np.sqrt(values[node.args[0]] - e[0]) + value) + fresh
            elif node.op in ("sin", "cos"):
                error = e[0] + SINE
            elif node.op in ("tanh", "arctan"):
                # Their slopes are at most 1.
                error = e[0] + 4 * fresh
            elif node.op == "exp":
                error = size * np.expm1(e[0]) + 4 * fresh
            else:
                error = np.maximum.reduce(e)
            # To second order in UNIT, and where anything overflows there is no bound.
            found.append(np.where(np.isfinite(value) & np.isfinite(error), error * (1.0 + 1e-12), np.inf))
            sizes.append(size)
    outputs, first = [], 0
    for port in program.outputs:
        errors = [found[result] for result in program.results[first : first + port.size]]
        outputs.append(np.stack(errors, axis=-1) if errors else np.empty((len(inputs[0]), 0)))
        first += port.size
    return outputs


def agree(a: Floats, b: Floats, *errors: Floats) -> bool:
    """Whether a and b are no further apart than the sum of their errors allows, where it is finite."""
    room = np.asarray(sum(errors))
    known = np.isfinite(room)
    return bool(np.all(np.abs(a[known] - b[known]) <= room[known]))
