"""Rod, top, turntable, conveyor and capstan: their exact values against other laws of mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import dynx
from dynx.contacts.cases import capstan, integrated, supports
from dynx.contacts.motion import G
from dynx.spatial.scalar import Floats


def fall(friction: float, sticks: bool) -> tuple[Floats, Floats, Floats, Floats]:
    """Return angle, angular velocity, slip [m/s] and friction over normal force of a rod of 1 kg over time.

    The equations are those of the plane, for the forces of the ground that keep the lower end on it, and
    either keep it from slipping or have the ratio of the friction.
    """
    half, r, inertia = integrated.ROD_HALF, integrated.ROD_RADIUS, integrated.ROD_INERTIA

    def forces(a: float, w: float) -> tuple[float, float, float]:
        # Unknowns: horizontal force, normal force, angular acceleration.
        d, s = half * math.sin(a), r + half * math.cos(a)
        rows = [[s, -d, inertia], [0.0, 1.0, half * math.sin(a)]]
        right = [0.0, G - half * w * w * math.cos(a)]
        if sticks:
            # The velocity of the centre is w s, of which the derivative is the force.
            rows.append([1.0, 0.0, -s])
            right.append(-half * w * w * math.sin(a))
        else:
            rows.append([1.0, -friction, 0.0])
            right.append(0.0)
        ahead, normal, alpha = np.linalg.solve(rows, right).tolist()
        return ahead, normal, alpha

    def rates(_: float, y: Floats) -> list[float]:
        ahead, _normal, alpha = forces(y[0], y[1])
        return [y[1], alpha, ahead]

    def fallen(_: float, y: Floats) -> float:
        return float(y[0]) - max(integrated.ROD_ANGLES)

    fallen.terminal = True  # type: ignore[attr-defined]
    start = [integrated.ROD_TILT, 0.0, 0.0]
    found = solve_ivp(rates, (0.0, 2.0), start, events=fallen, rtol=1e-9, atol=1e-11, max_step=0.002)
    angle, omega, speed = found.y
    ratios = [abs(f) / n for f, n, _ in (forces(a, w) for a, w in zip(angle, omega, strict=True))]
    slip = speed - omega * (integrated.ROD_RADIUS + half * np.cos(angle))
    return angle, omega, slip, np.array(ratios)


@pytest.mark.parametrize("friction", integrated.FallingRod.trials.values())
def test_a_rod_falls_as_its_equations_in_the_plane_say(friction: float) -> None:
    slides = integrated.rod_slides(friction)
    angle, omega, slip, ratios = fall(friction, sticks=not slides)
    for each in integrated.ROD_ANGLES:
        expected = float(np.interp(each, angle, omega))
        assert integrated.rod_rate(friction, each) == pytest.approx(expected, rel=1e-4)
    if slides:
        # The end slides back all the time, as the closed form takes it to.
        assert slip[1:].max() < 0.0
    else:
        assert np.abs(slip).max() < 1e-6
        assert ratios.max() < friction


@given(st.floats(0.0, 2.0))
def test_the_rod_slides_from_the_start_where_friction_cannot_hold_its_end(friction: float) -> None:
    needed = fall(0.0, sticks=True)[3][0]
    if abs(friction - needed) > 1e-9:
        assert integrated.rod_slides(friction) == (friction < needed)


def test_friction_is_below_that_of_the_paradox() -> None:
    # A sliding end that is pressed harder must not be pushed up: 1 + d (d - mu s) / k^2 > 0 at every angle.
    angles = np.linspace(0.0, 0.5 * math.pi, 2000)
    d = integrated.ROD_HALF * np.sin(angles)
    s = integrated.ROD_RADIUS + integrated.ROD_HALF * np.cos(angles)
    for friction in integrated.FallingRod.trials.values():
        assert friction < 4.0 / 3.0
        assert (1.0 + d * (d - friction * s) / integrated.ROD_INERTIA).min() > 0.0


def test_the_top_keeps_jelletts_integral_and_loses_energy_while_it_slides() -> None:
    axis, spin, velocity = integrated.top_at_start()
    start = np.concatenate([axis, spin, velocity[:2]])
    times = np.linspace(0.0, integrated.TOP_DURATION, 40)
    found = solve_ivp(
        integrated.top_rates,
        (0.0, times[-1]),
        start,
        method="DOP853",
        t_eval=times,
        rtol=1e-9,
        atol=1e-10,
    )
    jellett, energy, slips = [], [], []
    for y in found.y.T:
        axis, omega, center = y[:3], y[3:6], np.array([*y[6:], 0.0])
        contact = integrated.TOP_OFFSET * axis - np.array([0.0, 0.0, integrated.TOP_RADIUS])
        of_mass = center - np.cross(omega, integrated.TOP_OFFSET * axis)
        # A force at the contact has no moment about the line from the centre of mass to it.
        jellett.append(float(omega @ contact))
        kinetic = 0.5 * float(of_mass @ of_mass) + 0.5 * integrated.TOP_INERTIA * float(omega @ omega)
        energy.append(kinetic - G * integrated.TOP_OFFSET * float(axis[2]))
        lowest = center + np.cross(omega, [0.0, 0.0, -integrated.TOP_RADIUS])
        slips.append(float(np.linalg.norm(lowest[:2])))
    assert np.ptp(jellett) < 1e-7 * abs(jellett[0])
    assert (np.diff(energy) < 0.0).all()
    assert min(slips) > 0.1
    tilt, rate = integrated.top_at(float(times[-1]))
    assert tilt == pytest.approx(math.acos(found.y[2, -1]), abs=1e-6)
    assert rate == pytest.approx(found.y[5, -1], abs=1e-5)
    assert tilt > integrated.TOP_TILT + 0.7


def test_a_ball_on_a_turntable_rolls_without_slipping_along_its_orbit() -> None:
    """Friction is the only force: its moment turns the ball as fast as the contact without slip demands."""
    W, r = np.array([0.0, 0.0, supports.TURNTABLE_SPEED]), supports.ROLLING_BALL_RADIUS
    body = supports.Turntable().scene("ball").body("ball")
    v, w = np.array(body.twist[:3]), np.array(body.twist[3:])
    p = np.array([supports.TURNTABLE_RADIUS, 0.0, 0.0])
    down = np.array([0.0, 0.0, -r])
    np.testing.assert_allclose(v + np.cross(w, down), np.cross(W, p), atol=1e-12)

    def position(t: float) -> Floats:
        return np.array([*supports.orbit_on_turntable(t), 0.0])

    h = 1e-4
    for t in (0.0, 0.2, 0.5):
        before, now, after = position(t - h), position(t), position(t + h)
        speed, force = (after - before) / (2.0 * h), (after - 2.0 * now + before) / h**2
        alpha = np.cross(down, force) / (0.4 * r * r)
        # The derivative of the condition of rolling.
        np.testing.assert_allclose(force + np.cross(alpha, down), np.cross(W, speed), atol=1e-5)
        assert np.linalg.norm(force) < 0.8 * G
    np.testing.assert_allclose((position(h) - position(-h)) / (2.0 * h), v, atol=1e-6)
    assert supports.TURNTABLE_SPEED**2 * supports.TURNTABLE_RADIUS < 0.8 * G


def test_the_block_slides_as_long_on_the_conveyor_as_it_is_measured() -> None:
    stop = supports.CONVEYOR_SPEED / (supports.CONVEYOR_FRICTION * G)
    slid = supports.CONVEYOR_STARTING + supports.CONVEYOR_SLIDING
    assert slid < stop < slid + supports.CONVEYOR_DURATION


@given(st.floats(0.0, 0.9))
def test_the_forces_at_the_ends_of_a_chain_balance_at_every_joint(friction: float) -> None:
    tension, along = 1.0, 0.0
    for _ in range(capstan.NODES):
        # Directions away from the joint: back along the link before, and on along the one after.
        back, on = along + math.pi, along + capstan.BEND
        middle = along + 0.5 * capstan.BEND
        outward = np.array([math.cos(middle - 0.5 * math.pi), math.sin(middle - 0.5 * math.pi)])
        tangent = np.array([math.cos(middle), math.sin(middle)])
        # The drum pushes along its normal, and back along the chain, by the friction.
        columns = np.column_stack([[math.cos(on), math.sin(on)], outward - friction * tangent])
        pull = tension * np.array([math.cos(back), math.sin(back)])
        tension, normal = np.linalg.solve(columns, -pull).tolist()
        assert normal > 0.0
        along = on
    assert tension == pytest.approx(capstan.force_ratio(friction), rel=1e-9)
    rope = math.exp(friction * capstan.NODES * capstan.BEND)
    assert (1.0 - 1e-12) * rope <= tension <= (1.0 + 1e-12) * rope ** (1.0 + 0.1 * (1.0 + friction**2))


def test_the_balls_of_the_chain_touch_the_drum_at_their_joints() -> None:
    chain = dynx.load(capstan.chain_urdf())
    poses = dict(
        zip(
            chain.frame_names,
            dynx.backend("reference", chain).forward_kinematics(chain.neutral()),
            strict=True,
        )
    )
    for link in chain.links:
        for ball in chain.geometry.collisions(link.name):
            T = poses[link.name] @ ball.origin.matrix
            distance = float(np.linalg.norm(T[[0, 2], 3]))
            assert distance == pytest.approx(capstan.DRUM_RADIUS + capstan.SHOE_RADIUS, abs=1e-12)
            touch = T[:3, 3] * capstan.DRUM_RADIUS / distance
            np.testing.assert_allclose(touch, poses[link.name][:3, 3], atol=1e-12)
    # The first link points up, the last one down.
    np.testing.assert_allclose(poses["link0"][:3, 0], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(poses[f"link{capstan.NODES}"][:3, 0], [0.0, 0.0, -1.0], atol=1e-12)
