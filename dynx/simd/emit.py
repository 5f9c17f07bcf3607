"""LLVM IR for a program: one function that evaluates it for a whole batch.

The function takes a pointer to 64-bit integers: the number of samples, then for each input and output array
its address and its row stride in bytes. A row stride of 0 repeats one sample. There must be at least as many
samples as lanes; the last group starts early enough to end with the last sample, so no lane is masked and no
memory outside the arrays is accessed. Samples in different lanes are independent.

Large programs are divided into segments, each a function of its own, because compile time grows faster than
linearly with the length of straight-line code. Values that a later segment needs are spilled to memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from dynx.simd.elementary import elementary
from dynx.simd.expr import Op
from dynx.simd.ir_writer import NONTEMPORAL, NONTEMPORAL_METADATA, Writer
from dynx.simd.program import Port, Program, scalar_ranges
from dynx.simd.rows import (
    FILL,
    LOAD,
    STORE,
    Rows,
    Scratch,
    lane_names,
    load_column,
    row_pointers,
    scratch_functions,
    store_column,
)
from dynx.simd.schedule import (
    CACHE_LINE,
    ELEMENTARY,
    STORE_OPERATIONS,
    Segment,
    TrigGroup,
    operation_count,
    schedule,
    segment_operations,
    spill_slots,
    streamed_outputs,
)
from dynx.simd.target import Processor
from dynx.simd.trigonometry import declarations, replacements, sines_and_cosines
from dynx.simd.verify import check_schedule

if TYPE_CHECKING:
    from dynx.simd.streaming import Streaming

ENTRY = "kernel"
"""Name of the function."""

PREFETCHED_COLUMNS = range(16, 129)
"""Row lengths of arrays whose memory is prefetched before it is read or written.

Memory outside the caches stalls the processor. Short rows stall little, and processors prefetch long ones.
"""

PREFETCH_GROUPS = 8
"""Distance, in groups of samples, between prefetching a row and using it."""

PREFETCH_TO_READ, PREFETCH_TO_WRITE = "i32 0, i32 2", "i32 1, i32 3"
"""Hints of LLVM's prefetch: whether the memory will be written, and how near the processor it shall be."""

DECLARED_PREFETCH = "declare void @llvm.prefetch.p0(ptr, i32, i32, i32)"

MAX_OPTIMISED_LENGTH = 16_000
"""Length of a program above which LLVM does not optimise it. Optimising takes some 0.2 ms for each operation,
which is five times as long, and makes long programs a tenth to a fifth faster: they are limited by reading
their code from memory."""

QUICK_SEGMENT = 400
"""Length of the segments that are not optimised. In shorter ones fewer values leave the registers, but more
are spilled between them."""


MAX_QUICK_MODULE = 200_000
"""Length of the text of a module with several segments that are not optimised [characters]. A module of its
own for each segment takes a fifth longer; Ctrl-C takes effect between two modules."""


class ModuleText(NamedTuple):
    """The text of an LLVM module, and whether it is compiled without optimisation."""

    text: str
    quick: bool


@dataclass(frozen=True)
class Settings:
    """Options of code generation.

    `lanes` samples are evaluated at once. `fast` lets LLVM contract a product and a sum into one operation
    with one rounding and ignore the sign of zeros (its flags ``contract nsz``); otherwise every operation
    follows IEEE 754. NaN and infinity propagate in both cases. `segment` is the largest number of
    operations in one function. With `quick`, LLVM optimises nothing.
    """

    lanes: int
    fast: bool = True
    segment: int = 2500
    quick: bool = False

    def for_length(self, length: int) -> Settings:
        """Return the settings for a program of this length (`dynx.simd.schedule.program_length`)."""
        if length <= MAX_OPTIMISED_LENGTH:
            return self
        return replace(self, segment=min(self.segment, QUICK_SEGMENT), quick=True)

    @property
    def flags(self) -> str:
        """LLVM's fast-math flags for every arithmetic instruction; none where nothing is optimised."""
        return "contract nsz " if self.fast and not self.quick else ""


