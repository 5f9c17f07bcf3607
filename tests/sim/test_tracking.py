"""Closed loops follow the tutorial's motion, on every plant, as closely as they are said to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.control import (
    ComputedTorque,
    DiscreteComputedTorque,
    FeedForward,
    FrictionCompensation,
    GravityCompensatedPD,
    OperationalSpace,
)
from dynx.sim import Payload, simulate
from tests.sim.bars import EXACT_ON_BULLET, EXACT_ON_DYNX, TRACKING, tutorial_motion, tutorial_robot

needs_bullet = pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
PLANTS = [pytest.param("pybullet", marks=needs_bullet), "pinocchio"]
QUICK = [name for name in installed_backends() if name != "reference"]


@pytest.mark.parametrize("plant", PLANTS)
def test_computed_torque_follows_the_tutorial_s_motion(plant: str) -> None:
    robot = tutorial_robot()
    rollout = simulate(robot, ComputedTorque(robot, kp=400, kd=40), tutorial_motion(), plant=plant)
    assert np.abs(rollout.error).max() <= TRACKING
    assert np.abs(rollout.q[-1] - tutorial_motion().end.q).max() <= TRACKING


@pytest.mark.parametrize("plant", PLANTS)
def test_the_discrete_law_leaves_no_error(plant: str) -> None:
    robot = tutorial_robot()
    rollout = simulate(robot, DiscreteComputedTorque(robot, control_dt=1e-3), tutorial_motion(), plant=plant)
    assert np.abs(rollout.error).max() <= (EXACT_ON_BULLET if plant == "pybullet" else EXACT_ON_DYNX)


@pytest.mark.parametrize("plant", PLANTS)
def test_the_discrete_law_makes_up_for_an_error_in_one_step(plant: str) -> None:
    robot, motion = tutorial_robot(), tutorial_motion(0.5)
    law = DiscreteComputedTorque(robot, control_dt=1e-3)
    away = motion.start.q + np.array([0.01, -0.02, 0.01, 0.02, -0.01, 0.03])
    rollout = simulate(robot, law, motion, plant=plant, q0=away, duration=0.01, check_reference=False)
    assert np.abs(rollout.error[0]).max() > 0.02
    assert np.abs(rollout.error[1:]).max() <= EXACT_ON_BULLET


@pytest.mark.parametrize("plant", PLANTS)
def test_friction_that_is_compensated_leaves_no_error(plant: str) -> None:
    robot = tutorial_robot()
    friction = 0.5
    exact = DiscreteComputedTorque(robot, control_dt=1e-3)
    # The setpoint is that of the end of the step, at which dry friction acts.
    law = FrictionCompensation(exact, damping=False, friction=friction, slip=0.0, speed="setpoint")
    without, rollout = (
        simulate(robot, law, tutorial_motion(), plant=plant, duration=0.3, joint_friction=friction)
        for law in (exact, law)
    )
    assert np.abs(rollout.error).max() <= EXACT_ON_BULLET < np.abs(without.error).max()


@pytest.mark.parametrize("engine", QUICK)
def test_any_engine_may_be_plant_or_controller(engine: str) -> None:
    robot = tutorial_robot()
    law = DiscreteComputedTorque(robot, control_dt=1e-3)
    for plant, controller in ((engine, "pinocchio"), ("pinocchio", engine)):
        rollout = simulate(
            robot,
            law,
            tutorial_motion(),
            plant=plant,
            controller_backend=controller,
            integrator="semi_implicit",
            duration=0.05,
        )
        assert np.abs(rollout.error).max() <= EXACT_ON_DYNX


def test_laws_that_know_less_follow_less_closely() -> None:
    """Feedback on the full model beats a PD that knows the weight, and feed-forward sits between them."""
    robot, motion = tutorial_robot(), tutorial_motion()
    gains: dict[str, Any] = {"kp": [800, 800, 400, 50, 50, 20], "kd": [80, 80, 40, 5, 5, 2]}
    laws = [
        ComputedTorque(robot, kp=400, kd=40),
        FeedForward(robot, **gains),
        GravityCompensatedPD(robot, **gains),
    ]
    errors = [float(np.abs(simulate(robot, law, motion, dt=2e-3).error).max()) for law in laws]
    assert errors == sorted(errors)
    assert errors[-1] < 0.2


def test_a_frame_follows_where_the_joints_lead_it() -> None:
    robot = tutorial_robot()
    away = np.array([0.2, -1.4, 1.2, 0.1, 0.5, 0.2])
    law = OperationalSpace(robot, "tool0", natural_frequency=30.0, posture_kp=100.0, posture_kd=20.0)
    rollout = simulate(robot, law, away, q0=away + 0.05, duration=1.0)
    assert np.abs(rollout.error[-1]).max() < 1e-3 * np.abs(rollout.error[0]).max()


def test_payload_and_masses_that_the_controller_does_not_know_show() -> None:
    robot, motion = tutorial_robot(), tutorial_motion()
    law = ComputedTorque(robot, kp=400, kd=40)
    right = simulate(robot, law, motion)
    loaded = simulate(robot, law, motion, payload=Payload("tool0", 3.0))
    heavy = simulate(robot, law, motion, mass_scale=1.2)
    assert loaded.model.total_mass == pytest.approx(robot.total_mass + 3.0)
    assert heavy.model.total_mass == pytest.approx(1.2 * robot.total_mass)
    assert np.abs(right.error).max() < 0.1 * min(np.abs(loaded.error).max(), np.abs(heavy.error).max())
