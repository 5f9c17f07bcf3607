"""Calls of a kernel with NumPy arrays that machine code examines."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dynx.simd.arrays import ACCEPTED, DESCRIBED, REFUSED, UNSUITABLE, extent_of, is_disjoint
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.spatial.scalar import Floats

MAX_SAMPLES = 40
BOUND = 1e6


@cache
def kernel() -> Kernel:
    return Kernel(trace(lambda x, y: {"sum": x + y[:2], "square": x[:1] * x[:1]}, {"x": (2,), "y": (3,)}))


def entry() -> tuple[Callable[..., int], Any]:
    workspace = kernel().workspace()
    return workspace.accept_arrays([2, 3], MAX_SAMPLES, BOUND), workspace


LAYOUTS: dict[str, tuple[Callable[[Floats], Any], bool]] = {
    "contiguous": (lambda x: x, True),
    "read-only": (lambda x: np.frombuffer(x.tobytes()).reshape(x.shape), True),
    "every second row": (lambda x: np.repeat(x, 2, axis=0)[::2], True),
    "columns of wider rows": (lambda x: np.concatenate([x, x], axis=1)[:, : x.shape[1]], True),
    "one row for all": (lambda x: np.broadcast_to(x[:1], x.shape), True),
    "backwards": (lambda x: x[::-1], False),
    "column after column": (np.asfortranarray, False),
    "every second column": (lambda x: np.repeat(x, 2, axis=1)[:, ::2], False),
    "not aligned": (lambda x: np.frombuffer(b"\0" * 4 + x.tobytes(), offset=4).reshape(x.shape), False),
    "single precision": (lambda x: x.astype(np.float32), False),
    "integers": (lambda x: x.astype(np.int64), False),
    "complex": (lambda x: x.astype(np.complex128), False),
    "bytes swapped": (lambda x: x.astype(x.dtype.newbyteorder()), False),
    "dates, which have no buffer": (lambda x: x.astype("M8[s]"), False),
    "one row less": (lambda x: x[1:], False),
    "one column more": (lambda x: np.column_stack([x, x[:, 0]]), False),
    "one sample": (lambda x: x[0], False),
    "another axis": (lambda x: x[:, None], False),
    "a list": (lambda x: x.tolist(), False),
    "none": (lambda x: None, False),
}


@given(data=st.data())
def test_arrays_are_used_if_their_rows_are_contiguous(data: st.DataObject) -> None:
    call, _ = entry()
    lanes = kernel().image.lanes
    n = data.draw(st.integers(max(lanes, 2), MAX_SAMPLES))
    rng = np.random.default_rng(n)
    given = [rng.uniform(-9.0, 9.0, (n, 2)), rng.uniform(-9.0, 9.0, (n, 3))]
    layouts = [LAYOUTS[data.draw(st.sampled_from(list(LAYOUTS)))] for _ in given]
    assume(layouts != [LAYOUTS["one row less"]] * 2)
    x, y = (change(array) for (change, _), array in zip(layouts, given, strict=True))
    out = np.full((n, 2), np.nan)
    counts = [sys.getrefcount(array) for array in (x, y, out)]
    outcome = call(x, y, out)
    assert [sys.getrefcount(array) for array in (x, y, out)] == counts
    if all(usable for _, usable in layouts):
        assert outcome == ACCEPTED
        np.testing.assert_array_equal(out, x + y[:, :2])
    else:
        assert outcome == UNSUITABLE
        assert np.isnan(out).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e4, -1e200])
def test_an_addend_beyond_the_bound_is_found_in_any_row(value: float) -> None:
    call, _ = entry()
    for n in (kernel().image.lanes, MAX_SAMPLES - 3):
        y, out = np.ones((n, 3)), np.empty((n, 2))
        for row in range(n):
            x = np.ones((n, 2))
            assert call(x, y, out) == ACCEPTED
            x[row, 0] = value
            assert call(x, y, out) == REFUSED
            np.testing.assert_array_equal(out, x + y[:, :2])


def test_more_samples_are_described_and_not_evaluated() -> None:
    call, workspace = entry()
    n = MAX_SAMPLES + 1
    x, y, out, squares = np.ones((n, 2)), np.ones((2 * n, 3))[::2], np.zeros((n, 2)), np.zeros((n, 1))
    assert call(x, y, out) == DESCRIBED
    assert not out.any()
    words = workspace.batch_words
    words[0], words[7] = n, squares.ctypes.data
    workspace.run_batch()
    np.testing.assert_array_equal(out, 2.0)
    np.testing.assert_array_equal(squares, 1.0)


@pytest.mark.parametrize("first", range(0, 60, 5))
def test_an_output_over_an_input_is_not_used(first: int) -> None:
    call, _ = entry()
    n = max(8, kernel().image.lanes)
    memory = np.arange(200.0)
    y = memory[30 : 30 + 3 * n].reshape(n, 3)
    out = memory[first : first + 2 * n].reshape(n, 2)
    shared = np.shares_memory(y, out)
    assert call(np.zeros((n, 2)), y, out) == (UNSUITABLE if shared else ACCEPTED)


@given(st.data())
def test_arrays_of_the_same_memory_are_disjoint_where_they_share_no_number(data: st.DataObject) -> None:
    memory = np.arange(60.0)

    def view() -> Floats:
        """Return a view of some rows, in either order, and some columns."""
        rows, width = data.draw(st.sampled_from([(6, 10), (12, 5), (60, 1)]))
        table = memory.reshape(rows, width)
        first, end = sorted(data.draw(st.tuples(*[st.integers(0, rows)] * 2)))
        left, right = sorted(data.draw(st.tuples(*[st.integers(0, width)] * 2)))
        assume(first < end and left < right)
        return table[first:end, left:right][:: data.draw(st.sampled_from([1, 2, -1, -2]))]

    one, other = view(), view()
    extents = [extent_of(one), extent_of(other)]
    for array, (first, end) in zip((one, other), extents, strict=True):
        addresses = [entry.ctypes.data for row in array for entry in np.split(row, len(row))]
        assert (first, end) == (min(addresses), max(addresses) + 8)
    apart = extents[0][1] <= extents[1][0] or extents[1][1] <= extents[0][0]
    for own, array in enumerate((one, other)):
        # Rows that repeat memory are seen too; here a row is one of a table, and none does.
        assert is_disjoint(extents, own, array) == apart
    assert not (apart and np.shares_memory(one, other))
    assert not is_disjoint(extents, 0, np.broadcast_to(one[:1], (2, one.shape[1])))


def test_zero_columns() -> None:
    program = trace(lambda x, y: {"twice": y + y, "square": y * y}, {"x": (0,), "y": (1,)})
    workspace = Kernel(program).workspace()
    call = workspace.accept_arrays([0, 1], MAX_SAMPLES, BOUND)
    y = np.arange(2.0 * MAX_SAMPLES).reshape(-1, 2)[:, :1]
    out = np.empty_like(y)
    assert call(np.empty((MAX_SAMPLES, 0)), y, out) == ACCEPTED
    np.testing.assert_array_equal(out, 2.0 * y)
