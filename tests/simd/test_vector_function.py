"""Functions of two vectors in machine code: the results of the same text on floats, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from operator import methodcaller
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.arrays import ACCEPTED, REFUSED, UNSUITABLE
from dynx.simd.trace import trace
from dynx.simd.vector_function import vector_function
from dynx.spatial.scalar import equal, less, less_equal, maximum, minimum, select

NUMBERS = st.floats(-1e6, 1e6)


def head_of(x: Any, y: Any, *functions: Callable[[Any], Any]) -> list[Any]:
    """Every operation on numbers x and y."""
    sine, cosine, root, arc = functions
    return [
        x * y - x / (1.5 + abs(y)),
        sine(x) + cosine(-y),
        root(abs(x)) - arc(y),
        select(less(x, y), minimum(x, y), 2.0) + equal(x, y),
        maximum(x, 0.25) * less_equal(y, x),
    ]


@cache
def function() -> Callable[[object, object, object], int]:
    def head(first: Any, second: Any) -> dict[str, Any]:
        (x,), (y, unused) = first.tolist(), second.tolist()
        functions = (methodcaller(name) for name in ("sin", "cos", "sqrt", "arctan"))
        result = head_of(x, y, *functions)
        return {"result": result, "defect": 0.0 * unused}

    def tail(first: Any, second: Any) -> dict[str, Any]:
        return {"result": first - second, "defect": abs(first)[0]}

    return vector_function(
        trace(head, {"first": (1,), "second": (2,)}, simplify=None),
        trace(tail, {"first": (1,), "second": (1,)}, simplify=None),
    )


@given(st.lists(NUMBERS, max_size=4), st.data())
def test_results_are_those_of_floats(further: list[float], data: st.DataObject) -> None:
    x, y = data.draw(NUMBERS), data.draw(NUMBERS)
    others = [data.draw(NUMBERS) for _ in further]
    result = np.full(5 + len(further), math.nan)
    outcome = function()(np.array([x, *further]), np.array([y, 0.0, *others]), result)
    assert outcome == (ACCEPTED if sum(map(abs, further)) < 1.0 else REFUSED)
    head = head_of(x, y, math.sin, math.cos, math.sqrt, math.atan)
    assert result.tolist() == head + [a - b for a, b in zip(further, others, strict=True)]


def test_a_defect_that_is_no_number_is_refused() -> None:
    assert function()(np.array([1.0]), np.array([1.0, math.nan]), np.empty(5)) == REFUSED


@pytest.mark.parametrize(
    "first",
    [
        np.zeros(3),
        np.zeros(0),
        np.zeros((1, 2)),
        np.zeros(()),
        np.zeros(4)[::2],
        np.zeros(2, dtype=np.float32),
        np.zeros(2, dtype=np.int64),
        np.zeros(2, dtype=complex),
        np.zeros(2, dtype=">f8"),
        np.zeros(2, dtype="M8[s]"),
        np.zeros(2)[::-1],
        [0.0, 0.0],
        None,
    ],
)
def test_what_is_no_contiguous_vector_of_the_right_size_is_unsuitable(first: object) -> None:
    other, result = np.zeros(3), np.full(6, 7.0)
    for _ in range(3):
        assert function()(first, other, result) == UNSUITABLE
        assert result.tolist() == [7.0] * 6
    assert function()(np.zeros(2), other, np.zeros(5)) == UNSUITABLE


def test_vectors_that_are_read_only_are_accepted() -> None:
    fixed = np.frombuffer(np.array([2.0, 0.5]).tobytes())
    assert not fixed.flags.writeable
    result = np.empty(6)
    assert function()(fixed, np.array([3.0, 0.0, 0.25]), result) == ACCEPTED
    assert result[0] == 6.0 - 2.0 / 4.5
    assert result[5] == 0.25


def test_a_vector_that_is_not_aligned_is_unsuitable_or_read_as_it_is() -> None:
    odd = np.frombuffer(b"\0" * 4 + np.array([2.0, 0.5]).tobytes(), offset=4)
    result = np.empty(6)
    outcome = function()(odd, np.array([3.0, 0.0, 0.25]), result)
    assert outcome == UNSUITABLE or result[0] == 6.0 - 2.0 / 4.5
