"""Tracing: running ordinary array code on symbols to obtain the program that it is.

The function sees NumPy object arrays of `Symbol` and may do with them what it does with numbers, but
for asking what they are: a branch on a value raises TraceError, and would mean something else for
each of the samples that a kernel evaluates at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.errors import TraceError
from dynx.simd.expr import Graph, Simplify, Symbol
from dynx.simd.program import Port, Program, finished
from dynx.simd.simplify import FAST
from dynx.simd.verify import check_program
from dynx.spatial.scalar import Array


def trace(
    function: Callable[..., Any],
    inputs: Mapping[str, tuple[int, ...]],
    *,
    simplify: Simplify | None = FAST,
) -> Program:
    """The program of `function`, called with one array of symbols for each of `inputs`, by name.

    The function returns an array, or a mapping from names to arrays where there are several results;
    a single one is named ``result``. Entries that are plain numbers become constants.
    """
    graph = Graph(simplify)
    ports = [Port(name, tuple(shape)) for name, shape in inputs.items()]
    arguments: dict[str, Array] = {}
    slot = 0
    for port in ports:
        symbols = np.empty(port.size, dtype=object)
        for k in range(port.size):
            symbols[k] = Symbol(graph, graph.input(slot + k))
        slot += port.size
        arguments[port.name] = symbols.reshape(port.shape)
    answer = function(**arguments)
    answers = answer if isinstance(answer, Mapping) else {"result": answer}
    outputs, results = [], []
    for name, value in answers.items():
        array = np.asarray(value, dtype=object)
        outputs.append(Port(name, array.shape))
        results += [_node(graph, name, entry) for entry in array.ravel().tolist()]
    program = finished(graph, ports, outputs, results)
    check_program(program)
    return program


def _node(graph: Graph, name: str, entry: Any) -> int:
    if isinstance(entry, Symbol):
        if entry.graph is not graph:
            raise TraceError(f"result {name} holds a symbol of another trace")
        return entry.index
    try:
        return graph.constant(float(entry))
    except (TypeError, ValueError):
        raise TraceError(f"result {name} holds a {type(entry).__name__}; wanted numbers") from None
