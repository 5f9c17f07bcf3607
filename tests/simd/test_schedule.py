"""Segments: how long they are, what they keep, and that angles are taken together."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from dynx.simd.expr import Graph
from dynx.simd.program import Port, Program, finished
from dynx.simd.schedule import LEAVES, Segment, TrigGroup, places_of_kept, schedule
from tests.simd.programs import programs


@given(programs(), st.integers(1, 30))
def test_segments_are_no_longer_than_asked(program: Program, longest: int) -> None:
    """But for a group of angles, which is not cut."""
    for segment in schedule(program, 4, longest):
        if not any(isinstance(step, TrigGroup) for step in segment.steps):
            assert len(segment.steps) <= longest


@given(programs(), st.integers(1, 30))
def test_nothing_is_kept_that_no_later_segment_uses(program: Program, longest: int) -> None:
    segments = schedule(program, 4, longest)
    for number, segment in enumerate(segments):
        assert segment.kept <= used_by(program, segments[number + 1 :])
        assert not any(program.nodes[node].op in LEAVES for node in segment.kept)


def used_by(program: Program, segments: list[Segment]) -> set[int]:
    used: set[int] = set()
    for segment in segments:
        for step in segment.steps:
            used.update(step.angles if isinstance(step, TrigGroup) else program.nodes[step].args)
        used.update(node for store in segment.stores for node in store.nodes)
    return used


@given(programs(), st.integers(1, 30))
def test_what_is_still_wanted_is_not_overwritten(program: Program, longest: int) -> None:
    """A segment writes what it keeps while later steps of its own still read what others kept."""
    segments = schedule(program, 4, longest)
    places = places_of_kept(program, segments)
    assert set(places) == {value for segment in segments for value in segment.kept}
    for number, segment in enumerate(segments):
        wanted = used_by(program, segments[number:])
        earlier = {value for before in segments[:number] for value in before.kept} & wanted
        alive = [places[value] for value in (*earlier, *segment.kept)]
        assert len(set(alive)) == len(alive)


@given(programs())
def test_a_short_program_is_one_segment_that_keeps_nothing(program: Program) -> None:
    (segment,) = schedule(program, 4, 10**6)
    assert not segment.kept


def test_angles_known_at_the_same_time_share_a_group() -> None:
    """sin a, cos a, sin(a + b) are in one group, sin(sin a) in the next."""
    graph = Graph()
    a, b = graph.input(0), graph.input(1)
    first = graph.literal("sin", a)
    results = [
        graph.literal("cos", a),
        graph.literal("sin", graph.literal("add", a, b)),
        graph.literal("sin", first),
    ]
    program = finished(graph, [Port("x", (2,))], [Port("y", (3,))], results)
    (segment,) = schedule(program, 4, 10**6)
    groups = [step for step in segment.steps if isinstance(step, TrigGroup)]
    assert [len(group.angles) for group in groups] == [2, 1]
    assert [sum(node is not None for pair in group.nodes for node in pair) for group in groups] == [3, 1]
