"""Springs of joints in simulations: closed forms on every plant, batches, energy, and steps too long."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.control import PD
from dynx.control.base import Measurement
from dynx.errors import DivergedError
from dynx.model import JointDynamics, Model
from dynx.sim import simulate, simulate_batch
from dynx.sim.plants.disturbances import Disturbances
from dynx.trajectory.base import Setpoint
from tests.backends.robots import mixed_robot
from tests.backends.test_joint_dynamics import sliding_mass
from tests.sim.plants.test_joint_dynamics import every_plant

H = 1e-3
SPRING = sliding_mass(stiffness=50.0, spring_reference=0.3)
"""A mass on a spring: 5 rad/s about 0.3 m."""


def sprung(base: str = "fixed") -> Model:
    """Return a robot with every kind of joint, a mimic joint and springs beside all other joint dynamics."""
    model = mixed_robot(base, mimic=True)
    rng = np.random.default_rng(4)
    joints = tuple(
        replace(each, dynamics=JointDynamics(0.1, 0.05, 0.02, *rng.uniform((1.0, -0.5), (5.0, 0.5)).tolist()))
        for each in model.joints
    )
    return replace(model, joints=joints)


def test_a_mass_on_a_spring_swings_with_its_period() -> None:
    """Euler's method, that of all steps here, has the angle acos(1 - w^2 h^2 / 2) per step exactly."""
    angle = np.arccos(1.0 - 0.5 * 25.0 * H * H)
    # q[k] with q[0] = q0 and v[0] = 0 is a sum of two turning pointers.
    k = np.arange(1001)
    factor = (1.0 - 25.0 * H * H - np.cos(angle)) / np.sin(angle)
    exact = 0.3 - 0.2 * (np.cos(angle * k) + factor * np.sin(angle * k))
    smooth = 0.3 - 0.2 * np.cos(5.0 * H * k)
    for name, plant in every_plant(SPRING, 0.1).items():
        found = simulate(SPRING, q0=[0.1], duration=1.0, dt=H, **plant).q[:, 0]
        euler = plant.get("integrator") not in ("rk4", "adaptive")
        np.testing.assert_allclose(found, exact if euler else smooth, rtol=0.0, atol=1e-9, err_msg=name)
        still = simulate(SPRING, q0=[0.1], duration=0.1, dt=H, joint_springs=False, **plant)
        np.testing.assert_allclose(still.q, 0.1, rtol=0.0, atol=1e-12, err_msg=name)


