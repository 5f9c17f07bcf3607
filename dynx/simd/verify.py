"""Checks that a program and a schedule are well-formed.

Tracing ends with `check_program`, code generation begins with `check_schedule`. Both take time proportional
to the size of their input.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NoReturn

from dynx.errors import CompileError
from dynx.simd.expr import ARITY, COMMUTATIVE, Node, constant_key
from dynx.simd.program import Program, scalar_ranges
from dynx.simd.rows import tiles
from dynx.simd.schedule import LEAVES, Segment, TileStore, TrigGroup


def check_nodes(nodes: Sequence[Node], n_inputs: int) -> None:
    """Raise CompileError unless `nodes` is a well-formed graph.

    - Every operation is known and has the right number of arguments, all of them earlier nodes.
    - The slot of an input is below `n_inputs`; the value of a constant is a float.
    - No two nodes are the same operation on the same arguments, in either order if it is commutative; 0.0
      and -0.0 are distinct constants, all NaN are one.
    """
    known: dict[object, int] = {}
    for index, (op, args, slot, value) in enumerate(nodes):
        if op not in ARITY:
            _fail(index, f"is not a known operation: {op!r}")
        if len(args) != ARITY[op]:
            _fail(index, f"({op}) has {len(args)} arguments, wanted {ARITY[op]}")
        for arg in args:
            if not 0 <= arg < index:
                _fail(index, f"({op}) uses node {arg}, which is not before it")
        key: object
        if op == "input":
            if not 0 <= slot < n_inputs:
                _fail(index, f"reads input {slot} of {n_inputs}")
            key = op, slot
        elif op == "constant":
            if type(value) is not float:
                _fail(index, f"is the constant {value!r}, not a float")
            key = constant_key(value)
        else:
            key = op, args if op not in COMMUTATIVE or args[0] <= args[1] else args[::-1]
        first = known.setdefault(key, index)
        if first != index:
            _fail(index, f"({op}) is node {first} again")


def check_program(program: Program) -> None:
    """Raise CompileError unless `program` is well-formed.

    Its nodes are a graph, every result is one of them, there is one result for each scalar of the output
    ports, names are unique among inputs and among outputs, and every node is needed for a result.
    """
    check_nodes(program.nodes, program.n_inputs)
    for side in (program.inputs, program.outputs):
        names = [port.name for port in side]
        if len(set(names)) < len(names):
            raise CompileError(f"two ports have the same name: {', '.join(sorted(names))}")
    scalars = sum(port.size for port in program.outputs)
    if len(program.results) != scalars:
        raise CompileError(f"the program has {len(program.results)} results, its ports hold {scalars}")
    alive = [False] * len(program.nodes)
    for result in program.results:
        if not 0 <= result < len(alive):
            raise CompileError(f"a result is node {result} of {len(alive)}")
        alive[result] = True
    for index in range(len(alive) - 1, -1, -1):
        if not alive[index]:
            _fail(index, f"({program.nodes[index].op}) is needed for no result")
        for arg in program.nodes[index].args:
            alive[arg] = True


def check_schedule(program: Program, segments: Sequence[Segment], lanes: int) -> None:
    """Raise CompileError unless `segments` compute all of `program`.

    - Every node is computed once, after its arguments; sines and cosines in a group, with their angle.
    - A value used in a later segment than the one that computes it is spilled by that segment.
    - Every output is stored once, in the tiles of its row, from the nodes of its results.

    Inputs and constants are read where they are used; they are neither computed nor spilled.
    """
    segment_of: dict[int, int] = {}
    stores: list[TileStore] = []
    for number, segment in enumerate(segments):

        def use(node: int, user: str, number: int = number) -> None:
            if program.nodes[node].op in LEAVES:
                return
            if node not in segment_of:
                _fail(node, f"is used by {user} before it is computed")
            if segment_of[node] < number and node not in segments[segment_of[node]].spilled:
                by = f"segment {segment_of[node]} does not spill it"
                _fail(node, f"is used by {user} in segment {number}; {by}")

        for step in segment.steps:
            for node, arguments in _computed_nodes(program, step):
                if node in segment_of or program.nodes[node].op in LEAVES:
                    _fail(node, "is computed twice, or is an input or a constant")
                for argument in arguments:
                    use(argument, f"node {node}")
            for node, _ in _computed_nodes(program, step):
                segment_of[node] = number
        for node in segment.spilled:
            if segment_of.get(node) != number:
                _fail(node, f"is spilled by segment {number}, which does not compute it")
        for store in segment.stores:
            for node in store.nodes:
                use(node, f"output {store.output}")
        stores += segment.stores
    for index, (op, *_) in enumerate(program.nodes):
        if op not in LEAVES and index not in segment_of:
            _fail(index, f"({op}) is never computed")
    _check_stores(program, stores, lanes)


def _computed_nodes(program: Program, step: int | TrigGroup) -> Iterator[tuple[int, tuple[int, ...]]]:
    """Yield the nodes that a step computes, each with its arguments."""
    if not isinstance(step, TrigGroup):
        if program.nodes[step].op in ("sin", "cos"):
            _fail(step, "is a sine or cosine outside of a group")
        yield step, program.nodes[step].args
        return
    for angle, pair in zip(step.angles, step.nodes, strict=True):
        for op, index in zip(("sin", "cos"), pair, strict=True):
            if index is not None:
                if program.nodes[index].op != op or program.nodes[index].args != (angle,):
                    _fail(index, f"is in a group as the {op} of node {angle}, which it is not")
                yield index, (angle,)


def _check_stores(program: Program, stores: Sequence[TileStore], lanes: int) -> None:
    for number, (port, scalars) in enumerate(scalar_ranges(program.outputs)):
        own = sorted((store for store in stores if store.output == number), key=lambda s: s.columns.start)
        if [store.columns for store in own] != tiles(port.size, lanes):
            raise CompileError(f"output {port.name} is stored in wrong columns {[s.columns for s in own]}")
        for store in own:
            if store.nodes != tuple(program.results[scalars[column]] for column in store.columns):
                raise CompileError(
                    f"columns {store.columns} of output {port.name} are stored from wrong nodes"
                )
    if any(not 0 <= store.output < len(program.outputs) for store in stores):
        raise CompileError("a store refers to an output that the program does not have")


def _fail(index: int, what: str) -> NoReturn:
    raise CompileError(f"node {index} {what}")
