"""Segments: their length, the values they spill, and the grouping of angles."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.expr import Graph
from dynx.simd.kernel import Kernel
from dynx.simd.program import Port, Program, extract_program
from dynx.simd.schedule import (
    LEAVES,
    MAX_ANGLES,
    MAX_STORES,
    Segment,
    TrigGroup,
    schedule,
    spill_slots,
)
from dynx.simd.trace import trace
from tests.simd.programs import programs


@given(programs(), st.integers(1, 30))
def test_segments_respect_the_length_limit(program: Program, longest: int) -> None:
    """A group of angles is exempt, since it is never divided."""
    for segment in schedule(program, 4, longest):
        if not any(isinstance(step, TrigGroup) for step in segment.steps):
            assert len(segment.steps) <= longest


@given(programs(), st.integers(1, 30))
def test_only_values_used_by_later_segments_are_spilled(program: Program, longest: int) -> None:
    segments = schedule(program, 4, longest)
    for number, segment in enumerate(segments):
        assert segment.spilled <= used_by(program, segments[number + 1 :])
        assert not any(program.nodes[node].op in LEAVES for node in segment.spilled)


def used_by(program: Program, segments: list[Segment]) -> set[int]:
    used: set[int] = set()
    for segment in segments:
        for step in segment.steps:
            used.update(step.angles if isinstance(step, TrigGroup) else program.nodes[step].args)
        used.update(node for store in segment.stores for node in store.nodes)
    return used


@given(programs(), st.integers(1, 30))
def test_slots_still_in_use_are_not_overwritten(program: Program, longest: int) -> None:
    """A segment writes its spilled values while its later steps still read those of other segments."""
    segments = schedule(program, 4, longest)
    slots = spill_slots(program, segments)
    assert set(slots) == {value for segment in segments for value in segment.spilled}
    for number, segment in enumerate(segments):
        needed = used_by(program, segments[number:])
        earlier = {value for before in segments[:number] for value in before.spilled} & needed
        alive = [slots[value] for value in (*earlier, *segment.spilled)]
        assert len(set(alive)) == len(alive)


@given(programs())
def test_a_short_program_is_one_segment_without_spills(program: Program) -> None:
    (segment,) = schedule(program, 4, 10**6)
    assert not segment.spilled


def test_angles_available_at_the_same_time_share_a_group() -> None:
    """sin a, cos a, sin(a + b) are in one group, sin(sin a) in the next."""
    graph = Graph()
    a, b = graph.input(0), graph.input(1)
    first = graph.apply_unsimplified("sin", a)
    results = [
        graph.apply_unsimplified("cos", a),
        graph.apply_unsimplified("sin", graph.apply_unsimplified("add", a, b)),
        graph.apply_unsimplified("sin", first),
    ]
    program = extract_program(graph, [Port("x", (2,))], [Port("y", (3,))], results)
    (segment,) = schedule(program, 4, 10**6)
    groups = [step for step in segment.steps if isinstance(step, TrigGroup)]
    assert [len(group.angles) for group in groups] == [2, 1]
    assert [sum(node is not None for pair in group.nodes for node in pair) for group in groups] == [3, 1]


def test_many_stores_are_divided_over_segments() -> None:
    """LLVM's time grows faster than linearly with the length of a function."""
    program = trace(lambda x: np.outer(x, x) + 1.0, {"x": (40,)})
    segments = schedule(program, 4, 10**6)
    assert sum(len(segment.stores) for segment in segments) == 400
    assert max(len(segment.stores) for segment in segments) == MAX_STORES
    kernel, x = Kernel(program), np.linspace(1.0, 2.0, 400).reshape(10, 40)
    found = np.empty((10, 1600))
    kernel([x], [found])
    np.testing.assert_allclose(found.reshape(10, 40, 40), x[:, :, None] * x[:, None, :] + 1.0, rtol=1e-15)


def test_many_angles_are_divided_into_groups() -> None:
    program = trace(lambda x: np.sin(x), {"x": (100,)})
    groups = [s for part in schedule(program, 4, 2500) for s in part.steps if isinstance(s, TrigGroup)]
    assert [len(group.angles) for group in groups] == [MAX_ANGLES] * 4 + [4]
