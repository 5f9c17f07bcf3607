from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement import tolerances
from dynx.agreement.identities import MAX_REST_FREQUENCY, WEIGHTS, time_derivative
from dynx.agreement.magnitudes import EPS


@given(st.floats(0.0, 50.0), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_a_band_limited_function_is_differentiated_to_the_stated_error(
    frequency: float, phase: float, share: float
) -> None:
    lower = share * frequency
    rate = time_derivative(
        lambda t: np.sin(frequency * t + phase) + np.cos(lower * t), np.array([frequency, frequency])
    )
    exact = frequency * np.cos(phase)
    assert np.all(np.abs(rate - exact) <= 2.0 * max(frequency, MAX_REST_FREQUENCY) * tolerances.derivative(0))


def test_the_weights_differentiate_polynomials_of_their_order_exactly() -> None:
    for power in (1, 3, 5, 7):
        total = sum(2.0 * weight * k**power for k, weight in WEIGHTS.items())
        assert abs(total - (1.0 if power == 1 else 0.0)) <= EPS * 4**power


def test_the_stated_cancellation_is_that_of_the_weights() -> None:
    assert 2.0 * sum(abs(weight) for weight in WEIGHTS.values()) <= tolerances.CANCELLATION


def test_shapes() -> None:
    rate = time_derivative(lambda t: t[..., None, None] * np.ones((3, 2)), np.array([1.0, 2.0]))
    assert rate.shape == (2, 3, 2)
