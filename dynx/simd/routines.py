"""Routines: small traced programs that are compiled once and called with operands from a table.

The code of an ordinary kernel grows with the robot. Here the code is that of a few routines, such as the
step of a recursion from one body to the next, and the robot is data: a table of calls
(`dynx.simd.call_table`), each the number of a routine and the place of every operand. One image serves all
robots, so nothing is compiled for a robot of any size.

A port of a routine is a `Place`: consecutive vectors of a workspace, consecutive numbers of a table of
constants, or columns of the rows of an array of the caller. Values are read before any is written, so an
output may overwrite an input.

The entry function has the arguments of `dynx.simd.emit`. After those of the arrays follow, each as a number
and a zero: the addresses of the table of calls, of the constants and of the workspace, and the number of
calls. A routine may have any number of lanes; with one lane it evaluates single samples without repeating
them in every lane. Products and sums are contracted here and not by LLVM, so results do not depend on the
number of lanes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from dynx.simd.emit import ENTRY, SegmentBody, Settings
from dynx.simd.image import Image, compile_text
from dynx.simd.program import Port, Program, scalar_ranges
from dynx.simd.rows import Rows, tiles
from dynx.simd.schedule import Segment, schedule
from dynx.simd.target import Processor
from dynx.simd.trace import trace
from dynx.simd.trigonometry import declarations, replacements

Place = Literal["vectors", "constants"] | int
"""Where the values of a port are: in the workspace, in the table of constants (inputs only), or in the rows
of the caller's array of this number, counting inputs, then outputs."""


@dataclass(frozen=True)
class Routine:
    """A program with the place of every port."""

    program: Program
    places: tuple[Place, ...]
    """Places of the inputs, then of the outputs."""

    @classmethod
    def of(
        cls,
        function: Callable[..., Any],
        inputs: Mapping[str, tuple[Place, tuple[int, ...]]],
        outputs: Mapping[str, Place],
    ) -> Routine:
        """Trace `function` of arrays with the places and shapes `inputs`; it returns a mapping by the names
        of `outputs`."""
        program = trace(function, {name: shape for name, (_, shape) in inputs.items()})
        places = [place for place, _ in inputs.values()]
        return cls(program, (*places, *(outputs[port.name] for port in program.outputs)))

    @property
    def ports(self) -> tuple[Port, ...]:
        """Inputs, then outputs."""
        return (*self.program.inputs, *self.program.outputs)


@dataclass(frozen=True)
class RoutineSet:
    """Routines by name, for kernels with this number of arrays.

    The rows of outputs in `cleared`, numbers of arrays, are set to zero before the first call. Then follows,
    in the arguments of the entry function, the size of those rows in bytes and a zero, for each in order.
    """

    routines: Mapping[str, Routine]
    n_arrays: int
    cleared: tuple[int, ...] = ()

    @property
    def table_width(self) -> int:
        """Number of entries in a row of the table of calls: the routine and its operands."""
        return 1 + max(len(routine.places) for routine in self.routines.values())


def compile_routines(routines: RoutineSet, target: Processor, settings: Settings) -> Image:
    """Compile a set of routines to an image, whose ports are those of the tables that call them."""
    code = compile_text(emit_routines(routines, target, settings), target)
    return Image((), (), settings.lanes, target, (code,))


def emit_routines(routines: RoutineSet, target: Processor, settings: Settings) -> str:
    """Return the text of the LLVM module of a set of routines."""
    bodies = [
        RoutineBody(routine, target, settings, number).text()
        for number, routine in enumerate(routines.routines.values())
    ]
    parts = [f'target triple = "{target.triple}"', *bodies, _loop(routines, settings.lanes)]
    parts += replacements(bodies, settings.lanes)
    parts += [*declarations(settings.lanes), "declare void @llvm.memset.p0.i64(ptr, i8, i64, i1)"]
    return "\n".join(parts) + "\n"


def argument_word(name: str, index: int, kind: str = "i64") -> list[str]:
    """Return the code that loads word number `index` of the arguments."""
    return [
        f"  %{name}_at = getelementptr inbounds i64, ptr %arguments, i64 {index}",
        f"  %{name} = load {kind}, ptr %{name}_at",
    ]


