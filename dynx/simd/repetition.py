"""A traced function with loops inside: code, a step that is repeated, code, perhaps another loop, and code.

The function receives `repeat`, which repeats a step on arrays of symbols as often as a state says that it
goes on. All parts become one kernel. Values that later parts need are kept in memory, a vector each, so that
neither code nor time of compilation grows with the number of repetitions.

The whole function may be evaluated several times, in `turns`: an output with the name of an input is that
input of the next turn. Inputs are then read from their arrays once, and outputs are written once.

A lane whose loop has ended keeps its state whatever other lanes do. So its results depend neither on the
other lanes nor on their number. The loop of a vector ends when those of all its lanes have ended; where none
of them begins, it takes only the time of that test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from dynx.errors import TraceError
from dynx.simd.cache import load_code, program_recipe
from dynx.simd.elementary import DECLARED_ROOT_ESTIMATE, ROOT_ESTIMATE, quotient_by_root
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

_KEPT = "kept."
"""Beginning of the names of ports of values that later parts need."""

_TURN = "turn."
"""Beginning of the names of inputs and outputs of the function that stay in memory from turn to turn."""

_STATE = "state."
"""Beginning of the names of ports of the states, since arrays of the caller may have the same names."""

SEGMENT = 12_000
"""Length of the segments (`dynx.simd.emit`). A long one takes a tenth more time to compile than short ones,
and the code is a fifth faster, because fewer values go through memory."""

RELOADED_AFTER = 150
"""Lines of code after which a value that is kept in memory is read from there again. The compiler would keep
it on the stack as well, and both together exceed the first-level cache."""

MOST_OF_NODE = 50
"""Most operations of a node (`dynx.simd.schedule.operation_count`)."""

_LEAKS = "code outside of a loop uses what a step of the loop computed, beside the state"

Numbers = dict[str, Array]
Step = Callable[[Numbers], Numbers]


@dataclass(frozen=True)
class Repetition:
    """The parts of a function with loops."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    codes: tuple[Program, ...]
    """Code before the first loop, between loops, and after the last one. Each but the last computes the first
    state of the next loop, and values that later parts need."""
    steps: tuple[Program, ...]
    """For each loop the step from its state, and from what was computed before, to the next state."""
    most: tuple[int, ...]
    """Largest number of repetitions of each loop."""
    turns: int = 1
    """Number of evaluations of the function one after another."""

    @property
    def parts(self) -> tuple[Program, ...]:
        """All parts in order: code, then a step and code for each loop."""
        pairs = zip(self.steps, self.codes[1:], strict=True)
        return self.codes[0], *(part for pair in pairs for part in pair)


def trace_repetition(
    function: Callable[..., Mapping[str, Array]],
    inputs: Mapping[str, tuple[int, ...]],
    *,
    turns: int = 1,
    simplify: Simplify | None = FAST,
) -> Repetition:
    """Trace ``function(repeat=repeat, **arrays)``, which returns a mapping from output names to arrays.

    It calls ``repeat(step, state, most)`` for each loop, which returns the last state. ``step(state)``
    returns the next state, arrays by the same names; it may also use whatever was computed before. What it
    computes without the state is computed once. The loop ends after `most` steps, or where ``goes_on`` (1,)
    of the state is 0. In each of the `turns` after the first, inputs with the name of an output are that
    output of the turn before. Raises TraceError as `trace` does, or if the function does not keep to this.
    """
    with collection_paused():
        return replace(_Tracer(inputs, simplify).repetition(function), turns=turns)


@dataclass
class _Loop:
    """A loop in the trace."""

    state: list[Port]
    in_loop: range
    """Slots of the state in the loop."""
    last: range
    """Slots of the last state."""
    first_state: list[int]
    """Nodes of the first state."""
    most: int
    next_state: list[int] = field(default_factory=list)
    """Nodes of the next state."""


