"""Tiles: the columns that are loaded and stored at once."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.rows import WIDE, tile_start, tile_width, tiles
from tests.simd.machine import LANES


@given(st.integers(1, 200), st.sampled_from(LANES))
def test_tiles_cover_a_row_and_nothing_else(columns: int, lanes: int) -> None:
    row = tiles(columns, lanes)
    width = tile_width(columns, lanes)
    assert {column for tile in row for column in tile} == set(range(columns))
    assert all(lanes % len(tile) == 0 for tile in row)
    assert all(len(tile) in (width, WIDE) for tile in row)
    assert len(row) == -(-columns // len(row[0]))


@given(st.integers(1, 200), st.sampled_from(LANES), st.data())
def test_a_column_is_in_the_tile_that_is_loaded_for_it(columns: int, lanes: int, data: st.DataObject) -> None:
    column = data.draw(st.integers(0, columns - 1))
    width = tile_width(columns, lanes)
    start = tile_start(column, columns, width)
    assert column in range(start, start + width)
    assert 0 <= start <= columns - width


def test_an_empty_row_has_no_tiles() -> None:
    assert tiles(0, 4) == []
