"""LLVM IR that writes long rows of results to memory past the caches.

An ordinary store reads its cache line from memory before it writes, and a batch of long rows displaces
everything else from the caches: for a matrix of a humanoid that takes four times as long as its arithmetic.
In a large batch the rows of a group are therefore computed in a block that stays in the caches, and whole
cache lines are copied from there by stores that do not read them (LLVM's ``nontemporal``). The block also
keeps entries that are the same in all samples, such as the zeros of a mass matrix between two branches.

A batch that fits into the caches is stored as usual, since its user reads it from there. Both ways give the
same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from dynx.simd.program import Program
from dynx.simd.schedule import CACHE_LINE, block_size, streamed_outputs

MIN_STREAMED = 8 * 1024 * 1024
"""Least size of the results of a call that are streamed [bytes]: more than one core's share of the caches."""

COPY = "stream_rows"
"""Name of the function that copies the rows of a group."""


class StreamedArray(NamedTuple):
    """An output array whose rows are streamed in large batches."""

    number: int
    """Number of the array among inputs and outputs."""
    row: int
    """Size of a row [bytes]."""
    place: int
    """Place of its rows in the block [bytes]."""


class Streaming:
    """The streamed outputs of a program."""

    def __init__(self, program: Program, lanes: int) -> None:
        self.arrays: list[StreamedArray] = []
        self._lanes = lanes
        self._block = 0
        self._words = 1 + 2 * (len(program.inputs) + len(program.outputs))
        for output in streamed_outputs(program, lanes):
            port = program.outputs[output]
            self.arrays.append(StreamedArray(len(program.inputs) + output, 8 * port.size, self._block))
            self._block += block_size(port, lanes)

    def begin(self, constant_rows: Sequence[str]) -> list[str]:
        """Return the code that decides whether results are streamed, as %streams, and prepares that.

        It calls `constant_rows`, functions that store what all samples have in common. The code of a group
        takes %words, its arguments.
        """
        samples, copied = -(-MIN_STREAMED // sum(array.row for array in self.arrays)), 8 * self._words
        return [
            f"  %block = alloca [{self._block} x i8], align {CACHE_LINE}",
            f"  %changed = alloca [{self._words} x i64], align 8",
            f"  call void @llvm.memcpy.p0.p0.i64(ptr %changed, ptr %arguments, i64 {copied}, i1 false)",
            f"  %streams = icmp sge i64 %n, {samples}",
            "  %words = select i1 %streams, ptr %changed, ptr %arguments",
            *(line for array in self.arrays for line in self._pointers(array)),
            "  br i1 %streams, label %fill, label %begin",
            "fill:",
            *(f"  store i64 {array.row}, ptr %own_stride{array.number}" for array in self.arrays),
            *(f"  store ptr %rows{array.number}, ptr %own_base{array.number}" for array in self.arrays),
            *(f"  call void @{name}(ptr %changed, i64 0, ptr %kept)" for name in constant_rows),
            "  br label %begin",
            "begin:",
        ]

    def _pointers(self, array: StreamedArray) -> list[str]:
        k, base, stride = array.number, 1 + 2 * array.number, 2 + 2 * array.number
        return [
            f"  %rows{k} = getelementptr i8, ptr %block, i64 {array.place}",
            f"  %out_base_at{k} = getelementptr i64, ptr %arguments, i64 {base}",
            f"  %out_base{k} = load ptr, ptr %out_base_at{k}",
            f"  %out_stride_at{k} = getelementptr i64, ptr %arguments, i64 {stride}",
            f"  %out_stride{k} = load i64, ptr %out_stride_at{k}",
            f"  %own_base{k} = getelementptr i64, ptr %changed, i64 {base}",
            f"  %own_stride{k} = getelementptr i64, ptr %changed, i64 {stride}",
        ]

    def before_group(self) -> list[str]:
        """Return the code before the sample %first is computed with the next ones."""
        lines = []
        for k, row, _ in self.arrays:
            # The rows of every group have the same place; the code adds `first` rows to the address.
            lines += [
                f"  %back{k} = mul i64 %first, {-row}",
                f"  %moved{k} = getelementptr i8, ptr %rows{k}, i64 %back{k}",
                f"  store ptr %moved{k}, ptr %own_base{k}",
            ]
        return lines

    def after_group(self, constant_rows: Sequence[str]) -> list[str]:
        """Return the code after a group: it copies the rows, or stores what all samples have in common."""
        lines = ["  br i1 %streams, label %copy, label %complete", "copy:"]
        for k, row, _ in self.arrays:
            lines += [
                f"  %out_offset{k} = mul i64 %first, %out_stride{k}",
                f"  %out{k} = getelementptr i8, ptr %out_base{k}, i64 %out_offset{k}",
                f"  call void @{COPY}(ptr %out{k}, i64 %out_stride{k}, ptr %rows{k}, i64 {row})",
            ]
        return [
            *lines,
            "  br label %grouped",
            "complete:",
            *(f"  call void @{name}(ptr %arguments, i64 %first, ptr %kept)" for name in constant_rows),
            "  br label %grouped",
            "grouped:",
        ]

    def end(self) -> list[str]:
        """Return the code after all groups."""
        # Later stores and other threads see stores past the caches only after a fence.
        return ["  fence seq_cst"]

    def functions(self) -> list[str]:
        """Return the text of the function that copies rows."""
        return [_copy(self._lanes)]


def _copy(lanes: int) -> str:
    """Return the function of an address, the distance of its rows, the rows and the size of one.

    Two halves of the memory are written in turn, which is a fifth faster than one line after another.
    """
    line = f"<{CACHE_LINE // 8} x double>"
    return "\n".join(
        [
            f"define internal void @{COPY}(ptr %to, i64 %stride, ptr noalias %from, i64 %row) noinline {{",
            "entry:",
            "  %adjacent = icmp eq i64 %stride, %row",
            f"  %whole = mul i64 %row, {lanes}",
            "  %size = select i1 %adjacent, i64 %whole, i64 %row",
            f"  %count = select i1 %adjacent, i64 1, i64 {lanes}",
            "  br label %piece",
            "piece:",
            "  %k = phi i64 [0, %entry], [%k_next, %done]",
            "  %to_offset = mul i64 %k, %stride",
            "  %from_offset = mul i64 %k, %row",
            "  %target = getelementptr i8, ptr %to, i64 %to_offset",
            "  %source = getelementptr i8, ptr %from, i64 %from_offset",
            "  %address = ptrtoint ptr %target to i64",
            "  %below = sub i64 0, %address",
            f"  %head = and i64 %below, {CACHE_LINE - 1}",
            "  %rest = sub i64 %size, %head",
            f"  %half_lines = lshr i64 %rest, {(2 * CACHE_LINE).bit_length() - 1}",
            f"  %half = mul i64 %half_lines, {CACHE_LINE}",
            "  %lines = mul i64 %half, 2",
            "  %tail = add i64 %head, %lines",
            "  br label %odd",
            # Numbers before the first and after the last whole line.
            "odd:",
            "  %j = phi i64 [0, %piece], [%j_next, %odd_one], [%tail, %lines_done]",
            "  %at_head = icmp ult i64 %j, %head",
            "  %at_tail = icmp uge i64 %j, %tail",
            "  %in_size = icmp ult i64 %j, %size",
            "  %is_odd = or i1 %at_head, %at_tail",
            "  %goes_on = and i1 %is_odd, %in_size",
            "  br i1 %goes_on, label %odd_one, label %odd_done",
            "odd_one:",
            "  %odd_from = getelementptr i8, ptr %source, i64 %j",
            "  %odd_to = getelementptr i8, ptr %target, i64 %j",
            "  %number = load i64, ptr %odd_from, align 8",
            "  store i64 %number, ptr %odd_to, align 8",
            "  %j_next = add i64 %j, 8",
            "  br label %odd",
            "odd_done:",
            "  br i1 %in_size, label %line, label %done",
            "line:",
            "  %i = phi i64 [%head, %odd_done], [%i_next, %line]",
            "  %i_other = add i64 %i, %half",
            *(
                f"  %{side}_{where} = getelementptr i8, ptr %{where}, i64 %i{suffix}"
                for side, suffix in (("one", ""), ("other", "_other"))
                for where in ("source", "target")
            ),
            f"  %one = load {line}, ptr %one_source, align 8",
            f"  %other = load {line}, ptr %other_source, align 8",
            f"  store {line} %one, ptr %one_target, align {CACHE_LINE}, !nontemporal !1",
            f"  store {line} %other, ptr %other_target, align {CACHE_LINE}, !nontemporal !1",
            f"  %i_next = add i64 %i, {CACHE_LINE}",
            "  %line_end = add i64 %head, %half",
            "  %more_lines = icmp ult i64 %i_next, %line_end",
            "  br i1 %more_lines, label %line, label %lines_done",
            "lines_done:",
            "  br label %odd",
            "done:",
            "  %k_next = add i64 %k, 1",
            "  %more = icmp ult i64 %k_next, %count",
            "  br i1 %more, label %piece, label %return",
            "return:",
            "  ret void",
            "}",
            "!1 = !{i32 1}",
        ]
    )