class _Tracer:
    """Trace of all parts in one graph, which is then divided.

    Behind the inputs of the function follow, for each loop, those of the state in it, and those of the last
    state.
    """

    def __init__(self, inputs: Mapping[str, tuple[int, ...]], simplify: Simplify | None) -> None:
        self._graph = Graph(simplify)
        self._ports = [Port(name, tuple(shape)) for name, shape in inputs.items()]
        self._size = self._slots = sum(port.size for port in self._ports)
        self._arguments = {
            port.name: symbols(self._graph, port, slots.start) for port, slots in scalar_ranges(self._ports)
        }
        self._loops: list[_Loop] = []
        self._is_open = False

    def repetition(self, function: Callable[..., Mapping[str, Array]]) -> Repetition:
        """Return the trace of a function."""
        outputs, results = self._entries(function(repeat=self._repeat, **self._arguments))
        loops = self._loops
        if not loops:
            raise TraceError("the traced function repeats nothing")
        stages, inside = self._stages()
        # Results of each code, without the values it keeps, and of each step.
        wanted = [*(loop.first_state for loop in loops), results]
        if any(inside[index] for nodes in wanted for index in nodes):
            raise TraceError(_LEAKS)
        kept: list[set[int]] = [set() for _ in loops]
        for number, loop in enumerate(loops, 1):
            own = [each == number for each in inside]
            for index in self._needed(loop.next_state, own, inputs=True):
                kept[stages[index]].add(index)
        # From the last code on, because what a code keeps for later ones may need values of earlier ones.
        for number in range(len(loops), 0, -1):
            own = [stage == number for stage in stages]
            later = kept[number] if number < len(loops) else set[int]()
            for index in self._needed([*wanted[number], *sorted(later)], own, inputs=False):
                kept[stages[index]].add(index)
        values = [sorted(each) for each in kept]
        codes, steps = [], []
        for number in range(len(loops) + 1):
            if number < len(loops):
                ports = [*loops[number].state, Port(f"{_KEPT}{number}", (len(values[number]),))]
                nodes = [*wanted[number], *values[number]]
            else:
                ports, nodes = outputs, results
            codes.append(self._part(number, values[:number], ports, nodes, step=False))
            if number < len(loops):
                loop = loops[number]
                steps.append(self._part(number, values[: number + 1], loop.state, loop.next_state, step=True))
        found = Repetition(
            tuple(self._ports),
            tuple(outputs),
            tuple(codes),
            tuple(steps),
            tuple(loop.most for loop in loops),
        )
        for program in found.parts:
            check_program(program)
        return found

    def _stages(self) -> tuple[list[int], list[int]]:
        """Return for each node the number of loops whose last state it depends on, and the number, from 1 on,
        of the loop inside of which it is; 0 outside of all."""
        of_slot: dict[int, tuple[int, int]] = {}
        for number, loop in enumerate(self._loops, 1):
            of_slot.update(dict.fromkeys(loop.in_loop, (0, number)))
            of_slot.update(dict.fromkeys(loop.last, (number, 0)))
        stages: list[int] = []
        inside: list[int] = []
        for node in self._graph.nodes:
            if node.op == "input":
                stage, loop_number = of_slot.get(node.slot, (0, 0))
            else:
                stage = max((stages[arg] for arg in node.args), default=0)
                within = {inside[arg] for arg in node.args} - {0}
                if len(within) > 1:
                    raise TraceError(_LEAKS)
                loop_number = within.pop() if within else 0
            if loop_number and stage >= loop_number:
                raise TraceError(_LEAKS)
            stages.append(stage)
            inside.append(loop_number)
        return stages, inside

    def _needed(self, results: Sequence[int], own: Sequence[bool], *, inputs: bool) -> set[int]:
        """Return the nodes that `results` or their `own` ancestors use and that are not own: no constants, no
        states, and `inputs` of the function only if they shall be kept too."""
        alive, needed = set(results), set[int]()
        for index in range(max(alive, default=-1), -1, -1):
            node = self._graph.nodes[index]
            if index not in alive or node.op == "constant":
                continue
            if node.op == "input" and (node.slot >= self._size or not inputs):
                continue
            if own[index]:
                alive.update(node.args)
            else:
                needed.add(index)
        return needed

    def _part(
        self,
        number: int,
        kept: Sequence[Sequence[int]],
        outputs: Sequence[Port],
        results: Sequence[int],
        *,
        step: bool,
    ) -> Program:
        """Return the program of a part after `number` loops, or of the step of the next one.

        Its inputs are those of the function, which a step does not have, the last states, the state of a
        step, and the values of `kept`.
        """
        graph = Graph()
        graph.nodes = list(self._graph.nodes)
        ports = [] if step else list(self._ports)
        slots = {} if step else {slot: slot for slot in range(self._size)}
        size = len(slots)
        states = [(loop.state, loop.last) for loop in self._loops[:number]]
        if step:
            states.append((self._loops[number].state, self._loops[number].in_loop))
        for state, places in states:
            ports += state
            slots.update(zip(places, range(size, size + len(places)), strict=True))
            size += len(places)
        for index, node in enumerate(graph.nodes):
            if node.op == "input" and node.slot in slots:
                graph.nodes[index] = Node("input", slot=slots[node.slot])
        for k, nodes in enumerate(kept):
            ports.append(Port(f"{_KEPT}{k}", (len(nodes),)))
            for place, index in enumerate(nodes, size):
                # A code reads the inputs of the function from their arrays.
                if step or self._graph.nodes[index].op != "input":
                    graph.nodes[index] = Node("input", slot=place)
            size += len(nodes)
        return extract_program(graph, ports, outputs, results)

    def _repeat(self, step: Step, state: Numbers, most: int) -> Numbers:
        if self._is_open:
            raise TraceError("the step of a loop has a loop inside")
        if GOES_ON not in state:
            raise TraceError(f"the state of a loop has no entry {GOES_ON}")
        number = len(self._loops)
        named = {f"{_STATE}{number}.{name}": np.asarray(array) for name, array in state.items()}
        ports, first = self._entries(named)
        middle, end = self._slots + len(first), self._slots + 2 * len(first)
        loop = _Loop(ports, range(self._slots, middle), range(middle, end), first, most)
        self._loops.append(loop)
        self._slots = end
        old, last = (self._state(state, ports, slots.start) for slots in (loop.in_loop, loop.last))
        self._is_open = True
        new = step(old)
        self._is_open = False
        goes_on = old[GOES_ON].ravel()[0]
        chosen = {}
        for name, array in old.items():
            entries = np.empty(array.size, dtype=object)
            pairs = zip(np.ravel(new[name]), array.ravel(), strict=True)
            entries[:] = [select(goes_on, a, b) for a, b in pairs]
            chosen[name] = entries.reshape(array.shape)
        _, loop.next_state = self._entries(chosen)
        return last

    def _state(self, state: Numbers, ports: Sequence[Port], start: int) -> Numbers:
        return {
            name: symbols(self._graph, port, start + slots.start)
            for name, (port, slots) in zip(state, scalar_ranges(ports), strict=True)
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
        for code in repetition.codes[:-1]:
            for port in code.outputs:
                slots[port.name] = size
                size += port.size
        if repetition.turns > 1:
            for port in (*repetition.inputs, *repetition.outputs):
                if (name := f"{_TURN}{port.name}") not in slots:
                    slots[name] = size
                    size += port.size
        return cls(arrays, slots, size)

    def of_array(self, name: str, number: int) -> tuple[bool, int]:
        """Return the place of an input or output of the function: in memory, if there are turns, or array
        `number`."""
        slot = self.slots.get(f"{_TURN}{name}")
        return (False, number) if slot is None else (True, slot)


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
        is_step: bool,
        results: Mapping[int, Sequence[int]],
    ) -> None:
        """`inputs` and `outputs` have for each port whether it is in memory, and the number of its array or
        its first slot. `results` are the slots of nodes that are written at once: until the end of the code,
        all would have to stay in registers or on the stack. Quotients by roots are correct to 2 ulp in a
        step."""
        super().__init__(program, target, settings, segment, slots, number)
        self._sources, self._targets = inputs, outputs
        self._estimates_roots = is_step and target.estimates_roots and target.lanes == settings.lanes
        places = zip((*program.inputs, *program.outputs), (*inputs, *outputs), strict=True)
        self._rows = [Rows(self._write, port.size, partial(self._pointers, at)) for port, (_, at) in places]
        self._ages: dict[int, int] = {}
        self._results = results

    def _input(self, port: int, column: int) -> str:
        in_memory, place = self._sources[port]
        if in_memory:
            write = self._write
            return write.let(f"load {write.vector}, ptr {self._at(place + column)}, align {self._bytes}")
        return self._rows[port].load(column)

    def _store_results(self) -> None:
        kept: dict[int, int] = {}
        for output, columns, nodes in self._segment.stores:
            in_memory, place = self._targets[output]
            if not in_memory:
                values = [self._value(node) for node in nodes]
                self._rows[len(self._program.inputs) + output].store_tile(columns.start, values)
                continue
            for column, node in zip(columns, nodes, strict=True):
                if node not in self._results and self._slot_of(node) != place + column:
                    kept[place + column] = node
        # Results may replace values that others are read from.
        for slot, name in [(slot, self._value(node)) for slot, node in kept.items()]:
            self._keep(name, slot)

    def _slot_of(self, index: int) -> int | None:
        """Return the slot of an input in memory, None for another node."""
        node = self._program.nodes[index]
        if node.op != "input":
            return None
        port, column = self._slot_port[node.slot]
        in_memory, place = self._sources[port]
        return place + column if in_memory else None

    def _compute(self, index: int) -> None:
        nodes = self._program.nodes
        node = nodes[index]
        if self._estimates_roots and node.op == "div" and nodes[node.args[1]].op == "sqrt":
            (radicand,) = nodes[node.args[1]].args
            a, x = self._value(node.args[0]), self._value(radicand)
            self._set(index, quotient_by_root(self._write, a, x))
        else:
            super()._compute(index)

    def _set(self, index: int, name: str) -> None:
        super()._set(index, name)
        for slot in self._results.get(index, ()):
            self._keep(name, slot)
        self._ages[index] = len(self._write.lines)

    def _value(self, index: int) -> str:
        write, now = self._write, len(self._write.lines)
        results = self._results.get(index)
        slot = results[0] if results else self._slot_of(index)
        if slot is not None and now - self._ages.get(index, now) > RELOADED_AFTER:
            name = write.let(f"load {write.vector}, ptr {self._at(slot)}, align {self._bytes}")
            self._values[index] = name
            self._ages[index] = len(write.lines)
            return name
        found = super()._value(index)
        self._ages.setdefault(index, now)
        return found


