"""Closed forms of boxes and robots, against equations of motion that are integrated."""

from __future__ import annotations

import math

import numpy as np
import pytest

import dynx
from dynx.contacts.cases import friction, resting
from dynx.contacts.motion import G
from dynx.spatial.scalar import Floats


def tip(b: float, h: float, force: Floats, push: Floats | None, angle: float) -> tuple[float, float]:
    """Return the angular velocity of a box of 1 kg that has turned by `angle` about its lower edge, and the
    largest ratio of friction and normal force on the way.

    `force` (2,) acts at the centre and `push` (2,) at the middle of the top; x points to the edge, z up.
    """
    inertia, phi, w, step = (b * b + h * h) * 4.0 / 3.0, 0.0, 0.0, 1e-5
    worst, before = 0.0, 0.0
    while phi < angle:
        c, s = math.cos(phi), math.sin(phi)
        turn = np.array([[c, s], [-s, c]])
        center, top = turn @ (-b, h), turn @ (-b, 2.0 * h)
        total = force if push is None else force + push
        moment = center[1] * force[0] - center[0] * force[1]
        if push is not None:
            moment += top[1] * push[0] - top[0] * push[1]
        alpha = moment / inertia
        # The centre moves on a circle: the force of the ground is what that takes beside the other forces.
        ground = alpha * np.array([center[1], -center[0]]) - w * w * center - total
        worst = max(worst, abs(ground[0]) / ground[1])
        before = w
        w += step * alpha
        phi += step * 0.5 * (w + before)
    return w, worst


@pytest.mark.parametrize("angle", friction.ANGLES)
def test_a_box_tips_on_a_slope_as_its_equation_of_motion_says(angle: float) -> None:
    slope = math.atan(friction.TippingBox.trials["tips"].tangent)
    force = G * np.array([math.sin(slope), -math.cos(slope)])
    w, ratio = tip(friction.HALF_WIDTH, friction.HALF_HEIGHT, force, None, angle)
    assert math.isclose(friction.tipping_speed_on_slope(slope, angle), w, rel_tol=1e-4)
    # The edge does not slip.
    assert ratio < friction.TippingBox.trials["tips"].friction


def test_a_box_does_not_tip_below_the_threshold() -> None:
    slope = math.atan(friction.HALF_WIDTH / friction.HALF_HEIGHT)
    assert friction.tipping_speed_on_slope(slope + 1e-9, 1e-6) > 0.0
    with pytest.raises(ValueError, match="math domain"):
        friction.tipping_speed_on_slope(slope - 1e-3, 1e-6)


def test_a_pushed_cube_tips_as_its_equation_of_motion_says() -> None:
    push = friction.PushedBox.trials["tips"]
    half = friction.HALF
    force, at_top = np.array([0.0, -G]), np.array([push.force, 0.0])
    w, ratio = tip(half, half, force, at_top, friction.TILT)
    assert math.isclose(friction.tipping_speed_under_push(push.force, friction.TILT), w, rel_tol=1e-4)
    assert ratio < push.friction


def test_trials_are_on_the_sides_of_the_thresholds_that_their_names_say() -> None:
    ratio = friction.HALF_WIDTH / friction.HALF_HEIGHT
    trials = friction.TippingBox.trials
    assert trials["rests"].tangent < min(trials["rests"].friction, ratio)
    assert trials["slides"].friction < min(trials["slides"].tangent, ratio)
    assert ratio < trials["tips"].tangent < trials["tips"].friction
    pushes = friction.PushedBox.trials
    assert pushes["stays"].force < pushes["stays"].friction * G
    assert pushes["slides"].force > pushes["slides"].friction * G
    # Push and friction turn a cube that slides about its centre less than the normal force at its edge can.
    push = pushes["slides"]
    lever = push.height - friction.HALF
    assert push.force * lever + push.friction * G * friction.HALF < G * friction.HALF
    limit = resting.FRICTION * G * (resting.PLATFORM + resting.BLOCK)
    forces = resting.DrivenPlatform.trials
    assert forces["sticks"] < limit < forces["slides"]


@pytest.mark.parametrize("force", [0.0, 5.0, 11.0, 12.0, 30.0])
def test_platform_and_block_have_the_momentum_of_the_force(force: float) -> None:
    block, platform = resting.accelerations(force)
    total = resting.BLOCK * block + resting.PLATFORM * platform
    assert math.isclose(total, force, abs_tol=1e-12)
    assert block <= min(platform, resting.FRICTION * G) + 1e-12


def test_platform_and_block_change_continuously_at_the_threshold() -> None:
    limit = resting.FRICTION * G * (resting.PLATFORM + resting.BLOCK)
    assert np.allclose(resting.accelerations(limit), resting.accelerations(limit * (1 + 1e-12)))


def test_forces_on_feet_balance_the_weight_of_the_robot_that_is_simulated() -> None:
    weight, front = resting.foot_forces()
    robot = dynx.load(resting.quadruped(), base="floating")
    assert math.isclose(weight, robot.total_mass * G)
    q = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *[resting.LEG] * 4])
    # The moment of gravity about the y axis through the rear feet, from the dynamics of the robot.
    gravity = dynx.backend("reference", robot).gravity_torque(q)
    moment = gravity[4] - resting.REACH * gravity[2]
    assert math.isclose(-moment, front * 2.0 * resting.REACH, rel_tol=1e-12)
