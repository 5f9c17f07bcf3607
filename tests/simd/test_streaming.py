"""Long rows that are written past the caches, against rows that are stored as usual."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx.simd.streaming
from dynx.simd.emit import Settings, emit
from dynx.simd.program import Program
from dynx.simd.schedule import MAX_BLOCK, MIN_COLUMNS, streamed_outputs
from dynx.simd.streaming import Streaming
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from tests.simd.machine import LANES, TARGETS, Machine, same_bits

SIZES = (MIN_COLUMNS, MIN_COLUMNS + 2, 3, 200)
MARK = -123.456


def program() -> Program:
    """Rows of products, a third of them constants in whole tiles and between others; a short row."""

    def function(x: Array) -> dict[str, Array]:
        outputs = {}
        for number, size in enumerate(SIZES):
            row = [x[k % 5] * x[(k + number) % 7] if k % 24 < 15 else float(k) for k in range(size)]
            outputs[f"y{number}"] = np.array(row, dtype=object)
        return outputs

    return trace(function, {"x": (7,)})


def outputs_in(layout: str, n: int) -> tuple[list[Floats], list[Floats]]:
    """Return arrays of marks, and views of them for the results of n samples."""
    blocks, views = [], []
    for size in SIZES:
        if layout == "rows":
            block = np.full(n * size + 9, MARK)
            # Not the beginning of a cache line.
            view = block[5 : 5 + n * size].reshape(n, size)
        else:
            block = np.full((2 * n, size + 3), MARK)
            view = block[::2, 1 : size + 1] if layout == "padded" else block[::-2, 1 : size + 1]
        blocks.append(block)
        views.append(view)
    return blocks, views


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.cpu)
@pytest.mark.parametrize("lanes", LANES)
@pytest.mark.parametrize("quick", [False, True], ids=["optimised", "quick"])
def test_streamed_rows_have_the_bits_of_others(
    target: Any, lanes: int, quick: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Settings(lanes, segment=100, quick=quick)
    plain = Machine(program(), target, settings)
    monkeypatch.setattr(dynx.simd.streaming, "MIN_STREAMED", 1)
    streamed = Machine(program(), target, settings)
    for n in (lanes, 2 * lanes, 3 * lanes + 1):
        x = np.random.default_rng(n).normal(size=(n, 7))
        wanted = plain([x])
        for layout in ("rows", "padded", "backwards"):
            blocks, views = outputs_in(layout, n)
            streamed.fill([x], views, n)
            for block, view, right in zip(blocks, views, wanted, strict=True):
                assert same_bits(view, right)
                view[:] = MARK
                assert np.all(block == MARK)


def test_rows_are_streamed_from_the_stated_size_on() -> None:
    """The two ways cannot be told apart by results, but by the code that decides."""
    streaming = Streaming(program(), 8, 0)
    row = 8 * sum(size for size in SIZES if size >= MIN_COLUMNS)
    samples = -(-dynx.simd.streaming.MIN_STREAMED // row)
    assert f"  %streams = icmp sge i64 %n, {samples}" in streaming.begin([], ["%kept"])


def test_rows_too_long_for_the_block_and_short_rows_are_not_streamed() -> None:
    size = MAX_BLOCK // 64 + 1
    long = trace(lambda x: {"y": np.full(size, 1.0) * x[0], "z": np.full(130, 1.0) * x[0]}, {"x": (1,)})
    assert streamed_outputs(long, 8) == [1]
    assert streamed_outputs(program(), 8) == [0, 1, 3]


def test_rows_are_copied_between_the_operations() -> None:
    """Every burst of a group stands in the code of a segment, however the program is divided."""
    bursts = len(Streaming(program(), 4, 0).bursts())
    assert bursts > 3
    for segment in (30, 2500):
        text = emit(program(), TARGETS[0], Settings(4, segment=segment))
        # Two functions copy what is no whole burst, and what is left at the end.
        assert text.count("!nontemporal") == 2 * (bursts + 2)
