"""Valid arguments, which stay unchanged, and results, which belong to the caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dynx.spatial.scalar import Floats
from tests.contract.conftest import Make
from tests.contract.engine_calls import EngineCall, State, each_call, random_state
from tests.contract.robots import branched

FLOATING = branched().with_base("floating")


def every_other(x: Floats) -> Floats:
    """Return the same numbers, each two apart in memory."""
    wide = np.full((*x.shape[:-1], 2 * x.shape[-1]), np.nan)
    wide[..., ::2] = x
    return wide[..., ::2]


def backward(x: Floats) -> Floats:
    """Return the same numbers, backward in memory."""
    return np.ascontiguousarray(x[..., ::-1])[..., ::-1]


def read_only(x: Floats) -> Floats:
    """Return the same numbers, not to be written to."""
    x = x.copy()
    x.flags.writeable = False
    return x


def big_endian(x: Floats) -> Floats:
    """Return the same numbers in the other order of bytes."""
    return x.astype(">f8")


SPELLINGS: tuple[Callable[[Floats], Any], ...] = (
    every_other,
    backward,
    read_only,
    big_endian,
    np.asfortranarray,
    np.ndarray.tolist,
)


@pytest.mark.parametrize("spelling", SPELLINGS, ids=lambda spelling: spelling.__name__)
@each_call
def test_any_array_of_the_same_numbers(
    make: Make, engine_call: EngineCall, spelling: Callable[[Floats], Any]
) -> None:
    engine = make(FLOATING)
    for size in ((), (3,)):
        state = random_state(FLOATING, 11, size)
        result = engine_call.evaluate(engine, state.map(spelling))
        engine_call.check(engine, state, result, engine_call.evaluate(engine, state))


@pytest.mark.parametrize("dtype", ["float32", "float16", "int64", "int8", "uint8"])
@each_call
def test_other_real_numbers_are_converted_exactly(make: Make, engine_call: EngineCall, dtype: str) -> None:
    engine = make(FLOATING)
    narrow = random_state(FLOATING, 12).map(lambda x: np.rint(np.abs(x)).astype(dtype))
    narrow.q[3:7] = np.array([0, 0, 1, 0], dtype=dtype)
    result = engine_call.evaluate(engine, narrow)
    np.testing.assert_array_equal(result, engine_call.evaluate(engine, narrow.map(np.float64)))
    assert np.asarray(result).dtype == np.float64


@each_call
def test_arguments_stay_as_they_were(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    for size in ((), (2,)):
        state = random_state(FLOATING, 13, size)
        before = state.map(np.copy)
        engine_call.evaluate(engine, state)
        for name in ("q", "v", "a", "tau"):
            np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


@each_call
def test_results_belong_to_the_caller(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    for size in ((), (2,)):
        state = random_state(FLOATING, 14, size)
        first = np.asarray(engine_call.evaluate(engine, state))
        kept = first.copy()
        others = [np.asarray(engine_call.evaluate(engine, state)) for _ in range(2)]
        for argument in (state.q, state.v, state.a, state.tau):
            assert not np.shares_memory(first, argument)
        assert not any(np.shares_memory(first, other) for other in others)
        if size or first.ndim:
            assert first.flags.writeable
            first[...] = np.nan
        np.testing.assert_array_equal(engine_call.evaluate(engine, state), kept)
        engine_call.evaluate(engine, random_state(FLOATING, 15, size))
        np.testing.assert_array_equal(others[0], kept)


@each_call
def test_without_validation_the_results_are_the_same(make: Make, engine_call: EngineCall) -> None:
    checked, trusting = make(FLOATING), make(FLOATING, validate=False)
    for size in ((), (2,)):
        state: State = random_state(FLOATING, 16, size)
        np.testing.assert_array_equal(
            engine_call.evaluate(trusting, state), engine_call.evaluate(checked, state)
        )
