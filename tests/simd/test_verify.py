"""Well-formed programs and schedules pass; every kind of violation is detected and named in the error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import CompileError
from dynx.simd.emit import Settings, emit
from dynx.simd.expr import Graph, Node
from dynx.simd.program import Port, Program, extract_program
from dynx.simd.schedule import Segment, TileStore, TrigGroup, schedule
from dynx.simd.verify import check_nodes, check_program, check_schedule
from tests.simd.machine import LANES, TARGETS
from tests.simd.programs import programs


def example() -> Program:
    """Return the program of a b + sin a, cos a, 2, b, which has every kind of node."""
    graph = Graph()
    a, b = graph.input(0), graph.input(1)
    product, sine = graph.apply_unsimplified("mul", a, b), graph.apply_unsimplified("sin", a)
    results = [
        graph.apply_unsimplified("add", product, sine),
        graph.apply_unsimplified("cos", a),
        graph.constant(2.0),
        b,
    ]
    return extract_program(
        graph, [Port("a", ()), Port("b", (1,))], [Port("x", (2,)), Port("y", (2,))], results
    )


NODES = example().nodes
NUMBER = {node.op: index for index, node in enumerate(NODES)}


def changed(index: int, **fields: Any) -> Program:
    nodes = list(NODES)
    nodes[index] = nodes[index]._replace(**fields)
    return replace(example(), nodes=tuple(nodes))


def more(*nodes: Node) -> Program:
    """Return the example with further nodes, which are results too."""
    base = example()
    places = range(len(base.nodes), len(base.nodes) + len(nodes))
    outputs = (*base.outputs, Port("more", (len(nodes),)))
    return replace(base, nodes=base.nodes + nodes, outputs=outputs, results=(*base.results, *places))


def order(program: Program) -> list[str]:
    return [node.op for node in program.nodes]


@given(programs(), st.sampled_from(LANES), st.sampled_from((1, 5, 2500)))
def test_programs_and_schedules_of_the_compiler_are_well_formed(
    program: Program, lanes: int, longest: int
) -> None:
    check_program(program)
    check_schedule(program, schedule(program, lanes, longest), lanes)


MALFORMED_PROGRAMS: dict[str, tuple[Program, str]] = {
    "operation": (
        changed(NUMBER["add"], op=cast(Any, "pow")),
        f"node {NUMBER['add']} is not a known operation: 'pow'",
    ),
    "arity": (changed(NUMBER["mul"], args=(0,)), f"node {NUMBER['mul']} (mul) has 1 arguments, wanted 2"),
    "later argument": (changed(NUMBER["sin"], args=(len(NODES) - 1,)), "which is not before it"),
    "own argument": (changed(NUMBER["sin"], args=(NUMBER["sin"],)), "which is not before it"),
    "negative argument": (changed(NUMBER["sin"], args=(-1,)), "uses node -1"),
    "slot": (changed(0, slot=2), "node 0 reads input 2 of 2"),
    "no slot": (changed(0, slot=-1), "node 0 reads input -1 of 2"),
    "constant": (changed(NUMBER["constant"], value=cast(Any, 2)), "is the constant 2, not a float"),
    "NumPy's": (changed(NUMBER["constant"], value=np.float64(2.0)), "not a float"),
    "twice": (more(Node("sin", (0,))), f"(sin) is node {NUMBER['sin']} again"),
    "turned": (more(Node("mul", NODES[NUMBER["mul"]].args[::-1])), f"(mul) is node {NUMBER['mul']} again"),
    "two constants": (more(Node("constant", value=2.0)), f"(constant) is node {NUMBER['constant']} again"),
    "two NaN": (more(Node("constant", value=np.nan), Node("constant", value=-np.nan)), "again"),
    "two inputs": (more(Node("input", slot=1)), "(input) is node 1 again"),
    "dead": (
        replace(example(), nodes=(*NODES, Node("neg", (0,)))),
        f"node {len(NODES)} (neg) is needed for no result",
    ),
    "result": (replace(example(), results=(*example().results[:-1], 99)), "a result is node 99 of"),
    "too few": (replace(example(), results=example().results[:-1]), "has 3 results, its ports hold 4"),
    "names": (replace(example(), outputs=(Port("x", (2,)), Port("x", (2,)))), "two ports have the same name"),
}


@pytest.mark.parametrize("kind", MALFORMED_PROGRAMS)
def test_a_malformed_program_raises(kind: str) -> None:
    program, message = MALFORMED_PROGRAMS[kind]
    check_program(example())
    with pytest.raises(CompileError) as caught:
        check_program(program)
    assert message in str(caught.value)


def test_operations_that_do_not_commute_are_two() -> None:
    check_program(more(Node("sub", (0, 1)), Node("sub", (1, 0)), Node("min", (0, 1)), Node("min", (1, 0))))
    check_program(more(Node("constant", value=0.0), Node("constant", value=-0.0)))


def test_a_graph_may_have_dead_nodes() -> None:
    check_nodes((*NODES, Node("neg", (0,))), 2)


Corruption = Callable[[list[Segment]], None]


def _segments() -> list[Segment]:
    """Return the schedule of the example with one step per segment, in which many values are spilled."""
    return schedule(example(), 2, 1)


def _segment_of(segments: list[Segment], op: str) -> Segment:
    (found,) = (
        s for s in segments for step in s.steps if not isinstance(step, TrigGroup) and NODES[step].op == op
    )
    return found


def _swap(segments: list[Segment]) -> None:
    segments.reverse()


def _forget_spill(segments: list[Segment]) -> None:
    _segment_of(segments, "mul").spilled.clear()


def _leave_out(segments: list[Segment]) -> None:
    segment = _segment_of(segments, "add")
    segment.steps.clear()
    segment.stores[:] = []


def _compute_twice(segments: list[Segment]) -> None:
    segments[-1].steps.append(NUMBER["mul"])


def _compute_input(segments: list[Segment]) -> None:
    segments[0].steps.append(0)


def _spill_uncomputed(segments: list[Segment]) -> None:
    segments[-1].spilled.add(NUMBER["mul"])


def _exchange_sine_and_cosine(segments: list[Segment]) -> None:
    segments[0].steps[0] = TrigGroup((0,), ((NUMBER["cos"], NUMBER["sin"]),))


def _wrong_angle(segments: list[Segment]) -> None:
    segments[0].steps[0] = TrigGroup((1,), ((NUMBER["sin"], NUMBER["cos"]),))


def _sine_alone(segments: list[Segment]) -> None:
    segments[0].steps[0] = NUMBER["sin"]


def _stores(segments: list[Segment]) -> tuple[Segment, TileStore]:
    (found,) = ((segment, store) for segment in segments for store in segment.stores if store.output == 0)
    return found


def _no_store(segments: list[Segment]) -> None:
    segment, store = _stores(segments)
    segment.stores.remove(store)


def _store_twice(segments: list[Segment]) -> None:
    segment, store = _stores(segments)
    segment.stores.append(store)


def _store_other(segments: list[Segment]) -> None:
    segment, store = _stores(segments)
    segment.stores[segment.stores.index(store)] = store._replace(nodes=store.nodes[::-1])


def _store_elsewhere(segments: list[Segment]) -> None:
    segment, store = _stores(segments)
    segment.stores.append(store._replace(output=7))


def _store_early(segments: list[Segment]) -> None:
    segment, store = _stores(segments)
    segment.stores.remove(store)
    segments[0].stores.append(store)


MALFORMED_SCHEDULES: dict[Corruption, str] = {
    _swap: "before it is computed",
    _forget_spill: f"node {NUMBER['mul']} is used by node {NUMBER['add']} in segment",
    _leave_out: f"node {NUMBER['add']} (add) is never computed",
    _compute_twice: f"node {NUMBER['mul']} is computed twice, or is an input",
    _compute_input: "node 0 is computed twice, or is an input",
    _spill_uncomputed: f"node {NUMBER['mul']} is spilled by segment",
    _exchange_sine_and_cosine: "which it is not",
    _wrong_angle: "which it is not",
    _sine_alone: "is a sine or cosine outside of a group",
    _no_store: "output x is stored in wrong columns []",
    _store_twice: "output x is stored in wrong columns [range(0, 2), range(0, 2)]",
    _store_other: "columns range(0, 2) of output x are stored from wrong nodes",
    _store_elsewhere: "refers to an output that the program does not have",
    _store_early: "is used by output 0 before it is computed",
}


@pytest.mark.parametrize("corrupt", MALFORMED_SCHEDULES, ids=lambda corrupt: corrupt.__name__)
def test_a_malformed_schedule_raises(corrupt: Corruption) -> None:
    segments = _segments()
    check_schedule(example(), segments, 2)
    corrupt(segments)
    with pytest.raises(CompileError) as caught:
        check_schedule(example(), segments, 2)
    assert MALFORMED_SCHEDULES[corrupt] in str(caught.value)


def test_emission_checks_the_schedule(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.simd.emit.schedule", lambda *_: _segments()[::-1])
    with pytest.raises(CompileError, match="before it is computed"):
        emit(example(), TARGETS[0], Settings(2))
