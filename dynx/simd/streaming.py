"""LLVM IR that writes long rows of results to memory past the caches.

An ordinary store reads its cache line from memory before it writes, and a batch of long rows displaces
everything else from the caches: for a matrix of a humanoid that takes four times as long as its arithmetic.
In a large batch the rows of a group are therefore computed in a block that stays in the caches, and whole
cache lines are copied from there by stores that do not read them (LLVM's ``nontemporal``). The block also
keeps entries that are the same in all samples, such as the zeros of a mass matrix between two branches.

Memory takes as long to write the rows as the processor to compute them. There are therefore two blocks. While
the rows of a group are computed in one, those of the group before are copied from the other: a few lines
(`copy_burst`) after every few hundred operations. More lines at once would fill the processor's buffers, and
it would wait.

A batch that fits into the caches is stored as usual, since its user reads it from there. Both ways give the
same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from dynx.simd.ir_writer import NONTEMPORAL, Writer
from dynx.simd.program import Program
from dynx.simd.schedule import CACHE_LINE, block_size, streamed_outputs

MIN_STREAMED = 8 * 1024 * 1024
"""Least size of the results of a call that are streamed [bytes]: more than one core's share of the caches."""

COPY, FINISH = "copy_rows", "finish_copy"
"""Names of the functions that begin and finish to copy the rows of a group."""

PREFETCH_END = "i32 1, i32 2"
"""Hint of LLVM's prefetch for a line at the end of rows: it will be written, but not at once."""

BURST = 8
"""Number of cache lines that are copied at once, to each of the two halves of the rows."""

JOB_BYTES = 32
"""Size of a job [bytes]: the number of bursts left, the address to copy from, that to copy to, and the
distance of the two halves of the rows."""


class StreamedArray(NamedTuple):
    """An output array whose rows are streamed in large batches."""

    number: int
    """Number of the array among inputs and outputs."""
    row: int
    """Size of a row [bytes]."""
    place: int
    """Place of its rows in the block [bytes]."""
    job: int
    """Place of its job in the memory of the values [bytes]."""


