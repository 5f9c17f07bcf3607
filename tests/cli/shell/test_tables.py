"""Tables: nothing is lost or broken at any width."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dynx.cli.shell.tables import Table, listing

words = st.text("abcxyz", min_size=1, max_size=12)
widths = st.integers(1, 120)


def shown(table: Table, width: int) -> list[str]:
    """Return the lines of a table."""
    return [line.plain for line in table.lines(width)]


@given(st.data(), st.integers(1, 8), st.integers(1, 5), widths)
def test_every_cell_stands_in_its_row_in_order(
    data: st.DataObject, columns: int, rows: int, width: int
) -> None:
    names = [f"row{k}" for k in range(rows)]
    cells = data.draw(
        st.lists(st.lists(words, min_size=columns, max_size=columns), min_size=rows, max_size=rows)
    )
    table = Table("", *map(str, range(columns)), keys=1)
    for name, row in zip(names, cells, strict=True):
        table.add_row(name, *row)
    lines = shown(table, width)
    for name, row in zip(names, cells, strict=True):
        parts = [line.split()[1:] for line in lines if line.startswith(f" {name}")]
        assert [cell for part in parts for cell in part] == row
    widest = max(len(cell) for row in cells for cell in row)
    if width >= 2 * (1 + len("row0") + 3 + widest):
        assert max(map(len, lines)) <= width
    assert all(line == line.rstrip() for line in lines)


@given(st.lists(words, min_size=1, max_size=8), widths)
def test_a_table_without_keys_is_never_divided(row: list[str], width: int) -> None:
    table = Table(*["h"] * len(row))
    table.add_row(*row)
    head, _, body = shown(table, width)
    assert head.split() == ["h"] * len(row)
    assert body.split() == row


def test_numbers_are_aligned_right_under_headings_of_two_lines() -> None:
    table = Table("name", "one\n~two", right=["one\n~two"], keys=1)
    table.add_row("a", "1.5")
    table.add_row("bc", "-20.25")
    assert shown(table, 80) == [
        "           one",
        " name     ~two",
        " ─────────────",
        " a         1.5",
        " bc     -20.25",
    ]


def test_a_long_key_is_broken_between_words_only() -> None:
    table = Table("law", "error", keys=1)
    table.add_row("momentum of it all", "1e-16")
    assert shown(table, 20)[2:] == [" momentum  1e-16", "   of it", "   all"]


@given(st.lists(words, min_size=1), widths)
def test_a_listing_keeps_its_items_whole(items: list[str], width: int) -> None:
    lines = listing("all", items, width).split("\n")
    assert " ".join(line.strip() for line in lines) == f"all: {', '.join(items)}"
    longest = max(map(len, items)) + len("all: ,")
    assert max(map(len, lines)) <= max(width, longest)
