"""Trends of errors over the steps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.contacts.verdict import MIN_ORDER, judge

STEPS = (4e-3, 2e-3, 1e-3)
TOLERANCE = 1e-6


@given(st.floats(0.6, 4.0), st.floats(1e-2, 1.0))
def test_errors_in_proportion_to_a_power_of_the_step_fall_at_that_order(order: float, size: float) -> None:
    errors = [size * (step / STEPS[0]) ** order for step in STEPS]
    trend = judge(STEPS, errors, TOLERANCE)
    assert trend.kind == "falls"
    assert trend.order == pytest.approx(order)


@given(st.floats(1e-3, 1.0), st.floats(0.0, 0.3))
def test_an_error_that_hardly_changes_stays(size: float, order: float) -> None:
    assert judge(STEPS, [size * (step / STEPS[0]) ** order for step in STEPS], TOLERANCE).kind == "stays"


@given(st.permutations([4e-2, 2e-2, 1e-2]))
def test_errors_that_rise_somewhere_stay(errors: list[float]) -> None:
    assert (judge(STEPS, errors, TOLERANCE).kind == "falls") == (errors == sorted(errors, reverse=True))


@given(st.lists(st.floats(0.0, TOLERANCE), min_size=1, max_size=3))
def test_errors_within_the_tolerance_are_none_whatever_their_order(errors: list[float]) -> None:
    assert judge(STEPS[: len(errors)], errors, TOLERANCE).kind == "within"


def test_noise_below_the_tolerance_hides_no_order() -> None:
    trend = judge((8e-3, *STEPS), [4e-3, 1e-3, 2e-7, 9e-7], TOLERANCE)
    assert trend.kind == "falls"
    # The errors below the tolerance count as the tolerance in the slope of all.
    sizes, logs = np.log((8e-3, *STEPS)), np.log([4e-3, 1e-3, TOLERANCE, TOLERANCE])
    assert trend.order == pytest.approx(np.polyfit(sizes, logs, 1)[0])
    assert judge(STEPS, [1e-7, 1e-2, 1e-7], TOLERANCE).kind == "stays"


def test_a_fall_to_the_tolerance_is_a_fall_whatever_its_order() -> None:
    assert judge(STEPS, [4e-6, 1.1e-6, 0.0], TOLERANCE).kind == "falls"
    assert judge(STEPS, [4e-6, 0.9e-6, 1.1e-6], TOLERANCE).kind == "stays"


def test_an_error_that_stops_falling_stays() -> None:
    assert judge(STEPS, [8e-2, 2e-2, 1.9e-2], TOLERANCE).kind == "stays"
    assert judge(STEPS, [8e-2, 2e-2, 2e-2 / 2**MIN_ORDER * 0.999], TOLERANCE).kind == "falls"


def test_one_step_shows_no_order_and_nan_is_an_error() -> None:
    assert judge((1e-3,), [1e-2], TOLERANCE).kind == "stays"
    assert judge(STEPS, [1e-2, float("nan"), 1e-9], TOLERANCE).kind == "stays"
