"""Simplification rules, each with a name and a precondition.

`EXACT` rules hold for every double, bit for bit, signed zeros, infinities and NaN included. `FINITE` rules
hold if all values are finite and the sign of zero does not matter. `ROUNDED` rules hold in real arithmetic;
in floating point the two sides differ by a few roundings.

A rule receives an operation before it becomes a node, so the graph is simplified while it is built. It
returns an equal node, or None if it does not apply.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

from dynx.simd.expr import CONSTANT_KINDS, Graph, Kind, Op, Simplify

Precondition = Literal["exact", "finite", "rounded"]
Args = tuple[int, ...]
Kinds = tuple[Kind, ...]
Rewrite = Callable[[Graph, Op, Args], "int | None"]


def _some(*kinds: Kind) -> Callable[[Kinds], bool]:
    """Make the condition that an argument is of one of these kinds."""
    return lambda arguments: not set(kinds).isdisjoint(arguments)


def _every(*kinds: Kind) -> Callable[[Kinds], bool]:
    """Make the condition that all arguments are of these kinds."""
    return lambda arguments: set(kinds).issuperset(arguments)


def _multiple_of_product(arguments: Kinds) -> bool:
    return "mul" in arguments and not set(CONSTANT_KINDS).isdisjoint(arguments)


@dataclass(frozen=True)
class RewriteRule:
    """A simplification of the operations `ops`, valid under its precondition.

    It applies only if `condition` holds for the kinds of the arguments.
    """

    name: str
    ops: tuple[Op, ...]
    precondition: Precondition
    rewrite: Rewrite
    condition: Callable[[Kinds], bool] = lambda arguments: True


def simplifier(rules: Iterable[RewriteRule]) -> Simplify:
    """Combine rules into one function that applies the first rule that matches.

    Candidates are looked up by the operation and the kinds of its arguments.
    """
    every = tuple(rules)
    known: dict[tuple[Op, Kinds], list[Rewrite]] = {}

    def simplify(graph: Graph, op: Op, args: Args) -> int | None:
        of = graph.kinds
        kinds = (of[args[0]], of[args[1]]) if len(args) == 2 else tuple([of[arg] for arg in args])
        rewrites = known.get((op, kinds))
        if rewrites is None:
            rewrites = known[op, kinds] = [
                rule.rewrite for rule in every if op in rule.ops and rule.condition(kinds)
            ]
        for rewrite in rewrites:
            found = rewrite(graph, op, args)
            if found is not None:
                return found
        return None

    return simplify


def _value(graph: Graph, index: int) -> float | None:
    node = graph.nodes[index]
    return node.value if node.op == "constant" else None


def _negated(graph: Graph, index: int) -> int | None:
    """Return x if the node is -x, else None."""
    node = graph.nodes[index]
    return node.args[0] if node.op == "neg" else None


# -- exact --------------------------------------------------------------------------------------------


def _quotient(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    if a == 0.0 or a != a:
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


_FOLD: dict[Op, Callable[..., float]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": _quotient,
    "neg": lambda a: -a,
    "abs": abs,
    "sqrt": lambda a: math.sqrt(a) if a >= 0.0 else math.nan,
    "min": lambda a, b: a if a < b else b,
    "max": lambda a, b: a if a > b else b,
    "less": lambda a, b: float(a < b),
    "less_equal": lambda a, b: float(a <= b),
    "equal": lambda a, b: float(a == b),
    "select": lambda c, a, b: a if c != 0.0 else b,
}


def _fold(graph: Graph, op: Op, args: Args) -> int | None:
    """Evaluate an operation on constants, except elementary functions, which the kernel evaluates."""
    values = []
    for arg in args:
        node = graph.nodes[arg]
        if node.op != "constant":
            return None
        values.append(node.value)
    return graph.constant(_FOLD[op](*values))


def _factor_one(graph: Graph, op: Op, args: Args) -> int | None:
    """x * 1, x / 1"""
    a, b = args
    if _value(graph, b) == 1.0:
        return a
    return b if op == "mul" and _value(graph, a) == 1.0 else None


def _minus_one(graph: Graph, op: Op, args: Args) -> int | None:
    """x * -1, x / -1"""
    a, b = args
    if _value(graph, b) == -1.0:
        return graph.apply("neg", a)
    return graph.apply("neg", b) if op == "mul" and _value(graph, a) == -1.0 else None


def _neutral_zero(graph: Graph, op: Op, args: Args) -> int | None:
    """x + -0, x - +0"""
    a, b = args
    zero = -1.0 if op == "add" else 1.0
    if (value := _value(graph, b)) == 0.0 and math.copysign(1.0, value) == zero:
        return a
    if op == "add" and (value := _value(graph, a)) == 0.0 and math.copysign(1.0, value) == zero:
        return b
    return None


def _double_negation(graph: Graph, op: Op, args: Args) -> int | None:
    """-(-x)"""
    return _negated(graph, args[0])


def _negated_factor(graph: Graph, op: Op, args: Args) -> int | None:
    """(-x) y, x (-y), (-x) (-y), and likewise quotients: the sign moves to the front"""
    a, b = args
    x, y = _negated(graph, a), _negated(graph, b)
    if x is not None and y is not None:
        return graph.apply(op, x, y)
    if x is not None:
        return graph.apply("neg", graph.apply(op, x, b))
    return graph.apply("neg", graph.apply(op, a, y)) if y is not None else None


def _negated_multiple(graph: Graph, op: Op, args: Args) -> int | None:
    """-(c x), -(c / x), -(x / c) with a constant c: the sign moves into the constant"""
    node = graph.nodes[args[0]]
    if node.op not in ("mul", "div"):
        return None
    for place in (0, 1):
        if (value := _value(graph, node.args[place])) is not None:
            changed = list(node.args)
            changed[place] = graph.constant(-value)
            return graph.apply(node.op, *changed)
    return None


def _negated_term(graph: Graph, op: Op, args: Args) -> int | None:
    """x + -y, -x + y, x - -y"""
    a, b = args
    if (y := _negated(graph, b)) is not None:
        return graph.apply("sub" if op == "add" else "add", a, y)
    if op == "add" and (x := _negated(graph, a)) is not None:
        return graph.apply("sub", b, x)
    return None


def _odd_and_even(graph: Graph, op: Op, args: Args) -> int | None:
    """sin(-x), cos(-x), tanh(-x), arctan(-x), |-x|"""
    x = _negated(graph, args[0])
    if x is None:
        return None
    positive = graph.apply(op, x)
    return graph.apply("neg", positive) if op in ("sin", "tanh", "arctan") else positive


def _power_of_two(graph: Graph, op: Op, args: Args) -> int | None:
    """x / 2^k"""
    value = _value(graph, args[1])
    if value is None or value == 0.0 or not math.isfinite(value) or abs(math.frexp(value)[0]) != 0.5:
        return None
    if not 2.0**-1000 <= abs(value) <= 2.0**1000:
        return None
    return graph.apply("mul", args[0], graph.constant(1.0 / value))


def _decided(graph: Graph, op: Op, args: Args) -> int | None:
    """select(c, x, y) with a constant c, select(c, x, x)"""
    condition, yes, no = args
    value = _value(graph, condition)
    if value is None:
        return yes if yes == no else None
    return yes if value != 0.0 else no


# -- finite -------------------------------------------------------------------------------------------


def _zero_factor(graph: Graph, op: Op, args: Args) -> int | None:
    """x * 0, 0 / x"""
    a, b = args
    if _value(graph, a) == 0.0 or (op == "mul" and _value(graph, b) == 0.0):
        return graph.constant(0.0)
    return None


def _zero_term(graph: Graph, op: Op, args: Args) -> int | None:
    """x + 0, x - 0, 0 - x"""
    a, b = args
    if _value(graph, b) == 0.0:
        return a
    if _value(graph, a) == 0.0:
        return b if op == "add" else graph.apply("neg", b)
    return None


def _same_terms(graph: Graph, op: Op, args: Args) -> int | None:
    """x - x"""
    return graph.constant(0.0) if args[0] == args[1] else None


def _negated_sum(graph: Graph, op: Op, args: Args) -> int | None:
    """-x - y, as -(x + y), which is -0 instead of +0 if x = -y"""
    x = _negated(graph, args[0])
    return graph.apply("neg", graph.apply("add", x, args[1])) if x is not None else None


def _negated_difference(graph: Graph, op: Op, args: Args) -> int | None:
    """-(x - y)"""
    node = graph.nodes[args[0]]
    return graph.apply("sub", *node.args[::-1]) if node.op == "sub" else None


# -- rounded ------------------------------------------------------------------------------------------


def _scaled_twice(graph: Graph, op: Op, args: Args) -> int | None:
    """c (d x)"""
    for factor, product in (args, args[::-1]):
        c = _value(graph, factor)
        if c is None:
            continue
        node = graph.nodes[product]
        if node.op == "mul":
            for d, x in (node.args, node.args[::-1]):
                if (value := _value(graph, d)) is not None:
                    return graph.apply("mul", graph.constant(c * value), x)
    return None


def _common_factor(graph: Graph, op: Op, args: Args) -> int | None:
    """c x + c y, c x - c y with a constant c"""
    left, right = (graph.nodes[arg] for arg in args)
    if left.op != "mul" or right.op != "mul":
        return None
    for c, x in (left.args, left.args[::-1]):
        value = _value(graph, c)
        if value is None:
            continue
        for d, y in (right.args, right.args[::-1]):
            if _value(graph, d) == value:
                return graph.apply("mul", c, graph.apply(op, x, y))
            if _value(graph, d) == -value:
                return graph.apply("mul", c, graph.apply("sub" if op == "add" else "add", x, y))
    return None


def _division_by_constant(graph: Graph, op: Op, args: Args) -> int | None:
    """x / c"""
    value = _value(graph, args[1])
    if value is None or not 1e-300 < abs(value) < 1e300:
        return None
    return graph.apply("mul", args[0], graph.constant(1.0 / value))


def _quotient_of_product(graph: Graph, op: Op, args: Args) -> int | None:
    """(x y) / z, as (x / z) y, where x is the older node: the quotient x / z recurs and is then shared"""
    node = graph.nodes[args[0]]
    if node.op != "mul" or _value(graph, args[1]) is not None:
        return None
    x, y = node.args
    if _value(graph, x) is not None:
        x, y = y, x
    return graph.apply("mul", graph.apply("div", x, args[1]), y)


def _reciprocal(graph: Graph, op: Op, args: Args) -> int | None:
    """x / y, as x (1 / y): one division serves all quotients with the divisor y"""
    if _value(graph, args[0]) in (1.0, -1.0) or _value(graph, args[1]) is not None:
        return None
    return graph.apply("mul", args[0], graph.apply("div", graph.constant(1.0), args[1]))


EXACT: tuple[RewriteRule, ...] = (
    RewriteRule("constants", tuple(_FOLD), "exact", _fold, _every(*CONSTANT_KINDS)),
    RewriteRule("factor-one", ("mul", "div"), "exact", _factor_one, _some("one")),
    RewriteRule("factor-minus-one", ("mul", "div"), "exact", _minus_one, _some("minus one")),
    RewriteRule("neutral-zero", ("add", "sub"), "exact", _neutral_zero, _some("zero")),
    RewriteRule("double-negation", ("neg",), "exact", _double_negation, _some("neg")),
    RewriteRule("negated-factor", ("mul", "div"), "exact", _negated_factor, _some("neg")),
    RewriteRule("negated-multiple", ("neg",), "exact", _negated_multiple, _some("mul", "div")),
    RewriteRule("negated-term", ("add", "sub"), "exact", _negated_term, _some("neg")),
    RewriteRule(
        "odd-and-even", ("sin", "cos", "tanh", "arctan", "abs"), "exact", _odd_and_even, _some("neg")
    ),
    RewriteRule("power-of-two", ("div",), "exact", _power_of_two, _some(*CONSTANT_KINDS)),
    RewriteRule("decided", ("select",), "exact", _decided),
)

FINITE: tuple[RewriteRule, ...] = (
    RewriteRule("zero-factor", ("mul", "div"), "finite", _zero_factor, _some("zero")),
    RewriteRule("zero-term", ("add", "sub"), "finite", _zero_term, _some("zero")),
    RewriteRule("same-terms", ("sub",), "finite", _same_terms),
    RewriteRule("negated-sum", ("sub",), "finite", _negated_sum, _some("neg")),
    RewriteRule("negated-difference", ("neg",), "finite", _negated_difference, _some("sub")),
)

ROUNDED: tuple[RewriteRule, ...] = (
    RewriteRule("scaled-twice", ("mul",), "rounded", _scaled_twice, _multiple_of_product),
    RewriteRule("common-factor", ("add", "sub"), "rounded", _common_factor, _every("mul")),
    RewriteRule("division-by-constant", ("div",), "rounded", _division_by_constant, _some(*CONSTANT_KINDS)),
    RewriteRule("quotient-of-product", ("div",), "rounded", _quotient_of_product, _some("mul")),
    RewriteRule("reciprocal", ("div",), "rounded", _reciprocal),
)

STRICT: Simplify = simplifier(EXACT)
"""Simplifications that preserve every result bit for bit."""

FAST: Simplify = simplifier((*EXACT, *FINITE, *ROUNDED))
"""Simplifications that preserve results in real arithmetic; used for rigid-body dynamics."""
