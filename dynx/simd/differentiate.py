"""Exact partial derivatives of a program, as a program.

Every operation has a local derivative by each of its arguments. They label the edges of the graph, and
the derivative of an output by an input is the sum, over all paths between the two, of the products of
the labels (Griewank and Walther, Evaluating Derivatives, 2008, chapter 9). Nodes between them are
eliminated one after the other: what leads into a node is joined to what leads out of it. The order in
which that is done changes the cost, not the result. From the inputs on it is forward mode, from the
outputs back it is reverse mode (the gradient of a scalar at the cost of a few evaluations), and the
rule of Markowitz takes the node with the fewest ways through it next. Edges exist only where something
depends on something, so a derivative that is zero for all inputs is never computed; it is a constant.

Where a derivative does not exist:

- ``abs`` at 0, and ``min`` and ``max`` of equal arguments: the mean of the derivatives on both sides
- ``sqrt`` at 0, ``div`` by 0: what IEEE 754 makes of the formula, an infinity or NaN
- where an argument of ``abs``, ``min`` or ``max`` is NaN: NaN
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush
from typing import Literal

from dynx.errors import CompileError, nearest, shown
from dynx.simd.expr import Graph, Node, Simplify, sign
from dynx.simd.program import Port, Program, finished
from dynx.simd.simplify import FAST

Order = Literal["forward", "reverse", "markowitz"]


def differentiate(
    program: Program,
    pairs: Sequence[tuple[str, str]],
    *,
    values: Sequence[str] = (),
    order: Order = "markowitz",
    simplify: Simplify | None = FAST,
) -> Program:
    """The program of the derivatives of outputs by inputs, for each of `pairs` (output, input) in turn.

    The derivative of ``y`` by ``x`` is an output ``dy_dx`` of the shape of y followed by that of x.
    The outputs named in `values` come first, as they were. The inputs are those of `program`.

    Raises CompileError for an output or input that the program does not have.
    """
    graph = Graph(simplify)
    nodes = _copied(graph, program)
    slots, results = _entries(program.inputs), _entries(program.outputs)
    sources = {slot for _, name in pairs for slot in _named(slots, name, "input")}
    sinks = {nodes[program.results[place]] for name, _ in pairs for place in _named(results, name, "output")}
    jacobian = _Elimination(graph, {graph.input(slot) for slot in sorted(sources)}, sinks).run(order)

    zero = graph.constant(0.0)
    ports, found = [], []
    for name in values:
        places = _named(results, name, "output")
        ports.append(Port(name, _port(program.outputs, name).shape))
        found += [nodes[program.results[place]] for place in places]
    for y, x in pairs:
        ports.append(Port(f"d{y}_d{x}", (*_port(program.outputs, y).shape, *_port(program.inputs, x).shape)))
        columns = [graph.input(slot) for slot in slots[x]]
        for place in results[y]:
            row = jacobian[nodes[program.results[place]]]
            found += [row.get(column, zero) for column in columns]
    return finished(graph, program.inputs, ports, found)


def local_derivatives(graph: Graph, index: int) -> tuple[int, ...]:
    """The derivative of a node by each of its arguments, as nodes of the same graph."""
    node = graph.nodes[index]
    return _DERIVATIVES[node.op](graph, index, *node.args) if node.args else ()


class _Elimination:
    """The graph between `sources` and `sinks` with its local derivatives, while nodes are eliminated.

    `into[x]` and `out_of[x]` hold the edges of node x, by the node at their other end. What a sink is
    made of may be a sink, too; a sink is therefore a vertex of its own, numbered -1 - (its node).
    """

    def __init__(self, graph: Graph, sources: set[int], sinks: set[int]) -> None:
        self._graph = graph
        self._sources, self._sinks = sources, sinks
        self._into: dict[int, dict[int, int]] = {}
        self._out_of: dict[int, dict[int, int]] = {}
        one = graph.constant(1.0)
        active = self._between()
        for index in sorted(active):
            if index in sinks:
                self._join(index, -1 - index, one)
            if index in sources:
                continue
            for arg, label in zip(graph.nodes[index].args, local_derivatives(graph, index), strict=True):
                if arg in active:
                    self._join(arg, index, label)

    def run(self, order: Order) -> dict[int, dict[int, int]]:
        """For each sink the nonzero derivatives by the sources."""
        inner = [index for index in self._out_of if index not in self._sources]
        if order == "markowitz":
            self._by_markowitz(inner)
        else:
            for index in sorted(inner, reverse=order == "reverse"):
                self._eliminate(index)
        return {sink: self._into.get(-1 - sink, {}) for sink in self._sinks}

    def _between(self) -> set[int]:
        """The nodes that depend on a source and that a sink depends on."""
        nodes = self._graph.nodes
        needed, stack = set(), list(self._sinks)
        while stack:
            index = stack.pop()
            if index not in needed:
                needed.add(index)
                stack.extend(nodes[index].args)
        moved: set[int] = set()
        for index in sorted(needed):
            if index in self._sources or any(arg in moved for arg in nodes[index].args):
                moved.add(index)
        return moved

    def _join(self, start: int, end: int, label: int) -> None:
        """One more way from start to end."""
        before = self._into.setdefault(end, {}).get(start)
        total = label if before is None else self._graph.apply("add", before, label)
        if self._graph.nodes[total] == _ZERO:
            self._into[end].pop(start, None)
            self._out_of.get(start, {}).pop(end, None)
        else:
            self._into[end][start] = total
            self._out_of.setdefault(start, {})[end] = total

    def _eliminate(self, index: int) -> None:
        before, after = self._into.pop(index, {}), self._out_of.pop(index, {})
        for start in before:
            del self._out_of[start][index]
        for end in after:
            del self._into[end][index]
        for end, last in after.items():
            for start, first in before.items():
                self._join(start, end, self._graph.apply("mul", last, first))

    def _by_markowitz(self, inner: list[int]) -> None:
        """Always the node with the fewest products next; among equals the one that was made first."""
        waiting = set(inner)
        queue = [(self._ways(index), index) for index in inner]
        heapify(queue)
        while queue:
            ways, index = heappop(queue)
            if index not in waiting:
                continue
            if ways != self._ways(index):
                heappush(queue, (self._ways(index), index))
                continue
            waiting.remove(index)
            touched = [n for n in (*self._into.get(index, ()), *self._out_of.get(index, ())) if n in waiting]
            self._eliminate(index)
            for neighbour in touched:
                heappush(queue, (self._ways(neighbour), neighbour))

    def _ways(self, index: int) -> int:
        return len(self._into.get(index, ())) * len(self._out_of.get(index, ()))


_ZERO = Node("constant", value=0.0)

Derivatives = Callable[..., tuple[int, ...]]


def _of_product(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    return b, a


def _of_quotient(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    inverse = graph.apply("div", graph.constant(1.0), b)
    return inverse, graph.apply("neg", graph.apply("mul", index, inverse))


def _of_root(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    return (graph.apply("div", graph.constant(0.5), index),)


def _of_tanh(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    """(1 - tanh) (1 + tanh)"""
    one = graph.constant(1.0)
    return (graph.apply("mul", graph.apply("sub", one, index), graph.apply("add", one, index)),)


def _of_arctan(graph: Graph, index: int, a: int) -> tuple[int, ...]:
    one = graph.constant(1.0)
    return (graph.apply("div", one, graph.apply("add", one, graph.apply("mul", a, a))),)


def _of_smaller(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    return _of_larger(graph, index, b, a)


def _of_larger(graph: Graph, index: int, a: int, b: int) -> tuple[int, ...]:
    """(1 + sign(a - b)) / 2 and what is left to 1: a counts where it is larger."""
    half = graph.constant(0.5)
    share = graph.apply("mul", half, sign(graph, graph.apply("sub", a, b)))
    return graph.apply("add", half, share), graph.apply("sub", half, share)


_DERIVATIVES: dict[str, Derivatives] = {
    "add": lambda graph, index, a, b: (graph.constant(1.0), graph.constant(1.0)),
    "sub": lambda graph, index, a, b: (graph.constant(1.0), graph.constant(-1.0)),
    "mul": _of_product,
    "div": _of_quotient,
    "neg": lambda graph, index, a: (graph.constant(-1.0),),
    "abs": lambda graph, index, a: (sign(graph, a),),
    "sqrt": _of_root,
    "sin": lambda graph, index, a: (graph.apply("cos", a),),
    "cos": lambda graph, index, a: (graph.apply("neg", graph.apply("sin", a)),),
    "exp": lambda graph, index, a: (index,),
    "tanh": _of_tanh,
    "arctan": _of_arctan,
    "min": _of_smaller,
    "max": _of_larger,
}


def _copied(graph: Graph, program: Program) -> list[int]:
    """Where the nodes of the program are in `graph`, which makes them as they stand."""
    place: list[int] = []
    for node in program.nodes:
        if node.op == "input":
            place.append(graph.input(node.slot))
        elif node.op == "constant":
            place.append(graph.constant(node.value))
        else:
            place.append(graph.literal(node.op, *(place[arg] for arg in node.args)))
    return place


def _entries(ports: Sequence[Port]) -> dict[str, range]:
    """The numbers of every port's scalars."""
    found, first = {}, 0
    for port in ports:
        found[port.name] = range(first, first + port.size)
        first += port.size
    return found


def _named(entries: dict[str, range], name: str, kind: str) -> range:
    if name not in entries:
        raise CompileError(f"the program has no {kind} {shown(name)}{nearest(name, entries)}")
    return entries[name]


def _port(ports: Sequence[Port], name: str) -> Port:
    return next(port for port in ports if port.name == name)
