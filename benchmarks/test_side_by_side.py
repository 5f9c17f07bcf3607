"""Comparison of two columns of times, and of two answers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.side_by_side import Case, Row, cases, difference, interval, measure


class Scripted:
    """Stands for a checkout: an answer, and times for each round."""

    def __init__(self, answer: list[float] | None, seconds: float) -> None:
        self.answer, self.seconds = answer, seconds

    def ask(self, **request: object) -> dict[str, object]:
        """Return what a process would reply."""
        if "case" not in request:
            return {"seconds": self.seconds}
        return {"error": "none"} if self.answer is None else {"answer": self.answer, "calls": 3}


CASE = Case("any", lambda: (lambda: None, lambda x: x), 1e-6)


def measured(before: Scripted, after: Scripted) -> Row:
    """Return the row of two scripted checkouts."""
    return measure(CASE, before, after, rounds=4, bar=0.95)  # type: ignore[arg-type]


def test_names_of_cases_are_unique() -> None:
    names = [case.name for case in cases()]
    assert len(set(names)) == len(names)


def test_a_ratio_above_one_says_that_the_second_is_faster() -> None:
    row = measured(Scripted([1.0], 3.0), Scripted([1.0], 2.0))
    assert (row.before, row.after, row.ratio, row.low, row.high) == (3.0, 2.0, 1.5, 1.5, 1.5)
    assert not row.failed
    assert measured(Scripted([1.0], 0.9), Scripted([1.0], 1.0)).failed


@pytest.mark.parametrize(
    ("second", "failed"), [([1.0, 1.0 + 1e-7], False), ([1.0, 1.0 + 1e-5], True), ([1.0], True), (None, True)]
)
def test_answers_are_compared_before_anything_is_timed(second: list[float] | None, failed: bool) -> None:
    row = measured(Scripted([1.0, 1.0], 1.0), Scripted(second, 1.0))
    assert row.failed == failed
    assert row.rounds == (0 if failed else 4)
    assert not measured(Scripted(None, 1.0), Scripted([1.0], 1.0)).failed


def test_differences_are_relative_to_the_largest_number() -> None:
    assert difference([100.0, 0.0], [100.0, 1e-6]) == pytest.approx(1e-8)
    assert difference([math.nan, 1.0], [math.nan, 1.0]) == 0.0
    assert difference([math.nan, 1.0], [0.0, 1.0]) == math.inf
    assert difference([], []) == 0.0


def test_the_interval_holds_the_ratio_of_the_medians_in_19_of_20_runs() -> None:
    rng = np.random.default_rng(0)
    inside = 0
    for _ in range(200):
        low, high = interval(rng.gamma(20.0, size=(30, 2)) * [1.2, 1.0])
        inside += low <= 1.2 <= high
    assert 180 <= inside <= 199
