"""The sign of a number, made of the operations that there are."""

from __future__ import annotations

from dynx.simd.expr import Graph, Symbol

GROWTH = 2.0**537
"""Twice this factor lifts the smallest subnormal, 2^-1074, to 1."""


def sign(graph: Graph, x: int) -> int:
    """-1, 0 or 1: of every double, subnormals and infinities included; NaN of NaN.

    x is lifted and cut to [-1, 1] two times over. One cut comes between the two factors because one
    alone would not reach, and both together overflow. `min` and `max` pass a NaN on if it is their second
    argument. The derivative of this expression is of no use near 0.
    """
    for _ in range(2):
        lifted = graph.apply("mul", graph.constant(GROWTH), x)
        x = graph.apply("max", graph.constant(-1.0), graph.apply("min", graph.constant(1.0), lifted))
    return x


def sign_of(x: Symbol) -> Symbol:
    """The same of a symbol."""
    return Symbol(x.graph, sign(x.graph, x.index))
