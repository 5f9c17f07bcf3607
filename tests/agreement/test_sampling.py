from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.sampling import KINDS, MAX_DIFFERENTIATED_POSITION, assign_frames, draw_samples
from dynx.errors import ArgumentError
from dynx.model import Joint, Limits, Link, Model
from dynx.rbd.jacobians import REFERENCES
from dynx.testing.strategies import models
from tests.agreement.robots import arm


def test_half_of_the_samples_are_within_limits_and_every_kind_comes_up() -> None:
    samples = draw_samples(arm(), 16, 0)
    assert set(samples.kinds) == set(KINDS)
    inside = [k for k, kind in enumerate(samples.kinds) if kind in ("within", "limit")]
    assert len(inside) == 8
    assert np.all(samples.q[inside] >= arm().lower)
    assert np.all(samples.q[inside] <= arm().upper)


@given(models(), st.integers(1, 12), st.integers(0, 2**32))
def test_samples_follow_from_the_seed(model: Model, count: int, seed: int) -> None:
    one, two = (draw_samples(model, count, seed) for _ in range(2))
    for name in ("q", "v", "a", "tau", "wrench"):
        assert np.array_equal(getattr(one, name), getattr(two, name))
        assert np.isfinite(getattr(one, name)).all()
    assert one.q.shape == (count, model.nq)
    assert one.v.shape == (count, model.nv)


def test_a_joint_whose_limits_have_no_width_moves_all_the_same() -> None:
    joint = Joint("stuck", "revolute", "a", "b", limits=Limits(0.0, 0.0))
    model = Model.build("stuck", [Link("a"), Link("b")], [joint])
    samples = draw_samples(model, 16, 0)
    assert np.count_nonzero(samples.q) >= 4


def test_huge_limits_are_narrowed_where_quantities_are_differentiated() -> None:
    joint = Joint("rotor", "revolute", "a", "b", limits=Limits(-1e16, 1e16))
    samples = draw_samples(Model.build("rotor", [Link("a"), Link("b")], [joint]), 16, 0)
    chosen = samples.differentiable(4)
    assert len(chosen) == 4
    assert np.all(np.abs(samples.q[chosen]) <= MAX_DIFFERENTIATED_POSITION)


@given(st.integers(1, 40), st.integers(1, 20), st.integers(1, 4), st.integers(1, 3))
def test_every_frame_is_assigned_and_together_they_cover_every_sample(
    n_frames: int, count: int, each: int, references: int
) -> None:
    frames = tuple(f"frame{k}" for k in range(n_frames))
    each = min(each, count)
    entries = assign_frames(frames, count, each=each, references=references)
    pairs = {(entry.frame, entry.reference) for entry in entries}
    assert len(pairs) == n_frames * references
    assert {frame for frame, _ in pairs} == set(frames)
    assert n_frames < 3 or {reference for _, reference in pairs} == set(REFERENCES)
    covered = {int(k) for entry in entries for k in entry.samples}
    assert len(covered) == min(count, n_frames * references * each)


def test_a_part_of_the_samples_keeps_their_numbers() -> None:
    samples = draw_samples(arm(), 8, 3)
    part = samples.take([5, 2], 1)
    assert part.index.tolist() == [5, 2]
    assert np.array_equal(part.q[1], samples.q[2])
    assert {entry.frame for entry in part.every_frame} == set(arm().frame_names)


def test_invalid_counts_and_seeds_are_refused() -> None:
    with pytest.raises(ArgumentError, match="samples"):
        draw_samples(arm(), 0, 0)
    with pytest.raises(ArgumentError, match="seed"):
        draw_samples(arm(), 1, -1)
