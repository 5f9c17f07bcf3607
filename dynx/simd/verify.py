"""What a legal program and a legal schedule are, stated so that a machine can check it.

The stages of the compiler hand these on to each other: tracing ends with `check_program`, emission
begins with `check_schedule`. Both take time in proportion to what they check.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NoReturn

from dynx.errors import CompileError
from dynx.simd.expr import ARITY, COMMUTATIVE, Node, identity
from dynx.simd.program import Program
from dynx.simd.rows import tiles
from dynx.simd.schedule import LEAVES, Segment, Store, TrigGroup


def check_nodes(nodes: Sequence[Node], n_inputs: int) -> None:
    """Raise CompileError unless `nodes` is a graph.

    - Every operation is known and has as many arguments as it takes, all of them earlier nodes.
    - An input's slot is one of the `n_inputs`; a constant's value is a float.
    - No two nodes are the same operation on the same arguments, in either order where that means the
      same; zeros of either sign are two constants, all NaN one.
    """
    known: dict[object, int] = {}
    for index, (op, args, slot, value) in enumerate(nodes):
        if op not in ARITY:
            _fail(index, f"is no known operation: {op!r}")
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
            key = identity(value)
        else:
            key = op, args if op not in COMMUTATIVE or args[0] <= args[1] else args[::-1]
        first = known.setdefault(key, index)
        if first != index:
            _fail(index, f"({op}) is node {first} again")


def check_program(program: Program) -> None:
    """Raise CompileError unless `program` is whole.

    Its nodes are a graph, every result is one of them, there are as many results as the output ports
    hold, no two ports of a side share a name, and every node is needed for a result.
    """
    check_nodes(program.nodes, program.n_inputs)
    for side in (program.inputs, program.outputs):
        names = [port.name for port in side]
        if len(set(names)) < len(names):
            raise CompileError(f"two ports have one name: {', '.join(sorted(names))}")
    wanted = sum(port.size for port in program.outputs)
    if len(program.results) != wanted:
        raise CompileError(f"the program has {len(program.results)} results, its ports hold {wanted}")
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

    - Every node is computed once, after its arguments; sine and cosine in a group, by their angle.
    - What is used in a later segment than it was computed in is kept by that one.
    - Every output is stored once, in the tiles that its row is cut into, from the nodes it is made of.

    Inputs and constants are read where they are used, and neither computed nor kept.
    """
    home: dict[int, int] = {}
    stores: list[Store] = []
    for number, segment in enumerate(segments):

        def use(node: int, user: str, number: int = number) -> None:
            if program.nodes[node].op in LEAVES:
                return
            if node not in home:
                _fail(node, f"is used by {user} before it is computed")
            if home[node] < number and node not in segments[home[node]].kept:
                _fail(node, f"is used by {user} in segment {number}; segment {home[node]} does not keep it")

        for step in segment.steps:
            for node, arguments in _made(program, step):
                if node in home or program.nodes[node].op in LEAVES:
                    _fail(node, "is computed although it is known")
                for argument in arguments:
                    use(argument, f"node {node}")
            for node, _ in _made(program, step):
                home[node] = number
        for node in segment.kept:
            if home.get(node) != number:
                _fail(node, f"is kept by segment {number}, which does not compute it")
        for store in segment.stores:
            for node in store.nodes:
                use(node, f"output {store.output}")
        stores += segment.stores
    for index, (op, *_) in enumerate(program.nodes):
        if op not in LEAVES and index not in home:
            _fail(index, f"({op}) is never computed")
    _check_stores(program, stores, lanes)


def _made(program: Program, step: int | TrigGroup) -> Iterator[tuple[int, tuple[int, ...]]]:
    """The nodes that a step computes, each with what it needs."""
    if not isinstance(step, TrigGroup):
        if program.nodes[step].op in ("sin", "cos"):
            _fail(step, "is a sine or cosine outside of a group")
        yield step, program.nodes[step].args
        return
    for angle, pair in zip(step.angles, step.nodes, strict=True):
        for op, index in zip(("sin", "cos"), pair, strict=True):
            if index is not None:
                if program.nodes[index].op != op or program.nodes[index].args != (angle,):
                    _fail(index, f"is not the {op} of node {angle} that its group takes it for")
                yield index, (angle,)


def _check_stores(program: Program, stores: Sequence[Store], lanes: int) -> None:
    first = 0
    for number, port in enumerate(program.outputs):
        own = sorted((store for store in stores if store.output == number), key=lambda s: s.columns.start)
        if [store.columns for store in own] != tiles(port.size, lanes):
            raise CompileError(f"output {port.name} is stored in columns {[s.columns for s in own]}")
        for store in own:
            if store.nodes != tuple(program.results[first + column] for column in store.columns):
                raise CompileError(f"columns {store.columns} of output {port.name} are other nodes' values")
        first += port.size
    if any(not 0 <= store.output < len(program.outputs) for store in stores):
        raise CompileError("an output is stored that the program does not have")


def _fail(index: int, what: str) -> NoReturn:
    raise CompileError(f"node {index} {what}")