def _loop(routines: RoutineSet, lanes: int) -> str:
    """Return the entry function: for each group of samples, all calls of the table."""
    table = 1 + 2 * routines.n_arrays
    lines = [
        f"define void @{ENTRY}(ptr noalias nocapture readonly %arguments) {{",
        "entry:",
        "  %n = load i64, ptr %arguments",
        *argument_word("table", table, "ptr"),
        *argument_word("constants", table + 2, "ptr"),
        *argument_word("vectors", table + 4, "ptr"),
        *argument_word("calls", table + 6),
    ]
    for k, array in enumerate(routines.cleared):
        lines += argument_word(f"base{k}", 1 + 2 * array, "ptr")
        lines += argument_word(f"stride{k}", 2 + 2 * array)
        lines += argument_word(f"bytes{k}", table + 8 + 2 * k)
    lines += [
        f"  %last = sub i64 %n, {lanes}",
        "  br label %group",
        "group:",
        "  %i = phi i64 [0, %entry], [%next_group, %end]",
        "  %late = icmp sgt i64 %i, %last",
        "  %first = select i1 %late, i64 %last, i64 %i",
    ]
    for k in range(len(routines.cleared)):
        for lane in range(lanes):
            row = f"{k}_{lane}"
            lines += [
                f"  %sample{row} = add i64 %first, {lane}",
                f"  %offset{row} = mul i64 %sample{row}, %stride{k}",
                f"  %row{row} = getelementptr i8, ptr %base{k}, i64 %offset{row}",
                f"  call void @llvm.memset.p0.i64(ptr %row{row}, i8 0, i64 %bytes{k}, i1 false)",
            ]
    numbers = range(len(routines.routines))
    switch = " ".join(f"i32 {number}, label %call{number}" for number in numbers)
    lines += [
        "  br label %fetch",
        "fetch:",
        "  %k = phi i64 [0, %group], [%next, %done]",
        "  %more = icmp slt i64 %k, %calls",
        "  br i1 %more, label %dispatch, label %end",
        "dispatch:",
        f"  %start = mul i64 %k, {routines.table_width}",
        "  %operands = getelementptr inbounds i32, ptr %table, i64 %start",
        "  %routine = load i32, ptr %operands",
        f"  switch i32 %routine, label %done [{switch}]",
    ]
    passed = "ptr %operands, ptr %arguments, i64 %first, ptr %vectors, ptr %constants"
    for number in numbers:
        lines += [f"call{number}:", f"  call void @routine{number}({passed})", "  br label %done"]
    lines += [
        "done:",
        "  %next = add i64 %k, 1",
        "  br label %fetch",
        "end:",
        f"  %next_group = add i64 %i, {lanes}",
        "  %more_groups = icmp slt i64 %next_group, %n",
        "  br i1 %more_groups, label %group, label %return",
        "return:",
        "  ret void",
        "}",
    ]
    return "\n".join(lines)


