"""Motors at the end of a step: their law holds there, beside contacts, limits and dry friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.world import (
    PDMotor,
    PositionMotor,
    Scene,
    SceneRobot,
    VelocityMotor,
    World,
    ground,
)
from tests.compiled.test_contact_step_and_worlds import random_robot, scene_of

H = 2e-3


@settings(max_examples=15, deadline=None)
@given(
    st.integers(0, 10_000),
    st.booleans(),
    st.sampled_from([0.0, 1.0, 300.0, 1e6]),
    st.sampled_from([0.5, 50.0, 1e5]),
    st.sampled_from([0.2, 20.0, None]),
    st.booleans(),
)
def test_the_law_holds_with_the_state_after_the_step(
    seed: int, floating: bool, kp: float, kd: float, most: float | None, collisions: bool
) -> None:
    """Trees fall on the ground; their joints reach limits and stick."""
    rng = np.random.default_rng(seed)
    model = random_robot(rng, floating)
    n = len(model.mechanism.bodies)
    target, velocity = rng.uniform(-0.5, 0.5, n), rng.uniform(-0.2, 0.2, n)
    motor = PositionMotor(target, kp, kd, velocity, max_force=most)
    scene = scene_of(model, -0.3)
    with World(scene, "dynx", H, collisions=collisions, keep_last_step=True) as world:
        for _ in range(15):
            world.step(8, motors={"robot": motor})
            before = world.state.robots["robot"]
            world.step(motors={"robot": motor})
            v = world.state.robots["robot"].v[-n:]
            reached = before.q[-n:] + H * v
            wanted = kp * (target - reached) + kd * (velocity - v)
            held = wanted if most is None else np.clip(wanted, -most, most)
            scale = max(1.0, kp * H + kd)
            # Where a joint reaches a limit, a world without contacts changes the velocity after the step.
            q = world.state.robots["robot"].q[-n:]
            lower, upper = (limits[-n:] for limits in (model.lower, model.upper))
            free = np.ones(n, dtype=bool) if collisions else (lower < q) & (q < upper)
            if free.all():
                tau = world.torque("robot")[-n:]
                np.testing.assert_allclose(tau, held, rtol=1e-9, atol=1e-9 * scale)


def test_high_gains_are_stable_in_long_steps() -> None:
    """Gains with which motors diverge that take the other forces of the step before."""
    arm = dynx.load("panda")
    ready = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.0])
    scene = Scene("arm", robots=(SceneRobot("arm", arm, q=ready),), bodies=(ground(),))
    for h, kp in ((0.04, 200.0), (0.02, 2e4), (0.04, 2e6)):
        with World(scene, "dynx", h, joint_limits=False) as world:
            world.run(4.0, motors={"arm": PositionMotor(0.3, kp=kp, kd=0.1 * kp)})
            q, v = world.state.robots["arm"]
        assert np.abs(v).max() < 1e-2
        assert q == pytest.approx(np.full(8, 0.3), abs=0.2 if kp < 1e3 else 0.02)


def test_motors_of_several_laws_and_a_restored_state_continue_bit_for_bit() -> None:
    model = random_robot(np.random.default_rng(8), True)
    first, *rest = model.joint_names
    motors = {"robot": [PDMotor(0.1, 5.0, 0.1, joints=[first]), VelocityMotor(0.3, 40.0, 0.5, joints=rest)]}
    scene = scene_of(model, -0.3)
    with World(scene, "dynx", 1e-3, keep_last_step=True) as world:
        world.step(100, motors=motors)
        kept, torque = world.save(), world.torque("robot")
        world.step(50, motors=motors)
        wanted = world.state
        world.restore(kept)
        assert np.array_equal(world.state.torques["robot"], torque)
        world.step(50, motors=motors)
        assert world.state == wanted


def test_a_motor_whose_limit_decides_has_the_same_law_as_one_without() -> None:
    """A limit that no torque reaches changes no bit."""
    model = random_robot(np.random.default_rng(3), True)
    scene = scene_of(model, -0.3)
    motor = PositionMotor(0.1, 30.0, 1.0)
    found = []
    for each in (motor, replace(motor, max_force=1e3)):
        with World(scene, "dynx", 1e-3) as world:
            world.step(100, motors={"robot": each})
            found.append(world.state.robots["robot"])
    assert np.array_equal(found[0].q, found[1].q)