class Streaming:
    """The streamed outputs of a program, whose jobs are at `place` in the memory of the values [bytes]."""

    def __init__(self, program: Program, lanes: int, place: int) -> None:
        self.arrays: list[StreamedArray] = []
        self._lanes = lanes
        self._block = 0
        self._words = 1 + 2 * (len(program.inputs) + len(program.outputs))
        for output in streamed_outputs(program, lanes):
            port, number = program.outputs[output], len(program.inputs) + output
            job = place + JOB_BYTES * len(self.arrays)
            self.arrays.append(StreamedArray(number, 8 * port.size, self._block, job))
            self._block += block_size(port, lanes)

    @property
    def job_bytes(self) -> int:
        """Size of all jobs."""
        return JOB_BYTES * len(self.arrays)

    def bursts(self) -> list[int]:
        """Return the place of the job of each burst that copies the rows of a group, in a good order."""
        turns = []
        for array in self.arrays:
            count = array.row * self._lanes // (2 * BURST * CACHE_LINE)
            turns += [((k + 0.5) / count, array.job) for k in range(count)]
        return [job for _, job in sorted(turns)]

    def begin(self, constant_rows: Sequence[str], memories: Sequence[str]) -> list[str]:
        """Return the code that decides whether results are streamed, as %streams, and prepares that.

        It calls `constant_rows`, functions that store what all samples have in common. The code of a group
        takes %words, its arguments, and one of `memories`, those of the values; if results are streamed, the
        first.
        """
        samples, copied = -(-MIN_STREAMED // sum(array.row for array in self.arrays)), 8 * self._words
        filled = [f"  call void @{name}(ptr %changed, i64 0, ptr %kept)" for name in constant_rows]
        return [
            f"  %block = alloca [{2 * self._block} x i8], align {CACHE_LINE}",
            f"  %changed = alloca [{self._words} x i64], align 8",
            f"  call void @llvm.memcpy.p0.p0.i64(ptr %changed, ptr %arguments, i64 {copied}, i1 false)",
            f"  %streams = icmp sge i64 %n, {samples}",
            "  %words = select i1 %streams, ptr %changed, ptr %arguments",
            *(line for array in self.arrays for line in self._pointers(array, memories[1:])),
            "  br i1 %streams, label %fill, label %begin",
            "fill:",
            *(f"  store i64 {array.row}, ptr %own_stride{array.number}" for array in self.arrays),
            *(
                line
                for block in (0, 1)
                for line in (
                    *(
                        f"  store ptr %rows{array.number}_{block}, ptr %own_base{array.number}"
                        for array in self.arrays
                    ),
                    *filled,
                )
            ),
            "  br label %begin",
            "begin:",
        ]

    def _pointers(self, array: StreamedArray, more: Sequence[str]) -> list[str]:
        k, base, stride = array.number, 1 + 2 * array.number, 2 + 2 * array.number
        return [
            f"  %job{k} = getelementptr i8, ptr %kept, i64 {array.job}",
            f"  store i64 0, ptr %job{k}",
            *(
                line
                for memory in more
                for line in (
                    f"  %no_job{k} = getelementptr i8, ptr {memory}, i64 {array.job}",
                    f"  store i64 0, ptr %no_job{k}",
                )
            ),
            f"  %out_base_at{k} = getelementptr i64, ptr %arguments, i64 {base}",
            f"  %out_base{k} = load ptr, ptr %out_base_at{k}",
            f"  %out_stride_at{k} = getelementptr i64, ptr %arguments, i64 {stride}",
            f"  %out_stride{k} = load i64, ptr %out_stride_at{k}",
            f"  %own_base{k} = getelementptr i64, ptr %changed, i64 {base}",
            f"  %own_stride{k} = getelementptr i64, ptr %changed, i64 {stride}",
            *(
                f"  %rows{k}_{block} = getelementptr i8, ptr %block, i64 {block * self._block + array.place}"
                for block in (0, 1)
            ),
        ]

    def before_group(self) -> list[str]:
        """Return the code before the sample %first is computed with the next ones; %i counts the samples."""
        lines = [f"  %odd_bit = and i64 %i, {self._lanes}", "  %odd = icmp ne i64 %odd_bit, 0"]
        for k, row, _, _ in self.arrays:
            # The rows of every other group have the same place; the code adds `first` rows to the address.
            lines += [
                f"  %rows{k} = select i1 %odd, ptr %rows{k}_1, ptr %rows{k}_0",
                f"  %back{k} = mul i64 %first, {-row}",
                f"  %moved{k} = getelementptr i8, ptr %rows{k}, i64 %back{k}",
                f"  store ptr %moved{k}, ptr %own_base{k}",
            ]
        return lines

    def after_group(self, constant_rows: Sequence[str]) -> list[str]:
        """Return the code after a group: it begins to copy the rows, or stores what all samples have in
        common."""
        lines = ["  br i1 %streams, label %copy, label %complete", "copy:"]
        for k, row, _, _ in self.arrays:
            lines += [
                f"  call void @{FINISH}(ptr %job{k})",
                f"  %out_offset{k} = mul i64 %first, %out_stride{k}",
                f"  %out{k} = getelementptr i8, ptr %out_base{k}, i64 %out_offset{k}",
                f"  call void @{COPY}(ptr %out{k}, i64 %out_stride{k}, ptr %rows{k}, i64 {row}, ptr %job{k})",
            ]
        return [
            *lines,
            "  br label %copied",
            "complete:",
            *(f"  call void @{name}(ptr %arguments, i64 %first, ptr %kept)" for name in constant_rows),
            "  br label %copied",
            "copied:",
        ]

    def end(self) -> list[str]:
        """Return the code after all groups."""
        # Later stores and other threads see stores past the caches only after a fence.
        return [
            *(f"  call void @{FINISH}(ptr %job{array.number})" for array in self.arrays),
            "  fence seq_cst",
        ]

    def functions(self) -> list[str]:
        """Return the texts of the functions that copy rows."""
        return [_begin_copy(self._lanes), _finish_copy()]


def copy_burst(write: Writer, job: int) -> None:
    """Write the code that copies the next lines of the job at the place `job`, if any are left.

    Two halves of the memory are written in turn, which is a fifth faster than one line after another.
    """
    check, burst, line, after = (write.fresh(name) for name in ("check", "burst", "line", "after"))
    write.do(f"br label %{check}")
    write.label(check)
    at = [write.let(f"getelementptr i8, ptr %kept, i64 {job + 8 * k}") for k in range(4)]
    left = write.let(f"load i64, ptr {at[0]}")
    write.do(f"br i1 {write.let(f'icmp ne i64 {left}, 0')}, label %{burst}, label %{after}")
    write.label(burst)
    source, target = (write.let(f"load ptr, ptr {each}") for each in at[1:3])
    half = write.let(f"load i64, ptr {at[3]}")
    write.do(f"br label %{line}")
    write.label(line)
    write.do(f"%{line}_at = phi i64 [0, %{burst}], [%{line}_next, %{line}]")
    _copy_lines(write, source, target, f"%{line}_at", half)
    write.do(f"%{line}_next = add i64 %{line}_at, {CACHE_LINE}")
    more = write.let(f"icmp ult i64 %{line}_next, {BURST * CACHE_LINE}")
    done = write.fresh("done")
    write.do(f"br i1 {more}, label %{line}, label %{done}")
    write.label(done)
    write.do(f"store i64 {write.let(f'sub i64 {left}, 1')}, ptr {at[0]}")
    for pointer, place in ((source, at[1]), (target, at[2])):
        moved = write.let(f"getelementptr i8, ptr {pointer}, i64 {BURST * CACHE_LINE}")
        write.do(f"store ptr {moved}, ptr {place}")
    write.do(f"br label %{after}")
    write.label(after)


def _copy_lines(write: Writer, source: str, target: str, at: str, half: str) -> None:
    """Write the code that copies two cache lines, which are `half` bytes apart."""
    line = f"<{CACHE_LINE // 8} x double>"
    for place in (at, write.let(f"add i64 {at}, {half}")):
        found = write.let(
            f"load {line}, ptr {write.let(f'getelementptr i8, ptr {source}, i64 {place}')}, align 8"
        )
        out = write.let(f"getelementptr i8, ptr {target}, i64 {place}")
        write.do(f"store {line} {found}, ptr {out}, align {CACHE_LINE}, {NONTEMPORAL}")


def _finish_copy() -> str:
    """Return the function that copies what a job has left."""
    write = Writer(1, fma=False)
    write.do("br label %again")
    write.label("again")
    write.do("%left = load i64, ptr %kept")
    write.do("%some = icmp ne i64 %left, 0")
    write.do("br i1 %some, label %more, label %return")
    write.label("more")
    copy_burst(write, 0)
    write.do("br label %again")
    write.label("return")
    head = f"define internal void @{FINISH}(ptr %kept) noinline {{"
    return "\n".join([head, "entry:", *write.lines, "  ret void", "}"])


def _begin_copy(lanes: int) -> str:
    """Return the function of an address, the distance of its rows, the rows, the size of one, and a job.

    Adjacent rows become the job, except for what is no whole burst. Other rows are copied at once.
    """
    write = Writer(lanes, fma=False)
    _copy_lines(write, "%source", "%target", "%i", "%half")
    return "\n".join(
        [
            f"define internal void @{COPY}"
            "(ptr %to, i64 %stride, ptr noalias %from, i64 %row, ptr %job) noinline {",
            "entry:",
            "  %adjacent = icmp eq i64 %stride, %row",
            f"  %whole = mul i64 %row, {lanes}",
            f"  %group_size = mul i64 %stride, {lanes}",
            "  %size = select i1 %adjacent, i64 %whole, i64 %row",
            f"  %count = select i1 %adjacent, i64 1, i64 {lanes}",
            "  br label %piece",
            "piece:",
            "  %k = phi i64 [0, %entry], [%k_next, %done]",
            "  %to_offset = mul i64 %k, %stride",
            "  %from_offset = mul i64 %k, %row",
            "  %target = getelementptr i8, ptr %to, i64 %to_offset",
            "  %source = getelementptr i8, ptr %from, i64 %from_offset",
            # The first line and the last two are written by ordinary stores, which read them. Those of the
            # next group are read now: otherwise all later stores would wait for them.
            "  %next_head = getelementptr i8, ptr %target, i64 %group_size",
            "  %next_tail = getelementptr i8, ptr %next_head, i64 %size",
            f"  %next_last = getelementptr i8, ptr %next_tail, i64 {-CACHE_LINE}",
            *(
                f"  call void @llvm.prefetch.p0(ptr %next_{end}, {PREFETCH_END}, i32 1)"
                for end in ("head", "tail", "last")
            ),
            "  %address = ptrtoint ptr %target to i64",
            "  %below = sub i64 0, %address",
            f"  %head = and i64 %below, {CACHE_LINE - 1}",
            "  %rest = sub i64 %size, %head",
            f"  %half_lines = lshr i64 %rest, {(2 * CACHE_LINE).bit_length() - 1}",
            f"  %half = mul i64 %half_lines, {CACHE_LINE}",
            "  %line_bytes = mul i64 %half, 2",
            f"  %most_bursts = udiv i64 %half_lines, {BURST}",
            "  %bursts = select i1 %adjacent, i64 %most_bursts, i64 0",
            f"  %burst_bytes = mul i64 %bursts, {BURST * CACHE_LINE}",
            "  %first = add i64 %head, %burst_bytes",
            "  %end = add i64 %head, %half",
            "  br label %odd",
            # Numbers before the first and after the last whole line.
            "odd:",
            "  %j = phi i64 [0, %piece], [%j_next, %odd_one]",
            "  %at_head = icmp ult i64 %j, %head",
            "  %j_tail = add i64 %j, %line_bytes",
            "  %j_odd = select i1 %at_head, i64 %j, i64 %j_tail",
            "  %in_size = icmp ult i64 %j_odd, %size",
            "  br i1 %in_size, label %odd_one, label %lines",
            "odd_one:",
            "  %odd_from = getelementptr i8, ptr %source, i64 %j_odd",
            "  %odd_to = getelementptr i8, ptr %target, i64 %j_odd",
            "  %number = load i64, ptr %odd_from, align 8",
            "  store i64 %number, ptr %odd_to, align 8",
            "  %j_next = add i64 %j, 8",
            "  br label %odd",
            "lines:",
            "  %i = phi i64 [%first, %odd], [%i_next, %line]",
            "  %more_lines = icmp ult i64 %i, %end",
            "  br i1 %more_lines, label %line, label %done",
            "line:",
            *write.lines,
            f"  %i_next = add i64 %i, {CACHE_LINE}",
            "  br label %lines",
            "done:",
            "  %k_next = add i64 %k, 1",
            "  %more = icmp ult i64 %k_next, %count",
            "  br i1 %more, label %piece, label %return",
            "return:",
            "  %job_source = getelementptr i8, ptr %source, i64 %head",
            "  %job_target = getelementptr i8, ptr %target, i64 %head",
            *(
                f"  %job{k} = getelementptr i64, ptr %job, i64 {k}\n  store {kind} {value}, ptr %job{k}"
                for k, (kind, value) in enumerate(
                    (("i64", "%bursts"), ("ptr", "%job_source"), ("ptr", "%job_target"), ("i64", "%half"))
                )
            ),
            "  ret void",
            "}",
        ]
    )
