"""Steps of a configuration with a floating base in machine code: the results and refusals of floats."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, CompileError, NotFiniteError
from dynx.model import Model, configuration
from dynx.model.loading import load
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE
from dynx.spatial import branchless
from dynx.spatial.branchless import FLOATS
from dynx.spatial.scalar import Floats

STEPS = {"integration": configuration._integration, "subtraction": configuration._subtraction}
ROBOTS = {robot: load(robot, base="floating") for robot in ("free_body", "ur5", "talos")}


@pytest.fixture(autouse=True, scope="module")
def compiled() -> None:
    """Compile both steps, which a process does after thousands of them."""
    for step in STEPS.values():
        step.compile()


@st.composite
def starts(draw: st.DrawFn) -> tuple[Model, Floats, np.random.Generator]:
    model = ROBOTS[draw(st.sampled_from(sorted(ROBOTS)))]
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return model, model.random(rng), rng


@given(starts(), st.floats(-200.0, 30.0), st.floats(-200.0, 30.0))
def test_results_are_those_of_floats_bit_for_bit(
    start: tuple[Model, Floats, np.random.Generator], linear: float, angular: float
) -> None:
    """Also of steps that turn many times, and of steps whose squares underflow."""
    model, q, rng = start
    v = rng.uniform(-1.0, 1.0, model.nv)
    v[:3] *= 10.0**linear
    v[3:6] *= 10.0**angular
    end = model.integrate(q, v)
    assert np.array_equal(end, model.integrate(q.tolist(), v.tolist()))
    assert end[:7].tolist() == branchless.moved(q[:7].tolist(), v[:6].tolist(), FLOATS)
    back = model.difference(q, end)
    assert np.array_equal(back, model.difference(q.tolist(), end.tolist()))
    assert back[:6].tolist() == branchless.twist_between(q[:7].tolist(), end[:7].tolist(), FLOATS)


@given(starts(), st.sampled_from([math.nan, math.inf, -math.inf, MAX_MAGNITUDE]), st.data())
def test_an_entry_that_is_not_finite_or_too_large_is_named(
    start: tuple[Model, Floats, np.random.Generator], bad: float, data: st.DataObject
) -> None:
    model, q, _ = start
    v, wrong_q, wrong_v = np.zeros(model.nv), q.copy(), np.zeros(model.nv)
    at_q, at_v = data.draw(st.integers(0, model.nq - 1)), data.draw(st.integers(0, model.nv - 1))
    wrong_q[at_q] = wrong_v[at_v] = bad
    kind = ArgumentError if bad == MAX_MAGNITUDE else NotFiniteError
    for function, arguments, name in (
        (model.integrate, (wrong_q, v), rf"q\[{at_q}\]"),
        (model.integrate, (q, wrong_v), rf"v\[{at_v}\]"),
        (model.difference, (wrong_q, q), rf"q0\[{at_q}\]"),
        (model.difference, (q, wrong_q), rf"q1\[{at_q}\]"),
    ):
        with pytest.raises(kind, match=name):
            function(*arguments)


@given(starts(), st.floats(-10.0, 10.0))
def test_a_quaternion_counts_as_unit_exactly_where_it_does_for_floats(
    start: tuple[Model, Floats, np.random.Generator], deviation: float
) -> None:
    """One whose norm deviates by more than rounding is normalised; by more than 1e-6, refused."""
    model, q, rng = start
    v = rng.uniform(-1.0, 1.0, model.nv)
    q[3:7] *= 1.0 + deviation * UNIT_NORM_TOLERANCE
    assert np.array_equal(model.integrate(q, v), model.integrate(q.tolist(), v.tolist()))
    q[3:7] *= 1.0 + 1e-5
    for function, arguments in ((model.integrate, (q, v)), (model.difference, (model.neutral(), q))):
        with pytest.raises(ArgumentError, match="quaternion"):
            function(*arguments)


def calls(function: Callable[..., object], *arguments: Any) -> int:
    """Return how many functions, of Python or of C, a call of `function` calls."""
    count = 0

    def seen(frame: object, event: str, argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(seen)
    try:
        function(*arguments)
    finally:
        sys.setprofile(None)
    return count - 1  # without that of `sys.setprofile`


@pytest.mark.parametrize("robot", sorted(ROBOTS))
def test_a_step_is_one_call_of_machine_code_for_any_number_of_joints(robot: str) -> None:
    model = ROBOTS[robot]
    q, v = model.random(0), np.full(model.nv, 0.1)
    end = model.integrate(q, v)
    model.difference(q, end)
    # The method, the properties of sizes, `np.empty` and the function itself.
    assert calls(model.integrate, q, v) <= 4
    assert calls(model.difference, q, end) <= 4


def test_a_step_is_compiled_once_it_has_been_computed_often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(configuration, "MIN_CALLS_TO_COMPILE", 3)
    step = configuration.ConfigurationStep("integration")
    monkeypatch.setattr(configuration, "_integration", step)
    model = ROBOTS["ur5"]
    q, v = model.random(0), np.full(model.nv, 0.1)
    on_floats = [model.integrate(q, v) for _ in range(3)]
    result = np.empty(model.nq)
    assert step.function(q, v, result) == 0
    for each in (*on_floats, model.integrate(q, v)):
        assert np.array_equal(each, result)


def test_steps_remain_on_floats_where_they_cannot_be_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails() -> None:
        raise CompileError("no linker")

    monkeypatch.setattr(configuration, "MIN_CALLS_TO_COMPILE", 1)
    monkeypatch.setattr("dynx.compiled.configurations.integration", fails)
    step = configuration.ConfigurationStep("integration")
    monkeypatch.setattr(configuration, "_integration", step)
    model = ROBOTS["talos"]
    q, v = model.random(0), np.full(model.nv, 0.1)
    expected = model.integrate(q.tolist(), v.tolist())
    for _ in range(3):
        assert np.array_equal(model.integrate(q, v), expected)