class RoutineBody(SegmentBody):
    """One routine as a function of its operands."""

    def __init__(self, routine: Routine, target: Processor, settings: Settings, number: int) -> None:
        # Other segments only store; here the results are stored at their places.
        first, *_ = schedule(routine.program, settings.lanes, len(routine.program.nodes) * 100)
        exact = Settings(settings.lanes, fast=False, segment=settings.segment)
        super().__init__(routine.program, target, exact, Segment(first.steps), {}, number)
        self._routine = routine
        self._uses = Counter(arg for node in routine.program.nodes for arg in node.args)
        self._uses.update(routine.program.results)
        self._rows = [
            Rows(self._write, port.size, partial(self._pointers, k)) for k, port in enumerate(routine.ports)
        ]
        self._operands: dict[int, list[str]] = {}

    def text(self, linkage: str = "internal") -> str:
        self._compute_steps()
        self._store_results()
        head = (
            f"define {linkage} void @routine{self._number}(ptr noalias nocapture readonly %operands, "
            "ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %vectors, "
            "ptr noalias nocapture readonly %constants) {"
        )
        heads = [line for lines in self._operands.values() for line in lines]
        return "\n".join([head, "entry:", *heads, *self._write.lines, "  ret void", "}"])

    # -- operands -----------------------------------------------------------------------------------

    def _input(self, port: int, column: int) -> str:
        place, write = self._routine.places[port], self._write
        if isinstance(place, int):
            return self._rows[port].load(column)
        if place == "vectors":
            at = write.let(f"getelementptr inbounds {write.vector}, ptr {self._start(port)}, i64 {column}")
            return write.let(f"load {write.vector}, ptr {at}, align {8 * write.lanes}")
        at = write.let(f"getelementptr inbounds double, ptr {self._start(port)}, i64 {column}")
        number = write.let(f"load double, ptr {at}")
        vector = write.let(f"insertelement {write.vector} poison, double {number}, i32 0")
        zeros = ", ".join(["i32 0"] * write.lanes)
        return write.let(
            f"shufflevector {write.vector} {vector}, {write.vector} poison, <{write.lanes} x i32> <{zeros}>"
        )

    def _store_results(self) -> None:
        program, write = self._program, self._write
        results = [self._value(result) for result in program.results]
        for k, (port, scalars) in enumerate(scalar_ranges(program.outputs), start=len(program.inputs)):
            if isinstance(self._routine.places[k], int):
                for tile in tiles(port.size, write.lanes):
                    self._rows[k].store_tile(tile.start, [results[scalars[column]] for column in tile])
                continue
            for column, scalar in enumerate(scalars):
                at = write.let(f"getelementptr inbounds {write.vector}, ptr {self._start(k)}, i64 {column}")
                write.do(f"store {write.vector} {results[scalar]}, ptr {at}, align {8 * write.lanes}")

    def _start(self, port: int) -> str:
        """Return the address of the first value of a port in the workspace or among the constants."""
        place = self._routine.places[port]
        if port not in self._operands:
            kind = self._write.vector if place == "vectors" else "double"
            lines = [f"  %start{port} = getelementptr inbounds {kind}, ptr %{place}, i64 %o{port}"]
            self._operands[port] = [*self._operand(port), *lines]
        return f"%start{port}"

    def _pointers(self, port: int) -> list[str]:
        """Return the addresses of the first column of a port in the row of each lane."""
        lanes = range(self._write.lanes)
        if port not in self._operands:
            array = self._routine.places[port]
            assert isinstance(array, int)
            lines = [
                *self._operand(port),
                *argument_word(f"base{port}", 1 + 2 * array, "ptr"),
                *argument_word(f"stride{port}", 2 + 2 * array),
                f"  %samples{port} = mul i64 %first, %stride{port}",
                f"  %sample{port} = getelementptr i8, ptr %base{port}, i64 %samples{port}",
                f"  %p{port}_0 = getelementptr double, ptr %sample{port}, i64 %o{port}",
            ]
            lines += [
                f"  %p{port}_{lane} = getelementptr i8, ptr %p{port}_{lane - 1}, i64 %stride{port}"
                for lane in lanes[1:]
            ]
            self._operands[port] = lines
        return [f"%p{port}_{lane}" for lane in lanes]

    def _operand(self, port: int) -> list[str]:
        return [
            f"  %o{port}_at = getelementptr inbounds i32, ptr %operands, i64 {1 + port}",
            f"  %o{port}_short = load i32, ptr %o{port}_at",
            f"  %o{port} = zext i32 %o{port}_short to i64",
        ]

    # -- products with sums ---------------------------------------------------------------------------

    def _compute(self, index: int) -> None:
        node = self._program.nodes[index]
        if node.op not in ("add", "sub"):
            super()._compute(index)
            return
        write, (left, right) = self._write, node.args
        if self._is_product_used_once(left):
            a, b = self._factors(left)
            term = self._value(right)
            self._set(index, write.multiply_add(a, b, self._negative(term) if node.op == "sub" else term))
        elif self._is_product_used_once(right):
            a, b = self._factors(right)
            self._set(
                index,
                write.multiply_add(self._negative(a) if node.op == "sub" else a, b, self._value(left)),
            )
        else:
            super()._compute(index)

    def _is_product_used_once(self, index: int) -> bool:
        return self._program.nodes[index].op == "mul" and self._uses[index] == 1

    def _factors(self, product: int) -> tuple[str, str]:
        a, b = self._program.nodes[product].args
        return self._value(a), self._value(b)

    def _negative(self, value: str) -> str:
        return self._write.let(f"fneg {self._write.vector} {value}")
