"""Equal torques move a robot alike in every plant with the same integration scheme."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dynx.backends import backend, installed_backends
from dynx.control import ComputedTorque, OpenLoop
from dynx.errors import EngineLimitError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Rollout, simulate
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from dynx.trajectory import cycloidal
from tests.sim.bars import PLANTS_AGREE, apart

pytestmark = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
STEPS = 2000
DT = 1e-3


def both(model: Model, torques: Floats, q0: Floats, v0: Floats) -> tuple[Rollout, Rollout]:
    """On PyBullet's own stepper and on dynx's over Pinocchio."""
    law = OpenLoop(model, torques, control_dt=DT)
    by_bullet, by_dynx = (
        simulate(model, law, plant=plant, duration=len(torques) * DT, dt=DT, q0=q0, v0=v0)
        for plant in ("pybullet", "pinocchio")
    )
    return by_bullet, by_dynx


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_an_arm_under_the_torques_of_a_motion(name: str) -> None:
    """Replayed without feedback, so that nothing draws the two together."""
    model = load(name)
    middle = np.clip(0.5 * (np.maximum(model.lower, -3) + np.minimum(model.upper, 3)), -3, 3)
    motion = cycloidal(middle, model.clip(middle + 0.3), duration=STEPS * DT)
    law = ComputedTorque(model, kp=0.0, kd=0.0)
    torques = simulate(model, law, motion, duration=STEPS * DT, check_reference=False).tau
    by_bullet, by_dynx = both(model, torques, motion.start.q, motion.start.v)
    assert len(by_bullet) == STEPS
    assert apart(by_bullet.q, by_dynx.q) <= PLANTS_AGREE
    assert apart(by_bullet.v, by_dynx.v) <= PLANTS_AGREE


@pytest.mark.parametrize("name", ["solo12", "a1"])
def test_a_quadruped_that_falls_and_turns_and_moves_its_legs(name: str) -> None:
    model = load(name, base="floating")
    k = np.arange(STEPS)[:, None]
    legs = 0.02 * np.sin(0.01 * k + np.arange(model.nv - 6))
    # A wrench on the base, too: its way into Bullet is one of its own.
    wrench = 0.05 * np.cos(0.02 * k + np.arange(6))
    v0 = np.zeros(model.nv)
    v0[:6] = [0.3, -0.2, 0.5, 0.4, -0.7, 0.6]
    by_bullet, by_dynx = both(model, np.concatenate([wrench, legs], axis=1), model.neutral(), v0)
    assert np.abs(by_dynx.q[-1] - by_dynx.q[0])[7:].max() > 1.0
    assert apart(by_bullet.q, by_dynx.q) <= PLANTS_AGREE
    assert apart(by_bullet.v, by_dynx.v) <= PLANTS_AGREE
    assert apart(by_bullet.a, by_dynx.a) <= PLANTS_AGREE


@given(models(solvable=True, max_links=5), st.integers(0, 2**32 - 1))
def test_random_robots(model: Model, seed: int) -> None:
    assume(model.nv)
    rng = np.random.default_rng(seed)
    q0, v0 = model.random(rng), rng.uniform(-1.0, 1.0, model.nv)
    with backend("reference", model) as engine:
        torque = engine.inverse_dynamics(q0, v0, rng.uniform(-3.0, 3.0, model.nv))
    try:
        by_bullet, by_dynx = both(model, np.tile(torque, (50, 1)), q0, v0)
    except EngineLimitError:
        assume(False)
    assert apart(by_bullet.q, by_dynx.q) <= PLANTS_AGREE
