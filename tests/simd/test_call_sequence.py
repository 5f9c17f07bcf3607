"""Calls of kernels for one row after another, in a loop of machine code."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.simd.call_sequence import CallSequence, StridedRows
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.simd.user_code.numbers import as_symbol, as_traced, select
from dynx.spatial.scalar import Array


def kernel() -> Kernel:
    return Kernel(trace(lambda x, y: {"sum": x + y, "first": x[:1] * 2.0}, {"x": (3,), "y": (3,)}))


def zeros(n: int) -> np.ndarray:
    return np.zeros(n, dtype=np.int64)


@given(data=st.data())
def test_each_call_uses_its_own_rows(data: st.DataObject) -> None:
    n = data.draw(st.integers(1, 12))
    rows = st.lists(st.integers(0, 6), min_size=n, max_size=n)
    x_rows, y_rows = np.array(data.draw(rows)), np.array(data.draw(rows))
    x, y = np.arange(21.0).reshape(7, 3), np.random.default_rng(0).normal(size=(7, 5))[:, 1:4]
    out, first = np.zeros((n, 3)), np.zeros((1, 1))
    each = np.arange(n)
    arrays = {"x": StridedRows(x, x_rows), "y": StridedRows(y, y_rows)}
    arrays |= {"sum": StridedRows(out, each[::-1].copy()), "first": StridedRows(first, zeros(n))}
    one = kernel()
    calls = CallSequence([one], zeros(n), arrays)
    assert len(calls.addresses) == n
    for k in each:
        one.locked_entry(calls.addresses[k])
        np.testing.assert_array_equal(out[n - 1 - k], x[x_rows[k]] + y[y_rows[k]])
        assert first[0, 0] == 2.0 * x[x_rows[k], 0]
    found, out[:] = out.copy(), 0.0
    begin, end = sorted(data.draw(st.tuples(st.integers(0, n), st.integers(0, n))))
    assert calls.run(begin, end) is None
    np.testing.assert_array_equal(out[::-1][begin:end], found[::-1][begin:end])
    assert not out[::-1][:begin].any()
    assert not out[::-1][end:].any()


def test_a_call_reads_what_an_earlier_call_wrote() -> None:
    state, steps = np.zeros((5, 3)), np.arange(4)
    one, repeated = np.ones((2, 3)), np.broadcast_to(np.int64(1), steps.shape)
    arrays = {"x": StridedRows(state, steps), "y": StridedRows(one, repeated)}
    outputs = {"sum": StridedRows(state, steps + 1), "first": StridedRows(np.zeros((1, 1)), 0 * steps)}
    CallSequence([kernel()], zeros(4), arrays, outputs=outputs).run(0, 4)
    np.testing.assert_array_equal(state, np.arange(5.0)[:, None] * np.ones(3))


def counting(by: float) -> Kernel:
    """Return the kernel that adds to x, with the status 1 where the sum is above 10."""

    def step(x: Array) -> dict[str, Array]:
        above = select(as_traced(x[0] + by) > 10.0, 1.0, 0.0)
        return {"x": x + by, "status": np.array([as_symbol(above)], dtype=object)}

    return Kernel(trace(step, {"x": (1,)}))


@pytest.mark.parametrize("samples", [9, 17, 64])
def test_the_loop_ends_at_the_first_status(samples: int) -> None:
    """Calls of two kernels in turn, of samples that reach the bound one after another."""
    x, steps = np.zeros((7, samples, 1)), np.arange(6)
    x[0, :, 0] = 5.0
    x[0, -2, 0] = 6.5
    status = StridedRows(np.zeros((1, samples, 1)), zeros(6))
    calls = CallSequence(
        [counting(1.0), counting(2.0)],
        steps % 2,
        {"x": StridedRows(x, steps), "status": status},
        samples,
        outputs={"x": StridedRows(x, steps + 1)},
        status="status",
    )
    assert calls.run(0, 6) == (2, samples - 2)
    np.testing.assert_array_equal(x[3, :2, 0], 9.0)
    assert not x[4].any()
    assert calls.run(5, 5) is None
    assert calls.run(4, 6) is None
    before = x[5].copy()
    x[5] = 0.0
    calls.repeat_group(4, 0)
    lanes = counting(1.0).image.lanes
    np.testing.assert_array_equal(x[5, :lanes], before[:lanes])
    assert not x[5, lanes:].any()


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
        ({"x": StridedRows(np.zeros((4, 2, 3)), np.arange(4))}, "x is float64"),
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
    with pytest.raises(ArgumentError, match=words):
        CallSequence([kernel()], zeros(4), arrays | change)
