"""LLVM IR that loads and stores rows of the user's arrays, one sample per lane.

A vector holds the same scalar of several samples, one per lane, but in memory the scalars of one sample are
contiguous. Tiles of b by b numbers, b rows of b neighbouring columns, are therefore loaded row by row and
transposed in registers by shuffles; stores do the reverse. Vectors of 8 numbers are transposed whole, and
stored in tiles of 8 columns, so that a store writes as much as a cache line. The numbers of a single column
are one vector where they are neighbours too, which the code finds out when it runs.

Code that is not optimised has its inputs, constants, results and spilled values in a scratch memory, a vector
each. LLVM selects the instructions of such code three times as fast if they are loads, stores and arithmetic
only: after a single constant or shuffle it treats the whole block in the general way. Loops over the tiles of
all rows therefore load the inputs into the scratch memory and store the results from it. They are optimised,
and neither their code nor that of the segments repeats a tile that several segments use.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise

from dynx.simd.ir_writer import Writer, hex_double
from dynx.simd.program import Port, Program, scalar_ranges

WIDE = 8
"""Number of lanes of the widest vectors, and number of columns of the tiles that they store."""

LANES_OF_ROWS = (0, 2), (4, 6), (1, 3), (5, 7)
"""The two lanes whose numbers of four columns share a vector when a tile of `WIDE` lanes is transposed."""

EVEN, ODD = (0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)
"""Entries of two vectors that alternate, of the even and of the odd lanes."""


def tile_width(columns: int, lanes: int) -> int:
    """Return the number of columns loaded at once: the largest power of two <= 4, columns, lanes."""
    width = min(4, lanes)
    while width > columns:
        width //= 2
    return width


def tile_start(column: int, columns: int, width: int) -> int:
    """Return the first column of the tile with `column`; the last tile may overlap the one before."""
    return min(column // width * width, columns - width)


def tiles(columns: int, lanes: int) -> list[range]:
    """Return the columns of every tile that is stored; the last may overlap the one before."""
    if columns == 0:
        return []
    narrow = tile_width(columns, lanes)
    width = WIDE if lanes == WIDE <= columns else narrow
    found = [range(start, start + width) for start in range(0, columns - width + 1, width)]
    if rest := columns % width:
        found.append(range(columns - (narrow if rest <= narrow else width), columns))
    return found


def lane_names(number: int, lanes: int) -> list[str]:
    """Return the names of the pointers to the rows of array `number`, one for each lane."""
    return [f"%p{number}_{lane}" for lane in range(lanes)]


def row_pointers(number: int, lanes: int) -> list[str]:
    """Return the code that computes the pointers to the rows of array `number` from its address and its
    stride in the arguments."""
    return [*_first_row(number), *_further_rows(lane_names(number, lanes), number)]


def _first_row(number: int) -> list[str]:
    """Return the code that computes the pointer to the first row of array `number`, and its stride."""
    return [
        f"  %a{number} = getelementptr inbounds i64, ptr %arguments, i64 {1 + 2 * number}",
        f"  %b{number} = load ptr, ptr %a{number}",
        f"  %s{number}_ = getelementptr inbounds i64, ptr %arguments, i64 {2 + 2 * number}",
        f"  %s{number} = load i64, ptr %s{number}_",
        f"  %o{number} = mul i64 %first, %s{number}",
        f"  %p{number}_0 = getelementptr inbounds i8, ptr %b{number}, i64 %o{number}",
    ]


def _further_rows(names: Sequence[str], number: int) -> list[str]:
    """Return the code that computes the pointers to the rows of array `number` after the first."""
    return [
        f"  {name} = getelementptr inbounds i8, ptr {before}, i64 %s{number}"
        for before, name in pairwise(names)
    ]


def load_column(number: int, lanes: int) -> list[str]:
    """Return the code that loads the only column of array `number` into the vector ``%x`` of this number.

    It consists of several basic blocks. The arithmetic comes after it, so that LLVM finds the products and
    sums to contract in one block.
    """
    vector, names = f"<{lanes} x double>", lane_names(number, lanes)
    lines = [
        *_first_row(number),
        *_if_adjacent(number, "load"),
        f"  %x{number}_all = load {vector}, ptr %p{number}_0, align 8",
        f"  br label %loaded{number}",
        f"load_each{number}:",
        *_further_rows(names, number),
    ]
    before = "poison"
    for lane, name in enumerate(names):
        lines += [
            f"  %x{number}_{lane} = load double, ptr {name}, align 8",
            f"  %v{number}_{lane} = insertelement {vector} {before}, double %x{number}_{lane}, i32 {lane}",
        ]
        before = f"%v{number}_{lane}"
    return [
        *lines,
        f"  br label %loaded{number}",
        f"loaded{number}:",
        f"  %x{number} = phi {vector} [%x{number}_all, %load_all{number}], [{before}, %load_each{number}]",
    ]


def store_column(number: int, lanes: int, column: str) -> list[str]:
    """Return the code that stores a vector in the only column of array `number`; see `load_column`."""
    vector, names = f"<{lanes} x double>", lane_names(number, lanes)
    lines = [
        *_first_row(number),
        *_if_adjacent(number, "store"),
        f"  store {vector} {column}, ptr %p{number}_0, align 8",
        f"  br label %stored{number}",
        f"store_each{number}:",
        *_further_rows(names, number),
    ]
    for lane, name in enumerate(names):
        lines += [
            f"  %x{number}_{lane} = extractelement {vector} {column}, i32 {lane}",
            f"  store double %x{number}_{lane}, ptr {name}, align 8",
        ]
    return [*lines, f"  br label %stored{number}", f"stored{number}:"]


def _if_adjacent(number: int, name: str) -> list[str]:
    """Return the code that goes to a block for all lanes if the rows of array `number` are one number after
    another, and otherwise to one for each lane."""
    return [
        f"  %adjacent{number} = icmp eq i64 %s{number}, 8",
        f"  br i1 %adjacent{number}, label %{name}_all{number}, label %{name}_each{number}",
        f"{name}_all{number}:",
    ]


class Rows:
    """The rows of one array that belong to the samples in the lanes."""

    def __init__(self, write: Writer, columns: int, pointers: Callable[[], Sequence[str]]) -> None:
        self._write = write
        self._columns = columns
        self._width = tile_width(columns, write.lanes) if columns else 1
        self._pointers = pointers
        self._loaded: dict[int, list[str]] = {}

    def load(self, column: int) -> str:
        """Return the vector of one column, loading its tile if necessary."""
        start = tile_start(column, self._columns, self._width)
        if start not in self._loaded:
            self._loaded[start] = self.load_tile(start)
        return self._loaded[start][column - start]

    def store_tile(self, start: int | str, columns: Sequence[str]) -> None:
        """Write the vectors of all columns of the tile from a column, given as a number or by its name."""
        write, width = self._write, len(columns)
        if write.lanes == WIDE and width >= WIDE // 2:
            self._store_wide_tile(start, columns)
            return
        for first in range(0, write.lanes, width):
            lanes = list(range(first, first + width))
            parts = list(columns)
            if width < write.lanes:
                parts = [write.shuffle(c, "poison", lanes, write.lanes) for c in columns]
            for lane, row in zip(lanes, _transpose(write, parts), strict=True):
                write.do(f"store <{width} x double> {row}, ptr {self._at(lane, start)}, align 8")

    def load_tile(self, start: int | str) -> list[str]:
        """Return the vectors of all columns of the tile from a column, given as a number or by its name."""
        write, width = self._write, self._width
        if write.lanes == WIDE and width == WIDE // 2:
            return self._load_wide_tile(start)
        groups = []
        for first in range(0, write.lanes, width):
            rows = [
                write.let(f"load <{width} x double>, ptr {self._at(lane, start)}, align 8")
                for lane in range(first, first + width)
            ]
            groups.append(_transpose(write, rows))
        while len(groups) > 1:
            size = write.lanes // len(groups)
            groups = [
                [write.shuffle(a, b, range(2 * size), size) for a, b in zip(left, right, strict=True)]
                for left, right in zip(groups[::2], groups[1::2], strict=True)
            ]
        return groups[0]

    def _store_wide_tile(self, start: int | str, columns: Sequence[str]) -> None:
        write, width = self._write, len(columns)
        fours = [_rows_of_four(write, columns[k : k + 4]) for k in range(0, width, 4)]
        for lanes, parts in zip(LANES_OF_ROWS, zip(*fours, strict=True), strict=True):
            left, right = parts[0], parts[1] if width == WIDE else "poison"
            for half, lane in zip((range(4), range(4, 8)), lanes, strict=True):
                picks = [*half, *(WIDE + k for k in half)]
                row = write.shuffle(left, right, picks[:width], WIDE)
                write.do(f"store <{width} x double> {row}, ptr {self._at(lane, start)}, align 8")

    def _load_wide_tile(self, start: int | str) -> list[str]:
        write = self._write
        rows = [write.let(f"load <4 x double>, ptr {self._at(lane, start)}, align 8") for lane in range(WIDE)]
        both = [write.shuffle(rows[a], rows[b], range(WIDE), WIDE // 2) for a, b in LANES_OF_ROWS]
        found = []
        for pairs in ((0, 1, 4, 5, 8, 9, 12, 13), (2, 3, 6, 7, 10, 11, 14, 15)):
            even, odd = (write.shuffle(both[k], both[k + 1], pairs, WIDE) for k in (0, 2))
            found += [write.shuffle(even, odd, picks, WIDE) for picks in (EVEN, ODD)]
        return found

    def _at(self, lane: int, column: int | str) -> str:
        row = self._pointers()[lane]
        return (
            row if column == 0 else self._write.let(f"getelementptr inbounds double, ptr {row}, i64 {column}")
        )


def _rows_of_four(write: Writer, columns: Sequence[str]) -> list[str]:
    """Return the rows of four columns of `WIDE` lanes, two in a vector, in the order of `LANES_OF_ROWS`."""
    a, b, c, d = columns
    found = []
    for picks in (EVEN, ODD):
        left, right = write.shuffle(a, b, picks, WIDE), write.shuffle(c, d, picks, WIDE)
        for k in (0, 4):
            pairs = (k, k + 1, k + 8, k + 9, k + 2, k + 3, k + 10, k + 11)
            found.append(write.shuffle(left, right, pairs, WIDE))
    return found


def _transpose(write: Writer, rows: Sequence[str]) -> list[str]:
    """Transpose a square tile of 1, 2 or 4 vectors."""
    if len(rows) == 1:
        return list(rows)
    if len(rows) == 2:
        a, b = rows
        return [write.shuffle(a, b, (0, 2), 2), write.shuffle(a, b, (1, 3), 2)]
    # First exchange halves between rows two apart, then even and odd entries between the results.
    a, b, c, d = rows
    low, high = (0, 1, 4, 5), (2, 3, 6, 7)
    ac, bd = write.shuffle(a, c, low, 4), write.shuffle(b, d, low, 4)
    ca, db = write.shuffle(a, c, high, 4), write.shuffle(b, d, high, 4)
    even, odd = (0, 4, 2, 6), (1, 5, 3, 7)
    return [write.shuffle(*pair, picks, 4) for pair in ((ac, bd), (ca, db)) for picks in (even, odd)]


# -- scratch memory -----------------------------------------------------------------------------------

LOAD, STORE = "load_rows", "store_rows"
"""Names of the functions of the arguments, the first sample of the group, and the scratch memory."""

FILL = "fill_constants"
"""Name of the function that writes the constants into the scratch memory."""


@dataclass(frozen=True)
class Scratch:
    """Layout of the scratch memory."""

    slots: dict[int, int]
    """Slot of each input, constant and spilled value, by node."""
    first_result: int
    """Slot of the first result; the others follow in the order of the program."""
    first_constant: int
    """Slot of the first constant; the others follow in the order of `constants`."""
    constants: tuple[float, ...]
    size: int
    """Number of slots."""

    @classmethod
    def of(cls, program: Program, spilled: dict[int, int]) -> Scratch:
        """Arrange inputs, results, constants and the `spilled` nodes, given with their slots among these."""
        slots: dict[int, int] = {}
        values: list[float] = []
        first_result = program.n_inputs
        first_constant = first_result + len(program.results)
        for index, node in enumerate(program.nodes):
            if node.op == "input":
                slots[index] = node.slot
            elif node.op == "constant":
                slots[index] = first_constant + len(values)
                values.append(node.value)
        first_spilled = first_constant + len(values)
        slots.update((node, first_spilled + slot) for node, slot in spilled.items())
        size = first_spilled + max(spilled.values(), default=-1) + 1
        return cls(slots, first_result, first_constant, tuple(values), size)


def scratch_functions(program: Program, scratch: Scratch, lanes: int) -> list[str]:
    """Return the texts of the functions that fill the scratch memory and store the results."""
    used = {node.slot for node in program.nodes if node.op == "input"}
    inputs, outputs = list(scalar_ranges(program.inputs)), list(scalar_ranges(program.outputs))
    loaded = [(k, port, at.start) for k, (port, at) in enumerate(inputs) if not used.isdisjoint(at)]
    stored = [
        (len(inputs) + k, port, scratch.first_result + at.start)
        for k, (port, at) in enumerate(outputs)
        if port.size
    ]
    return [
        _row_function(LOAD, loaded, lanes),
        _row_function(STORE, stored, lanes),
        *_fill_constants(scratch, lanes),
    ]


def _row_function(name: str, arrays: Sequence[tuple[int, Port, int]], lanes: int) -> str:
    """Return the text of a function that loads or stores arrays, each given by its number, its port, and the
    slot of its first column."""
    write = Writer(lanes, fma=False)
    heads = [line for number, _, _ in arrays for line in row_pointers(number, lanes)]
    before = "entry"
    for number, port, slot in arrays:
        width, this = tile_width(port.size, lanes), f"tiles{number}"
        write.do(f"br label %{this}")
        write.label(this)
        # The last tile may overlap the one before.
        write.do(f"%c{number} = phi i64 [0, %{before}], [%n{number}, %{this}]")
        late = write.let(f"icmp ugt i64 %c{number}, {port.size - width}")
        column = write.let(f"select i1 {late}, i64 {port.size - width}, i64 %c{number}")
        first = write.let(f"add i64 {column}, {slot}")
        places = [
            write.let(f"getelementptr {write.vector}, ptr %kept, i64 {write.let(f'add i64 {first}, {k}')}")
            for k in range(width)
        ]
        rows = Rows(write, port.size, partial(lane_names, number, lanes))
        if name == LOAD:
            for place, vector in zip(places, rows.load_tile(column), strict=True):
                write.do(f"store {write.vector} {vector}, ptr {place}, align {8 * lanes}")
        else:
            loads = [f"load {write.vector}, ptr {place}, align {8 * lanes}" for place in places]
            rows.store_tile(column, [write.let(load) for load in loads])
        write.do(f"%n{number} = add i64 %c{number}, {width}")
        more = write.let(f"icmp ult i64 %n{number}, {port.size}")
        before = f"end{number}"
        write.do(f"br i1 {more}, label %{this}, label %{before}")
        write.label(before)
    parameters = "ptr noalias nocapture readonly %arguments, i64 %first, ptr noalias nocapture %kept"
    head = f"define void @{name}({parameters}) {{"
    return "\n".join([head, "entry:", *heads, *write.lines, "  ret void", "}"])


def _fill_constants(scratch: Scratch, lanes: int) -> list[str]:
    vector, n = f"<{lanes} x double>", len(scratch.constants)
    zeros = ", ".join(["i32 0"] * lanes)
    if not n:
        return [f"define void @{FILL}(ptr %kept) {{", "  ret void", "}"]
    values = ", ".join(f"double {hex_double(value)}" for value in scratch.constants)
    return [
        f"@constants = private unnamed_addr constant [{n} x double] [{values}]",
        f"define void @{FILL}(ptr noalias nocapture %kept) {{",
        "entry:",
        f"  %start = getelementptr {vector}, ptr %kept, i64 {scratch.first_constant}",
        "  br label %fill",
        "fill:",
        "  %k = phi i64 [0, %entry], [%next, %fill]",
        "  %from = getelementptr double, ptr @constants, i64 %k",
        "  %one = load double, ptr %from",
        f"  %some = insertelement {vector} poison, double %one, i32 0",
        f"  %all = shufflevector {vector} %some, {vector} poison, <{lanes} x i32> <{zeros}>",
        f"  %to = getelementptr {vector}, ptr %start, i64 %k",
        f"  store {vector} %all, ptr %to, align {8 * lanes}",
        "  %next = add i64 %k, 1",
        f"  %more = icmp ult i64 %next, {n}",
        "  br i1 %more, label %fill, label %done",
        "done:",
        "  ret void",
        "}",
    ]
