"""In which order a program's operations are done, and where it is cut into segments.

Sines and cosines of angles that are known at the same time are done together, before what needs
them: they share one test for large angles, and the rest is one straight line.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dynx.simd.program import Program
from dynx.simd.rows import tiles

TRIG = frozenset({"sin", "cos"})
ELEMENTARY = frozenset({"exp", "tanh", "arctan"})
"""Functions that are some thirty operations each."""
LEAVES = frozenset({"input", "constant"})
"""Operations that need no computing: they are read where they are used."""


class TrigGroup(NamedTuple):
    """Angles that are known at the same time; for each the nodes of its sine and cosine, if wanted."""

    angles: tuple[int, ...]
    nodes: tuple[tuple[int | None, int | None], ...]


Step = int | TrigGroup
"""A node to compute, or a group of sines and cosines."""


class Store(NamedTuple):
    """A tile of neighbouring columns of output number `output`, and the node of each."""

    output: int
    columns: range
    nodes: tuple[int, ...]


@dataclass
class Segment:
    """Steps in order, then stores. `kept` are the values that later segments need."""

    steps: list[Step] = field(default_factory=list)
    stores: list[Store] = field(default_factory=list)
    kept: set[int] = field(default_factory=set)


def schedule(program: Program, lanes: int, longest: int) -> list[Segment]:
    """One segment if that has at most `longest` operations, else segments of half as many.

    A group of angles is not cut.
    """
    steps = list(_steps(program))
    if sum(_size(program, step) for step in steps) > longest:
        longest = max(longest // 2, 1)
    segments, home, length = [Segment()], {}, 0
    for step in steps:
        size = _size(program, step)
        if length and length + size > longest:
            segments.append(Segment())
            length = 0
        segments[-1].steps.append(step)
        length += size
        for node in _made(step):
            home[node] = len(segments) - 1
    for store in _stores(program, lanes):
        segments[max((home.get(node, 0) for node in store.nodes), default=0)].stores.append(store)
    for number, segment in enumerate(segments):
        for node in _read(program, segment):
            if home.get(node, number) < number:
                segments[home[node]].kept.add(node)
    return segments


def places_of_kept(program: Program, segments: Sequence[Segment]) -> dict[int, int]:
    """A place in memory for every value that is kept; places are used again when none needs them."""
    last = {value: number for number, segment in enumerate(segments) for value in _read(program, segment)}
    places: dict[int, int] = {}
    held: list[int] = []
    free: list[int] = []
    for number, segment in enumerate(segments):
        free += [places[value] for value in held if last[value] < number]
        held = [value for value in held if last[value] >= number]
        for value in sorted(segment.kept):
            places[value] = free.pop() if free else len(held)
            held.append(value)
    return places


def _size(program: Program, step: Step) -> int:
    """Operations of a step, about."""
    if isinstance(step, TrigGroup):
        return 50 * len(step.angles)
    return 30 if program.nodes[step].op in ELEMENTARY else 1


def _steps(program: Program) -> Iterator[Step]:
    """Group after group of angles, each preceded by what its angles need; then all the rest."""
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
        yield TrigGroup(tuple(angles), pairs)
    yield from (index for index in range(len(nodes)) if index not in done)


def _ancestors(program: Program, indices: Iterable[int], done: set[int]) -> list[int]:
    """All of `indices` and what they are made of, but for what is done, in order."""
    found: set[int] = set()
    stack = [index for index in indices if index not in done]
    while stack:
        index = stack.pop()
        if index not in found:
            found.add(index)
            stack.extend(arg for arg in program.nodes[index].args if arg not in done)
    return sorted(found)


def _stores(program: Program, lanes: int) -> Iterator[Store]:
    first = 0
    for output, port in enumerate(program.outputs):
        for columns in tiles(port.size, lanes):
            yield Store(output, columns, tuple(program.results[first + c] for c in columns))
        first += port.size


def _made(step: Step) -> list[int]:
    if isinstance(step, TrigGroup):
        return [index for pair in step.nodes for index in pair if index is not None]
    return [step]


def _read(program: Program, segment: Segment) -> Iterator[int]:
    """Every value that a segment uses."""
    for step in segment.steps:
        yield from step.angles if isinstance(step, TrigGroup) else program.nodes[step].args
    for store in segment.stores:
        yield from store.nodes
