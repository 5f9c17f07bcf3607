"""A traced function with a loop inside: code before it, a step that is repeated, and code after it.

The function receives `repeat`, which repeats a step on arrays of symbols as often as a state says that it
goes on. All three parts become one kernel. Values that the step or the code after it need are kept in memory,
a vector each, so that neither code nor time of compilation grows with the number of repetitions.

A lane whose loop has ended keeps its state whatever other lanes do. So its results depend neither on the
other lanes nor on their number. The loop of a vector ends when those of all its lanes have ended.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from dynx.errors import TraceError
from dynx.simd.cache import load_code, program_recipe
from dynx.simd.emit import (
    DECLARED_PREFETCH,
    ENTRY,
    SegmentBody,
    Settings,
    prefetch,
    prefetch_pointers,
)
from dynx.simd.expr import Graph, Node, Simplify
from dynx.simd.image import Image, compile_text
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program, collection_paused, extract_program, scalar_ranges
from dynx.simd.rows import Rows
from dynx.simd.schedule import LEAVES, Segment, schedule, spill_slots
from dynx.simd.simplify import FAST
from dynx.simd.target import Processor, host
from dynx.simd.trace import result_node, symbols
from dynx.simd.trigonometry import declarations, replacements
from dynx.simd.verify import check_program, check_schedule
from dynx.spatial.scalar import Array, select

GOES_ON = "goes_on"
"""Entry (1,) of the state that is 0 where the loop has ended."""

KEPT = "kept"
"""Name of the port of values from before the loop that the step or the code after it needs."""

_STATE = "state."
"""Beginning of the names of ports of the state, since arrays of the caller may have the same names."""

SEGMENT = 12_000
"""Length of the segments (`dynx.simd.emit`). A long one takes a tenth more time to compile than short ones,
and the code is a fifth faster, because fewer values go through memory."""

RELOADED_AFTER = 100
"""Lines of code after which a value that is kept in memory is read from there again. The compiler would keep
it on the stack as well, and both together exceed the first-level cache."""

Numbers = dict[str, Array]
Step = Callable[[Numbers], Numbers]


@dataclass(frozen=True)
class Repetition:
    """The three parts of a function with a loop."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    before: Program
    """From the inputs to the first state and the kept values."""
    step: Program
    """From the state and the kept values to the next state."""
    after: Program
    """From the inputs, the last state and the kept values to the outputs."""
    most: int
    """Largest number of repetitions."""

    @property
    def parts(self) -> tuple[Program, Program, Program]:
        """The three parts in order."""
        return self.before, self.step, self.after


def trace_repetition(
    function: Callable[..., Mapping[str, Array]],
    inputs: Mapping[str, tuple[int, ...]],
    *,
    simplify: Simplify | None = FAST,
) -> Repetition:
    """Trace ``function(repeat=repeat, **arrays)``, which returns a mapping from output names to arrays.

    It calls ``repeat(step, state, most)`` once, which returns the last state. ``step(state)`` returns the
    next state, arrays by the same names; it may also use whatever was computed before. What it computes
    without the state is computed once. The loop ends after `most` steps, or where ``goes_on`` (1,) of the
    state is 0. Raises TraceError as `trace` does, or if the function does not keep to this.
    """
    with collection_paused():
        return _Tracer(inputs, simplify).repetition(function)


