"""A program: a finished graph with named inputs and outputs, only what the outputs need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

from dynx.simd.expr import Graph, Node


@dataclass(frozen=True)
class Port:
    """A named array of scalars going in or out, of the shape of one sample."""

    name: str
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of scalars."""
        return prod(self.shape)


@dataclass(frozen=True)
class Program:
    """What a kernel computes for one sample.

    Inputs are numbered over all input ports in order, each in row-major order; `outputs` lists the
    node of every output scalar in the same way.
    """

    nodes: tuple[Node, ...]
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    results: tuple[int, ...]

    @property
    def n_inputs(self) -> int:
        """Number of input scalars."""
        return sum(port.size for port in self.inputs)


def finished(
    graph: Graph, inputs: Sequence[Port], outputs: Sequence[Port], results: Sequence[int]
) -> Program:
    """The program that computes `results`: dead nodes left out, the rest in the order of the graph.

    That is the order in which the traced code works, body after body, which was measured to be as fast
    as depth first from the results on small robots, and by a sixth faster on a humanoid.
    """
    nodes = graph.nodes
    needed = [False] * len(nodes)
    for result in results:
        needed[result] = True
    for index in range(len(nodes) - 1, -1, -1):
        if needed[index]:
            for arg in nodes[index].args:
                needed[arg] = True
    place: dict[int, int] = {}
    kept: list[Node] = []
    for index, (op, args, slot, value) in enumerate(nodes):
        if needed[index]:
            place[index] = len(kept)
            kept.append(Node(op, tuple([place[arg] for arg in args]), slot, value))
    return Program(tuple(kept), tuple(inputs), tuple(outputs), tuple(place[result] for result in results))
