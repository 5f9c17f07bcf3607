"""LLVM IR that loads and stores rows of the user's arrays, one sample per lane.

A vector holds the same scalar of several samples, one per lane, but in memory the scalars of one sample are
contiguous. Tiles of b by b numbers, b rows of b neighbouring columns, are therefore loaded row by row and
transposed in registers by shuffles; stores do the reverse.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dynx.simd.ir_writer import Writer


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
    """Return the columns of every tile of a row."""
    if columns == 0:
        return []
    width = tile_width(columns, lanes)
    return [
        range(start, start + width) for start in sorted({*range(0, columns - width, width), columns - width})
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
            self._loaded[start] = self._load_tile(start)
        return self._loaded[start][column - start]

    def store(self, tile: range, columns: Sequence[str]) -> None:
        """Write the vectors of all columns of a tile."""
        write, width = self._write, self._width
        for first in range(0, write.lanes, width):
            lanes = list(range(first, first + width))
            parts = list(columns)
            if width < write.lanes:
                parts = [write.shuffle(c, "poison", lanes, write.lanes) for c in columns]
            for lane, row in zip(lanes, _transpose(write, parts), strict=True):
                write.do(f"store <{width} x double> {row}, ptr {self._at(lane, tile.start)}, align 8")

    def _load_tile(self, start: int) -> list[str]:
        write, width = self._write, self._width
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

    def _at(self, lane: int, column: int) -> str:
        row = self._pointers()[lane]
        return (
            row if column == 0 else self._write.let(f"getelementptr inbounds double, ptr {row}, i64 {column}")
        )


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
