"""Excitation: harmonics, rest at the ends, limits at all times, condition number."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Joint, Limits, Link, Model
from dynx.spatial.scalar import Floats
from dynx.trajectory import Identifiability, Trajectory, cycloidal, excitation
from tests.trajectory.motions import REACH, hundredths, ur5

EPS = float(np.finfo(np.float64).eps)
MAX_LOSS = 1.0 / np.cos(np.pi / 128.0) - 1.0
"""Fraction of a limit lost to the bound between samples, 0.03 %."""


def slides(*limits: Limits) -> Model:
    """Build a chain of prismatic joints."""
    links = [Link(f"link{k}") for k in range(len(limits) + 1)]
    joints = [
        Joint(f"joint{k}", "prismatic", f"link{k}", f"link{k + 1}", limits=limit)
        for k, limit in enumerate(limits)
    ]
    return Model.build("slides", links, joints)


@st.composite
def robots(draw: st.DrawFn) -> Model:
    def limit() -> Limits:
        middle, half = draw(hundredths(-2.0, 2.0)), draw(hundredths(0.1, 2.0))
        return Limits(middle - half, middle + half, draw(hundredths(0.1, 3.0)))

    return slides(*(limit() for _ in range(draw(st.integers(1, 3)))))


@given(
    robots(),
    hundredths(0.5, 20.0),
    st.integers(3, 7),
    st.integers(0, 1000),
    st.one_of(st.none(), hundredths(0.2, 5.0)),
)
def test_limits_hold_and_each_joint_reaches_one(
    model: Model, duration: float, harmonics: int, seed: int, acceleration: float | None
) -> None:
    motion = excitation(model, duration, harmonics=harmonics, rng=seed, acceleration=acceleration)
    q, v, a = motion(np.linspace(0.0, duration, 2000))
    assert (q <= model.upper + 8.0 * EPS).all()
    assert (q >= model.lower - 8.0 * EPS).all()
    assert (np.abs(v) <= model.velocity_limit).all()
    highest = np.inf if acceleration is None else acceleration
    assert (np.abs(a) <= highest).all()
    half, middle = 0.5 * (model.upper - model.lower), 0.5 * (model.upper + model.lower)
    touched = np.max(
        [
            np.abs(q - middle).max(axis=0) / half,
            np.abs(v).max(axis=0) / model.velocity_limit,
            np.abs(a).max(axis=0) / highest,
        ],
        axis=0,
    )
    # Twice the loss, as the bound is about the middle of the range, plus what 2000 samples miss.
    missed = 0.5 * (2.0 * np.pi * harmonics / 2000.0) ** 2
    assert (touched >= 1.0 - 2.0 * MAX_LOSS - missed).all()


@given(robots(), hundredths(0.5, 20.0), st.integers(3, 7), st.integers(0, 1000))
def test_rest_at_the_ends_and_only_the_stated_harmonics(
    model: Model, duration: float, harmonics: int, seed: int
) -> None:
    motion = excitation(model, duration, harmonics=harmonics, rng=seed)
    for end in (motion.inside(np.array([0.0])), motion.inside(np.array([duration]))):
        assert np.abs(end.q[0] - motion.start.q).max() <= 64.0 * EPS * 4.0
        assert np.abs(end.v).max() <= 256.0 * EPS * model.velocity_limit.max()
        size = np.abs(motion(np.linspace(0.0, duration, 500)).a).max()
        assert np.abs(end.a).max() <= 256.0 * EPS * size
    samples = motion(np.arange(64) * duration / 64.0).q
    spectrum = np.abs(np.fft.rfft(samples, axis=0))
    assert spectrum[harmonics + 1 :].max() <= 1e3 * EPS * spectrum.max()
    assert (spectrum[1 : harmonics + 1].max(axis=1) > 1e3 * EPS * spectrum.max()).all()


def test_equal_seeds_give_equal_motions() -> None:
    def at(seed: int) -> Floats:
        return excitation(ur5(), 10.0, rng=seed)(3.3).q

    np.testing.assert_array_equal(at(5), at(5))
    assert not np.array_equal(at(5), at(6))


def test_the_best_candidate_is_returned() -> None:
    """The best has the smallest condition number of the stacked regressor."""
    model = dynx.load("planar_2r")
    with Identifiability(model) as measure:
        rng = np.random.default_rng(3)
        alone = [
            measure.condition_number(excitation(model, 5.0, rng=rng, acceleration=20.0)) for _ in range(4)
        ]
        best = excitation(model, 5.0, rng=np.random.default_rng(3), acceleration=20.0, candidates=4)
        assert measure.condition_number(best) == min(alone) < max(alone)


def stacked_regressor(model: Model, motion: Trajectory) -> Floats:
    with dynx.backend("reference", model) as engine:
        Y = engine.inertial_regressor(*motion(np.linspace(0.0, motion.duration, 200)))
    return Y.reshape(-1, Y.shape[-1])


@pytest.mark.parametrize("seed", [0, 1])
def test_the_condition_number_is_that_of_the_regressor(seed: int) -> None:
    motion = excitation(ur5(), 10.0, q0=REACH, rng=seed)
    sizes = np.linalg.svd(stacked_regressor(ur5(), motion), compute_uv=False)
    with Identifiability(ur5()) as measure:
        # UR5 has 36 base parameters (Khalil and Dombre: 10 n minus 3 per joint, minus those of the first).
        assert measure.identifiable == 36
        wanted = sizes[0] / sizes[35]
        # The matrices differ by rounding, which the condition number amplifies.
        assert measure.condition_number(motion) == pytest.approx(wanted, rel=1e4 * EPS * wanted)


def test_a_constant_configuration_is_less_informative() -> None:
    model = dynx.load("planar_2r")
    q = np.zeros(model.nq)
    with Identifiability(model) as measure:
        still = measure.condition_number(cycloidal(q, q, 1.0))
        moving = measure.condition_number(excitation(model, 5.0, acceleration=20.0))
    assert still > 1e6 * moving
