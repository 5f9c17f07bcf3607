"""The sample of cases that runs without ``--whole``."""

from __future__ import annotations

from typing import Any

from tests.conftest import CASES, LONG_CASES, few_cases


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
