"""Distributions of parameters, and draws that depend on their environment alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.envs import Randomization
from dynx.envs.randomization import Draws, parameters_of, read_distribution
from dynx.steppers.random import Streams


@given(
    seed=st.integers(0, 2**70),
    count=st.integers(1, 9),
    first=st.integers(0, 8),
    block=st.integers(0, 2**40),
    low=st.floats(0.1, 1.0),
    high=st.floats(1.0, 3.0),
)
@settings(max_examples=40, deadline=None)
def test_a_draw_depends_on_its_environment_alone(
    seed: int, count: int, first: int, block: int, low: float, high: float
) -> None:
    given_ranges = Randomization(mass_scale={"a": (low, high)}, delay={"log_uniform": (low, high)})
    alone = Randomization(delay={"log_uniform": (low, high)})
    draws, fewer = (Draws(parameters_of(each, ("mass_scale", "delay"))) for each in (given_ranges, alone))
    streams, part = (
        Streams(*range(seed, seed + first + count)),
        Streams(*range(seed + first, seed + first + count)),
    )
    for row in range(count):
        values = draws.values(streams, first + row, block)
        assert np.array_equal(values, draws.values(part, row, block))
        assert np.array_equal(values[:, 1:], fewer.values(streams, first + row, block))
        assert (values >= low * (1.0 - 1e-15)).all()
        assert (values <= high * (1.0 + 1e-15)).all()


def test_a_normal_distribution_is_clamped() -> None:
    found = read_distribution("delay", {"normal": (1.0, 0.1)})
    numbers = found.numbers(np.random.default_rng(0).standard_normal(20_000))
    assert found.bounds == pytest.approx((0.7, 1.3))
    assert numbers.min() >= 0.7 - 1e-12
    assert numbers.max() <= 1.3 + 1e-12
    assert numbers.std() == pytest.approx(0.1, rel=0.03)