def test_a_spring_is_stretched_by_a_weight() -> None:
    """Damped, a mass of 2 kg at 50 N/m comes to rest 2 * 5 / 50 m beyond the reference."""
    model = sliding_mass(stiffness=50.0, spring_reference=0.3, damping=20.0).with_gravity((5.0, 0.0, 0.0))
    for name, plant in every_plant(model, 0.3).items():
        found = simulate(model, q0=[0.3], duration=8.0, dt=4e-3, **plant)
        assert found.q[-1, 0] == pytest.approx(0.5, abs=1e-9), name
    batch = simulate_batch(model, PD(model, kp=0.0, kd=0.0), [0.3], rollouts=2, duration=8.0, dt=4e-3)
    np.testing.assert_allclose(batch.q, 0.5, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_plants_and_batches_move_alike(base: str) -> None:
    model = sprung(base)
    rng = np.random.default_rng(9)
    start: dict[str, Any] = {"q0": model.random(rng), "v0": 0.5 * rng.standard_normal(model.nv)}
    options: dict[str, Any] = {**start, "duration": 0.2, "dt": H, "check_reference": False}
    law = PD(model, kp=0.0, kd=0.0)
    exact = simulate(model, law, model.neutral(), plant="reference", **options)
    without = simulate(model, law, model.neutral(), plant="reference", joint_springs=False, **options)
    assert np.abs(exact.q[-1] - without.q[-1]).max() > 1e-3
    for plant in ("compiled", "pinocchio"):
        found = simulate(model, law, model.neutral(), plant=plant, **options)
        np.testing.assert_allclose(found.q, exact.q, rtol=0.0, atol=1e-10)
        assert found.energy == pytest.approx(exact.energy, abs=1e-9)
    batch = simulate_batch(model, law, model.neutral(), rollouts=2, **options)
    np.testing.assert_allclose(batch.q[0], exact.q[-1], rtol=0.0, atol=1e-10)
    parametric = dynx.parametric(model, joint_dynamics=True)
    batch = simulate_batch(model, law, model.neutral(), rollouts=2, parametric=parametric, **options)
    np.testing.assert_allclose(batch.q[0], exact.q[-1], rtol=0.0, atol=1e-10)


def test_energy_has_that_of_the_springs() -> None:
    joints = tuple(
        replace(each, dynamics=JointDynamics(0.0, 0.0, 0.02, each.dynamics.stiffness, 0.3))
        for each in sprung().joints
    )
    model = replace(sprung(), joints=joints)
    found = simulate(model, q0=model.neutral(), duration=0.5, plant="pinocchio", integrator="adaptive")
    assert np.ptp(found.energy) < 1e-8
    assert np.ptp(found.kinetic_energy) > 0.1


def test_controllers_that_know_joint_dynamics_know_springs() -> None:
    model = sprung()
    q = model.random(np.random.default_rng(2))
    known: dict[str, Any] = {"joint_dynamics": True}
    laws = [
        control.ComputedTorque(model, natural_frequency=20.0, **known),
        control.GravityCompensatedPD(model, kp=30.0, kd=5.0, **known),
        control.FeedForward(model, **known),
    ]
    for law in laws:
        tau, _ = law.torque(
            Measurement(0.0, q, np.zeros(model.nv)),
            Setpoint(q, np.zeros(model.nv), np.zeros(model.nv)),
            law.initial_state(),
        )
        with dynx.backend("reference", model) as engine:
            rest = np.zeros(model.nv)
            wanted = engine.inverse_dynamics(q, rest, rest, joint_dynamics=True)
        np.testing.assert_allclose(tau, wanted, rtol=0.0, atol=1e-11)


def test_an_observer_takes_springs_for_no_external_torque() -> None:
    law = PD(SPRING, kp=0.0, kd=0.0)
    rollout = simulate(SPRING, law, [0.0], q0=[0.1], duration=1.0, dt=1e-4)
    log = (rollout.t, rollout.q, rollout.v, rollout.tau)
    assert np.abs(control.MomentumObserver(SPRING, gain=50.0).residuals(*log)).max() < 0.02
    blind = control.MomentumObserver(SPRING, gain=50.0, joint_springs=False)
    assert np.abs(blind.residuals(*log)).max() > 5.0


def test_torque_for_plants_of_others_has_springs() -> None:
    with dynx.backend("reference", SPRING) as engine:
        found = Disturbances(SPRING).torque(engine, 0.0, np.array([0.1]), np.zeros(1))
    assert found == pytest.approx([10.0])


def test_a_step_too_long_for_a_spring_is_noted() -> None:
    """h^2 k / m is 4 at h = 0.4 s: the motion is bounded below it, and grows above."""
    for dt, stable in ((0.39, True), (0.41, False)):
        for plant in ("pinocchio", "compiled"):
            try:
                found = simulate(SPRING, q0=[0.2], duration=60.0 * dt, dt=dt, plant=plant, joint_limits=False)
                notes: tuple[str, ...] = found.notes
                assert bool(np.abs(found.q).max() < 5.0) == stable
            except DivergedError as error:
                assert not stable
                notes = (str(error),)
            assert any("the spring of 'slide' is stiff" in note for note in notes) != stable
    loose = simulate(SPRING, q0=[0.2], duration=2.0, dt=0.41, plant="pinocchio", integrator="rk4")
    assert not any("stiff" in note for note in loose.notes)
