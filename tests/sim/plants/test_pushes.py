"""A push gives its impulse at any time, for any duration and step, in every plant and in batches."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import ExternalForce
from dynx.backends import installed_backends
from dynx.control import PD
from dynx.sim import ScenePlant, simulate, simulate_batch
from dynx.steppers.registry import installed_worlds
from dynx.world import Scene, SceneRobot
from tests.backends.robots import chain

SLIDER = chain(1, "prismatic").with_gravity(np.zeros(3))
"""One kilogram on a straight line, so that the final speed is the impulse."""
IDLE = PD(SLIDER, kp=0.0, kd=0.0)
AXIS = np.asarray(SLIDER.joints[0].axis)
TIME = 0.06
"""Simulated time [s], which no push below exceeds."""
PLANTS = [
    ("compiled", "semi_implicit"),
    ("compiled", "rk4"),
    ("compiled", "adaptive"),
    *[
        pytest.param(plant, scheme, marks=pytest.mark.skipif(plant not in installed_backends(), reason=plant))
        for plant, scheme in (("pinocchio", "semi_implicit"), ("pybullet", "engine"))
    ],
]

starts = st.one_of(st.floats(0.0, 0.03), st.integers(0, 30).map(lambda k: k * 1e-3))
durations = st.one_of(st.floats(1e-9, 0.03), st.integers(1, 30).map(lambda k: k * 1e-3))
steps = st.sampled_from([1e-3, 7e-4, 3e-3, 0.01, 0.02, 1 / 240, TIME])


def pushed(force: float, start: float, duration: float) -> ExternalForce:
    """Return a push along the slider."""
    return ExternalForce("link1", np.concatenate([force * AXIS, np.zeros(3)]), start, duration)


@pytest.mark.parametrize(("plant", "integrator"), PLANTS)
@given(start=starts, duration=durations, dt=steps, substeps=st.integers(1, 3))
def test_the_impulse_is_exact_on_every_plant(
    plant: str, integrator: str, start: float, duration: float, dt: float, substeps: int
) -> None:
    push = pushed(3.0 / duration, start, duration)
    rollout = simulate(
        SLIDER,
        plant=plant,
        integrator=integrator,
        pushes=[push],
        dt=dt,
        duration=TIME,
        substeps=substeps,
    )
    assert rollout.v[-1, 0] == pytest.approx(3.0, rel=1e-7)
    speed = np.interp(rollout.t, [start, start + duration], [0.0, 3.0])
    np.testing.assert_allclose(rollout.v[:, 0], speed, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("engine", installed_worlds())
@pytest.mark.parametrize("substeps", [1, 4])
@pytest.mark.parametrize("dt", [0.01, 0.02])
@pytest.mark.parametrize(
    ("start", "duration"), [(0.0, 0.005), (0.0125, 0.003), (0.0199, 2e-4), (0.004, 0.03)], ids=str
)
def test_the_impulse_is_exact_in_a_scene(
    engine: str, substeps: int, dt: float, start: float, duration: float
) -> None:
    scene = Scene("s", robots=(SceneRobot("slider", SLIDER),), gravity=(0.0, 0.0, 0.0))
    rollout = simulate(
        SLIDER,
        plant=ScenePlant(scene, engine=engine),
        pushes=[pushed(3.0 / duration, start, duration)],
        dt=dt,
        duration=TIME,
        substeps=substeps,
    )
    assert rollout.v[-1, 0] == pytest.approx(3.0, rel=1e-9)


@given(start=starts, duration=durations, dt=steps)
def test_the_impulse_is_exact_in_a_batch(start: float, duration: float, dt: float) -> None:
    push = pushed(3.0 / duration, start, duration)
    many = simulate_batch(
        SLIDER, IDLE, SLIDER.neutral(), pushes=[push], dt=dt, duration=TIME, rollouts=2, record_every=1
    )
    one = simulate(SLIDER, IDLE, SLIDER.neutral(), plant="compiled", pushes=[push], dt=dt, duration=TIME)
    assert many.v[0, 0] == pytest.approx(3.0, rel=1e-7)
    np.testing.assert_allclose(many.v_record[1], one.v[1:], rtol=0.0, atol=1e-12)


@given(
    k=st.integers(0, 10**5), n=st.integers(1, 1000), dt=st.sampled_from([1e-4, 1 / 240, 1e-3, 0.002, 0.01])
)
def test_a_push_on_the_grid_acts_in_whole_steps(k: int, n: int, dt: float) -> None:
    push = ExternalForce("link1", np.ones(6), k * dt, n * dt)
    for step, share in ((k - 1, 0.0), (k, 1.0), (k + n - 1, 1.0), (k + n, 0.0)):
        assert push.share(step * dt, dt) == share


@given(start=st.floats(0.0, 1000.0), duration=st.floats(1e-9, 100.0), dt=st.floats(1e-4, 0.1))
def test_the_shares_of_a_push_add_up_to_its_duration(start: float, duration: float, dt: float) -> None:
    push = ExternalForce("link1", np.ones(6), start, duration)
    first, last = int(start // dt) - 2, int((start + duration) // dt) + 3
    if last - first > 10**4:
        return
    shares = [push.share(k * dt, dt) for k in range(first, last)]
    assert 0.0 <= min(shares) <= max(shares) <= 1.0
    rounding = 4.0 * np.spacing(abs(start) + duration + dt) * len(shares)
    assert sum(shares) * dt == pytest.approx(duration, rel=2e-6, abs=rounding)


def test_a_push_without_an_end_acts_until_the_end() -> None:
    rollout = simulate(SLIDER, pushes=[pushed(2.0, 0.0105, np.inf)], duration=0.02)
    assert rollout.v[-1, 0] == pytest.approx(2.0 * 0.0095, rel=1e-9)
