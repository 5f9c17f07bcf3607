"""Order of a program's operations, and its division into segments.

Sines and cosines of angles that are available at the same time are computed together, before the operations
that need them: they share one test for large angles, and the remaining code has no branches.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dynx.simd.program import Port, Program, scalar_ranges
from dynx.simd.rows import tiles

TRIG = frozenset({"sin", "cos"})
ELEMENTARY = frozenset({"exp", "tanh", "arctan"})
"""Functions that take about thirty operations each."""

LEAVES = frozenset({"input", "constant"})
"""Nodes that are not computed but read where they are used."""


MAX_STORES = 24
"""Most stores of one segment. A store takes some fifty instructions, so many of them would take as long to
compile as thousands of operations."""


STORE_OPERATIONS = 3
"""Approximate number of operations of the store of a column."""


MAX_ANGLES = 24
"""Most angles of one group; a group is compiled in one piece."""

CACHE_LINE = 64
"""Size of a cache line [bytes]."""

MIN_COLUMNS = 129
"""Least row length of a streamed array; shorter rows are prefetched (`dynx.simd.emit`)."""

MAX_BLOCK = 192 * 1024
"""Largest size of the rows of a group [bytes], which must fit into the second-level cache."""


class TrigGroup(NamedTuple):
    """Angles available at the same time, and for each the nodes of its sine and cosine, or None."""

    angles: tuple[int, ...]
    nodes: tuple[tuple[int | None, int | None], ...]


Step = int | TrigGroup
"""A node to compute, or a group of sines and cosines."""


class TileStore(NamedTuple):
    """A tile of neighbouring columns of output number `output`, and the node of each."""

    output: int
    columns: range
    nodes: tuple[int, ...]


@dataclass
class Segment:
    """Steps in order, then stores. `spilled` are the values that later segments need."""

    steps: list[Step] = field(default_factory=list)
    stores: list[TileStore] = field(default_factory=list)

    spilled: set[int] = field(default_factory=set)
    constant: bool = False
    """True if it stores constants in streamed rows (`dynx.simd.streaming`), and nothing else."""


def schedule(program: Program, lanes: int, longest: int, *, in_memory: bool = False) -> list[Segment]:
    """Divide the program into segments of about half of `longest` operations; into one if it has at most
    `longest`.

    A group of angles is never divided. Constants in streamed rows are stored by segments of their own. Stores
    of results that stay `in_memory` are short, and never make a segment longer than it may be.
    """
    steps = list(_steps(program))
    if sum(operation_count(program, step) for step in steps) > longest:
        longest = max(longest // 2, 1)
    segments, segment_of, length = [Segment()], {}, 0
    for step in steps:
        size = operation_count(program, step)
        if length and length + size > longest:
            segments.append(Segment())
            length = 0
        segments[-1].steps.append(step)
        length += size
        for node in _computed_nodes(step):
            segment_of[node] = len(segments) - 1
    streamed, constants = streamed_outputs(program, lanes), Segment(constant=True)
    for store in _stores(program, lanes):
        if store.output in streamed and all(program.nodes[node].op == "constant" for node in store.nodes):
            constants.stores.append(store)
        else:
            segments[max((segment_of.get(node, 0) for node in store.nodes), default=0)].stores.append(store)
    if constants.stores:
        segments.append(constants)
    if not in_memory:
        segments = [part for segment in segments for part in _divide_stores(segment)]
    for number, segment in enumerate(segments):
        segment_of.update((node, number) for step in segment.steps for node in _computed_nodes(step))
    for number, segment in enumerate(segments):
        for node in _used_values(program, segment):
            if segment_of.get(node, number) < number:
                segments[segment_of[node]].spilled.add(node)
    return segments


def _divide_stores(segment: Segment) -> Iterator[Segment]:
    """Yield the segment with its first stores, then segments with the others."""
    yield Segment(segment.steps, segment.stores[:MAX_STORES], constant=segment.constant)
    for first in range(MAX_STORES, len(segment.stores), MAX_STORES):
        yield Segment([], segment.stores[first : first + MAX_STORES], constant=segment.constant)


def program_length(program: Program) -> int:
    """Return the approximate number of operations of a program, of which every result takes two."""
    operations = sum(
        25 if node.op in TRIG else operation_count(program, index)
        for index, node in enumerate(program.nodes)
        if node.op not in LEAVES
    )
    return operations + 2 * len(program.results)


def spill_slots(program: Program, segments: Sequence[Segment]) -> dict[int, int]:
    """Assign a memory slot to every spilled value, reusing the slots of values no longer needed."""
    last = {
        value: number for number, segment in enumerate(segments) for value in _used_values(program, segment)
    }
    places: dict[int, int] = {}
    held: list[int] = []
    free: list[int] = []
    for number, segment in enumerate(segments):
        free += [places[value] for value in held if last[value] < number]
        held = [value for value in held if last[value] >= number]
        for value in sorted(segment.spilled):
            places[value] = free.pop() if free else len(held)
            held.append(value)
    return places


def segment_operations(program: Program, segment: Segment) -> int:
    """Return the approximate number of operations of a segment with its stores, without sines and cosines."""
    steps = sum(operation_count(program, step) for step in segment.steps if isinstance(step, int))
    return steps + STORE_OPERATIONS * sum(len(store.columns) for store in segment.stores)


def operation_count(program: Program, step: Step) -> int:
    """Return the approximate number of operations of a step."""
    if isinstance(step, TrigGroup):
        return 50 * len(step.angles)
    return 30 if program.nodes[step].op in ELEMENTARY else 1


def _steps(program: Program) -> Iterator[Step]:
    """Yield each group of angles, preceded by the nodes its angles need; then all remaining nodes."""
    nodes = program.nodes
    level: list[int] = []
    for node in nodes:
        level.append(max((level[arg] + (nodes[arg].op in TRIG) for arg in node.args), default=0))
    wanted: dict[int, dict[int, dict[str, int]]] = {}
    for index, node in enumerate(nodes):
        if node.op in TRIG:
            wanted.setdefault(level[index], {}).setdefault(node.args[0], {})[node.op] = index
    done = {index for index, node in enumerate(nodes) if node.op in LEAVES}
    for angles in (wanted[key] for key in sorted(wanted)):
        for index in _ancestors(program, angles, done):
            done.add(index)
            yield index
        pairs = tuple((pair.get("sin"), pair.get("cos")) for pair in angles.values())
        done.update(index for pair in pairs for index in pair if index is not None)
        for first in range(0, len(pairs), MAX_ANGLES):
            part = slice(first, first + MAX_ANGLES)
            yield TrigGroup(tuple(angles)[part], pairs[part])
    yield from (index for index in range(len(nodes)) if index not in done)


def _ancestors(program: Program, indices: Iterable[int], done: set[int]) -> list[int]:
    """Return `indices` and all nodes they depend on, except those in `done`, in order."""
    found: set[int] = set()
    stack = [index for index in indices if index not in done]
    while stack:
        index = stack.pop()
        if index not in found:
            found.add(index)
            stack.extend(arg for arg in program.nodes[index].args if arg not in done)
    return sorted(found)


def _stores(program: Program, lanes: int) -> Iterator[TileStore]:
    for output, (port, scalars) in enumerate(scalar_ranges(program.outputs)):
        for columns in tiles(port.size, lanes):
            yield TileStore(output, columns, tuple(program.results[scalars[c]] for c in columns))


def _computed_nodes(step: Step) -> list[int]:
    if isinstance(step, TrigGroup):
        return [index for pair in step.nodes for index in pair if index is not None]
    return [step]


def _used_values(program: Program, segment: Segment) -> Iterator[int]:
    """Yield every value that a segment uses."""
    for step in segment.steps:
        yield from step.angles if isinstance(step, TrigGroup) else program.nodes[step].args
    for store in segment.stores:
        yield from store.nodes


def streamed_outputs(program: Program, lanes: int) -> list[int]:
    """Return the numbers of the outputs whose rows are streamed in large batches."""
    found, room = [], MAX_BLOCK
    for number, port in enumerate(program.outputs):
        size = block_size(port, lanes)
        if port.size >= MIN_COLUMNS and size <= room:
            found.append(number)
            room -= size
    return found


def block_size(port: Port, lanes: int) -> int:
    """Return the size of the rows of a group, which end with a cache line [bytes]."""
    return -(-8 * port.size * lanes // CACHE_LINE) * CACHE_LINE
