"""Reference values, and the states at which they are computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import (
    TILTED_GRAVITY,
    draw_states,
    model_without_mimics,
    referee_error,
    reference_values,
)
from dynx.model import Model
from dynx.testing.strategies import models
from tests.rules.documents import case_of, joint, link

BODY = link("arm", center=(0.1, 0.2, 0.3))
PAIR = case_of(
    *(link("base"), BODY, link("hand", center=(0.3, 0.1, 0.2))),
    joint("j", "base", "arm"),
    joint("k", "arm", "hand", '<origin xyz="0.1 0.2 0.3" rpy="1 2 3"/>', '<mimic joint="j"/>'),
)


def test_followers_move_by_themselves_and_gravity_is_tilted() -> None:
    model = model_without_mimics(PAIR.source, "floating")
    assert (model.nv, PAIR.model.nv) == (8, 1)
    assert model.gravity == TILTED_GRAVITY
    assert min(map(abs, TILTED_GRAVITY)) > 0.0


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_torques_and_accelerations_fit_and_no_state_is_balanced(base: str) -> None:
    model = model_without_mimics(PAIR.source, "floating" if base == "floating" else "fixed")
    reference = reference_values(model, draw_states(model, 4, 0))
    size = np.max(np.abs(reference.torque))
    assert np.max(np.abs(reference.required_torque(reference.states.a) - reference.torque)) <= BAR * size
    # Of the robot's own magnitude, for another acceleration than that of the state.
    assert np.min(np.max(np.abs(reference.states.tau - reference.torque), axis=1)) > 1e-3 * size
    assert sorted(map(tuple, reference.states.tau)) == sorted(map(tuple, reference.torque))


def test_the_referee_finds_a_wrong_answer_of_either_kind() -> None:
    model = model_without_mimics(PAIR.source, "fixed")
    reference = reference_values(model, draw_states(model, 2, 0))
    assert referee_error(reference) <= BAR
    for spoiled in (
        replace(reference, torque=1.001 * reference.torque),
        replace(reference, mass_matrix=reference.mass_matrix * 2.0),
    ):
        assert referee_error(spoiled) > 1e-4


@given(models(mimics=False, max_links=5), st.integers(0, 99))
def test_states_keep_away_from_limits(model: Model, seed: int) -> None:
    base = 7 if model.floating else 0
    q = draw_states(model, 5, seed).q[:, base:]
    lower, upper = model.lower[base:], model.upper[base:]
    width = np.where(upper > lower, np.minimum(upper - lower, 1.0), np.inf)
    near = np.maximum(np.abs(lower), np.abs(upper)) > 100.0
    inside = (q > lower + 0.05 * width) & (q < upper - 0.05 * width)
    assert np.all(inside | ~np.isfinite(width) | near)


def test_one_seed_gives_the_same_states_and_another_gives_others() -> None:
    model = model_without_mimics(PAIR.source, "floating")
    one, same, other = (draw_states(model, 3, seed) for seed in (0, 0, 1))
    assert all(np.array_equal(getattr(one, name), getattr(same, name)) for name in ("q", "v", "a", "tau"))
    assert not np.array_equal(one.q, other.q)
