"""Tracing: permitted operations, and the line named in the error for others."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dynx.errors import CompileError, TraceError
from dynx.simd.emit import Settings
from dynx.simd.expr import Symbol
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program
from dynx.simd.simplify import FAST, STRICT
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, clamp, cos, sin, sqrt
from tests.simd.interp import interpret


def test_a_function_of_arrays() -> None:
    def function(A: Array, x: Array) -> dict[str, Array]:
        return {"y": A @ x + sqrt(np.sum(x * x)), "z": np.stack([sin(x), cos(x)]), "one": np.ones(2)}

    shapes = {"A": (2, 3), "x": (3,)}
    rng = np.random.default_rng(0)
    for simplify in (None, STRICT, FAST):
        with pytest.raises(ValueError, match="operands"):
            trace(lambda A, x: A @ x + x, shapes, simplify=simplify)
        program = trace(lambda A, x: {**function(A, x), "y": A @ x + x[:2]}, shapes, simplify=simplify)
        A, x = rng.normal(size=(5, 2, 3)), rng.normal(size=(5, 3))
        y, z, one = interpret(program, [A.reshape(5, 6), x])
        assert [(port.name, port.shape) for port in program.inputs] == [("A", (2, 3)), ("x", (3,))]
        assert [(port.name, port.shape) for port in program.outputs] == [
            ("y", (2,)),
            ("z", (2, 3)),
            ("one", (2,)),
        ]
        for k in range(5):
            np.testing.assert_allclose(y[k], A[k] @ x[k] + x[k, :2], rtol=1e-14, atol=1e-14)
            np.testing.assert_array_equal(z[k], np.concatenate([sine(x[k]), cosine(x[k])]))
        assert np.all(one == 1.0)


def sine(x: Array) -> list[float]:
    return [math.sin(entry) for entry in x.tolist()]


def cosine(x: Array) -> list[float]:
    return [math.cos(entry) for entry in x.tolist()]


def test_a_single_result_is_named_result() -> None:
    program = trace(lambda x: np.sum(x), {"x": (3,)})
    assert [(port.name, port.shape) for port in program.outputs] == [("result", ())]


def test_an_empty_input_and_an_empty_result() -> None:
    program = trace(lambda x, y: {"nothing": x, "y": y}, {"x": (0,), "y": (1,)})
    nothing, y = interpret(program, [np.empty((2, 0)), np.array([[1.0], [2.0]])])
    assert nothing.shape == (2, 0)
    assert y.tolist() == [[1.0], [2.0]]


def _if(x: Array) -> Any:
    return x if x[0] > 0.0 else -x


def _truth(x: Array) -> Any:
    return x if x[0] else -x


def _equal(x: Array) -> Any:
    return x[0] == x[1]


def _member(x: Array) -> Any:
    return x[0] in [1.0]


def _key(x: Array) -> Any:
    return {x[0]: 1.0}


def _float(x: Array) -> Any:
    return math.sin(x[0])


def _index(x: Array) -> Any:
    return [1.0, 2.0][x[0]]


def _round(x: Array) -> Any:
    return round(x[0])


def _maximum(x: Array) -> Any:
    return np.maximum(x, 0.0)


def _where(x: Array) -> Any:
    return np.where(x > 0.0, x, 1.0)


def _sort(x: Array) -> Any:
    return np.sort(x)


def _clip(x: Array) -> Any:
    return np.clip(x, 0.0, 1.0)


def _median(x: Array) -> Any:
    return np.median(x)


def _as_floats(x: Array) -> Any:
    return x.astype(float)


def _allclose(x: Array) -> Any:
    return np.array_equal(x, x[::-1])


VALUE_NEEDED = (_if, _truth, _equal, _member, _key, _float, _index, _round)
VALUE_NEEDED_BY_NUMPY = (_maximum, _where, _sort, _clip, _median, _as_floats, _allclose)


@pytest.mark.parametrize(
    "function", [*VALUE_NEEDED, *VALUE_NEEDED_BY_NUMPY], ids=lambda function: function.__name__
)
def test_the_error_names_the_line_that_needs_a_value(function: Callable[[Array], Any]) -> None:
    with pytest.raises(TraceError) as caught:
        trace(function, {"x": (3,)})
    line = inspect.getsourcelines(function)[1] + 1
    assert f"{__file__}:{line} needs the value of a symbol" in str(caught.value)


def test_two_traces_do_not_mix() -> None:
    stolen: list[Symbol] = []

    def stealing(x: Array) -> Array:
        stolen.append(x[0])
        return x

    trace(stealing, {"x": (1,)})

    def mixing(x: Array) -> Any:
        return x[0] + stolen[0]

    with pytest.raises(TraceError) as caught:
        trace(mixing, {"x": (1,)})
    assert f"{__file__}:{inspect.getsourcelines(mixing)[1] + 1} mixes symbols of two traces" in str(
        caught.value
    )
    with pytest.raises(TraceError, match="result holds a symbol of another trace"):
        trace(lambda x: stolen[0], {"x": (1,)})


@pytest.mark.parametrize("result", ["text", None, 1j, object()], ids=["text", "none", "complex", "object"])
def test_results_are_numbers(result: object) -> None:
    with pytest.raises(TraceError, match=f"result holds a {type(result).__name__}; wanted numbers"):
        trace(lambda x: [x[0], result], {"x": (1,)})


def test_results_may_be_any_real_number() -> None:
    program = trace(lambda x: [1, True, np.float32(0.5), np.int64(3), 2.5], {"x": (1,)})
    (y,) = interpret(program, [np.zeros((2, 1))])
    assert y.tolist() == [[1.0, 1.0, 0.5, 3.0, 2.5]] * 2


def test_tracing_ends_with_a_check_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    broken = Program((), (), (Port("y", (1,)),), (5,))
    monkeypatch.setattr("dynx.simd.trace.extract_program", lambda *_: broken)
    with pytest.raises(CompileError, match="a result is node 5 of 0"):
        trace(lambda x: x, {"x": (1,)})


@pytest.mark.parametrize("fast", [True, False])
def test_clamping_propagates_nan(fast: bool) -> None:
    limit = np.array([1.0, 1.0, 1.0, np.inf, 2.0])
    program = trace(lambda x: clamp(x, limit), {"x": (5,)}, simplify=FAST if fast else STRICT)
    x = np.array([[np.nan, np.inf, -3.0, np.nan, 0.5]])
    found = np.empty((1, 5))
    kernel = Kernel(program, settings=Settings(host().lanes, fast=fast))
    kernel([x], [found])
    np.testing.assert_array_equal(found, clamp(x, limit))
    np.testing.assert_array_equal(found, [[np.nan, 1.0, -1.0, np.nan, 0.5]])
