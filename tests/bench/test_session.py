"""A session of made-up ways, and which works a plan holds."""

from __future__ import annotations

import pytest

import dynx
from dynx.backends.registry import installed_backends
from dynx.bench.cases import Work
from dynx.bench.cost import cost_of, program_of
from dynx.bench.measurement import Measurement
from dynx.bench.session import BATCHES, WORTH_THREADS, Plan, Session, all_ways, works
from dynx.errors import ArgumentError, EngineLimitError, UnknownNameError
from dynx.model import Link, Model
from tests.bench.implementations import PEAK, Scaled, session_of

MODEL = dynx.load("double_pendulum")
FRAME = MODEL.frame_names[-1]


def test_large_batches_come_first_and_small_ones_have_one_thread() -> None:
    made = works(["mass_matrix", "jacobian", "mass_matrix"], (8, WORTH_THREADS), (2, 1))
    assert made == (
        Work("mass_matrix", WORTH_THREADS, 1),
        Work("mass_matrix", WORTH_THREADS, 2),
        Work("jacobian", WORTH_THREADS, 1),
        Work("jacobian", WORTH_THREADS, 2),
        Work("mass_matrix", 8, 1),
        Work("jacobian", 8, 1),
    )


def test_threads_that_are_asked_for_are_tried_on_any_batch() -> None:
    assert works(["jacobian"], (8,), (2,), least=1) == (Work("jacobian", 8, 2),)


def test_everything_is_the_default() -> None:
    made = works()
    assert {work.batch for work in made} == set(BATCHES)
    assert len(made) == len(BATCHES) * 5


def test_a_robot_without_coordinates_is_refused() -> None:
    still = Model.build("stone", [Link("base")], [])
    with pytest.raises(ArgumentError, match="stone has no coordinates"):
        Plan(still, "base", works())


def test_a_plan_without_works_is_refused() -> None:
    with pytest.raises(ArgumentError, match="nothing to time"):
        Plan(MODEL, FRAME, ())


def test_an_unknown_frame_is_refused_before_anything_is_timed() -> None:
    with pytest.raises(UnknownNameError, match="nosuch"):
        Plan(MODEL, "nosuch", works())


def test_the_peak_of_each_number_of_threads_is_kept() -> None:
    with session_of([], MODEL, works(threads=(1, 2))) as session:
        session.measure_machine(1)
    assert session.peaks == {1: PEAK}
    assert session.plan.threads == (1, 2)


def test_on_several_threads_backends_with_one_are_left_out_and_peers_are_not() -> None:
    ways = [Scaled("backend"), Scaled("peer", role="peer")]
    both = works(["jacobian"], (WORTH_THREADS,), (1, 2))
    with session_of([*ways], MODEL, both, repetitions=1) as session:
        found = [[each.way for each in session.measure(work)] for work in both]
    assert found == [["backend", "peer"], ["peer"]]


def test_leaving_closes_the_ways() -> None:
    way = Scaled("way")
    with session_of([way], MODEL, works(["jacobian"], (2,)), repetitions=1) as session:
        session.measure(Work("jacobian", 2))
        assert not way.closed
    assert way.closed


def test_the_cost_is_that_of_the_compiled_program() -> None:
    session = session_of([], MODEL, works())
    program = program_of(MODEL, "mass_matrix", FRAME)
    assert program is not None
    assert session.cost(measured("compiled")) == cost_of(program)
    assert session.cost(measured("pinocchio")) is None


def measured(way: str) -> Measurement:
    """Something found of the mass matrix."""
    return Measurement(Work("mass_matrix", 8), way, "backend", "", 1, 8)


def test_all_ways_are_the_backends_then_the_peers() -> None:
    found = all_ways(Plan(MODEL, FRAME, works()), 1)
    names = [way.name for way in found if way.role == "backend"]
    assert names == list(installed_backends())
    assert [way.name for way in found if way.role == "peer"] == [
        "pinocchio C++ batch",
        "pinocchio binding",
        "pinocchio C++ call",
    ]
    only = all_ways(Plan(MODEL, FRAME, works(), backends=("reference",)), 1)
    assert [way.name for way in only if way.role == "backend"] == ["reference"]


def test_an_engine_that_cannot_hold_the_robot_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise EngineLimitError("too large")

    monkeypatch.setattr("dynx.bench.session.backend_way", refuse)
    plan = Plan(MODEL, FRAME, works(["jacobian"], (2,)), backends=("reference",), repetitions=1)
    with Session(plan) as session:
        found = session.measure(Work("jacobian", 2))
    assert (found[0].way, found[0].problem, found[0].error) == ("reference", "too large", None)
    assert found[1].times is not None