def emit_repetition(repetition: Repetition, target: Processor, settings: Settings) -> list[str]:
    """Return the texts of LLVM modules that evaluate a repetition together."""
    layout = _PortSlots.of(repetition)
    bodies: list[str] = []
    calls: list[list[int]] = []
    size, last, inputs = layout.size, len(repetition.parts) - 1, repetition.inputs
    has_turns = repetition.turns > 1
    read: set[int] = set()
    """Slots that the parts read."""

    def add(
        program: Program,
        sources: Sequence[tuple[bool, int]],
        targets: Sequence[tuple[bool, int]],
        *,
        longest: int = settings.segment,
        is_step: bool = False,
        at_once: bool = False,
    ) -> list[int]:
        """Write the segments of a program; return their numbers."""
        nonlocal size
        in_memory = all(each for each, _ in targets)
        segments = schedule(program, settings.lanes, longest, in_memory=in_memory)
        check_schedule(program, segments, settings.lanes)
        results = _results(program, targets) if at_once else {}
        for segment in segments:
            segment.spilled -= results.keys()
        spilled = spill_slots(program, segments)
        slots = {node: found[0] for node, found in results.items()}
        slots |= {node: layout.size + slot for node, slot in spilled.items()}
        size = max(size, layout.size + max(spilled.values(), default=-1) + 1)
        first = len(bodies)
        for k, segment in enumerate(segments):
            body = _PartBody(
                program,
                target,
                settings,
                segment,
                slots,
                first + k,
                inputs=sources,
                outputs=targets,
                is_step=is_step,
                results=results,
            )
            bodies.append(body.text(""))
        read.update(_read_slots(program, sources))
        return list(range(first, len(bodies)))

    outputs = [(False, len(inputs) + k) for k in range(len(repetition.outputs))]
    for part, program in enumerate(repetition.parts):
        is_step = part % 2 == 1
        sources = list(_places(program.inputs, layout, inputs, arrays=not is_step))
        if part < last:
            # Results in memory are written at once, unless they replace values that are read.
            targets = list(_places(program.outputs, layout, (), arrays=False))
            calls.append(add(program, sources, targets, is_step=is_step, at_once=not is_step))
        else:
            targets = [
                layout.of_array(port.name, k) for port, (_, k) in zip(program.outputs, outputs, strict=True)
            ]
            longest = len(program.nodes) * MOST_OF_NODE if has_turns else settings.segment
            calls.append(add(program, sources, targets, longest=longest))
    ends: tuple[list[int], list[int]] = [], []
    if has_turns:
        arrays = [(False, k) for k in range(len(inputs))]
        kept = [layout.of_array(port.name, 0) for port in repetition.outputs]
        every = _identity(repetition.outputs)
        ends[1].extend(add(every, kept, outputs))
        slots = [
            layout.slots[f"{_TURN}{port.name}"] + column for port in inputs for column in range(port.size)
        ]
        used = [slot in read for slot in slots]
        targets = [(True, slot) for slot, is_used in zip(slots, used, strict=True) if is_used]
        ends[0].extend(add(_columns(inputs, used), arrays, targets))
    declared = [f"declare void @segment{k}(ptr, i64, ptr)" for k in range(len(bodies))]
    goes_on = [layout.slots[f"{_STATE}{k}.{GOES_ON}"] for k in range(len(repetition.steps))]
    loop = _loop(repetition, goes_on, calls, ends, size, settings.lanes)
    return [_module(texts, target, settings) for texts in (*([body] for body in bodies), [*declared, loop])]


