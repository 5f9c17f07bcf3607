"""From a program to LLVM IR: one function that evaluates it for a whole batch.

The function takes one pointer, to 64-bit integers: the number of samples, then for each input and
output array its address and the distance of its rows in bytes (`arguments` below writes them). A row
distance of 0 repeats one sample. There must be at least as many samples as lanes; the last group
starts early enough to end with the last sample, so nothing is masked and nothing beyond the arrays is
touched. Samples in different lanes have nothing to do with each other.

Large programs are cut into segments, each a function of its own, for the time that compilers need
grows faster than the length of straight-line code. Values that a later segment needs are kept in
memory between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from dynx.simd.elementary import elementary
from dynx.simd.expr import Op
from dynx.simd.program import Program
from dynx.simd.rows import Rows
from dynx.simd.schedule import ELEMENTARY, Segment, TrigGroup, places_of_kept, schedule
from dynx.simd.target import Target
from dynx.simd.text import Writer
from dynx.simd.trigonometry import declarations, sines_and_cosines
from dynx.simd.verify import check_schedule

ENTRY = "kernel"
"""Name of the function."""


WIDE = range(16, 129)
"""Numbers in a row of an output whose memory is fetched before it is written.

Writing to memory that is not in the caches waits for it. Narrow rows wait little, and long ones are
fetched by the processor itself."""

AHEAD = 8
"""So many groups before."""

LINE = 64
"""Bytes fetched at a time."""


@dataclass(frozen=True)
class Settings:
    """How a program becomes code.

    `lanes` samples are evaluated at once. `fast` lets LLVM contract a product and a sum into one
    operation with one rounding and ignore the sign of zeros (its flags ``contract nsz``); without it
    every operation is IEEE 754's own. NaN and infinity keep their meaning in both.
    """

    lanes: int
    fast: bool = True
    segment: int = 2500

    @property
    def flags(self) -> str:
        """LLVM's fast-math flags of every arithmetic instruction."""
        return "contract nsz " if self.fast else ""


def emit(program: Program, target: Target, settings: Settings) -> str:
    """The module's text."""
    segments = schedule(program, settings.lanes, settings.segment)
    check_schedule(program, segments, settings.lanes)
    slots = places_of_kept(program, segments)
    bodies = [
        _Body(program, target, settings, segment, slots, number).text()
        for number, segment in enumerate(segments)
    ]
    parts = [f'target triple = "{target.triple}"']
    parts += bodies
    parts += [_loop(program, settings, len(segments), max(slots.values(), default=0) + 1)]
    parts += [*declarations(settings.lanes), "declare void @llvm.prefetch.p0(ptr, i32, i32, i32)"]
    return "\n".join(parts) + "\n"


def _loop(program: Program, settings: Settings, segments: int, slots: int) -> str:
    """The entry: samples in groups of as many as there are lanes, the last group moved back to fit."""
    lanes = settings.lanes
    lines = [
        f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
        "entry:",
        f"  %kept = alloca [{slots} x <{lanes} x double>], align 64",
        "  %n = load i64, ptr %arguments",
        f"  %last = sub i64 %n, {lanes}",
        *_wide_arrays(program),
        "  br label %group",
        "group:",
        "  %i = phi i64 [0, %entry], [%next, %group]",
        "  %late = icmp sgt i64 %i, %last",
        "  %first = select i1 %late, i64 %last, i64 %i",
    ]
    lines += _fetched_ahead(program, lanes)
    lines += [f"  call void @segment{k}(ptr %arguments, i64 %first, ptr %kept)" for k in range(segments)]
    lines += [
        f"  %next = add i64 %i, {lanes}",
        "  %more = icmp slt i64 %next, %n",
        "  br i1 %more, label %group, label %done",
        "done:",
        "  ret void",
        "}",
    ]
    return "\n".join(lines)


def _wide(program: Program) -> list[tuple[int, int]]:
    """The outputs that are fetched before they are written: their number among all arrays, their size."""
    ports = enumerate(program.outputs, start=len(program.inputs))
    return [(number, port.size) for number, port in ports if port.size in WIDE]


def _wide_arrays(program: Program) -> list[str]:
    """Their addresses and row distances."""
    lines = []
    for k, _ in _wide(program):
        lines += [
            f"  %at{k} = getelementptr inbounds i64, ptr %arguments, i64 {1 + 2 * k}",
            f"  %base{k} = load ptr, ptr %at{k}",
            f"  %by{k} = getelementptr inbounds i64, ptr %arguments, i64 {2 + 2 * k}",
            f"  %stride{k} = load i64, ptr %by{k}",
        ]
    return lines


def _fetched_ahead(program: Program, lanes: int) -> list[str]:
    """Their rows of a later group. Beyond the arrays that does nothing: a fetch never faults."""
    lines = []
    for k, size in _wide(program):
        for lane in range(lanes):
            row = f"{k}_{lane}"
            lines += [
                f"  %sample{row} = add i64 %first, {AHEAD * lanes + lane}",
                f"  %offset{row} = mul i64 %sample{row}, %stride{k}",
                f"  %row{row} = getelementptr i8, ptr %base{k}, i64 %offset{row}",
            ]
            for start in range(0, 8 * size, LINE):
                place = f"%line{row}_{start}"
                lines += [
                    f"  {place} = getelementptr i8, ptr %row{row}, i64 {start}",
                    f"  call void @llvm.prefetch.p0(ptr {place}, i32 1, i32 3, i32 1)",
                ]
    return lines


