"""Derivatives of programs against difference quotients in 50 digits and the rules of calculus."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dynx.errors import CompileError
from dynx.simd.differentiate import Order, differentiate
from dynx.simd.expr import Graph, Op
from dynx.simd.program import Port, Program, extract_program
from dynx.simd.trace import inline, trace
from dynx.spatial.scalar import Array, Floats, arctan, cos, exp, sin, sqrt, tanh
from tests.simd.interp import interpret
from tests.simd.programs import RANDOM, SPECIAL, doubles

DIGITS = 50
STEP = 15
"""The step is 1e-15: a central difference is then off by 1e-30 times a third derivative, and by
1e-35 for rounding."""
CLOSE = 1e-20
TAME = 1e3

ORDERS: tuple[Order, ...] = ("forward", "reverse")


@pytest.fixture(autouse=True)
def _fifty_digits() -> Iterator[None]:
    with mpmath.workdps(DIGITS):
        yield


def exactly(numbers: object) -> Array:
    return np.asarray(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(numbers, dtype=float)), dtype=object)


def smaller(a: Array, b: Array) -> Array:
    return np.asarray(a.item().minimum(b.item()), dtype=object)


def larger(a: Array, b: Array) -> Array:
    return np.asarray(a.item().maximum(b.item()), dtype=object)


STEPS: tuple[Callable[[Array, Array], Array], ...] = (
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: np.asarray(a / (b * b + 1.5)),
    lambda a, b: np.asarray(-a),
    lambda a, b: np.asarray(abs(a)),
    lambda a, b: sqrt(np.asarray(a * a + 0.25)),
    lambda a, b: sin(a),
    lambda a, b: cos(a),
    lambda a, b: exp(np.asarray(-a * a)),
    lambda a, b: tanh(a),
    lambda a, b: arctan(a),
    smaller,
    larger,
)
"""Every operation, on arguments for which it has a derivative."""


@st.composite
def smooth_programs(draw: st.DrawFn) -> Program:
    """Draw a program of x (3,) and y (2,) with outputs z (2,) and `every`, all intermediate values."""
    picks = st.integers(0, 2**16)
    recipe = draw(st.lists(st.tuples(st.sampled_from(STEPS), picks, picks), min_size=1, max_size=14))

    def function(x: Array, y: Array) -> dict[str, Array]:
        values = [np.asarray(entry) for entry in (*x, *y, x[0] * 0 + 0.75)]
        for step, a, b in recipe:
            first, second = values[-1 - a % min(len(values), 5)], values[b % len(values)]
            values.append(np.asarray(step(first, second)))
        return {"z": np.stack([values[-1], values[len(values) // 2]]), "every": np.stack(values)}

    return trace(function, {"x": (3,), "y": (2,)}, simplify=None)


def quotient(program: Program, point: dict[str, Array], of: str, by: str) -> Array:
    """Return central differences, with the shape of the output followed by that of the input."""
    h = mpmath.mpf(10) ** -STEP
    columns = []
    for k in range(point[by].size):
        unit = exactly(np.eye(point[by].size)[k])
        ahead, behind = (inline(program, {**point, by: point[by] + s * h * unit})[of] for s in (1, -1))
        columns.append((ahead - behind) / (2 * h))
    return np.stack(columns, axis=-1)


def random_point(program: Program, rng: np.random.Generator) -> dict[str, Array]:
    return {port.name: exactly(rng.uniform(-1.5, 1.5, port.shape)) for port in program.inputs}


def assert_close(got: Array, wanted: Array) -> None:
    assert got.shape == wanted.shape
    size = max([1, *(abs(w) for w in wanted.ravel())])
    assert all(abs(g - w) <= CLOSE * size for g, w in zip(got.ravel(), wanted.ravel(), strict=True))


@pytest.mark.parametrize("step", STEPS)
@given(RANDOM)
def test_each_operation_s_derivatives_are_limits_of_difference_quotients(
    step: Callable[[Array, Array], Array], rng: np.random.Generator
) -> None:
    def function(x: Array) -> Array:
        return np.asarray(step(np.asarray(x[0]), np.asarray(x[1]))).reshape(1)

    program = trace(function, {"x": (2,)}, simplify=None)
    point = random_point(program, rng)
    found = inline(differentiate(program, [("result", "x")], simplify=None), point)["dresult_dx"]
    assert_close(found, quotient(program, point, "result", "x"))


@given(smooth_programs(), RANDOM)
def test_derivatives_are_limits_of_difference_quotients(program: Program, rng: np.random.Generator) -> None:
    point = random_point(program, rng)
    assume(all(abs(value) < TAME for value in inline(program, point)["every"]))
    pairs = [("z", "x"), ("z", "y")]
    wanted = {f"d{of}_d{by}": quotient(program, point, of, by) for of, by in pairs}
    for order in ORDERS:
        derivatives = differentiate(program, pairs, order=order, simplify=None)
        assert [port.name for port in derivatives.outputs] == list(wanted)
        found = inline(derivatives, point)
        for name, derivative in wanted.items():
            assert_close(found[name], derivative)


@given(smooth_programs(), smooth_programs(), RANDOM)
def test_the_chain_rule(outer: Program, inner: Program, rng: np.random.Generator) -> None:
    point = random_point(inner, rng)

    def composed(x: Array, y: Array) -> Array:
        z = inline(inner, {"x": x, "y": y})["z"]
        return inline(outer, {"x": np.array([z[0], z[1], y[0]]), "y": y})["z"]

    whole = trace(composed, {"x": (3,), "y": (2,)}, simplify=None)
    by_x = inline(differentiate(whole, [("result", "x")], simplify=None), point)["dresult_dx"]
    z = inline(inner, point)["z"]
    assume(all(abs(value) < TAME for value in inline(inner, point)["every"]))
    middle = {"x": np.array([z[0], z[1], point["y"][0]]), "y": point["y"]}
    assume(all(abs(value) < TAME for value in inline(outer, middle)["every"]))
    of_outer = inline(differentiate(outer, [("z", "x")], simplify=None), middle)["dz_dx"]
    of_inner = inline(differentiate(inner, [("z", "x")], simplify=None), point)["dz_dx"]
    assert_close(by_x, of_outer[:, :2] @ of_inner)


@given(smooth_programs(), RANDOM)
def test_the_product_rule(program: Program, rng: np.random.Generator) -> None:
    point = random_point(program, rng)
    assume(all(abs(value) < TAME for value in inline(program, point)["every"]))

    def product(x: Array, y: Array) -> Array:
        f, g = inline(program, {"x": x, "y": y})["z"]
        return np.array([f * g], dtype=object)

    whole = trace(product, {"x": (3,), "y": (2,)}, simplify=None)
    (row,) = inline(differentiate(whole, [("result", "x")], simplify=None), point)["dresult_dx"]
    f, g = inline(program, point)["z"]
    df, dg = inline(differentiate(program, [("z", "x")], simplify=None), point)["dz_dx"]
    assert_close(row, df * g + dg * f)


def test_outputs_have_the_shape_of_the_function_and_then_of_the_argument() -> None:
    program = trace(lambda x: {"s": sin(x), "c": cos(x)}, {"x": (2, 3)})
    found = differentiate(program, [("c", "x")])
    assert found.inputs == program.inputs
    assert found.outputs == (Port("dc_dx", (2, 3, 2, 3)),)
    x = np.linspace(-2.0, 2.0, 6)[None]
    (dc,), (s, _) = interpret(found, [x]), interpret(program, [x])
    np.testing.assert_array_equal(dc.reshape(6, 6), np.diag(-s[0]))


def test_zero_derivatives_are_not_computed() -> None:
    program = trace(lambda x, y: {"f": x[:2] * x[:2], "g": y * x[2]}, {"x": (3,), "y": (2,)})
    found = differentiate(program, [("f", "x"), ("f", "y"), ("g", "x")])
    constant = [found.nodes[k].op == "constant" for k in found.results]
    assert [not c for c in constant[:6]] == [True, False, False, False, True, False]
    assert all(constant[6:10])
    assert [not c for c in constant[10:]] == [False, False, True, False, False, True]
    assert sorted({node.op for node in found.nodes}) == ["add", "constant", "input"]


def test_a_gradient_costs_a_few_evaluations_in_reverse() -> None:
    n = 40
    program = trace(lambda x: {"f": np.array([np.sum(sin(x) * np.roll(x * x, 1))])}, {"x": (n,)})
    reverse = differentiate(program, [("f", "x")], order="reverse")
    assert len(reverse.nodes) < 4 * len(program.nodes)


def test_a_jacobian_costs_as_much_forward() -> None:
    n = 40
    program = trace(lambda t: {"f": sin(np.full(n, t[0] * t[0], dtype=object) * np.arange(n))}, {"t": (1,)})
    forward = differentiate(program, [("f", "t")], order="forward")
    assert len(forward.nodes) < 4 * len(program.nodes)


def test_the_same_derivative_is_computed_once() -> None:
    program = trace(lambda x: {"f": sin(x) * x, "g": sin(x) * x}, {"x": (1,)})
    once = differentiate(program, [("f", "x")])
    assert differentiate(program, [("f", "x"), ("g", "x")]).nodes == once.nodes


def test_an_input_is_its_own_derivative() -> None:
    program = trace(lambda x: {"f": np.array([x[1], x[0] * 0 + 2.0, x[0]])}, {"x": (2,)})
    (found,) = interpret(differentiate(program, [("f", "x")]), [np.array([[3.0, 4.0]])])
    np.testing.assert_array_equal(found.reshape(3, 2), [[0, 1], [0, 0], [1, 0]])


def at(op: Op, *arguments: float) -> Floats:
    """Return the derivatives of one operation at one point, in float64."""
    graph = Graph()
    node = graph.apply_unsimplified(op, *(graph.input(k) for k in range(len(arguments))))
    program = extract_program(graph, [Port("x", (len(arguments),))], [Port("y", (1,))], [node])
    (found,) = interpret(differentiate(program, [("y", "x")]), [np.array([arguments])])
    return np.asarray(found[0])


TINY = 5e-324


@pytest.mark.parametrize(
    ("op", "arguments", "wanted"),
    [
        ("abs", (0.0,), (0.0,)),
        ("abs", (-0.0,), (0.0,)),
        ("abs", (TINY,), (1.0,)),
        ("abs", (-TINY,), (-1.0,)),
        ("abs", (-math.inf,), (-1.0,)),
        ("abs", (math.nan,), (math.nan,)),
        ("max", (1.0, 2.0), (0.0, 1.0)),
        ("max", (2.0, 1.0), (1.0, 0.0)),
        ("max", (2.0, 2.0), (0.5, 0.5)),
        ("max", (0.0, TINY), (0.0, 1.0)),
        ("less", (1.0, 2.0), (0.0, 0.0)),
        ("less_equal", (1.0, 1.0), (0.0, 0.0)),
        ("equal", (1.0, 1.0), (0.0, 0.0)),
        ("select", (1.0, 2.0, 3.0), (0.0, 1.0, 0.0)),
        ("select", (0.0, 2.0, 3.0), (0.0, 0.0, 1.0)),
        ("min", (1.0, 2.0), (1.0, 0.0)),
        ("min", (2.0, 1.0), (0.0, 1.0)),
        ("min", (-0.0, 0.0), (0.5, 0.5)),
        ("min", (1.0, math.nan), (math.nan, math.nan)),
        ("sqrt", (0.0,), (math.inf,)),
        ("sqrt", (4.0,), (0.25,)),
        ("div", (1.0, 0.0), (math.inf, -math.inf)),
        ("div", (0.0, 0.0), (math.inf, math.nan)),
        ("div", (3.0, 2.0), (0.5, -0.75)),
    ],
)
def test_where_there_is_no_derivative(op: Op, arguments: tuple[float, ...], wanted: Floats) -> None:
    np.testing.assert_array_equal(at(op, *arguments), wanted)


@given(RANDOM)
def test_the_sign_of_every_double(rng: np.random.Generator) -> None:
    graph = Graph()
    program = extract_program(graph, [Port("x", (1,))], [Port("y", (1,))], [graph.sign(graph.input(0))])
    x = np.array([*doubles(rng, (64,)), *SPECIAL, *(-s for s in SPECIAL), math.nan, -0.0])
    np.testing.assert_array_equal(interpret(program, [x[:, None]])[0][:, 0], np.sign(x))


def test_unknown_names_raise() -> None:
    program = trace(lambda x: {"torque": x}, {"x": (2,)})
    with pytest.raises(CompileError, match="no output 'torq'; did you mean 'torque'"):
        differentiate(program, [("torq", "x")])
    with pytest.raises(CompileError, match="no input 'y'"):
        differentiate(program, [("torque", "y")])
