"""Tracing: calling ordinary array code on symbols to obtain its program.

The function receives NumPy object arrays of `Symbol` and may compute with them as with numbers. It must not
branch on their values, which raises TraceError: a kernel evaluates several samples at once, and each could
take another branch.

`inline` is the reverse: it evaluates a finished program on arrays of symbols, within another trace, or on
arrays of numbers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.errors import TraceError
from dynx.simd.expr import Graph, Simplify, Symbol
from dynx.simd.program import Port, Program, collection_paused, extract_program, scalar_ranges
from dynx.simd.simplify import FAST
from dynx.simd.verify import check_program
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


def trace(
    function: Callable[..., Any],
    inputs: Mapping[str, tuple[int, ...]],
    *,
    simplify: Simplify | None = FAST,
) -> Program:
    """Trace `function`, called with one array of symbols for each of `inputs` (shapes by argument name).

    The function returns an array, which becomes the output ``result``, or a mapping from output names to
    arrays. Entries that are plain numbers become constants. Raises TraceError if the function branches on a
    symbol, mixes symbols of two traces, or returns an entry that is neither a symbol nor a number.
    """
    with collection_paused():
        return _traced(function, inputs, simplify)


def _traced(
    function: Callable[..., Any], inputs: Mapping[str, tuple[int, ...]], simplify: Simplify | None
) -> Program:
    graph = Graph(simplify)
    ports = [Port(name, tuple(shape)) for name, shape in inputs.items()]
    arguments: dict[str, Array] = {}
    for port, slots in scalar_ranges(ports):
        arguments[port.name] = symbols(graph, port, slots.start)
    returned = function(**arguments)
    arrays = returned if isinstance(returned, Mapping) else {"result": returned}
    outputs, results = [], []
    for name, value in arrays.items():
        array = np.asarray(value, dtype=object)
        outputs.append(Port(name, array.shape))
        results += [result_node(graph, name, entry) for entry in array.ravel().tolist()]
    program = extract_program(graph, ports, outputs, results)
    check_program(program)
    return program


def symbols(graph: Graph, port: Port, first: int) -> Array:
    """Return an array of symbols of the inputs of a graph from number `first` on, in the shape of a port."""
    found = np.empty(port.size, dtype=object)
    found[:] = [Symbol(graph, graph.input(slot)) for slot in range(first, first + port.size)]
    return found.reshape(port.shape)


def result_node(graph: Graph, name: str, entry: Any) -> int:
    """Return the node of an entry of the result `name`, a symbol or a number."""
    if isinstance(entry, Symbol):
        if entry.graph is not graph:
            raise TraceError(f"result {name} holds a symbol of another trace")
        return entry.index
    try:
        return graph.constant(float(entry))
    except (TypeError, ValueError):
        raise TraceError(f"result {name} holds a {type(entry).__name__}; wanted numbers") from None


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
