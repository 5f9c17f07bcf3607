"""Tables of text whose cells are never broken: a table too wide for the terminal continues in blocks."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator, Sequence

from rich.console import Console, ConsoleOptions
from rich.text import Text

Cell = str | Text

_GAP, _NARROW_GAP = 3, 2
"""Number of blanks between columns in a table that fits and in one that does not; one precedes them."""

MAX_ROWS = 30
"""Largest number of rows of a table; the JSON document has them all."""

_MAX_KEY_FRACTION = 0.4
"""Largest width of a key, as a fraction of the width of a table that does not fit; wider keys are wrapped."""


class Table:
    """A table in the one style of dynx, for ``Console.print``.

    A table that is too wide is printed in blocks of columns, one below the other, each of which repeats the
    first `keys` columns, as Octave prints wide matrices. Without `keys` it is never divided. Columns named in
    `right` are aligned right.
    """

    def __init__(
        self, *columns: str, right: Sequence[str] = (), keys: int = 0, show_header: bool = True
    ) -> None:
        self._columns = columns
        self._right = [column in right for column in columns]
        self._keys = keys
        self._show_header = show_header
        self._rows: list[list[Text]] = []

    def add_row(self, *cells: Cell) -> None:
        """Add a row of cells; columns without a cell stay empty."""
        filled = [*cells, *[""] * (len(self._columns) - len(cells))]
        self._rows.append([Text(cell) if isinstance(cell, str) else cell for cell in filled])

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        return self.lines(options.max_width, "-" if options.ascii_only else "─")

    def lines(self, width: int, rule: str = "─") -> Iterator[Text]:
        """Return the table as lines without trailing blanks, at most `width` wide where cells allow."""
        heads = [[Text(line, "bold") for line in column.split("\n")] for column in self._columns]
        body = [[[cell] for cell in row] for row in self._rows]
        widths = _widths([heads, *body])
        gap = _GAP
        if self._keys and _total(widths, gap) > width:
            gap = _NARROW_GAP
        if self._keys and _total(widths, gap) > width:
            limit = int(_MAX_KEY_FRACTION * width)
            for row in body:
                row[: self._keys] = [_broken(cell[0], limit) for cell in row[: self._keys]]
            widths = _widths([heads, *body])
        for number, block in enumerate(self._blocks(widths, width, gap)):
            if number:
                yield Text("")
            if self._show_header:
                depth = max(len(heads[column]) for column in block)
                padded = [[Text("")] * (depth - len(head)) + head for head in heads]
                yield from self._row(padded, block, widths, gap)
                yield Text(f" {rule * (_total([widths[column] for column in block], gap) - 1)}")
            for row in body:
                yield from self._row(row, block, widths, gap)

    def _blocks(self, widths: Sequence[int], width: int, gap: int) -> list[list[int]]:
        """Divide the columns into blocks. Each has the keys and at least one other column, for which half
        of `width` is reserved."""
        keys = list(range(self._keys))
        if not keys:
            return [list(range(len(widths)))]
        allowed = max(width, _total(widths[: self._keys], gap) + width // 2)
        blocks = [list(keys)]
        for column in range(self._keys, len(widths)):
            wider = [widths[each] for each in (*blocks[-1], column)]
            if _total(wider, gap) > allowed and len(blocks[-1]) > len(keys):
                blocks.append(list(keys))
            blocks[-1].append(column)
        return blocks

    def _row(
        self, cells: Sequence[Sequence[Text]], block: Sequence[int], widths: Sequence[int], gap: int
    ) -> Iterator[Text]:
        """Return the lines of one row; a cell with fewer lines than the tallest is blank below."""
        for k in range(max(len(cells[column]) for column in block)):
            line = Text()
            for number, column in enumerate(block):
                cell = cells[column][k] if k < len(cells[column]) else Text("")
                blanks = " " * (widths[column] - cell.cell_len)
                line.append(" " * (gap if number else 1))
                line.append_text(Text.assemble(blanks, cell) if self._right[column] else cell + blanks)
            line.rstrip()
            yield line


def print_rest(out: Console, rest: int, noun: str = "", plural: str = "") -> None:
    """Print how many rows are left out after the first `MAX_ROWS`; nothing where there are none."""
    if rest > 0:
        words = filter(None, (f"... and {rest} more", noun if rest == 1 else plural))
        out.print(f"{' '.join(words)} (--json has all)")


def listing(heading: str, items: Iterable[str], width: int) -> str:
    """Write ``heading: a, b, c`` in lines of at most `width`, without breaking an item."""
    lines = [f"{heading}:"]
    parts = list(items)
    for number, item in enumerate(parts):
        word = item if number == len(parts) - 1 else f"{item},"
        if len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(f"  {word}")
    return "\n".join(lines)


def _broken(cell: Text, limit: int) -> list[Text]:
    """Wrap a key between words into lines of at most `limit`."""
    lines = textwrap.wrap(
        cell.plain, max(limit, 1), break_long_words=False, break_on_hyphens=False, subsequent_indent="  "
    )
    return [Text(line, cell.style) for line in lines] or [cell]


def _widths(rows: Sequence[Sequence[Sequence[Text]]]) -> list[int]:
    return [max(line.cell_len for cell in column for line in cell) for column in zip(*rows, strict=True)]


def _total(widths: Sequence[int], gap: int) -> int:
    """Return the length of a line of columns of these widths."""
    return 1 + sum(widths) + gap * (len(widths) - 1)
