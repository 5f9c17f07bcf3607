"""Laws of mechanics for motions without motors: energy, momentum, the period of a pendulum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

from dynx import ExternalForce
from dynx.backends import backend
from dynx.model.loading import load
from dynx.sim import simulate
from tests.oracles.closed_form import MODELS, G
from tests.oracles.pendulums import Pendulum
from tests.sim.bars import ENERGY, MOMENTUM, tutorial_robot
from tests.sim.rigid_bodies import RIGID_BODIES

START = 1.0
"""Angle [rad] from which the pendulum falls."""


def quarter_off(integrator: str, steps: int, tolerance: float = 1e-10) -> float:
    """Angle left to the lowest point after a quarter of the period, in that many steps [rad]."""
    form = Pendulum
    rate = np.sqrt(form.m * G * form.c / (form.m * form.c**2 + form.inertia))
    # Exact for any amplitude (Landau and Lifshitz, Mechanics, section 11, problem 1).
    quarter = float(ellipk(np.sin(START / 2) ** 2) / rate)
    robot = load(MODELS / "pendulum.urdf")
    rollout = simulate(
        robot,
        q0=[START],
        dt=quarter / steps,
        duration=quarter,
        integrator=integrator,
        rtol=tolerance,
        atol=tolerance / 100,
        **RIGID_BODIES,
    )
    return float(np.abs(rollout.q[-1, 0]))


@pytest.mark.parametrize(("integrator", "order"), [("semi_implicit", 1), ("rk4", 4)])
def test_the_pendulum_is_on_time_to_the_order_of_the_integrator(integrator: str, order: int) -> None:
    coarse, fine = quarter_off(integrator, 50), quarter_off(integrator, 100)
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_the_adaptive_integrator_keeps_its_tolerance() -> None:
    assert quarter_off("adaptive", 1, tolerance=1e-12) < 1e-10


def test_the_energy_of_a_falling_arm_stays() -> None:
    rollout = simulate(tutorial_robot(), q0=np.zeros(6), integrator="rk4", duration=10.0)
    assert np.abs(rollout.v).max() > 5.0
    assert rollout.summary().energy_drift <= ENERGY


@pytest.mark.parametrize("integrator", ["rk4", "adaptive"])
def test_a_free_body_keeps_its_momentum(integrator: str) -> None:
    body = load(MODELS / "free_body.urdf", base="floating").with_gravity(np.zeros(3))
    v0 = [0.3, -0.2, 0.5, 1.4, -0.7, 2.6]
    rollout = simulate(body, v0=v0, integrator=integrator, duration=0.5)
    with backend("reference", body) as engine:
        momentum = engine.centroidal_momentum(rollout.q, rollout.v)
    assert np.abs(np.diff(momentum, axis=0)).max() <= MOMENTUM


@pytest.mark.parametrize("plant", ["pinocchio", "pybullet"])
def test_semi_implicit_euler_keeps_linear_momentum(plant: str) -> None:
    pytest.importorskip(plant)
    body = load(MODELS / "free_body.urdf", base="floating").with_gravity(np.zeros(3))
    rollout = simulate(body, v0=[0.3, -0.2, 0.5, 1.4, -0.7, 2.6], plant=plant, duration=0.5)
    with backend("reference", body) as engine:
        momentum = engine.centroidal_momentum(rollout.q, rollout.v)[:, :3]
    assert np.abs(np.diff(momentum, axis=0)).max() <= MOMENTUM


def test_a_push_gives_its_impulse() -> None:
    body = load(MODELS / "free_body.urdf", base="floating").with_gravity(np.zeros(3))
    force = np.array([2.0, -1.0, 0.5, 0.0, 0.0, 0.0])
    push = ExternalForce(body.root, force, start=0.1, duration=0.2)
    rollout = simulate(body, duration=0.5, pushes=[push])
    with backend("reference", body) as engine:
        momentum = engine.centroidal_momentum(rollout.q, rollout.v)[:, :3]
    assert np.abs(momentum[100]).max() == 0.0
    np.testing.assert_allclose(momentum[-1], 0.2 * force[:3], rtol=0.0, atol=200 * MOMENTUM)


def test_damping_takes_the_energy_it_should() -> None:
    """What the damper takes is d v^2 over time; the rest of the balance is exact to the integrator."""
    robot = load(MODELS / "pendulum.urdf")
    d = 0.3
    options = RIGID_BODIES | {"joint_damping": d}
    rollout = simulate(robot, q0=[START], integrator="adaptive", duration=2.0, **options)
    power = d * rollout.v[:, 0] ** 2
    lost = float(np.sum(0.5 * (power[1:] + power[:-1])) * 1e-3)
    assert rollout.energy[0] - rollout.energy[-1] == pytest.approx(lost, rel=1e-5)


def test_dry_friction_holds_a_joint_that_is_pushed_less() -> None:
    robot = load(MODELS / "pendulum.urdf")
    weight = Pendulum.m * G * Pendulum.c * np.sin(0.1)
    options = RIGID_BODIES | {"q0": [0.1], "friction_slip": 0.01, "duration": 1.0}
    held, slips = (simulate(robot, **options | {"joint_friction": share * weight}) for share in (2.0, 0.5))
    # It creeps at the speed at which the regularised friction balances the weight.
    assert np.abs(held.v).max() <= 0.01 * np.arctanh(0.5) * 1.001
    assert np.abs(slips.v).max() > 0.05
