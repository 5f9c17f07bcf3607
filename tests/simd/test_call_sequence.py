"""Calls of a kernel for one row after another."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.simd.call_sequence import StridedRows, prepare_calls
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace


def kernel() -> Kernel:
    return Kernel(trace(lambda x, y: {"sum": x + y, "first": x[:1] * 2.0}, {"x": (3,), "y": (3,)}))


@given(data=st.data())
def test_each_call_uses_its_own_rows(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 12))
    rows = st.lists(st.integers(0, 6), min_size=n, max_size=n)
    x_rows, y_rows = np.array(data.draw(rows)), np.array(data.draw(rows))
    x, y = np.arange(21.0).reshape(7, 3), np.random.default_rng(0).normal(size=(7, 5))[:, 1:4]
    out, first = np.zeros((n, 3)), np.zeros((1, 1))
    each, still = np.arange(n), np.zeros(n, dtype=np.int64)
    calls = prepare_calls(
        kernel(),
        [StridedRows(x, x_rows), StridedRows(y, y_rows)],
        [StridedRows(out, each[::-1].copy()), StridedRows(first, still)],
    )
    assert len(calls.addresses) == n
    for k in each:
        calls.run(calls.addresses[k])
        np.testing.assert_array_equal(out[n - 1 - k], x[x_rows[k]] + y[y_rows[k]])
        assert first[0, 0] == 2.0 * x[x_rows[k], 0]


def test_a_call_reads_what_an_earlier_call_wrote() -> None:
    state = np.zeros((5, 3))
    steps = np.arange(4)
    one, repeated = np.ones((2, 3)), np.broadcast_to(np.int64(1), steps.shape)
    calls = prepare_calls(
        kernel(),
        [StridedRows(state, steps), StridedRows(one, repeated)],
        [StridedRows(state, steps + 1), StridedRows(np.zeros((1, 1)), 0 * steps)],
    )
    for address in calls.addresses:
        calls.run(address)
    np.testing.assert_array_equal(state, np.arange(5.0)[:, None] * np.ones(3))


def read_only() -> np.ndarray:
    array = np.zeros((4, 3))
    array.setflags(write=False)
    return array


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"x": StridedRows(np.zeros((4, 2)), np.arange(4))}, "x is float64"),
        ({"x": StridedRows(np.zeros((4, 3), dtype=np.float32), np.arange(4))}, "float32"),
        ({"x": StridedRows(np.zeros((4, 6))[:, ::2], np.arange(4))}, "x is float64"),
        ({"x": StridedRows(np.zeros((4, 3)), np.arange(1, 5))}, "4 rows; rows 1 to 4"),
        ({"x": StridedRows(np.zeros((4, 3)), np.arange(-1, 3))}, "rows -1 to 2"),
        ({"x": StridedRows(np.zeros((4, 3)), np.broadcast_to(np.int64(4), (4,)))}, "4 rows; rows 4 to 4"),
        ({"y": StridedRows(np.zeros((4, 3)), np.arange(3))}, r"at \(3,\) rows"),
        ({"sum": StridedRows(read_only(), np.arange(4))}, "sum is read-only"),
    ],
)
def test_arrays_that_do_not_fit_raise(change: dict[str, StridedRows], words: str) -> None:
    steps = np.arange(4)
    arrays = {name: StridedRows(np.zeros((4, 3)), steps) for name in ("x", "y", "sum")}
    arrays["first"] = StridedRows(np.zeros((4, 1)), steps)
    arrays |= change
    with pytest.raises(ArgumentError, match=words):
        prepare_calls(kernel(), [arrays["x"], arrays["y"]], [arrays["sum"], arrays["first"]])


def test_a_wrong_number_of_arrays_raises() -> None:
    with pytest.raises(ArgumentError, match="2 inputs and 2 outputs was given 1 and 0"):
        prepare_calls(kernel(), [StridedRows(np.zeros((1, 3)), np.zeros(1, dtype=np.int64))], [])