def emit(program: Program, target: Processor, settings: Settings) -> str:
    """Return the text of one LLVM module that evaluates a program."""
    bodies, rows, loop = _functions(program, target, settings, "internal")
    return _module([*bodies, *rows, loop], target, settings)


def emit_modules(program: Program, target: Processor, settings: Settings) -> list[ModuleText]:
    """Return the LLVM modules that evaluate a program together: segments, each in a module of its own if they
    are optimised, and the loop over the samples. Each is compiled in a fraction of a second."""
    bodies, rows, loop = _functions(program, target, settings, "")
    if len(bodies) == 1 and not settings.quick:
        return [ModuleText(emit(program, target, settings), quick=False)]
    groups: list[list[str]] = []
    room = 0
    for body in bodies:
        if not settings.quick or len(body) > room:
            groups.append([])
            room = MAX_QUICK_MODULE
        groups[-1].append(body)
        room -= len(body)
    declared = [f"declare void @{name}(ptr, i64, ptr)" for name in _called(len(bodies), settings)]
    if settings.quick:
        declared.append(f"declare void @{FILL}(ptr)")
    modules = [ModuleText(_module(texts, target, settings), settings.quick) for texts in groups]
    if rows:
        modules.append(ModuleText(_module(rows, target, settings), quick=False))
    return [*modules, ModuleText(_module([*declared, loop], target, settings), settings.quick)]


def _functions(
    program: Program, target: Processor, settings: Settings, linkage: str
) -> tuple[list[str], list[str], str]:
    """Return the texts of the segments, whose symbols have this linkage, of the functions for the scratch
    memory, if there is one, and of the entry function."""
    segments = schedule(program, settings.lanes, settings.segment)
    check_schedule(program, segments, settings.lanes)
    spilled = spill_slots(program, segments)
    made: Callable[..., SegmentBody]
    rows: list[str] = []
    if settings.quick:
        scratch = Scratch.of(program, spilled)
        made = partial(ScratchSegmentBody, first_result=scratch.first_result)
        slots, size = scratch.slots, scratch.size
        rows = scratch_functions(program, scratch, settings.lanes)
    else:
        made, slots, size = SegmentBody, spilled, max(spilled.values(), default=0) + 1
    streaming = _streaming(program, settings, size)
    bodies = [
        made(program, target, settings, segment, slots, number) for number, segment in enumerate(segments)
    ]
    if streaming and not settings.quick:
        _share_bursts(program, segments, bodies, streaming)
    texts = [body.text(linkage) for body in bodies]
    return texts, rows, _loop(program, settings, segments, size, streaming)


def _streaming(program: Program, settings: Settings, slots: int) -> Streaming | None:
    """Return what streams rows of results, if there are long ones; its jobs come after the `slots` vectors of
    the memory of values."""
    if not streamed_outputs(program, settings.lanes):
        return None
    from dynx.simd.streaming import Streaming

    return Streaming(program, settings.lanes, 8 * settings.lanes * slots)


