"""Hypothesis strategies for programs, and random inputs."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from dynx.simd.expr import ARITY, Graph, Op, Simplify
from dynx.simd.program import Port, Program, extract_program
from dynx.spatial.scalar import Floats

OPERATIONS: tuple[Op, ...] = tuple(op for op, arity in ARITY.items() if arity)

SPECIAL = (
    *(0.0, 1.0, 2.0, 0.5, 3.0, 1e5, 1e-3, math.pi, math.pi / 2, 1e22, 5e-324, 2.0**-1022, 2.0**-1023),
    *(2.0**1023, 1.7976931348623157e308, 1.0 + 2.0**-52, 1e-160, 1e160, math.inf),
)
"""Doubles at which an operation changes its behaviour; their negatives and NaN are used too."""


def doubles(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Draw numbers of every kind: ordinary ones, ones of any exponent, and special ones."""
    kind = rng.integers(0, 4, shape)
    sign = rng.choice([-1.0, 1.0], shape)
    any_exponent = np.ldexp(rng.uniform(1.0, 2.0, shape), rng.integers(-1074, 1024, shape))
    special = rng.choice([*SPECIAL, math.nan], shape)
    return np.where(kind < 2, rng.normal(0.0, 2.0, shape), sign * np.where(kind == 2, any_exponent, special))


def ordinary(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Draw numbers of magnitude 0.01 to 10, the range of a robot's states, with either sign."""
    return np.asarray(rng.choice([-1.0, 1.0], shape) * 10.0 ** rng.uniform(-2.0, 1.0, shape))


RANDOM = st.integers(0, 2**32 - 1).map(np.random.default_rng)
CONSTANTS = st.sampled_from((*SPECIAL, *(-x for x in SPECIAL), math.nan)) | st.floats()
ORDINARY_CONSTANTS = st.sampled_from((0.0, -0.0, 1.0, -1.0, 2.0, 0.25)) | st.floats(0.01, 10.0)


@st.composite
def programs(
    draw: st.DrawFn,
    operations: Sequence[Op] = OPERATIONS,
    constants: st.SearchStrategy[float] = CONSTANTS,
    longest: int = 40,
) -> Program:
    """Draw a program without simplification, with several input and output ports of 1 to 9 numbers.

    Results may be inputs, constants, or the same node several times.
    """
    graph = Graph()
    inputs = [Port(f"in{k}", (size,)) for k, size in enumerate(draw(st.lists(SIZES, min_size=1, max_size=3)))]
    for slot in range(sum(port.size for port in inputs)):
        graph.input(slot)
    for value in draw(st.lists(constants, max_size=4)):
        graph.constant(value)
    picks = st.integers(0, 2**16)
    for op, a, b in draw(st.lists(st.tuples(st.sampled_from(operations), picks, picks), max_size=longest)):
        # Recent nodes are preferred as arguments, so that expressions become deep.
        recent = len(graph) - 1 - a % min(len(graph), 8)
        args = (recent, b % len(graph), (a // 8 + b) % len(graph))
        graph.apply_unsimplified(op, *args[: ARITY[op]])
    outputs = [
        Port(f"out{k}", (size,)) for k, size in enumerate(draw(st.lists(SIZES, min_size=1, max_size=3)))
    ]
    results = [len(graph) - 1 - draw(picks) % len(graph) for port in outputs for _ in range(port.size)]
    return extract_program(graph, inputs, outputs, results)


SIZES = st.integers(1, 9)


def simplified(program: Program, simplify: Simplify | None) -> Program:
    """Return the program rebuilt with the simplifications `simplify`."""
    graph = Graph(simplify)
    new_index: list[int] = []
    for node in program.nodes:
        if node.op == "input":
            new_index.append(graph.input(node.slot))
        elif node.op == "constant":
            new_index.append(graph.constant(node.value))
        else:
            new_index.append(graph.apply(node.op, *(new_index[arg] for arg in node.args)))
    return extract_program(
        graph, program.inputs, program.outputs, [new_index[result] for result in program.results]
    )
