"""Finishing a graph: what nobody needs is left out."""

from __future__ import annotations

from collections import Counter

from hypothesis import given

from dynx.simd.expr import Graph
from dynx.simd.program import Port, Program, extract_program
from tests.simd.programs import programs, simplified


def test_sizes() -> None:
    assert [Port("x", shape).size for shape in ((), (3,), (2, 3), (0, 4))] == [1, 3, 6, 0]


def test_dead_nodes_are_left_out_and_inputs_keep_their_number() -> None:
    graph = Graph()
    a, b = graph.input(0), graph.input(1)
    graph.apply_unsimplified("sin", a)
    program = extract_program(
        graph, [Port("x", (2,))], [Port("y", (2,))], [graph.apply_unsimplified("neg", b), b]
    )
    assert [(node.op, node.args, node.slot) for node in program.nodes] == [
        ("input", (), 1),
        ("neg", (0,), -1),
    ]
    assert program.results == (1, 0)
    assert program.n_inputs == 2


@given(programs())
def test_building_a_program_again_makes_nothing_new(program: Program) -> None:
    """Arguments of sums and products may change places."""
    again = simplified(program, None)
    assert Counter(node.op for node in again.nodes) == Counter(node.op for node in program.nodes)
    assert [again.nodes[result].op for result in again.results] == [
        program.nodes[result].op for result in program.results
    ]
