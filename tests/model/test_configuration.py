"""Configuration arithmetic: inverse operations, limits, and Pinocchio's free-flyer beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DTypeError, NotFiniteError, ShapeError
from dynx.model import Joint, Limits, Link, Mimic, Model
from dynx.model.loading import load
from dynx.testing.strategies import configurations, models, velocities
from tests.spatial.rounding import EPS, assert_same_to_rounding

Floats = NDArray[np.float64]
FREE_BODY = load("free_body", base="floating")


def scale(*arrays: Floats) -> float:
    return 8.0 * (1.0 + max(float(np.max(np.abs(array), initial=0.0)) for array in arrays))


def same_configuration(model: Model, a: Floats, b: Floats, operations: int, size: float) -> None:
    """Assert equality to rounding; a quaternion and its negative are one orientation."""
    if model.floating:
        b = b.copy()
        b[3:7] *= np.copysign(1.0, np.dot(a[3:7], b[3:7]))
    assert_same_to_rounding(a, b, operations, size)


@given(st.data())
def test_integrating_the_difference_reaches_the_end(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4))
    q0, q1 = data.draw(configurations(model)), data.draw(configurations(model))
    arrived = model.integrate(q0, model.difference(q0, q1))
    same_configuration(model, q1, arrived, 256, scale(q0, q1))


@given(st.data())
def test_the_difference_after_integrating_is_the_velocity(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4))
    q, v = data.draw(configurations(model)), data.draw(velocities(model, reach=1.5))
    # Rotation angles below pi: 1.5 sqrt(3) < pi.
    assert_same_to_rounding(model.difference(q, model.integrate(q, v)), v, 256, scale(q, v))


@given(st.data())
def test_nothing_moves_without_velocity(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4))
    q = data.draw(configurations(model))
    same_configuration(model, q, model.integrate(q, np.zeros(model.nv)), 8, scale(q))
    assert_same_to_rounding(model.difference(q, q), np.zeros(model.nv), 8, scale(q))


@given(st.data())
def test_two_half_steps_equal_one_step(data: st.DataObject) -> None:
    q, v = data.draw(configurations(FREE_BODY)), data.draw(velocities(FREE_BODY))
    halfway = FREE_BODY.integrate(q, v / 2)
    same_configuration(
        FREE_BODY, FREE_BODY.integrate(q, v), FREE_BODY.integrate(halfway, v / 2), 256, scale(q, v)
    )


@given(st.data())
def test_the_floating_base_moves_as_pinocchios_free_flyer(data: st.DataObject) -> None:
    pinocchio: Any = pytest.importorskip("pinocchio")
    engine = pinocchio.Model()
    engine.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "base")
    q, v = data.draw(configurations(FREE_BODY)), data.draw(velocities(FREE_BODY))
    q1 = data.draw(configurations(FREE_BODY))
    same_configuration(
        FREE_BODY, pinocchio.integrate(engine, q, v), FREE_BODY.integrate(q, v), 256, scale(q, v)
    )
    ours = FREE_BODY.difference(q, q1)
    # At an angle of pi both directions are shortest, and either may be returned.
    if np.linalg.norm(ours[3:]) < math.pi - 1e-6:
        theirs = pinocchio.difference(engine, q, q1)
        # Pinocchio computes the angle from the trace of a rotation matrix, which loses half the digits at pi.
        lost = 1.0 / (math.pi - float(np.linalg.norm(ours[3:])))
        assert_same_to_rounding(ours, theirs, 512, scale(q, q1) * max(1.0, lost))


@given(models(), st.integers(0, 2**32))
def test_random_configurations_are_valid_and_within_the_limits(model: Model, seed: int) -> None:
    q = model.random(seed, size=(3, 2))
    assert q.shape == (3, 2, model.nq)
    assert np.all(q >= model.lower)
    assert np.all(q <= model.upper)
    assert np.all(np.isfinite(q))
    if model.floating:
        assert_same_to_rounding(np.linalg.norm(q[..., 3:7], axis=-1), np.ones((3, 2)), 8)
    np.testing.assert_array_equal(q, model.random(np.random.default_rng(seed), size=(3, 2)))
    assert model.random(seed).shape == (model.nq,)
    assert model.random(seed, size=4).shape == (4, model.nq)


@given(st.data())
def test_clipping_is_idempotent_and_changes_only_entries_outside(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4))
    q = data.draw(configurations(model)) * data.draw(st.sampled_from((1.0, 0.5, 3.0)))
    clipped = model.clip(q)
    base = 7 if model.floating else 0
    assert np.all(clipped >= model.lower)
    assert np.all(clipped <= model.upper)
    inside = (q >= model.lower) & (q <= model.upper)
    np.testing.assert_array_equal(clipped[base:][inside[base:]], q[base:][inside[base:]])
    np.testing.assert_array_equal(model.clip(clipped)[base:], clipped[base:])
    assert_same_to_rounding(model.clip(clipped), clipped, 4, scale(q))


def test_random_angles_reach_both_ends() -> None:
    model = load("ur5_limited")
    q = model.random(0, size=4000)
    span = model.upper - model.lower
    # The chance that 4,000 uniform draws all miss the last hundredth of a range is 0.99^4000 < 1e-17.
    assert np.all(q.min(axis=0) < model.lower + 0.01 * span)
    assert np.all(q.max(axis=0) > model.upper - 0.01 * span)


@pytest.mark.parametrize(
    ("limits", "low", "high"),
    [
        (Limits(), -math.pi, math.pi),
        (Limits(lower=5.0), 5.0, 5.0 + 2 * math.pi),
        (Limits(upper=-5.0), -5.0 - 2 * math.pi, -5.0),
        (Limits(2.0, -1.0), -1.0, 2.0),
        (Limits(-1e308, 1e308), -math.pi, math.pi),
        (Limits(0.5, 0.5), 0.5, 0.5),
    ],
)
def test_random_samples_between_existing_limits(limits: Limits, low: float, high: float) -> None:
    model = Model.build("r", [Link("a"), Link("b")], [Joint("j", "revolute", "a", "b", limits=limits)])
    q = model.random(0, size=200)
    assert low <= q.min() <= q.max() <= high
    assert q.max() - q.min() >= 0.5 * (high - low)


def test_limits_of_a_driver_are_narrowed_by_its_followers() -> None:
    links = [Link(name) for name in "abcd"]
    driver = Joint("x", "revolute", "a", "b", limits=Limits(-1.0, 1.0))
    follower = Joint("y", "revolute", "b", "c", limits=Limits(-0.5, 4.0), mimic=Mimic("x", -2.0, 0.5))
    model = Model.build("r", links[:3], [driver, follower])
    assert (model.lower.tolist(), model.upper.tolist()) == ([-1.0], [0.5])
    without_room = replace(follower, limits=Limits(30.0, 40.0))
    model = Model.build("r", links[:3], [driver, without_room])
    assert (model.lower.tolist(), model.upper.tolist()) == ([-1.0], [1.0])


@given(st.data())
def test_leading_axes_are_batches(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4))
    q = np.stack([data.draw(configurations(model)) for _ in range(3)])
    v = np.stack([data.draw(velocities(model)) for _ in range(2)])
    moved = model.integrate(q[:, None], v)
    assert moved.shape == (3, 2, model.nq)
    turned = model.difference(q[:, None], moved)
    assert turned.shape == (3, 2, model.nv)
    clipped = model.clip(moved)
    for i in range(3):
        for j in range(2):
            one = model.integrate(q[i], v[j])
            # NumPy may sum a batch in another order than one sample.
            assert_same_to_rounding(moved[i, j], one, 64, scale(q, v))
            assert_same_to_rounding(turned[i, j], model.difference(q[i], one), 256, scale(q, v))
            assert_same_to_rounding(clipped[i, j], model.clip(one), 64, scale(q, v))


def test_neutral_is_zero_with_the_identity_quaternion() -> None:
    np.testing.assert_array_equal(load("ur5").neutral(), np.zeros(6))
    np.testing.assert_array_equal(load("ur5", base="floating").neutral()[:8], [0, 0, 0, 0, 0, 0, 1, 0])


BAD: list[tuple[object, type[Exception], str]] = [
    (np.zeros(6), ShapeError, r"q has shape \(6,\); wanted \(..., 7\)"),
    (0.0, ShapeError, r"q has shape \(\); wanted"),
    ([[0.0] * 7, [0.0] * 6], ShapeError, "q is ragged"),
    (["a"] * 7, DTypeError, "wanted real numbers"),
    ([None] * 7, DTypeError, "wanted real numbers"),
    ({"hinge": 0.3}, DTypeError, r"; set entries by joint: q\[model\.position_index\(name\)\], v\["),
    (np.zeros(7, dtype=complex), DTypeError, "q has dtype complex128"),
    ([True] * 7, DTypeError, "q has dtype bool"),
    ([0, 0, 0, 0, 0, math.nan, 1], NotFiniteError, r"q\[5\] is nan"),
    ([[0, 0, 0, 0, 0, 0, 1], [0, 0, math.inf, 0, 0, 0, 1]], NotFiniteError, r"q\[1, 2\] is inf"),
    ([0, 0, 0, 0, 0, 0, 2], ArgumentError, r"q\[3:7\] is a quaternion \(x, y, z, w\) of length 2; wanted"),
]


@pytest.mark.parametrize(("q", "kind", "message"), BAD)
def test_a_bad_configuration_is_named(q: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        FREE_BODY.integrate(q, np.zeros(6))


def test_a_zero_quaternion_cannot_be_clipped() -> None:
    with pytest.raises(ArgumentError, match="zero quaternion"):
        FREE_BODY.clip(np.zeros(7))
    q = FREE_BODY.clip(np.array([0, 0, 0, 0, 3, 0, 4]))
    np.testing.assert_allclose(q[3:7], [0, 0.6, 0, 0.8], rtol=2 * EPS)
