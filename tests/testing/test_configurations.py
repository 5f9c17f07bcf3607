"""Configurations and velocities fit their model; singular and limiting ones occur."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, NotFiniteError
from dynx.model import Joint, Limits, Link, Model
from dynx.model.configuration import checked_q
from dynx.testing.strategies import accelerations, configurations, models, samples, velocities
from tests.testing.occurrence import assert_occurs, simplest

ARM = Model.build(
    "arm",
    [Link("a"), Link("b"), Link("c")],
    [
        Joint("turn", "revolute", "a", "b", limits=Limits(-1.0, 2.0)),
        Joint("spin", "continuous", "b", "c"),
    ],
)


@given(st.data())
def test_they_fit_the_model(data: st.DataObject) -> None:
    model = data.draw(models())
    q, v, a = data.draw(samples(model))
    assert q.shape == (model.nq,)
    assert v.shape == a.shape == (model.nv,)
    assert {q.dtype, v.dtype, a.dtype} == {np.dtype(np.float64)}
    checked_q(model, q)
    assert np.isfinite(v).all()
    assert np.isfinite(a).all()


@given(st.data())
def test_within_limits(data: st.DataObject) -> None:
    model = data.draw(models())
    q = data.draw(configurations(model, within_limits=True))
    assert (q >= model.lower).all()
    assert (q <= model.upper).all()


FREE = Model.build(
    "free",
    [Link("a"), Link("b"), Link("c")],
    [Joint("slide", "prismatic", "a", "b"), Joint("spin", "continuous", "b", "c")],
)


@given(configurations(FREE, within_limits=True))
def test_without_limits_joints_stay_within_a_metre_or_half_a_turn(q: np.ndarray) -> None:
    assert abs(q[0]) <= 1.0
    assert abs(q[1]) <= np.pi


def test_without_limits_the_whole_range_occurs() -> None:
    for within in (False, True):
        strategy = configurations(FREE, within_limits=within)
        assert_occurs(strategy, lambda q: q[0] > 0.9 and q[1] < -3.0)
        assert_occurs(strategy, lambda q: q[0] < -0.9 and q[1] > 3.0)


@given(velocities(ARM, reach=0.5))
def test_velocities_within_reach(v: np.ndarray) -> None:
    assert np.max(np.abs(v)) <= 0.5


def test_shrink_targets() -> None:
    np.testing.assert_array_equal(simplest(configurations(ARM), lambda q: True), ARM.neutral())
    floating = ARM.with_base("floating")
    np.testing.assert_array_equal(simplest(configurations(floating), lambda q: True), floating.neutral())
    np.testing.assert_array_equal(simplest(velocities(ARM), lambda v: True), np.zeros(2))
    np.testing.assert_array_equal(simplest(accelerations(ARM), lambda a: True), np.zeros(2))


@pytest.mark.parametrize("limit", [-1.0, 2.0])
def test_limits_occur(limit: float) -> None:
    def next_to_it(q: np.ndarray) -> bool:
        return bool(0.0 < abs(q[0] - limit) < 1e-5)

    assert_occurs(configurations(ARM), lambda q: q[0] == limit)
    assert_occurs(configurations(ARM), next_to_it)
    assert_occurs(configurations(ARM, within_limits=True), lambda q: q[0] == limit)


def test_singular_postures_and_turns_occur() -> None:
    for step in (1e-12, 1e-9, 1e-6, 1e-3):
        assert_occurs(
            configurations(ARM),
            lambda q, step=step: 0.9 * step < abs(abs(q[1]) - np.pi / 2) < 1.1 * step,  # type: ignore[misc]
        )
    assert_occurs(configurations(ARM), lambda q: abs(q[1]) > 2 * np.pi)
    assert_occurs(configurations(ARM), lambda q: q[0] > 2.0)


@pytest.mark.parametrize("strategy", [configurations, velocities, accelerations, samples])
def test_something_that_is_no_model(strategy: Any) -> None:
    with pytest.raises(DTypeError, match="wanted a dynx Model"):
        strategy("ur5")


def test_arguments_that_cannot_be() -> None:
    text: Any = "yes"
    with pytest.raises(DTypeError, match="within_limits"):
        configurations(ARM, within_limits=text)
    with pytest.raises(ArgumentError, match="reach"):
        velocities(ARM, reach=-1.0)
    with pytest.raises(NotFiniteError, match="reach"):
        accelerations(ARM, reach=float("nan"))
