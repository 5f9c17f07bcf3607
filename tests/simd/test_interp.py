"""The meaning of every operation, stated by numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dynx.simd.expr import ARITY, Graph, Op
from dynx.simd.program import Port, extract_program
from tests.simd.interp import interpret
from tests.simd.machine import same_bits

NAN, INF = math.nan, math.inf
PAIRS = [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0), (0.0, -0.0), (NAN, 1.0), (1.0, NAN), (INF, INF)]
CASES: list[tuple[Op, tuple[float, ...], float]] = [
    ("add", (0.1, 0.2), 0.30000000000000004),
    ("add", (-0.0, -0.0), -0.0),
    ("add", (INF, -INF), NAN),
    ("sub", (1.0, 3.0), -2.0),
    ("sub", (0.0, 0.0), 0.0),
    ("mul", (-1.0, 0.0), -0.0),
    ("mul", (INF, 0.0), NAN),
    ("div", (1.0, 3.0), 1.0 / 3.0),
    ("div", (1.0, -0.0), -INF),
    ("div", (-1.0, -0.0), INF),
    ("div", (0.0, 0.0), NAN),
    ("div", (1.0, INF), 0.0),
    ("neg", (0.0,), -0.0),
    ("abs", (-0.0,), 0.0),
    ("abs", (-INF,), INF),
    ("sqrt", (2.0,), math.sqrt(2.0)),
    ("sqrt", (-0.0,), -0.0),
    ("sqrt", (-1.0,), NAN),
    ("sin", (1.0,), math.sin(1.0)),
    ("sin", (-0.0,), -0.0),
    ("sin", (INF,), NAN),
    ("cos", (1.0,), math.cos(1.0)),
    ("cos", (NAN,), NAN),
    ("exp", (1.0,), math.exp(1.0)),
    ("exp", (-INF,), 0.0),
    ("tanh", (-0.0,), -0.0),
    ("tanh", (INF,), 1.0),
    ("arctan", (1.0,), math.pi / 4.0),
    ("arctan", (-INF,), -math.pi / 2.0),
    ("min", (1.0, 2.0), 1.0),
    ("min", (NAN, 2.0), 2.0),
    ("min", (2.0, NAN), NAN),
    ("min", (0.0, -0.0), -0.0),
    ("min", (-0.0, 0.0), 0.0),
    ("max", (1.0, 2.0), 2.0),
    ("max", (NAN, 2.0), 2.0),
    ("max", (2.0, NAN), NAN),
    ("max", (0.0, -0.0), -0.0),
    ("max", (-0.0, 0.0), 0.0),
    *(("less", pair, float(pair[0] < pair[1])) for pair in PAIRS),
    *(("less_equal", pair, float(pair[0] <= pair[1])) for pair in PAIRS),
    *(("equal", pair, float(pair[0] == pair[1])) for pair in PAIRS),
    ("select", (1.0, 2.0, 3.0), 2.0),
    ("select", (-0.0, NAN, 3.0), 3.0),
    ("select", (NAN, 2.0, 3.0), 2.0),
]


@pytest.mark.parametrize(("op", "numbers", "wanted"), CASES, ids=str)
def test_an_operation_means(op: Op, numbers: tuple[float, ...], wanted: float) -> None:
    graph = Graph()
    args = [graph.input(slot) for slot in range(len(numbers))]
    program = extract_program(
        graph, [Port("x", (len(args),))], [Port("y", (1,))], [graph.apply_unsimplified(op, *args)]
    )
    (y,) = interpret(program, [np.array([numbers])])
    assert same_bits(y, np.array([[wanted]]))


def test_every_operation_has_a_case() -> None:
    assert {op for op, _, _ in CASES} == {op for op, arity in ARITY.items() if arity}


def test_ports_in_order_and_constants_for_every_sample() -> None:
    graph = Graph()
    a, b, c = (graph.input(slot) for slot in range(3))
    results = [graph.constant(7.0), c, graph.apply_unsimplified("sub", a, b)]
    ports = [Port("p", (2,)), Port("q", ())], [Port("r", (1,)), Port("s", (2,))]
    r, s = interpret(
        extract_program(graph, *ports, results),
        [np.array([[1.0, 2.0], [5.0, 3.0]]), np.array([[4.0], [8.0]])],
    )
    assert r.tolist() == [[7.0], [7.0]]
    assert s.tolist() == [[4.0, -1.0], [8.0, 2.0]]
