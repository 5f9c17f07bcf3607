"""Bounds on the rounding errors of a program's results.

Running error analysis (Higham, Accuracy and Stability of Numerical Algorithms, section 3.3): every
operation adds half a unit in the last place of its result to the propagated errors of its arguments.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.simd.program import Port, Program
from dynx.spatial.scalar import Floats
from tests.simd.interp import interpret

UNIT = 2.0**-53
TINY = 2.0**-1074
SINE_ERROR = 4 * UNIT
"""Error bound of sine and cosine: two units in the last place."""


def bounds(program: Program, inputs: Sequence[Floats], *, any_order: bool = False) -> list[Floats]:
    """Return a bound on the error of every output (n, port magnitude), infinite where there is none.

    A constant may itself be the rounded result of one operation. With `any_order` sums may be taken in
    another order than the program's, as NumPy does: all terms count with their magnitudes.
    """
    everything = Port("all", (len(program.nodes),))
    whole = Program(program.nodes, program.inputs, (everything,), tuple(range(len(program.nodes))))
    values = interpret(whole, inputs)[0].T
    found: list[Floats] = []
    magnitudes: list[Floats] = []
    with np.errstate(all="ignore"):
        for node, value in zip(program.nodes, values, strict=True):
            e, s = [found[arg] for arg in node.args], [magnitudes[arg] for arg in node.args]
            magnitude = np.abs(value)
            if any_order and node.op in ("add", "sub"):
                magnitude = s[0] + s[1]
            elif any_order and node.op == "mul":
                magnitude = s[0] * s[1]
            elif any_order and node.op == "div":
                magnitude = s[0] / np.abs(values[node.args[1]])
            elif any_order and node.op == "neg":
                magnitude = s[0]
            own_error = UNIT * magnitude + TINY
            error: Floats
            if node.op == "input":
                error = np.zeros_like(value)
            elif node.op == "constant":
                error = own_error
            elif node.op in ("add", "sub"):
                error = e[0] + e[1] + own_error
            elif node.op == "mul":
                error = s[0] * e[1] + s[1] * e[0] + e[0] * e[1] + own_error
            elif node.op == "div":
                divisor = np.abs(values[node.args[1]])
                error = (e[0] + magnitude * e[1]) / np.maximum(divisor - e[1], 0.0) + own_error
            elif node.op == "sqrt":
                error = e[0] / (np.sqrt(values[node.args[0]] - e[0]) + value) + own_error
            elif node.op in ("sin", "cos"):
                error = e[0] + SINE_ERROR
            elif node.op in ("tanh", "arctan"):
                # Their slopes are at most 1.
                error = e[0] + 4 * own_error
            elif node.op == "exp":
                error = magnitude * np.expm1(e[0]) + 4 * own_error
            else:
                error = np.maximum.reduce(e)
            # The factor covers terms of second order in UNIT; overflow has no bound.
            found.append(np.where(np.isfinite(value) & np.isfinite(error), error * (1.0 + 1e-12), np.inf))
            magnitudes.append(magnitude)
    outputs, first = [], 0
    for port in program.outputs:
        errors = [found[result] for result in program.results[first : first + port.size]]
        outputs.append(np.stack(errors, axis=-1) if errors else np.empty((len(inputs[0]), 0)))
        first += port.size
    return outputs


def agree(a: Floats, b: Floats, *errors: Floats) -> bool:
    """Return whether a and b differ by at most the sum of their error bounds, where it is finite."""
    bound = np.asarray(sum(errors))
    known = np.isfinite(bound)
    return bool(np.all(np.abs(a[known] - b[known]) <= bound[known]))