class _Tracer:
    """Trace of all parts in one graph, which is then divided.

    Behind the inputs of the function follow those of the state in the loop, and those of the last state.
    """

    def __init__(self, inputs: Mapping[str, tuple[int, ...]], simplify: Simplify | None) -> None:
        self._graph = Graph(simplify)
        self._ports = [Port(name, tuple(shape)) for name, shape in inputs.items()]
        self._size = sum(port.size for port in self._ports)
        self._arguments = {
            port.name: symbols(self._graph, port, slots.start) for port, slots in scalar_ranges(self._ports)
        }
        self._states: list[Port] = []
        self._first: list[int] = []
        """Nodes of the first state."""
        self._next: list[int] = []
        """Nodes of the next state."""
        self._most = 0

    def repetition(self, function: Callable[..., Mapping[str, Array]]) -> Repetition:
        """Return the trace of a function."""
        outputs, results = self._entries(function(repeat=self._repeat, **self._arguments))
        if not self._states:
            raise TraceError("the traced function repeats nothing")
        size = sum(port.size for port in self._states)
        in_loop = self._dependent(range(self._size, self._size + size))
        late = self._dependent(range(self._size + size, self._size + 2 * size))
        if any(in_loop[index] for index in results) or any(map(all, zip(in_loop, late, strict=True))):
            raise TraceError("code after a loop uses what a step of the loop computed, beside the state")
        kept = sorted(
            self._needed(self._next, in_loop, inputs=True) | self._needed(results, late, inputs=False)
        )
        port = Port(KEPT, (len(kept),))
        before = extract_program(self._graph, self._ports, [*self._states, port], [*self._first, *kept])
        step = self._part([*self._states, port], kept, self._size, self._states, self._next)
        arrays = self._size + size
        after = self._part([*self._ports, *self._states, port], kept, arrays, outputs, results)
        for program in (before, step, after):
            check_program(program)
        return Repetition(tuple(self._ports), tuple(outputs), before, step, after, self._most)

    def _dependent(self, slots: range) -> list[bool]:
        """Return for each node whether it depends on these inputs."""
        found: list[bool] = []
        for node in self._graph.nodes:
            found.append(node.slot in slots if node.op == "input" else any(found[arg] for arg in node.args))
        return found

    def _needed(self, results: Sequence[int], own: Sequence[bool], *, inputs: bool) -> set[int]:
        """Return the nodes that `results` or their `own` ancestors use and that are not own: no constants,
        and `inputs` only if they shall be kept too."""
        alive, needed = set(results), set[int]()
        for index in range(max(alive, default=-1), -1, -1):
            op = self._graph.nodes[index].op
            if index not in alive or op == "constant" or (op == "input" and (own[index] or not inputs)):
                continue
            if own[index]:
                alive.update(self._graph.nodes[index].args)
            else:
                needed.add(index)
        return needed

    def _part(
        self,
        inputs: Sequence[Port],
        kept: Sequence[int],
        first_state: int,
        outputs: Sequence[Port],
        results: Sequence[int],
    ) -> Program:
        """Return the program of a part. Kept nodes and the state from slot `first_state` are its inputs, and
        in the code after the loop the arrays."""
        graph, size = Graph(), sum(port.size for port in self._states)
        own = sum(port.size for port in inputs) - size - len(kept)
        graph.nodes = list(self._graph.nodes)
        for index, node in enumerate(graph.nodes):
            if node.op == "input" and node.slot >= self._size:
                graph.nodes[index] = Node("input", slot=node.slot - first_state + own)
        for place, index in enumerate(kept):
            if own == 0 or graph.nodes[index].op != "input":
                graph.nodes[index] = Node("input", slot=own + size + place)
        return extract_program(graph, inputs, outputs, results)

    def _repeat(self, step: Step, state: Numbers, most: int) -> Numbers:
        if self._states:
            raise TraceError("a traced function repeats a step twice")
        if GOES_ON not in state:
            raise TraceError(f"the state of a loop has no entry {GOES_ON}")
        named = {f"{_STATE}{name}": np.asarray(array) for name, array in state.items()}
        self._states, self._first = self._entries(named)
        self._most = most
        old, last = self._state(state, 0), self._state(state, 1)
        new = step(old)
        goes_on = old[GOES_ON].ravel()[0]
        chosen = {}
        for name, array in old.items():
            entries = np.empty(array.size, dtype=object)
            pairs = zip(np.ravel(new[name]), array.ravel(), strict=True)
            entries[:] = [select(goes_on, a, b) for a, b in pairs]
            chosen[name] = entries.reshape(array.shape)
        _, self._next = self._entries(chosen)
        return last

    def _state(self, state: Numbers, number: int) -> Numbers:
        first = self._size + number * sum(port.size for port in self._states)
        return {
            name: symbols(self._graph, port, first + slots.start)
            for name, (port, slots) in zip(state, scalar_ranges(self._states), strict=True)
        }

    def _entries(self, arrays: Mapping[str, Array]) -> tuple[list[Port], list[int]]:
        """Return a port for each array, and the nodes of all entries."""
        ports, nodes = [], []
        for name, value in arrays.items():
            array = np.asarray(value, dtype=object)
            ports.append(Port(name, array.shape))
            nodes += [result_node(self._graph, name, entry) for entry in array.ravel().tolist()]
        return ports, nodes


