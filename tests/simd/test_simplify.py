"""Every simplification rule against the expression that it replaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from hypothesis import given

from dynx.simd import simplify
from dynx.simd.expr import ARITY, Graph, Op
from dynx.simd.program import Port, Program, extract_program
from dynx.simd.simplify import EXACT, FAST, FINITE, ROUNDED, STRICT, Args, RewriteRule, simplifier
from dynx.spatial.scalar import Floats
from tests.simd.interp import interpret
from tests.simd.machine import same_bits
from tests.simd.programs import (
    CONSTANTS,
    ORDINARY_CONSTANTS,
    RANDOM,
    SPECIAL,
    doubles,
    ordinary,
    programs,
    simplified,
)
from tests.simd.rounding import agree, bounds

RULES = {rule.name: rule for rule in (*EXACT, *FINITE, *ROUNDED)}
Value = float | str
Shape = tuple["Op | str | float | Shape", ...]
"""An operation and its arguments; x and y are inputs, c and d random constants."""


def _both_ways(*shapes: Shape) -> list[Shape]:
    """Return each shape, and with the arguments of the outermost operation exchanged."""
    return [*shapes, *((shape[0], *shape[:0:-1]) for shape in shapes)]


CASES: dict[str, list[Shape]] = {
    "constants": [
        *(
            (op, *("c", "d", "c")[: ARITY[op]])
            for op in (
                *("add", "sub", "mul", "div", "neg", "abs", "sqrt", "min", "max"),
                *("less", "less_equal", "equal", "select"),
            )
        )
    ],
    "factor-one": [*_both_ways(("mul", "x", 1.0)), ("div", "x", 1.0)],
    "factor-minus-one": [*_both_ways(("mul", "x", -1.0)), ("div", "x", -1.0)],
    "neutral-zero": [*_both_ways(("add", "x", -0.0)), ("sub", "x", 0.0)],
    "double-negation": [("neg", ("neg", "x"))],
    "negated-factor": [
        (op, *pair)
        for op in ("mul", "div")
        for pair in (
            (("neg", "x"), "y"),
            ("x", ("neg", "y")),
            (("neg", "x"), ("neg", "y")),
            (("neg", "x"), "c"),
        )
    ],
    "negated-multiple": [
        *(("neg", shape) for shape in _both_ways(("mul", "c", "x"), ("div", "c", "x"))),
    ],
    "negated-term": [*_both_ways(("add", "x", ("neg", "y"))), ("sub", "x", ("neg", "y"))],
    "odd-and-even": [(op, ("neg", "x")) for op in ("sin", "cos", "tanh", "arctan", "abs")],
    "power-of-two": [("div", "x", sign * 2.0**k) for k in (-1000, -3, 1, 52, 1000) for sign in (1.0, -1.0)],
    "decided": [("select", value, "x", "y") for value in (1.0, 0.0, -0.0, math.nan)]
    + [("select", "x", "y", "y")],
    "zero-factor": [
        *_both_ways(("mul", "x", 0.0), ("mul", "x", -0.0)),
        ("div", 0.0, "x"),
        ("div", -0.0, "x"),
    ],
    "zero-term": _both_ways(("add", "x", 0.0), ("add", "x", -0.0), ("sub", "x", 0.0), ("sub", "x", -0.0)),
    "same-terms": [("sub", "x", "x")],
    "negated-sum": [("sub", ("neg", "x"), "y")],
    "negated-difference": [("neg", ("sub", "x", "y"))],
    "scaled-twice": _both_ways(("mul", "c", ("mul", "d", "x")), ("mul", "c", ("mul", "x", "d"))),
    "common-factor": [
        (op, ("mul", *left), ("mul", *right))
        for op in ("add", "sub")
        for left in (("c", "x"), ("x", "c"))
        for right in (("c", "y"), ("y", "c"), ("-c", "y"), ("y", "-c"))
    ],
    "division-by-constant": [("div", "x", "c")],
    "quotient-of-product": [("div", ("mul", "x", "y"), "z"), ("div", ("mul", "c", "y"), "z")],
    "reciprocal": [("div", "x", "y"), ("div", "c", "y")],
}
SHAPES = [(name, shape) for name, shapes in CASES.items() for shape in shapes]


def test_every_rule_has_a_case() -> None:
    defined = {rule.name for value in vars(simplify).values() for rule in _rules(value)}
    assert defined == set(RULES) == set(CASES)
    assert len(RULES) == len(EXACT) + len(FINITE) + len(ROUNDED)


def _rules(value: object) -> Iterator[RewriteRule]:
    if isinstance(value, RewriteRule):
        yield value
    elif isinstance(value, tuple | list | set):
        yield from (rule for rule in value if isinstance(rule, RewriteRule))


def test_the_rule_sets_match_the_preconditions() -> None:
    for rules, precondition in ((EXACT, "exact"), (FINITE, "finite"), (ROUNDED, "rounded")):
        assert {rule.precondition for rule in rules} == {precondition}


class Both:
    """A shape with and without one rule; `fired`: the rule applied."""

    def __init__(self, rule: RewriteRule, shape: Shape, constants: dict[str, float]) -> None:
        self._constants = constants
        graph = Graph()
        for slot in range(3):
            graph.input(slot)
        op, args = self._operation(graph, shape)
        applies = op in rule.ops and rule.condition(tuple(graph.kinds[arg] for arg in args))
        found = rule.rewrite(graph, op, args) if applies else None
        self.fired = found is not None
        written = graph.apply_unsimplified(op, *args)
        self.written = self._program(graph, written)
        self.rewritten = self._program(graph, written if found is None else found)
        # The lookup by kinds of the arguments finds the rule too.
        by_table = simplifier([rule])(graph, op, args)
        assert by_table == found

    def _operation(self, graph: Graph, shape: Shape) -> tuple[Op, Args]:
        op, *rest = shape
        assert isinstance(op, str)
        (name,) = (known for known in ARITY if known == op)
        args = tuple(self._node(graph, part) for part in rest)
        return name, args if name not in ("add", "mul") or args[0] <= args[1] else args[::-1]

    def _node(self, graph: Graph, part: object) -> int:
        if isinstance(part, tuple):
            op, args = self._operation(graph, part)
            return graph.apply_unsimplified(op, *args)
        if isinstance(part, float):
            return graph.constant(part)
        assert isinstance(part, str)
        if part in self._constants:
            return graph.constant(self._constants[part])
        return graph.input("xyz".index(part))

    def _program(self, graph: Graph, result: int) -> Program:
        return extract_program(graph, [Port("x", (3,))], [Port("y", (1,))], [result])

    def values(self, x: Floats) -> tuple[Floats, Floats]:
        return interpret(self.written, [x])[0], interpret(self.rewritten, [x])[0]


def _constants(c: float, d: float) -> dict[str, float]:
    return {"c": c, "d": d, "-c": -c}


def _numbers(rng: np.random.Generator) -> Floats:
    """Return every pair of special numbers, and random pairs."""
    special = np.array([*SPECIAL, *(-x for x in SPECIAL), np.nan])
    pairs = np.stack([np.repeat(special, len(special)), np.tile(special, len(special))], axis=-1)
    chosen = np.concatenate([pairs, rng.permutation(pairs)[:, :1]], axis=-1)
    return np.concatenate([chosen, doubles(rng, (300, 3))])


@pytest.mark.parametrize(("name", "shape"), SHAPES, ids=str)
def test_the_rule_applies(name: str, shape: Shape) -> None:
    assert Both(RULES[name], shape, _constants(3.0, 7.0)).fired


def _of(rules: Sequence[RewriteRule]) -> Callable[..., object]:
    names = {rule.name for rule in rules}
    return pytest.mark.parametrize(("name", "shape"), [case for case in SHAPES if case[0] in names], ids=str)


@_of(EXACT)
@given(CONSTANTS, CONSTANTS, RANDOM)
def test_exact_rules_keep_every_bit(
    name: str, shape: Shape, c: float, d: float, rng: np.random.Generator
) -> None:
    both = Both(RULES[name], shape, _constants(c, d))
    assert same_bits(*both.values(_numbers(rng)))


@_of(FINITE)
@given(RANDOM)
def test_finite_rules_hold_for_finite_values_up_to_the_sign_of_zero(
    name: str, shape: Shape, rng: np.random.Generator
) -> None:
    written, rewritten = Both(RULES[name], shape, {}).values(_numbers(rng))
    finite = np.isfinite(written) & np.isfinite(rewritten)
    assert np.count_nonzero(finite) > 100
    assert np.array_equal(written[finite], rewritten[finite])


@_of(ROUNDED)
@given(ORDINARY_CONSTANTS, ORDINARY_CONSTANTS, RANDOM)
def test_rounded_rules_differ_by_roundings_only(
    name: str, shape: Shape, c: float, d: float, rng: np.random.Generator
) -> None:
    both = Both(RULES[name], shape, _constants(c, d))
    x = ordinary(rng, (300, 3))
    written, rewritten = both.values(x)
    (one,), (other,) = bounds(both.written, [x]), bounds(both.rewritten, [x])
    assert np.all(np.isfinite(one + other)) or c == 0.0 or d == 0.0
    assert agree(written, rewritten, one, other)


@given(programs(), RANDOM)
def test_exact_rules_together_keep_every_bit_of_random_programs(
    program: Program, rng: np.random.Generator
) -> None:
    inputs = [doubles(rng, (40, port.size)) for port in program.inputs]
    short = simplified(program, STRICT)
    assert (
        len(short.nodes) <= len(program.nodes) + 2 * sum(node.op == "constant" for node in program.nodes) + 2
    )
    for a, b in zip(interpret(short, inputs), interpret(program, inputs), strict=True):
        assert same_bits(a, b)


@given(programs(constants=ORDINARY_CONSTANTS), RANDOM)
def test_all_rules_together_keep_random_programs_to_rounding(
    program: Program, rng: np.random.Generator
) -> None:
    inputs = [ordinary(rng, (40, port.size)) for port in program.inputs]
    short = simplified(program, FAST)
    for a, b, one, other in zip(
        interpret(short, inputs),
        interpret(program, inputs),
        bounds(short, inputs),
        bounds(program, inputs),
        strict=True,
    ):
        assert agree(a, b, one, other)


@given(programs(operations=("add", "sub", "mul", "neg"), constants=ORDINARY_CONSTANTS, longest=12), RANDOM)
def test_bounds_of_rounding_are_finite_where_nothing_divides(
    program: Program, rng: np.random.Generator
) -> None:
    """Without finite bounds the tests above would compare nothing."""
    inputs = [ordinary(rng, (40, port.size)) for port in program.inputs]
    assert all(np.isfinite(bound).mean() > 0.5 for bound in bounds(program, inputs))


def test_one_division_serves_all_quotients_by_the_same_number() -> None:
    graph = Graph(FAST)
    x, y, z = (graph.input(slot) for slot in range(3))
    products = [graph.apply("mul", a, b) for a in (x, y) for b in (x, y)]
    for numerator in (x, y, *products):
        graph.apply("div", numerator, z)
    assert sum(node.op == "div" for node in graph.nodes) == 1


def test_rewriting_terminates() -> None:
    """Simplifying every operation on every pair of small expressions terminates."""
    for rules in (STRICT, FAST):
        graph = Graph(rules)
        x, y = graph.input(0), graph.input(1)
        parts = [x, y, *(graph.constant(c) for c in (0.0, -0.0, 1.0, -1.0, 2.0, 3.0, np.nan, np.inf))]
        parts += [graph.apply(op, a) for op in ("neg", "sin", "abs") for a in (x, y)]
        parts += [
            graph.apply(op, a, b) for op in ("mul", "div", "sub", "add") for a in parts for b in parts[:4]
        ]
        for op, arity in ARITY.items():
            for a in parts if arity else ():
                for b in parts[::4] if arity == 2 else (a,):
                    graph.apply(op, *(a, b, a)[:arity])
        assert len(graph) > len(parts)
