"""Comparison of two traces of the same code, which differ if the code depends on more than its arguments."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.simd.expr import Graph, Kind, Node, caller_location


class LocatedGraph(Graph):
    """A graph that knows the line of code that made each node."""

    def __init__(self) -> None:
        super().__init__()
        self.places: list[str] = []
        """File and line of each node."""

    def _append(self, key: object, node: Node, kind: Kind) -> int:
        self.places.append(caller_location())
        return super()._append(key, node, kind)


def needed_nodes(graph: Graph, results: Sequence[int]) -> list[int]:
    """Return the nodes that `results` need, ascending."""
    needed, stack = set(), list(results)
    while stack:
        index = stack.pop()
        if index not in needed:
            needed.add(index)
            stack.extend(graph.nodes[index].args)
    return sorted(needed)


def first_difference(
    one: LocatedGraph, results: Sequence[int], other: LocatedGraph, other_results: Sequence[int]
) -> tuple[str, tuple[float, float] | None] | None:
    """Return file and line of the first node in which two traces differ, with both values of a constant.

    Nodes without an effect on the results are not compared. Return None for equal traces.
    """
    pairs = needed_nodes(one, results), needed_nodes(other, other_results)
    numbers = [{index: place for place, index in enumerate(side)} for side in pairs]
    # Of two traces of unequal length, the shorter one ends in results that differ.
    for a, b in zip(*pairs, strict=False):
        nodes = one.nodes[a], other.nodes[b]
        ours, theirs = (
            (node.op, tuple(number[arg] for arg in node.args), node.slot, node.value.hex())
            for node, number in zip(nodes, numbers, strict=True)
        )
        if ours != theirs:
            constants = {node.op for node in nodes} == {"constant"}
            return one.places[a], (nodes[0].value, nodes[1].value) if constants else None
    ends = [numbers[0][index] for index in results], [numbers[1][index] for index in other_results]
    return None if ends[0] == ends[1] else ("", None)