def _identity(ports: Sequence[Port]) -> Program:
    """Return the program whose outputs are its inputs."""
    size = sum(port.size for port in ports)
    return Program(
        tuple(Node("input", slot=k) for k in range(size)), tuple(ports), tuple(ports), tuple(range(size))
    )


def _columns(ports: Sequence[Port], used: Sequence[bool]) -> Program:
    """Return the program whose outputs are the columns of its inputs that are `used`, each by itself."""
    nodes = tuple(Node("input", slot=k) for k, is_used in enumerate(used) if is_used)
    outputs = tuple(Port(f"column{k}", (1,)) for k in range(len(nodes)))
    return Program(nodes, tuple(ports), outputs, tuple(range(len(nodes))))


def _read_slots(program: Program, sources: Sequence[tuple[bool, int]]) -> Iterator[int]:
    """Yield the slots of memory that a program reads."""
    of_scalar = [
        place + column if in_memory else None
        for (in_memory, place), port in zip(sources, program.inputs, strict=True)
        for column in range(port.size)
    ]
    for node in program.nodes:
        if node.op == "input" and (slot := of_scalar[node.slot]) is not None:
            yield slot


def _results(program: Program, targets: Sequence[tuple[bool, int]]) -> dict[int, list[int]]:
    """Return the slots of the computed results of a program, by node, from the first slot of each output."""
    found: dict[int, list[int]] = {}
    for (_, place), (_, scalars) in zip(targets, scalar_ranges(program.outputs), strict=True):
        for slot, scalar in enumerate(scalars, place):
            node = program.results[scalar]
            if program.nodes[node].op not in LEAVES:
                found.setdefault(node, []).append(slot)
    return found