def _share_bursts(
    program: Program, segments: Sequence[Segment], bodies: Sequence[SegmentBody], streaming: Streaming
) -> None:
    """Let each segment copy a share of the rows of the group before, by its share of the operations."""
    bursts = streaming.bursts()
    varying = [number for number, segment in enumerate(segments) if not segment.constant]
    work = [segment_operations(program, segments[number]) for number in varying]
    ends = [len(bursts) * sum(work[: k + 1]) // max(sum(work), 1) for k in range(len(work))]
    for number, begin, end in zip(varying, [0, *ends], ends, strict=False):
        bodies[number].copy_between(bursts[begin:end])


def _called(segments: int, settings: Settings) -> list[str]:
    """Return the names of the functions that evaluate a group of samples, in their order."""
    names = [f"segment{k}" for k in range(segments)]
    return [LOAD, *names, STORE] if settings.quick else names


def _module(functions: Sequence[str], target: Processor, settings: Settings) -> str:
    parts = [f'target triple = "{target.triple}"', *functions, *replacements(functions, settings.lanes)]
    parts += [*declarations(settings.lanes), DECLARED_PREFETCH]
    if any(NONTEMPORAL in function for function in functions):
        parts.append(NONTEMPORAL_METADATA)
    return "\n".join(parts) + "\n"


def _loop(
    program: Program,
    settings: Settings,
    segments: Sequence[Segment],
    slots: int,
    streaming: Streaming | None,
) -> str:
    """Return the entry function, a loop over groups of `lanes` samples, of which the last may overlap; and
    the functions that it needs.

    Code of several segments does not fit into the first-level cache. Each segment is therefore called for two
    groups in turn, unless results are streamed.
    """
    lanes = settings.lanes
    if streaming:
        slots += -(-streaming.job_bytes // (8 * lanes))
    called = _called(len(segments), settings)
    constant = [] if settings.quick else [f"segment{k}" for k, each in enumerate(segments) if each.constant]
    varying = [name for name in called if name not in constant]
    words, start = ("%words", "begin") if streaming else ("%arguments", "entry")
    paired = sum(bool(each.steps) for each in segments) > 1 and not settings.quick
    memories = ["%kept", "%kept_second"][: 1 + paired]
    prefetching = _prefetch_functions(program, lanes) if paired else {}
    lines = [
        *prefetching.values(),
        *(streaming.functions() if streaming else ()),
        f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
        "entry:",
        f"  %kept = alloca [{slots * len(memories)} x <{lanes} x double>], align 64",
        *(f"  {name} = getelementptr i8, ptr %kept, i64 {8 * lanes * slots}" for name in memories[1:]),
        "  %n = load i64, ptr %arguments",
        f"  %last = sub i64 %n, {lanes}",
        *([] if paired else prefetch_pointers(program.inputs, program.outputs)),
        *([f"  call void @{FILL}(ptr %kept)"] if settings.quick else []),
        *(streaming.begin(constant, memories) if streaming else ()),
        "  br label %group",
        "group:",
        f"  %i = phi i64 [0, %{start}], [%next, %{'grouped' if streaming or paired else 'group'}]",
        "  %late = icmp sgt i64 %i, %last",
        "  %first = select i1 %late, i64 %last, i64 %i",
    ]
    if paired:
        names = [*varying, *constant]
        lines += _pair_of_groups(names, list(prefetching), lanes, streams=streaming is not None)
        lines += [f"  call void @{name}(ptr %arguments, i64 %first)" for name in prefetching]
    else:
        lines += prefetch(program.inputs, program.outputs, lanes)
    lines += streaming.before_group() if streaming else []
    lines += [f"  call void @{name}(ptr {words}, i64 %first, ptr %kept)" for name in varying]
    lines += streaming.after_group(constant) if streaming else []
    lines += ["  br label %grouped", "grouped:"] if streaming or paired else []
    if paired:
        lines.append(
            f"  %count = phi i64 [{2 * lanes}, %pair], [{lanes}, %{'copied' if streaming else 'alone'}]"
        )
    lines += [
        f"  %next = add i64 %i, {'%count' if paired else lanes}",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %group, label %done",
        "done:",
        *(streaming.end() if streaming else ()),
        "  ret void",
        "}",
    ]
    return "\n".join(lines)


def _pair_of_groups(
    names: Sequence[str], prefetching: Sequence[str], lanes: int, *, streams: bool
) -> list[str]:
    """Return the code that calls each of the functions `names` for the samples from %first on and for the
    next ones, and between them those that prefetch. It continues at the label ``alone`` if there are no next
    samples, or if results are streamed."""
    pair = (("%first", "%kept"), ("%second", "%kept_second"))
    calls = [
        f"  call void @{name}(ptr %arguments, i64 {first}, ptr {kept})"
        for name in names
        for first, kept in pair
    ]
    # Many prefetches at once would stall the processor.
    rows = [f"  call void @{name}(ptr %arguments, i64 {first})" for first, _ in pair for name in prefetching]
    ends = [len(rows) * (k + 1) // len(calls) for k in range(len(calls))]
    parts = zip(calls, [0, *ends], ends, strict=False)
    return [
        f"  %i_second = add i64 %i, {lanes}",
        "  %several = icmp slt i64 %i_second, %n",
        f"  %two = select i1 {'%streams' if streams else 'false'}, i1 false, i1 %several",
        "  br i1 %two, label %pair, label %alone",
        "pair:",
        "  %late_second = icmp sgt i64 %i_second, %last",
        "  %second = select i1 %late_second, i64 %last, i64 %i_second",
        *(line for call, begin, end in parts for line in (*rows[begin:end], call)),
        "  br label %grouped",
        "alone:",
    ]


def _prefetch_functions(program: Program, lanes: int) -> dict[str, str]:
    """Return functions of the arguments and the first sample of a group, by name, each of which prefetches
    half of the rows of an array that a later group needs."""
    pointers = prefetch_pointers(program.inputs, program.outputs)
    rows = list(_prefetched_rows(program.inputs, program.outputs, lanes))
    found = {}
    for number in range(2 * len(rows) // lanes):
        half = rows[number * lanes // 2 : (number + 1) * lanes // 2]
        name = f"prefetch{number}"
        head = f"define internal void @{name}(ptr nocapture readonly %arguments, i64 %first) noinline {{"
        found[name] = "\n".join([head, "entry:", *pointers, *chain(*half), "  ret void", "}"])
    return found


def _prefetched_arrays(ports: Sequence[Port]) -> list[tuple[int, int]]:
    """List (array number, row length) of the arrays whose rows are prefetched."""
    return [(number, port.size) for number, port in enumerate(ports) if port.size in PREFETCHED_COLUMNS]


def prefetch_pointers(inputs: Sequence[Port], outputs: Sequence[Port]) -> list[str]:
    """Return the code that loads addresses and row strides of the prefetched arrays."""
    lines = []
    for k, _ in _prefetched_arrays([*inputs, *outputs]):
        lines += [
            f"  %at{k} = getelementptr inbounds i64, ptr %arguments, i64 {1 + 2 * k}",
            f"  %base{k} = load ptr, ptr %at{k}",
            f"  %by{k} = getelementptr inbounds i64, ptr %arguments, i64 {2 + 2 * k}",
            f"  %stride{k} = load i64, ptr %by{k}",
        ]
    return lines


def prefetch(inputs: Sequence[Port], outputs: Sequence[Port], lanes: int) -> list[str]:
    """Return the code that prefetches the rows of a later group; a prefetch beyond an array is harmless."""
    return list(chain(*_prefetched_rows(inputs, outputs, lanes)))


def _prefetched_rows(inputs: Sequence[Port], outputs: Sequence[Port], lanes: int) -> Iterator[list[str]]:
    """Yield the code that prefetches each row of a later group than that of %first."""
    for k, size in _prefetched_arrays([*inputs, *outputs]):
        hint = PREFETCH_TO_READ if k < len(inputs) else PREFETCH_TO_WRITE
        for lane in range(lanes):
            row = f"{k}_{lane}"
            lines = [
                f"  %sample{row} = add i64 %first, {PREFETCH_GROUPS * lanes + lane}",
                f"  %offset{row} = mul i64 %sample{row}, %stride{k}",
                f"  %row{row} = getelementptr i8, ptr %base{k}, i64 %offset{row}",
            ]
            for start in range(0, 8 * size, CACHE_LINE):
                place = f"%line{row}_{start}"
                lines += [
                    f"  {place} = getelementptr i8, ptr %row{row}, i64 {start}",
                    f"  call void @llvm.prefetch.p0(ptr {place}, {hint}, i32 1)",
                ]
            yield lines


_BINARY: dict[Op, str] = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_ORDER: dict[Op, str] = {"min": "olt", "max": "ogt"}
_COMPARISON: dict[Op, str] = {"less": "olt", "less_equal": "ole", "equal": "oeq"}
_COMBINATION: dict[Op, str] = {"mul": "and", "min": "and", "max": "or"}
"""Operations on masks that do what those on numbers 1 and 0 do."""


class SegmentBody:
    """One segment as a function of the arguments, the first sample of the group, and the values in memory."""

    def __init__(
        self,
        program: Program,
        target: Processor,
        settings: Settings,
        segment: Segment,
        slots: dict[int, int],
        number: int,
    ) -> None:
        self._program, self._settings, self._segment = program, settings, segment
        self._slots = slots
        self._number = number
        self._bytes = 8 * settings.lanes
        self._write = Writer(settings.lanes, fma=target.fma)
        self._values: dict[int, str] = {}
        self._conditions: dict[int, str] = {}
        """Masks of the nodes that are 1 in some lanes and 0 in the others, as far as they were computed here.
        LLVM drops the vectors of those that are only selected by."""
        ports = [*program.inputs, *program.outputs]
        self._rows = [
            Rows(self._write, port.size, partial(self._pointers, k)) for k, port in enumerate(ports)
        ]
        self._loaded: set[int] = set()
        self._columns: set[int] = set()
        """Inputs of one column."""
        self._stored_columns: list[str] = []
        """Code that stores the outputs of one column."""
        self._bursts: Sequence[int] = ()
        """Jobs of the bursts (`dynx.simd.streaming`) that are still to be written."""
        self._interval = self._since_burst = 0.0
        """Operations from one burst to the next, and since the last."""
        self._slot_port = [
            (k, column) for k, port in enumerate(program.inputs) for column in range(port.size)
        ]

    def text(self, linkage: str = "internal") -> str:
        """Return the text of the function, whose symbol has this linkage."""
        self._compute_steps()
        self._store_results()
        head = (
            f"define {linkage} void @segment{self._number}"
            "(ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %kept) {"
        )
        lanes = self._settings.lanes
        columns = [line for number in sorted(self._columns) for line in load_column(number, lanes)]
        heads = [line for number in sorted(self._loaded) for line in row_pointers(number, lanes)]
        lines = [*columns, *heads, *self._write.lines, *self._stored_columns]
        return "\n".join([head, "entry:", *lines, "  ret void", "}"])

    def copy_between(self, bursts: Sequence[int]) -> None:
        """Let the segment copy rows between its operations: `bursts` are the places of their jobs."""
        self._bursts = bursts
        self._interval = segment_operations(self._program, self._segment) / max(len(bursts), 1)

    def _pass(self, operations: int) -> None:
        """Copy rows if it is time to, after so many more operations."""
        self._since_burst += operations
        while self._bursts and self._since_burst >= self._interval:
            from dynx.simd.streaming import copy_burst

            copy_burst(self._write, self._bursts[0])
            self._bursts, self._since_burst = self._bursts[1:], self._since_burst - self._interval

    # -- values -------------------------------------------------------------------------------------

    def _compute_steps(self) -> None:
        for step in self._segment.steps:
            if isinstance(step, TrigGroup):
                self._trig(step)
            else:
                self._compute(step)
                self._pass(operation_count(self._program, step))

    def _value(self, index: int) -> str:
        """Return the name of a node's vector: computed here, in memory, constant, or an input."""
        found = self._values.get(index)
        if found is not None:
            return found
        node = self._program.nodes[index]
        if (slot := self._slots.get(index)) is not None:
            name = self._write.let(f"load {self._write.vector}, ptr {self._at(slot)}, align {self._bytes}")
        elif node.op == "constant":
            name = self._write.splat(node.value)
        else:
            name = self._input(*self._slot_port[node.slot])
        self._values[index] = name
        return name

    def _mask(self, index: int) -> str:
        """Return the name of the mask of the lanes in which a node is not 0."""
        found = self._conditions.get(index)
        return found or self._write.compare("une", self._value(index), self._write.splat(0.0))

    def _condition(self, index: int, mask: str) -> str:
        """Note the mask of a condition; return the name of its vector of 1 and 0."""
        self._conditions[index] = mask
        return self._write.choose(mask, self._write.splat(1.0), self._write.splat(0.0))

    def _combined(self, index: int) -> str | None:
        """Return the name of the mask of a node that combines conditions, or None for another node."""
        node, conditions = self._program.nodes[index], self._conditions
        if node.op in _COMBINATION and all(arg in conditions for arg in node.args):
            one, other = (conditions[arg] for arg in node.args)
            return self._write.let(f"{_COMBINATION[node.op]} {self._write.mask} {one}, {other}")
        if node.op != "select" or node.args[0] not in conditions:
            return None
        constants = [self._program.nodes[arg] for arg in node.args[1:]]
        says = all(each.op == "constant" for each in constants) and [each.value for each in constants]
        return conditions[node.args[0]] if says == [1.0, 0.0] else None

    def _input(self, port: int, column: int) -> str:
        """Return the name of the vector of one column of an input."""
        if self._program.inputs[port].size == 1 < self._settings.lanes:
            self._columns.add(port)
            return f"%x{port}"
        return self._rows[port].load(column)

    def _compute(self, index: int) -> None:
        write, node, flags = self._write, self._program.nodes[index], self._settings.flags
        args = [self._value(arg) for arg in node.args]
        if node.op in _BINARY:
            name = write.let(f"{_BINARY[node.op]} {flags}{write.vector} {args[0]}, {args[1]}")
        elif node.op in _ORDER:
            name = write.select(_ORDER[node.op], *args, *args)
        elif node.op in _COMPARISON:
            name = self._condition(index, write.compare(_COMPARISON[node.op], *args))
        elif (mask := self._combined(index)) is not None:
            name = self._condition(index, mask)
        elif node.op == "select":
            name = write.choose(self._mask(node.args[0]), *args[1:])
        elif node.op in ELEMENTARY:
            name = elementary(write, node.op, args[0])
        elif node.op == "neg":
            name = write.let(f"fneg {flags}{write.vector} {args[0]}")
        elif node.op == "abs":
            name = write.magnitude(args[0])
        else:
            name = write.let(f"call {write.vector} @llvm.sqrt.v{write.lanes}f64({write.vector} {args[0]})")
        self._set(index, name)

    def _trig(self, group: TrigGroup) -> None:
        angles = [self._value(angle) for angle in group.angles]
        for found, (sin, cos) in zip(sines_and_cosines(self._write, angles), group.nodes, strict=True):
            for index, name in ((sin, found.sin), (cos, found.cos)):
                if index is not None:
                    self._set(index, name)

    def _set(self, index: int, name: str) -> None:
        self._values[index] = name
        if index in self._segment.spilled:
            self._keep(name, self._slots[index])

    def _keep(self, name: str, slot: int) -> None:
        """Write a vector to a slot of the memory."""
        self._write.do(f"store {self._write.vector} {name}, ptr {self._at(slot)}, align {self._bytes}")

    def _at(self, slot: int) -> str:
        return self._write.let(f"getelementptr i8, ptr %kept, i64 {slot * self._bytes}")

    # -- rows ---------------------------------------------------------------------------------------

    def _store_results(self) -> None:
        """Write the tiles of outputs that this segment completes."""
        lanes = self._settings.lanes
        for output, columns, nodes in self._segment.stores:
            number, values = len(self._program.inputs) + output, [self._value(node) for node in nodes]
            if self._program.outputs[output].size == 1 < lanes:
                self._stored_columns += store_column(number, lanes, *values)
            else:
                self._rows[number].store_tile(columns.start, values)
            self._pass(STORE_OPERATIONS * len(columns))

    def _pointers(self, port: int) -> list[str]:
        """Return the row pointers of one array, one per lane, which the head of the function computes."""
        self._loaded.add(port)
        return lane_names(port, self._settings.lanes)


class ScratchSegmentBody(SegmentBody):
    """One segment that writes its results to the scratch memory (`dynx.simd.rows`)."""

    def __init__(self, *arguments: Any, first_result: int) -> None:
        super().__init__(*arguments)
        self._first_results = [first_result + at.start for _, at in scalar_ranges(self._program.outputs)]

    def _store_results(self) -> None:
        for output, columns, nodes in self._segment.stores:
            for column, node in zip(columns, nodes, strict=True):
                self._keep(self._value(node), self._first_results[output] + column)
