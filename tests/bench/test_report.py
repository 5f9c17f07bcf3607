"""The JSON document of invented measurements."""

from __future__ import annotations

import json

import pytest

import dynx
from dynx.bench.cases import BenchmarkCase
from dynx.bench.machine import Cost
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.report import SCHEMA, document, is_wrong, result, wrong
from dynx.bench.session import benchmark_cases
from dynx.bench.timing import Times
from tests.bench.implementations import PEAK, Scaled, session_of

CASE = BenchmarkCase("inverse_dynamics", 65536)
COST = Cost(bytes=192, operations=750, multiply_adds=400)


def found(
    implementation: str, nanoseconds: tuple[float, ...] | None, role: str = "backend"
) -> BenchmarkMeasurement:
    """Return a measurement of the given nanoseconds."""
    times = None if nanoseconds is None else Times(tuple(1e-9 * each for each in nanoseconds))
    return BenchmarkMeasurement(CASE, implementation, role, "1.0", 1, 65536, 1e-15, 1e-13, times)


GROUP = [
    found("compiled", (40.0, 38.0, 42.0)),
    found("slow", (4000.0,)),
    found("batch", (1000.0,), "peer"),
    found("loop", (2000.0,), "peer"),
    found("lost", None, "peer"),
]


def test_a_ratio_is_the_speed_up_over_each_peer() -> None:
    implementations = result(GROUP, [None] * 5, {})["ways"]
    assert implementations[0]["ratios"] == pytest.approx({"batch": 25.0, "loop": 50.0})
    assert implementations[1]["ratios"] == pytest.approx({"batch": 0.25, "loop": 0.5})
    assert implementations[2]["ratios"] == pytest.approx({"batch": 1.0, "loop": 2.0})
    assert implementations[4]["ratios"] == {}
    assert implementations[4]["ns"] is None


def test_times_are_nanoseconds_of_one_sample() -> None:
    implementation = result(GROUP, [None] * 5, {})["ways"][0]
    assert implementation["ns"] == pytest.approx(40.0)
    assert implementation["ns_quartiles"] == pytest.approx([39.0, 41.0])


def test_the_roofline_is_that_of_the_threads_of_the_implementation() -> None:
    with_cost = result(GROUP[:1], [COST], {1: PEAK})["ways"][0]["roofline"]
    assert with_cost is not None
    # 19.2 ns for the bytes and 20 ns for the operations, of 40.
    assert with_cost["memory_share"] == pytest.approx(0.48)
    assert with_cost["arithmetic_share"] == pytest.approx(0.5)
    assert with_cost["binds"] == "arithmetic"
    assert (with_cost["bytes"], with_cost["operations"], with_cost["multiply_adds"]) == (192, 750, 400)
    assert result(GROUP[:1], [COST], {2: PEAK})["ways"][0]["roofline"] is None
    assert result(GROUP[:1], [None], {1: PEAK})["ways"][0]["roofline"] is None


def test_wrong_results_and_failures_are_listed() -> None:
    right, refused = GROUP[0], BenchmarkMeasurement(CASE, "x", "backend", "", 1, 8, problem="cannot")
    bad = BenchmarkMeasurement(CASE, "x", "backend", "", 1, 8, 1e-3, 1e-13, problem="wrong result")
    nothing = BenchmarkMeasurement(CASE, "x", "backend", "", 1, 8, float("nan"), 1e-13)
    assert [is_wrong(each) for each in (right, refused, bad, nothing)] == [False, False, True, True]
    assert wrong([[right, bad], [refused]]) == [bad]


def test_the_document_lists_timed_and_skipped_cases() -> None:
    model = dynx.load("double_pendulum")
    both = benchmark_cases(["jacobian", "mass_matrix"], (4,))
    with session_of([Scaled("compiled"), Scaled("peer", role="peer")], model, both) as session:
        session.measure_machine(1)
        done = [session.measure(both[0])]
        made = document(session, done, "a processor")
    keys = "schema dynx robot source base nq nv frame repetitions seed processor load peaks results not_done"
    assert set(made) == set(keys.split())
    assert made["schema"] == SCHEMA == 1
    assert made["peaks"] == [{"threads": 1, "copy_bandwidth": 10e9, "multiply_adds": 20e9}]
    (only,) = made["results"]
    assert (only["quantity"], only["batch"], only["threads"]) == ("jacobian", 4, 1)
    implementations = (
        "way role version threads samples error tolerance problem ns ns_quartiles ratios roofline"
    )
    assert [set(implementation) for implementation in only["ways"]] == [set(implementations.split())] * 2
    assert only["ways"][0]["roofline"] is not None
    assert only["ways"][1]["roofline"] is None
    assert made["not_done"] == [{"quantity": "mass_matrix", "batch": 4, "threads": 1}]
    assert json.loads(json.dumps(made)) == made
