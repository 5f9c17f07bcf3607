"""Sessions of invented implementations, and the cases of a plan."""

from __future__ import annotations

import pytest

import dynx
from dynx.backends.registry import installed_backends
from dynx.bench.cases import BenchmarkCase
from dynx.bench.machine import cost_of, program_of
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.session import (
    BATCHES,
    MIN_BATCH_FOR_THREADS,
    Plan,
    Session,
    all_implementations,
    benchmark_cases,
)
from dynx.errors import ArgumentError, EngineLimitError, UnknownNameError
from dynx.model import Link, Model
from tests.bench.implementations import PEAK, Scaled, session_of

MODEL = dynx.load("double_pendulum")
FRAME = MODEL.frame_names[-1]


def test_large_batches_come_first_and_small_ones_have_one_thread() -> None:
    made = benchmark_cases(["mass_matrix", "jacobian", "mass_matrix"], (8, MIN_BATCH_FOR_THREADS), (2, 1))
    assert made == (
        BenchmarkCase("mass_matrix", MIN_BATCH_FOR_THREADS, 1),
        BenchmarkCase("mass_matrix", MIN_BATCH_FOR_THREADS, 2),
        BenchmarkCase("jacobian", MIN_BATCH_FOR_THREADS, 1),
        BenchmarkCase("jacobian", MIN_BATCH_FOR_THREADS, 2),
        BenchmarkCase("mass_matrix", 8, 1),
        BenchmarkCase("jacobian", 8, 1),
    )


def test_requested_threads_are_used_for_any_batch() -> None:
    assert benchmark_cases(["jacobian"], (8,), (2,), least=1) == (BenchmarkCase("jacobian", 8, 2),)


def test_all_cases_are_the_default() -> None:
    made = benchmark_cases()
    assert {case.batch for case in made} == set(BATCHES)
    assert len(made) == len(BATCHES) * 5


def test_a_robot_without_coordinates_is_refused() -> None:
    still = Model.build("stone", [Link("base")], [])
    with pytest.raises(ArgumentError, match="stone has no coordinates"):
        Plan(still, "base", benchmark_cases())


def test_a_plan_without_cases_is_refused() -> None:
    with pytest.raises(ArgumentError, match="nothing to time"):
        Plan(MODEL, FRAME, ())


def test_an_unknown_frame_is_refused_before_anything_is_timed() -> None:
    with pytest.raises(UnknownNameError, match="nosuch"):
        Plan(MODEL, "nosuch", benchmark_cases())


def test_the_peak_of_each_number_of_threads_is_kept() -> None:
    with session_of([], MODEL, benchmark_cases(threads=(1, 2))) as session:
        session.measure_machine(1)
    assert session.peaks == {1: PEAK}
    assert session.plan.threads == (1, 2)


def test_on_several_threads_backends_with_one_are_left_out_and_peers_are_not() -> None:
    implementations = [Scaled("backend"), Scaled("peer", role="peer")]
    both = benchmark_cases(["jacobian"], (MIN_BATCH_FOR_THREADS,), (1, 2))
    with session_of([*implementations], MODEL, both, repetitions=1) as session:
        found = [[each.implementation for each in session.measure(case)] for case in both]
    assert found == [["backend", "peer"], ["peer"]]


def test_leaving_the_session_closes_the_implementations() -> None:
    implementation = Scaled("scaled")
    with session_of([implementation], MODEL, benchmark_cases(["jacobian"], (2,)), repetitions=1) as session:
        session.measure(BenchmarkCase("jacobian", 2))
        assert not implementation.closed
    assert implementation.closed


def test_the_cost_is_that_of_the_compiled_program() -> None:
    session = session_of([], MODEL, benchmark_cases())
    program = program_of(MODEL, "mass_matrix", FRAME)
    assert program is not None
    assert session.cost(measured("compiled")) == cost_of(program)
    assert session.cost(measured("pinocchio")) is None


def measured(implementation: str) -> BenchmarkMeasurement:
    """Return a measurement of the mass matrix."""
    return BenchmarkMeasurement(BenchmarkCase("mass_matrix", 8), implementation, "backend", "", 1, 8)


def test_all_implementations_are_the_backends_then_the_peers() -> None:
    found = all_implementations(Plan(MODEL, FRAME, benchmark_cases()), 1)
    names = [implementation.name for implementation in found if implementation.role == "backend"]
    assert names == list(installed_backends())
    assert [implementation.name for implementation in found if implementation.role == "peer"] == [
        "pinocchio C++ batch",
        "pinocchio binding",
        "pinocchio C++ call",
    ]
    only = all_implementations(Plan(MODEL, FRAME, benchmark_cases(), backends=("reference",)), 1)
    assert [implementation.name for implementation in only if implementation.role == "backend"] == [
        "reference"
    ]


def test_an_engine_that_refuses_the_robot_is_reported_with_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise EngineLimitError("too large")

    monkeypatch.setattr("dynx.bench.session.backend_implementation", refuse)
    plan = Plan(MODEL, FRAME, benchmark_cases(["jacobian"], (2,)), backends=("reference",), repetitions=1)
    with Session(plan) as session:
        found = session.measure(BenchmarkCase("jacobian", 2))
    assert (found[0].implementation, found[0].problem, found[0].error) == ("reference", "too large", None)
    assert found[1].times is not None