# -- code ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _PortSlots:
    """Places of the ports: numbers of arrays, and slots of vectors in memory."""

    arrays: dict[str, int]
    slots: dict[str, int]
    size: int

    @classmethod
    def of(cls, repetition: Repetition) -> _PortSlots:
        arrays = {port.name: k for k, port in enumerate(repetition.inputs)}
        slots: dict[str, int] = {}
        size = 0
        for port in repetition.before.outputs:
            slots[port.name] = size
            size += port.size
        return cls(arrays, slots, size)


class _PartBody(SegmentBody):
    """A segment of a part: its ports are arrays of the caller or vectors in memory."""

    def __init__(
        self,
        program: Program,
        target: Processor,
        settings: Settings,
        segment: Segment,
        slots: dict[int, int],
        number: int,
        *,
        inputs: Sequence[tuple[bool, int]],
        outputs: Sequence[tuple[bool, int]],
        at_once: bool,
    ) -> None:
        """`inputs` and `outputs` have for each port whether it is in memory, and the number of its array or
        its first slot. Results in memory are written `at_once`, unless they replace values that are read."""
        super().__init__(program, target, settings, segment, slots, number)
        self._sources, self._targets = inputs, outputs
        places = zip((*program.inputs, *program.outputs), (*inputs, *outputs), strict=True)
        self._rows = [Rows(self._write, port.size, partial(self._pointers, at)) for port, (_, at) in places]
        self._ages: dict[int, int] = {}
        self._results: dict[int, list[int]] = {}
        """Slots of results in memory that are written at once, by node. Until the end of the code, all would
        have to stay in registers or on the stack."""
        for (in_memory, place), (_, scalars) in zip(outputs, scalar_ranges(program.outputs), strict=True):
            for slot, scalar in enumerate(scalars, place):
                if in_memory and at_once:
                    self._results.setdefault(program.results[scalar], []).append(slot)

    def _input(self, port: int, column: int) -> str:
        in_memory, place = self._sources[port]
        if in_memory:
            write = self._write
            return write.let(f"load {write.vector}, ptr {self._at(place + column)}, align {self._bytes}")
        return self._rows[port].load(column)

    def _store_results(self) -> None:
        for output, columns, nodes in self._segment.stores:
            in_memory, place = self._targets[output]
            if not in_memory:
                values = [self._value(node) for node in nodes]
                self._rows[len(self._program.inputs) + output].store_tile(columns.start, values)
                continue
            for column, node in zip(columns, nodes, strict=True):
                if node not in self._results or self._program.nodes[node].op in LEAVES:
                    self._keep(self._value(node), place + column)

    def _set(self, index: int, name: str) -> None:
        super()._set(index, name)
        for slot in self._results.get(index, ()):
            self._keep(name, slot)
        self._ages[index] = len(self._write.lines)

    def _value(self, index: int) -> str:
        if (
            index in self._results
            and index in self._ages
            and len(self._write.lines) - self._ages[index] > RELOADED_AFTER
        ):
            write = self._write
            name = write.let(
                f"load {write.vector}, ptr {self._at(self._results[index][0])}, align {self._bytes}"
            )
            self._values[index] = name
            self._ages[index] = len(write.lines)
        return super()._value(index)


def emit_repetition(repetition: Repetition, target: Processor, settings: Settings) -> list[str]:
    """Return the texts of LLVM modules that evaluate a repetition together."""
    layout = _PortSlots.of(repetition)
    bodies: list[str] = []
    calls: list[list[int]] = []
    size = layout.size
    for part, program in enumerate(repetition.parts):
        segments = schedule(program, settings.lanes, settings.segment)
        check_schedule(program, segments, settings.lanes)
        spilled = spill_slots(program, segments)
        slots = {node: layout.size + slot for node, slot in spilled.items()}
        size = max(size, layout.size + max(spilled.values(), default=-1) + 1)
        sources = list(_places(program.inputs, layout, repetition.inputs, arrays=part != 1))
        if part < 2:
            targets = list(_places(program.outputs, layout, (), arrays=False))
        else:
            targets = [(False, len(repetition.inputs) + k) for k in range(len(program.outputs))]
        first = len(bodies)
        bodies += [
            _PartBody(
                program,
                target,
                settings,
                segment,
                slots,
                first + k,
                inputs=sources,
                outputs=targets,
                at_once=part == 0,
            ).text("")
            for k, segment in enumerate(segments)
        ]
        calls.append(list(range(first, len(bodies))))
    declared = [f"declare void @segment{k}(ptr, i64, ptr)" for k in range(len(bodies))]
    loop = _loop(repetition, layout.slots[f"{_STATE}{GOES_ON}"], calls, size, settings.lanes)
    return [_module(texts, target, settings) for texts in (*([body] for body in bodies), [*declared, loop])]


