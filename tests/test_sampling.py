"""The sample of cases that runs without ``--whole``, and which parallel process runs which tests."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import CASES, LONG_CASES, WAITING, few_cases, pytest_xdist_make_scheduler


class Case:
    """What is used of an item of pytest."""

    def __init__(self, test: str, number: int, marks: tuple[str, ...] = ()) -> None:
        self.nodeid, self.marks = f"tests/test_a.py::{test}[{number}]", marks

    def get_closest_marker(self, name: str) -> str | None:
        return name if name in self.marks else None


def test_a_few_cases_of_each_test_are_kept_in_their_order_and_always_the_same() -> None:
    every: list[Any] = [
        *(Case("quick", k) for k in range(40)),
        *(Case("long", k, ("long_cases",)) for k in range(40)),
        *(Case("few", k) for k in range(3)),
    ]
    kept = few_cases(every)
    counts = [sum(f"::{test}[" in item.nodeid for item in kept) for test in ("quick", "long", "few")]
    assert counts == [CASES, LONG_CASES, 3]
    assert kept == [item for item in every if item in kept]
    assert few_cases(every[::-1]) == kept[::-1]


class Worker:
    """What a scheduler uses of a parallel process of xdist."""

    def __init__(self, name: str) -> None:
        self.gateway = SimpleNamespace(id=name)
        self.given: list[int] = []
        self.shutting_down = False

    def send_runtest_some(self, tests: list[int]) -> None:
        assert not self.shutting_down
        self.given += tests

    def shutdown(self) -> None:
        self.shutting_down = True


@given(st.integers(0, 30), st.integers(0, 60), st.integers(1, 4), st.randoms(use_true_random=False))
def test_one_process_runs_the_tests_that_wait_while_there_are_others(
    waiting: int, others: int, count: int, random: Any
) -> None:
    pytest.importorskip("xdist")
    options = {"dist": "load", "tx": ["popen"] * count, "maxschedchunk": 2}
    config = SimpleNamespace(getoption=options.__getitem__, getvalue=options.__getitem__)
    scheduler = pytest_xdist_make_scheduler(config, SimpleNamespace(loadsched=lambda *_: None))  # type: ignore[arg-type]
    names = [f"{WAITING}test_a.py::{k}" for k in range(waiting)] + [f"tests/b.py::{k}" for k in range(others)]
    workers = [Worker(f"gw{k}") for k in range(count)]
    for worker in workers:
        scheduler.add_node(worker)
    for worker in workers:
        scheduler.add_node_collection(worker, names)
    scheduler.schedule()
    done: list[tuple[Worker, int]] = []
    while running := [worker for worker in workers if scheduler.node2pending[worker]]:
        worker = random.choice(running)
        test = scheduler.node2pending[worker][0]
        done.append((worker, test))
        scheduler.mark_test_complete(worker, test)
    assert sorted(test for _, test in done) == list(range(len(names)))
    for worker in workers[1:]:
        own = [test for test in worker.given if test < waiting]
        # They come last, once nothing else is left.
        assert own == worker.given[len(worker.given) - len(own) :]
    first = workers[0].given
    assert first[: min(waiting, 2)] == list(range(min(waiting, 2)))


def test_other_ways_to_distribute_tests_stay() -> None:
    options = {"dist": "loadfile"}
    assert pytest_xdist_make_scheduler(SimpleNamespace(getoption=options.get), None) is None  # type: ignore[arg-type]