_BINARY: dict[Op, str] = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv"}
_ORDER: dict[Op, str] = {"min": "olt", "max": "ogt"}


class _Body:
    """One segment as a function of the arguments, the first sample of the group, and what is kept."""

    def __init__(
        self,
        program: Program,
        target: Target,
        settings: Settings,
        segment: Segment,
        slots: dict[int, int],
        number: int,
    ) -> None:
        self._program, self._settings, self._segment = program, settings, segment
        self._fma = target.fma
        self._slots = slots
        self._number = number
        self._write = Writer(settings.lanes)
        self._values: dict[int, str] = {}
        ports = [*program.inputs, *program.outputs]
        self._rows = [
            Rows(self._write, port.size, partial(self._pointers, k)) for k, port in enumerate(ports)
        ]
        self._lanes: dict[int, list[str]] = {}
        self._slot_port = [
            (k, column) for k, port in enumerate(program.inputs) for column in range(port.size)
        ]

    def text(self) -> str:
        """The function."""
        for step in self._segment.steps:
            if isinstance(step, TrigGroup):
                self._trig(step)
            else:
                self._compute(step)
        self._store_results()
        head = (
            f"define internal void @segment{self._number}"
            "(ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %kept) {"
        )
        heads = [line for index in sorted(self._lanes) for line in self._heads[index]]
        return "\n".join([head, "entry:", *heads, *self._write.lines, "  ret void", "}"])

    # -- values -------------------------------------------------------------------------------------

    def _value(self, index: int) -> str:
        """The name of a node's vector: computed here, loaded, kept by an earlier segment, or constant."""
        found = self._values.get(index)
        if found is not None:
            return found
        node = self._program.nodes[index]
        if node.op == "constant":
            name = self._write.splat(node.value)
        elif node.op == "input":
            port, column = self._slot_port[node.slot]
            name = self._rows[port].load(column)
        else:
            name = self._write.let(f"load {self._write.vector}, ptr {self._slot(index)}, align 64")
        self._values[index] = name
        return name

    def _compute(self, index: int) -> None:
        write, node, flags = self._write, self._program.nodes[index], self._settings.flags
        args = [self._value(arg) for arg in node.args]
        if node.op in _BINARY:
            name = write.let(f"{_BINARY[node.op]} {flags}{write.vector} {args[0]}, {args[1]}")
        elif node.op in _ORDER:
            first = write.let(f"fcmp {_ORDER[node.op]} {write.vector} {args[0]}, {args[1]}")
            name = write.let(
                f"select {write.mask} {first}, {write.vector} {args[0]}, {write.vector} {args[1]}"
            )
        elif node.op in ELEMENTARY:
            name = elementary(write, node.op, args[0], fma=self._fma)
        elif node.op == "neg":
            name = write.let(f"fneg {flags}{write.vector} {args[0]}")
        else:
            function = {"abs": "fabs", "sqrt": "sqrt"}[node.op]
            name = write.let(
                f"call {write.vector} @llvm.{function}.v{write.lanes}f64({write.vector} {args[0]})"
            )
        self._set(index, name)

    def _trig(self, group: TrigGroup) -> None:
        angles = [self._value(angle) for angle in group.angles]
        for found, (sin, cos) in zip(
            sines_and_cosines(self._write, angles, fma=self._fma), group.nodes, strict=True
        ):
            for index, name in ((sin, found.sin), (cos, found.cos)):
                if index is not None:
                    self._set(index, name)

    def _set(self, index: int, name: str) -> None:
        self._values[index] = name
        if index in self._segment.kept:
            self._write.do(f"store {self._write.vector} {name}, ptr {self._slot(index)}, align 64")

    def _slot(self, index: int) -> str:
        return self._write.let(
            f"getelementptr inbounds {self._write.vector}, ptr %kept, i64 {self._slots[index]}"
        )

    # -- rows ---------------------------------------------------------------------------------------

    def _store_results(self) -> None:
        """The tiles of outputs that this segment completes."""
        for output, columns, nodes in self._segment.stores:
            rows = self._rows[len(self._program.inputs) + output]
            rows.store(columns, [self._value(node) for node in nodes])

    def _pointers(self, port: int) -> list[str]:
        """The rows of one array, one pointer for each lane, computed at the head of the function."""
        if port not in self._lanes:
            self._lanes[port] = [f"%p{port}_{lane}" for lane in range(self._settings.lanes)]
        return self._lanes[port]

    @property
    def _heads(self) -> dict[int, list[str]]:
        heads = {}
        for port in self._lanes:
            base, stride = 1 + 2 * port, 2 + 2 * port
            lines = [
                f"  %a{port} = getelementptr inbounds i64, ptr %arguments, i64 {base}",
                f"  %b{port} = load ptr, ptr %a{port}",
                f"  %s{port}_ = getelementptr inbounds i64, ptr %arguments, i64 {stride}",
                f"  %s{port} = load i64, ptr %s{port}_",
                f"  %o{port} = mul i64 %first, %s{port}",
                f"  %p{port}_0 = getelementptr inbounds i8, ptr %b{port}, i64 %o{port}",
            ]
            lines += [
                f"  %p{port}_{lane} = getelementptr inbounds i8, ptr %p{port}_{lane - 1}, i64 %s{port}"
                for lane in range(1, self._settings.lanes)
            ]
            heads[port] = lines
        return heads