def _places(
    ports: Sequence[Port], layout: _PortSlots, inputs: Sequence[Port], *, arrays: bool
) -> Iterator[tuple[bool, int]]:
    names = {port.name for port in inputs} if arrays else set[str]()
    for port in ports:
        yield (False, layout.arrays[port.name]) if port.name in names else (True, layout.slots[port.name])


def _module(functions: Sequence[str], target: Processor, settings: Settings) -> str:
    parts = [f'target triple = "{target.triple}"', *functions, *replacements(functions, settings.lanes)]
    return "\n".join([*parts, *declarations(settings.lanes), DECLARED_PREFETCH]) + "\n"


def _loop(
    repetition: Repetition, goes_on: int, calls: Sequence[Sequence[int]], slots: int, lanes: int
) -> str:
    """Return the entry function (`dynx.simd.emit`)."""
    vector = f"<{lanes} x double>"
    before, step, after = (
        [f"  call void @segment{k}(ptr %arguments, i64 %first, ptr %kept)" for k in numbers]
        for numbers in calls
    )
    return "\n".join(
        [
            f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
            "entry:",
            f"  %kept = alloca [{slots} x {vector}], align 64",
            f"  %goes_on_at = getelementptr {vector}, ptr %kept, i64 {goes_on}",
            "  %n = load i64, ptr %arguments",
            f"  %last = sub i64 %n, {lanes}",
            *prefetch_pointers(repetition.inputs, repetition.outputs),
            "  br label %group",
            "group:",
            "  %i = phi i64 [0, %entry], [%next, %end]",
            "  %late = icmp sgt i64 %i, %last",
            "  %first = select i1 %late, i64 %last, i64 %i",
            *prefetch(repetition.inputs, repetition.outputs, lanes),
            *before,
            "  br label %test",
            "test:",
            "  %count = phi i64 [0, %group], [%count_next, %repeat]",
            f"  %goes_on = load {vector}, ptr %goes_on_at, align {8 * lanes}",
            f"  %some = fcmp une {vector} %goes_on, zeroinitializer",
            f"  %bits = bitcast <{lanes} x i1> %some to i{lanes}",
            f"  %any = icmp ne i{lanes} %bits, 0",
            f"  %in_time = icmp slt i64 %count, {repetition.most}",
            "  %more = and i1 %any, %in_time",
            "  br i1 %more, label %repeat, label %end",
            "repeat:",
            *step,
            "  %count_next = add i64 %count, 1",
            "  br label %test",
            "end:",
            *after,
            f"  %next = add i64 %i, {lanes}",
            "  %more_groups = icmp slt i64 %next, %n",
            "  br i1 %more_groups, label %group, label %done",
            "done:",
            "  ret void",
            "}",
        ]
    )


def compile_repetition(repetition: Repetition, target: Processor, settings: Settings) -> Image:
    """Compile a repetition to an image with its inputs and outputs."""
    with collection_paused():
        texts = emit_repetition(repetition, target, settings)
        objects = tuple(compile_text(text, target) for text in texts)
    return Image(repetition.inputs, repetition.outputs, settings.lanes, target, objects)


def load_repetition(repetition: Repetition) -> Kernel:
    """Load the kernel of a repetition from the cache, or compile and store it."""
    target = host()
    settings = Settings(target.lanes, segment=SEGMENT)
    recipe = b"\n".join([*map(program_recipe, repetition.parts), str(repetition.most).encode()])
    return load_code(
        recipe, lambda: compile_repetition(repetition, target, settings), target, settings, Kernel
    )
