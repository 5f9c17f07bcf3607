"""Nodes are unique; symbols build the expression that the same code computes on numbers."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.expr import Graph, Symbol, constant_key
from dynx.simd.program import Port, extract_program
from tests.simd.interp import interpret
from tests.simd.machine import same_bits

FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": lambda x, y: -x,
    "pos": lambda x, y: +x,
    "abs": lambda x, y: abs(x),
}


def symbols() -> tuple[Graph, Symbol, Symbol]:
    graph = Graph()
    return graph, Symbol(graph, graph.input(0)), Symbol(graph, graph.input(1))


def value(graph: Graph, symbol: Any, x: float, y: float) -> float:
    assert isinstance(symbol, Symbol)
    program = extract_program(graph, [Port("x", (2,))], [Port("z", (1,))], [symbol.index])
    return float(interpret(program, [np.array([[x, y]])])[0][0, 0])


NUMBERS = st.floats(-1e3, 1e3).filter(lambda x: x != 0.0)


@pytest.mark.parametrize("name", FUNCTIONS)
@given(NUMBERS, NUMBERS, st.sampled_from(["both", "left", "right", "NumPy left", "NumPy right", "whole"]))
def test_arithmetic_on_symbols_is_that_on_numbers(name: str, x: float, y: float, which: str) -> None:
    function = FUNCTIONS[name]
    graph, a, b = symbols()
    if which == "whole":
        y = float(math.ceil(abs(y)))
    pairs: dict[str, tuple[Any, Any]] = {
        "both": (a, b),
        "left": (a, y),
        "right": (x, b),
        "NumPy left": (a, np.float64(y)),
        "NumPy right": (np.float64(x), b),
        "whole": (a, int(y)),
    }
    result = function(*pairs[which])
    if isinstance(result, Symbol):
        assert value(graph, result, x, y) == function(x, y)
    else:
        assert not isinstance(pairs[which][0], Symbol)
        assert result == function(x, y)


def test_methods_called_by_numpy_and_dynx() -> None:
    graph, a, b = symbols()
    for got, wanted in (
        (a.sin(), math.sin(0.3)),
        (a.cos(), math.cos(0.3)),
        (a.sqrt(), math.sqrt(0.3)),
        (a.minimum(b), 0.3),
        (a.maximum(b), 0.7),
        (a.minimum(0.2), 0.2),
    ):
        assert value(graph, got, 0.3, 0.7) == wanted


def test_equal_operations_are_one_node() -> None:
    graph, a, b = symbols()
    assert (a + b).index == (b + a).index
    assert (a * b).index == (b * a).index
    assert (a - b).index != (b - a).index
    assert a.minimum(b).index != b.minimum(a).index
    size = len(graph)
    _ = (a + b) * 1.5 - a.sin()
    grown = len(graph)
    _ = (b + a) * 1.5 - a.sin()
    assert len(graph) == grown > size


def test_constants_are_distinguished_by_their_bits() -> None:
    graph = Graph()
    zeros = graph.constant(0.0), graph.constant(-0.0)
    assert zeros[0] != zeros[1]
    assert [math.copysign(1.0, graph.nodes[zero].value) for zero in zeros] == [1.0, -1.0]
    assert graph.constant(math.nan) == graph.constant(-math.nan)
    assert graph.constant(np.float64(2.5)) == graph.constant(2.5)
    assert type(graph.nodes[graph.constant(np.float64(2.5))].value) is float


@given(st.floats(), st.floats())
def test_constant_key_distinguishes_bits(x: float, y: float) -> None:
    assert (constant_key(x) == constant_key(y)) == bool(same_bits(np.array([x]), np.array([y])))


def test_other_operands_raise() -> None:
    _, a, _ = symbols()
    for other in ("1", None, [1.0], 1j):
        with pytest.raises(TypeError, match="unsupported operand"):
            a + other
