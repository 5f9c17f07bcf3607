"""Exact partial derivatives of a program, as another program.

Every operation has a local derivative with respect to each of its arguments. These label the edges of the
graph, and the derivative of an output by an input is the sum, over all paths between the two, of the products
of the labels (Griewank and Walther, Evaluating Derivatives, 2008, chapter 9). The nodes in between are
eliminated one after the other: each edge into a node is combined with each edge out of it. The elimination
order changes the cost, not the result. From the inputs onwards it is forward mode; from the outputs backwards
it is reverse mode (the gradient of a scalar for the cost of a few evaluations). Only actual dependencies have
edges, so a derivative that is identically zero is never computed; it is a constant.

Where a derivative does not exist:

- ``abs`` at 0, and ``min`` and ``max`` of equal arguments: the mean of the derivatives on both sides
- ``sqrt`` at 0, ``div`` by 0: the IEEE 754 result of the formula, an infinity or NaN
- where an argument of ``abs``, ``min`` or ``max`` is NaN: NaN
- a comparison of equal arguments, and ``select`` where its condition changes: the derivative on one side
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

from dynx.errors import CompileError, nearest, shown
from dynx.simd.expr import Graph, Node, Simplify
from dynx.simd.program import Port, Program, extract_program, scalar_ranges
from dynx.simd.simplify import FAST

Order = Literal["forward", "reverse"]


def differentiate(
    program: Program,
    pairs: Sequence[tuple[str, str]],
    *,
    order: Order = "reverse",
    simplify: Simplify | None = FAST,
) -> Program:
    """Return the program that computes the derivative of an output by an input, for each of `pairs`.

    A pair is (output, input). The derivative of ``y`` by ``x`` is an output ``dy_dx`` of the shape of y
    followed by that of x. The inputs are those of `program`. `order` is the order in which the nodes are
    eliminated.

    Raises CompileError for an output or input that the program does not have.
    """
    graph = Graph(simplify)
    nodes = _copy_nodes(graph, program)
    slots, results = _scalar_ranges(program.inputs), _scalar_ranges(program.outputs)
    sources = {slot for _, name in pairs for slot in _lookup(slots, name, "input")}
    sinks = {nodes[program.results[place]] for name, _ in pairs for place in _lookup(results, name, "output")}
    jacobian = _Elimination(graph, {graph.input(slot) for slot in sorted(sources)}, sinks).run(order)

    zero = graph.constant(0.0)
    ports, found = [], []
    for y, x in pairs:
        ports.append(Port(f"d{y}_d{x}", (*_port(program.outputs, y).shape, *_port(program.inputs, x).shape)))
        columns = [graph.input(slot) for slot in slots[x]]
        for place in results[y]:
            row = jacobian[nodes[program.results[place]]]
            found += [row.get(column, zero) for column in columns]
    return extract_program(graph, program.inputs, ports, found)


def local_derivatives(graph: Graph, index: int) -> tuple[int, ...]:
    """Return the derivative of a node by each of its arguments, as nodes of the same graph."""
    node = graph.nodes[index]
    return _DERIVATIVES[node.op](graph, index, *node.args) if node.args else ()


class _Elimination:
    """Graph of local derivatives between `sources` and `sinks`, from which nodes are eliminated.

    `_predecessors[x]` and `_successors[x]` hold the edges of node x, by the node at their other end. A node
    may be both a sink and an argument of another sink; each sink is therefore a separate vertex, numbered
    -1 - (its node).
    """

    def __init__(self, graph: Graph, sources: set[int], sinks: set[int]) -> None:
        self._graph = graph
        self._sources, self._sinks = sources, sinks
        self._predecessors: dict[int, dict[int, int]] = {}
        self._successors: dict[int, dict[int, int]] = {}
        one = graph.constant(1.0)
        active = self._active_nodes()
        for index in sorted(active):
            if index in sinks:
                self._add_edge(index, -1 - index, one)
            if index in sources:
                continue
            for arg, label in zip(graph.nodes[index].args, local_derivatives(graph, index), strict=True):
                if arg in active:
                    self._add_edge(arg, index, label)

    def run(self, order: Order) -> dict[int, dict[int, int]]:
        """Eliminate all inner nodes; return for each sink the non-zero derivatives by the sources."""
        inner = [index for index in self._successors if index not in self._sources]
        for index in sorted(inner, reverse=order == "reverse"):
            self._eliminate(index)
        return {sink: self._predecessors.get(-1 - sink, {}) for sink in self._sinks}

    def _active_nodes(self) -> set[int]:
        """Return the nodes that depend on a source and that a sink depends on."""
        nodes = self._graph.nodes
        needed, stack = set(), list(self._sinks)
        while stack:
            index = stack.pop()
            if index not in needed:
                needed.add(index)
                stack.extend(nodes[index].args)
        active: set[int] = set()
        for index in sorted(needed):
            if index in self._sources or any(arg in active for arg in nodes[index].args):
                active.add(index)
        return active

    def _add_edge(self, start: int, end: int, label: int) -> None:
        """Add `label` to the edge from start to end; remove the edge if the sum is the constant 0."""
        before = self._predecessors.setdefault(end, {}).get(start)
        total = label if before is None else self._graph.apply("add", before, label)
        if self._graph.nodes[total] == _ZERO:
            self._predecessors[end].pop(start, None)
            self._successors.get(start, {}).pop(end, None)
        else:
            self._predecessors[end][start] = total
            self._successors.setdefault(start, {})[end] = total

    def _eliminate(self, index: int) -> None:
        before, after = self._predecessors.pop(index, {}), self._successors.pop(index, {})
        for start in before:
            del self._successors[start][index]
        for end in after:
            del self._predecessors[end][index]
        for end, last in after.items():
            for start, first in before.items():
                self._add_edge(start, end, self._graph.apply("mul", last, first))


_ZERO = Node("constant", value=0.0)

Derivatives = Callable[..., tuple[int, ...]]


def _product_rule(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    return b, a


def _quotient_rule(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    inverse = graph.apply("div", graph.constant(1.0), b)
    return inverse, graph.apply("neg", graph.apply("mul", index, inverse))


def _sqrt_rule(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    return (graph.apply("div", graph.constant(0.5), index),)


def _tanh_rule(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    """Return (1 - tanh) (1 + tanh)."""
    one = graph.constant(1.0)
    return (graph.apply("mul", graph.apply("sub", one, index), graph.apply("add", one, index)),)


def _arctan_rule(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    one = graph.constant(1.0)
    return (graph.apply("div", one, graph.apply("add", one, graph.apply("mul", a, a))),)


def _min_rule(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    return _max_rule(graph, index, b, a)


def _max_rule(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    """Return (1 + sign(a - b)) / 2 and (1 - sign(a - b)) / 2."""
    half = graph.constant(0.5)
    half_sign = graph.apply("mul", half, graph.sign(graph.apply("sub", a, b)))
    return graph.apply("add", half, half_sign), graph.apply("sub", half, half_sign)


def _step_rule(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    return graph.constant(0.0), graph.constant(0.0)


def _select_rule(graph: Graph, index: int, c: int, a: int, b: int) -> tuple[int, ...]:
    zero, one = graph.constant(0.0), graph.constant(1.0)
    return zero, graph.apply("select", c, one, zero), graph.apply("select", c, zero, one)


_DERIVATIVES: dict[str, Derivatives] = {
    "add": lambda graph, index, a, b: (graph.constant(1.0), graph.constant(1.0)),
    "sub": lambda graph, index, a, b: (graph.constant(1.0), graph.constant(-1.0)),
    "mul": _product_rule,
    "div": _quotient_rule,
    "neg": lambda graph, index, a: (graph.constant(-1.0),),
    "abs": lambda graph, index, a: (graph.sign(a),),
    "sqrt": _sqrt_rule,
    "sin": lambda graph, index, a: (graph.apply("cos", a),),
    "cos": lambda graph, index, a: (graph.apply("neg", graph.apply("sin", a)),),
    "exp": lambda graph, index, a: (index,),
    "tanh": _tanh_rule,
    "arctan": _arctan_rule,
    "min": _min_rule,
    "max": _max_rule,
    **dict.fromkeys(("less", "less_equal", "equal"), _step_rule),
    "select": _select_rule,
}


def _copy_nodes(graph: Graph, program: Program) -> list[int]:
    """Copy the nodes of the program into `graph` without simplification; return their new indices."""
    place: list[int] = []
    for node in program.nodes:
        if node.op == "input":
            place.append(graph.input(node.slot))
        elif node.op == "constant":
            place.append(graph.constant(node.value))
        else:
            place.append(graph.apply_unsimplified(node.op, *(place[arg] for arg in node.args)))
    return place


def _scalar_ranges(ports: Sequence[Port]) -> dict[str, range]:
    """Return the range of scalar indices of each port, by the name of the port."""
    return {port.name: scalars for port, scalars in scalar_ranges(ports)}


def _lookup(entries: dict[str, range], name: str, kind: str) -> range:
    if name not in entries:
        raise CompileError(f"the program has no {kind} {shown(name)}{nearest(name, entries)}")
    return entries[name]


def _port(ports: Sequence[Port], name: str) -> Port:
    return next(port for port in ports if port.name == name)
