"""Errors of sensors: their statistics, their order, and on what their random numbers depend."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, GainError
from dynx.spatial.scalar import Floats
from dynx.world import SensorErrors
from dynx.world.sensors.errors import SampleNumbers, apply_errors

N = 100_000
SIGMAS = 4.0


def readings(
    errors: SensorErrors, true: Floats, period: float = 0.01, name: str = "gyro", seed: int = 3
) -> Floats:
    """Return the readings (n, m) of the true values in the first n samples."""
    samples = np.arange(len(true))
    numbers = SampleNumbers(name, seed, 0, true.shape[1])
    return apply_errors({"rate": errors}, {"rate": true}, samples, period, numbers)["rate"]


def refuse_correlation(x: Floats, y: Floats) -> None:
    """The correlation of n independent pairs has the deviation 1 / sqrt(n)."""
    correlation = np.corrcoef(x, y)[0, 1]
    assert abs(correlation) < SIGMAS / math.sqrt(len(x))


def has_deviation(x: Floats, sigma: float) -> None:
    """The mean of n normal numbers has the deviation sigma / sqrt(n), their variance sigma^2 sqrt(2 / n)."""
    n = len(x)
    assert abs(x.mean()) < SIGMAS * sigma / math.sqrt(n)
    assert abs(x.var() - sigma**2) < SIGMAS * sigma**2 * math.sqrt(2.0 / n)


@pytest.mark.parametrize("per_sample", [True, False])
def test_white_noise_has_its_mean_variance_and_no_correlation(per_sample: bool) -> None:
    """In time, between components, between channels, between sensors, seeds and rollouts."""
    rate, sigma = 200.0, np.array([0.02, 0.5, 3.0])
    errors = SensorErrors(noise=sigma) if per_sample else SensorErrors(noise_density=sigma / math.sqrt(rate))
    true = np.full((N, 3), 7.0)
    found = readings(errors, true, 1.0 / rate) - true
    for k in range(3):
        has_deviation(found[:, k], float(sigma[k]))
        refuse_correlation(found[1:, k], found[:-1, k])
        refuse_correlation(found[:, k], found[:, (k + 1) % 3])
    for other in (
        readings(errors, true, 1.0 / rate, "gyra"),
        readings(errors, true, 1.0 / rate, seed=4),
    ):
        refuse_correlation(found[:, 0], other[:, 0] - true[:, 0])
    two = {name: np.zeros((N, 3)) for name in ("force", "torque")}
    both = apply_errors(
        dict.fromkeys(two, errors), two, np.arange(N), 1.0 / rate, SampleNumbers("ft", 0, 0, 6)
    )
    refuse_correlation(both["force"][:, 0], both["torque"][:, 0])


def test_the_bias_walks_with_its_density() -> None:
    """Its increments are white with random_walk sqrt(T), so that it spreads as random_walk sqrt(t)."""
    period, density = 0.005, 0.3
    found = readings(SensorErrors(random_walk=density), np.zeros((N, 2)), period)
    np.testing.assert_array_equal(found[0], 0.0)
    steps = np.diff(found, axis=0)
    for k in range(2):
        has_deviation(steps[:, k], density * math.sqrt(period))
        refuse_correlation(steps[1:, k], steps[:-1, k])
    refuse_correlation(steps[:, 0], steps[:, 1])
    # Over 1000 samples: 99 disjoint spans.
    spans = found[1000::1000] - found[:-1000:1000][: len(found[1000::1000])]
    has_deviation(spans[:, 0], density * math.sqrt(1000 * period))
    # White noise beside it does not follow it.
    both = readings(SensorErrors(random_walk=density, noise=0.1), np.zeros((N, 2)), period)
    white = both - found
    has_deviation(white[:, 0], 0.1)
    refuse_correlation(white[1:, 0], steps[:, 0])


@given(
    st.lists(st.integers(0, 700), min_size=1, max_size=12, unique=True),
    st.booleans(),
    st.integers(0, 2**64 - 1),
)
def test_a_sample_has_its_numbers_in_whatever_order_it_is_read(
    samples: list[int], walks: bool, lane: int
) -> None:
    errors = {"force": SensorErrors(noise=1.0, random_walk=0.5 if walks else 0.0)}
    whole = apply_errors(
        errors, {"force": np.zeros((701, 3))}, np.arange(701), 0.01, SampleNumbers("ft", 5, lane, 3)
    )["force"]
    numbers = SampleNumbers("ft", 5, lane, 3)
    for sample in samples:
        one = apply_errors(errors, {"force": np.zeros((1, 3))}, np.array([sample]), 0.01, numbers)["force"]
        np.testing.assert_array_equal(one[0], whole[sample])


@given(
    st.lists(st.floats(-50.0, 50.0), min_size=3, max_size=3),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
    st.floats(-0.2, 0.2),
    st.floats(-0.1, 0.1),
    st.floats(0.01, 2.0),
    st.floats(1.0, 40.0),
)
def test_scale_misalignment_and_bias_come_before_rounding_and_saturation(
    x: list[float], bias: list[float], scale: float, cross: float, step: float, most: float
) -> None:
    errors = SensorErrors(bias=bias, scale=scale, cross_axis=cross, resolution=step, saturation=most)
    (found,) = readings(errors, np.array([x]))
    for k in range(3):
        others = sum(x) - x[k]
        exact = (1.0 + scale) * x[k] + cross * others + bias[k]
        assert abs(found[k]) <= most
        if abs(found[k]) < most:
            assert abs(found[k] - exact) <= 0.5 * step * (1.0 + 1e-9) + 1e-12
            assert abs(found[k] / step - round(found[k] / step)) < 1e-9
        else:
            assert abs(exact) >= most - 0.5 * step - 1e-9


def test_a_matrix_of_cross_axis_errors_has_a_row_for_each_component_read() -> None:
    errors = SensorErrors(cross_axis=[[0.0, 0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.2, 0.0]])
    (found,) = readings(errors, np.array([[0.0, 1.0, 0.0]]))
    np.testing.assert_allclose(found, [0.1, 1.0, 0.2], rtol=0, atol=1e-15)


def test_without_errors_a_reading_is_the_true_value_to_the_last_bit() -> None:
    true = np.random.default_rng(0).normal(size=(10, 3))
    np.testing.assert_array_equal(readings(SensorErrors(), true), true)


@pytest.mark.parametrize(
    ("given", "kind", "says"),
    [
        ({"noise": -1.0}, GainError, "noise of a sensor is -1.0; wanted numbers of at least 0"),
        ({"bias": math.nan}, GainError, "bias of a sensor is nan; wanted finite numbers"),
        ({"noise": 1.0, "noise_density": 1.0}, ArgumentError, "wanted one of them"),
        ({"cross_axis": np.eye(3)}, ArgumentError, "wanted zeros"),
        ({"resolution": "fine"}, ArgumentError, "resolution has dtype"),
    ],
)
def test_invalid_errors_are_refused(given: dict[str, object], kind: type[Exception], says: str) -> None:
    with pytest.raises(kind, match=says):
        SensorErrors(**given)  # type: ignore[arg-type]


def test_errors_that_do_not_fit_the_components_are_refused() -> None:
    with pytest.raises(GainError, match=r"bias of gyro has shape \(2,\); wanted one number or 3"):
        SensorErrors(bias=[1.0, 2.0]).require("gyro", 3)
    with pytest.raises(GainError, match=r"cross_axis of the encoder is 0.1; wanted 0, because it"):
        SensorErrors(cross_axis=0.1).require("the encoder", 1)