def _places(
    ports: Sequence[Port], layout: _PortSlots, inputs: Sequence[Port], *, arrays: bool
) -> Iterator[tuple[bool, int]]:
    names = {port.name for port in inputs} if arrays else set[str]()
    for port in ports:
        if port.name in names:
            yield layout.of_array(port.name, layout.arrays[port.name])
        else:
            yield True, layout.slots[port.name]


def _module(functions: Sequence[str], target: Processor, settings: Settings) -> str:
    parts = [f'target triple = "{target.triple}"', *functions, *replacements(functions, settings.lanes)]
    parts += [*declarations(settings.lanes), DECLARED_PREFETCH]
    if any(ROOT_ESTIMATE in function for function in functions):
        parts.append(DECLARED_ROOT_ESTIMATE)
    return "\n".join(parts) + "\n"


def _loop(
    repetition: Repetition,
    goes_on: Sequence[int],
    calls: Sequence[Sequence[int]],
    ends: Sequence[Sequence[int]],
    slots: int,
    lanes: int,
) -> str:
    """Return the entry function (`dynx.simd.emit`). `ends` are the segments before and after all turns."""
    vector = f"<{lanes} x double>"
    before, after, *parts = [
        [f"  call void @segment{k}(ptr %arguments, i64 %first, ptr %kept)" for k in numbers]
        for numbers in (*ends, *calls)
    ]
    final = len(goes_on) - 1
    lines = [
        f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
        "entry:",
        f"  %kept = alloca [{slots} x {vector}], align 64",
        *(
            f"  %goes_on_at{k} = getelementptr {vector}, ptr %kept, i64 {slot}"
            for k, slot in enumerate(goes_on)
        ),
        "  %n = load i64, ptr %arguments",
        f"  %last = sub i64 %n, {lanes}",
        *prefetch_pointers(repetition.inputs, repetition.outputs),
        "  br label %group",
        "group:",
        "  %i = phi i64 [0, %entry], [%next, %turned]",
        "  %late = icmp sgt i64 %i, %last",
        "  %first = select i1 %late, i64 %last, i64 %i",
        *prefetch(repetition.inputs, repetition.outputs, lanes),
        *before,
        "  br label %turn",
        "turn:",
        f"  %turns = phi i64 [1, %group], [%more_turns, %end{final}]",
        *parts[0],
    ]
    for k, most in enumerate(repetition.most):
        entered = "turn" if k == 0 else f"end{k - 1}"
        lines += [
            f"  br label %test{k}",
            f"test{k}:",
            f"  %count{k} = phi i64 [0, %{entered}], [%next{k}, %repeat{k}]",
            f"  %goes_on{k} = load {vector}, ptr %goes_on_at{k}, align {8 * lanes}",
            f"  %some{k} = fcmp une {vector} %goes_on{k}, zeroinitializer",
            f"  %bits{k} = bitcast <{lanes} x i1> %some{k} to i{lanes}",
            f"  %any{k} = icmp ne i{lanes} %bits{k}, 0",
            f"  %in_time{k} = icmp slt i64 %count{k}, {most}",
            f"  %more{k} = and i1 %any{k}, %in_time{k}",
            f"  br i1 %more{k}, label %repeat{k}, label %end{k}",
            f"repeat{k}:",
            *parts[2 * k + 1],
            f"  %next{k} = add i64 %count{k}, 1",
            f"  br label %test{k}",
            f"end{k}:",
            *parts[2 * k + 2],
        ]
    return "\n".join(
        [
            *lines,
            "  %more_turns = add i64 %turns, 1",
            f"  %again = icmp slt i64 %turns, {repetition.turns}",
            "  br i1 %again, label %turn, label %turned",
            "turned:",
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
    numbers = f"{repetition.most} {repetition.turns}"
    recipe = b"\n".join([*map(program_recipe, repetition.parts), numbers.encode()])
    return load_code(
        recipe, lambda: compile_repetition(repetition, target, settings), target, settings, Kernel
    )
