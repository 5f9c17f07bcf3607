"""Closed forms of impacts, against conservation laws and the integral of Coulomb's friction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.contacts.cases import collisions
from dynx.contacts.motion import Throw, after_bounce, farthest, rms_deviation, speeds_after_collision
from dynx.contacts.verdict import MIN_ORDER, judge
from dynx.model.geometry import Collision, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from dynx.steppers.state import BodyState, WorldState
from dynx.world import Scene, SceneBody, box

MASSES = st.floats(0.01, 100.0)
SPEEDS = st.floats(-10.0, 10.0)
RESTITUTIONS = st.floats(0.0, 1.0)


@given(MASSES, MASSES, SPEEDS, SPEEDS, RESTITUTIONS)
def test_collisions_conserve_momentum_and_separate_by_the_restitution(
    m1: float, m2: float, v1: float, v2: float, e: float
) -> None:
    w1, w2 = speeds_after_collision(m1, m2, v1, v2, e)
    scale = (m1 + m2) * 20.0
    assert abs(m1 * w1 + m2 * w2 - m1 * v1 - m2 * v2) <= 1e-14 * scale
    assert math.isclose(w2 - w1, e * (v1 - v2), abs_tol=1e-12)
    reduced = m1 * m2 / (m1 + m2)
    lost = 0.5 * (m1 * (v1**2 - w1**2) + m2 * (v2**2 - w2**2))
    assert math.isclose(lost, 0.5 * reduced * (1.0 - e**2) * (v1 - v2) ** 2, abs_tol=1e-13 * scale * 20.0)


vectors = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


@given(st.lists(st.tuples(vectors, vectors, vectors), min_size=2, max_size=2), vectors, vectors)
def test_momenta_and_energy_of_two_bodies_are_those_of_the_relative_motion(
    motions: list[tuple[Floats, Floats, Floats]], drift: Floats, shift: Floats
) -> None:
    masses, offset = (2.0, 0.5), (0.1, -0.2, 0.3)
    tensor = ((0.2, 0.05, 0.0), (0.05, 0.3, 0.0), (0.0, 0.0, 0.4))
    bodies = [
        SceneBody(name, (Collision(Sphere(0.1)),), mass=m, center_of_mass=offset, inertia=tensor)
        for name, m in zip("ab", masses, strict=True)
    ]
    fixed = box("fixed", (1.0, 1.0, 1.0))
    scene = Scene("s", bodies=(*bodies, fixed))
    p, v, energy, turning = [], [], 0.0, np.zeros(3)
    states = {"fixed": BodyState(np.eye(4), np.full(6, 7.0))}
    for body, (at, velocity, spin) in zip(bodies, motions, strict=True):
        T = np.eye(4)
        T[:3, :3] = R = rotation_from_rpy(at)
        lever = R @ offset
        T[:3, 3] = at + shift - lever
        states[body.name] = BodyState(T, np.concatenate([velocity + drift - np.cross(spin, lever), spin]))
        p.append(at)
        v.append(velocity)
        moments = R @ np.array(tensor) @ R.T
        turning = turning + moments @ spin
        energy += 0.5 * float(spin @ moments @ spin)
    state = WorldState(0.0, {}, states)
    reduced = masses[0] * masses[1] / sum(masses)
    apart, relative = p[1] - p[0], v[1] - v[0]
    momentum = masses[0] * (v[0] + drift) + masses[1] * (v[1] + drift)
    assert np.allclose(collisions.linear_momentum(scene, state), momentum, atol=1e-12)
    turning = turning + reduced * np.cross(apart, relative)
    assert np.allclose(collisions.angular_momentum(scene, state), turning, atol=1e-11)
    energy += 0.5 * reduced * float(relative @ relative)
    assert math.isclose(collisions.kinetic_energy(scene, state), energy, abs_tol=1e-11)


@given(SPEEDS)
def test_equal_masses_exchange_speeds_and_a_wall_reflects_them(v: float) -> None:
    assert np.allclose(speeds_after_collision(1.0, 1.0, v, 0.0, 1.0), (0.0, v), atol=1e-12)
    assert math.isclose(speeds_after_collision(1.0, 1e12, v, 0.0, 1.0)[0], -v, abs_tol=1e-9)


@given(SPEEDS, SPEEDS, st.floats(0.1, 5.0), st.floats(0.0, 2.0), RESTITUTIONS)
def test_a_bounce_is_the_integral_of_friction_over_the_normal_impulse(
    speed: float, backspin: float, fall: float, friction: float, e: float
) -> None:
    n, normal = 2000, (1.0 + e) * fall
    v, w = speed, backspin
    for _ in range(n):
        # Friction of one part of the impulse reverses no slip: it ends it.
        part = min(friction * normal / n, 2.0 / 7.0 * abs(v + w))
        part = math.copysign(part, v + w)
        v, w = v - part, w - 2.5 * part
    assert np.allclose(after_bounce(Throw(speed, backspin, fall, friction, e)), (v, w), atol=1e-9)


@given(SPEEDS, SPEEDS, st.floats(0.1, 5.0), st.floats(0.0, 2.0), RESTITUTIONS)
def test_a_bounce_keeps_the_angular_momentum_about_the_contact_and_adds_no_energy(
    speed: float, backspin: float, fall: float, friction: float, e: float
) -> None:
    v, w = after_bounce(Throw(speed, backspin, fall, friction, e))
    assert math.isclose(w - 2.5 * v, backspin - 2.5 * speed, abs_tol=1e-11)
    assert v**2 + 0.4 * w**2 <= speed**2 + 0.4 * backspin**2 + 1e-11
    # The slip keeps its direction or ends.
    assert (v + w) * (speed + backspin) >= -1e-11


def test_a_ball_with_enough_backspin_comes_back() -> None:
    assert after_bounce(Throw(1.0, 3.0, 2.0, 1.0, 0.5))[0] < 0.0


def test_bounces_are_those_of_a_ball_whose_flights_are_integrated() -> None:
    g, height, velocity, time = 9.81, 1.0, 0.0, 0.0
    tops, impacts = [], []
    for _ in range(4):
        # From rest or from the ground: the positive root of the height.
        flight = (velocity + math.sqrt(velocity**2 + 2.0 * g * height)) / g
        time += flight
        impacts.append(time)
        velocity, height = collisions.RESTITUTION * (g * flight - velocity), 0.0
        tops.append(velocity**2 / (2.0 * g))
    unit = collisions.fall_time(1.0)
    assert np.allclose([collisions.impact_time(n) for n in range(1, 5)], np.array(impacts) / unit)
    assert np.allclose(tops, [collisions.RESTITUTION ** (2 * n) for n in range(1, 5)])


@pytest.mark.parametrize("dt", [1e-2, 1e-3])
def test_flights_are_told_apart_where_no_sample_is_near_the_ground(dt: float) -> None:
    g, merged = 9.81, 0
    for fall in collisions.BOUNCING_BALL_HEIGHTS:
        unit = collisions.fall_time(fall)
        ends = np.array([collisions.impact_time(n) for n in range(1, 6)]) * unit
        times = np.arange(0.0, ends[3], dt)
        number = np.searchsorted(ends, times)
        launch = collisions.RESTITUTION**number * np.where(number, math.sqrt(2.0 * g * fall), 0.0)
        since = times - np.where(number, ends[number - 1], 0.0)
        heights = np.where(number, launch * since, fall) - 0.5 * g * since**2
        merged += int(np.any(np.diff(number)[heights[1:] > collisions.MIN_HEIGHT * fall]))
        found = collisions.rebound_heights(heights / fall, launch - g * since)
        wanted = [collisions.RESTITUTION ** (2 * n) for n in range(1, 4)]
        assert np.allclose(found, wanted, rtol=0.0, atol=g * dt**2 / 8.0 / fall + 1e-12)
    assert (merged > 0) == (dt > 5e-3)


def test_all_bounces_take_as_long_as_their_geometric_series() -> None:
    # All bounces take (1 + e) / (1 - e) of the time of the fall.
    e = collisions.RESTITUTION
    assert math.isclose(collisions.impact_time(60), (1.0 + e) / (1.0 - e), rel_tol=1e-12)


def test_farthest_is_the_largest_error_and_not_the_largest_number() -> None:
    assert farthest([0.9, 1.0, 1.05], 1.0) == 0.9


def test_rms_deviation_is_that_of_numbers_of_one_distance() -> None:
    assert math.isclose(rms_deviation([0.9, 1.1, 1.1], 1.0), 0.1)


STEPS = (4e-3, 2e-3, 1e-3)
TOLERANCE = 1e-6


@given(st.floats(0.6, 4.0), st.floats(1e-2, 1.0))
def test_errors_in_proportion_to_a_power_of_the_step_fall_at_that_order(order: float, size: float) -> None:
    errors = [size * (step / STEPS[0]) ** order for step in STEPS]
    trend = judge(STEPS, errors, TOLERANCE)
    assert trend.kind == "falls"
    assert trend.order == pytest.approx(order)


@given(st.floats(1e-3, 1.0), st.floats(0.0, 0.3))
def test_an_error_that_hardly_changes_stays(size: float, order: float) -> None:
    assert judge(STEPS, [size * (step / STEPS[0]) ** order for step in STEPS], TOLERANCE).kind == "stays"


@given(st.permutations([4e-2, 2e-2, 1e-2]))
def test_errors_that_rise_somewhere_stay(errors: list[float]) -> None:
    assert (judge(STEPS, errors, TOLERANCE).kind == "falls") == (errors == sorted(errors, reverse=True))


@given(st.lists(st.floats(0.0, TOLERANCE), min_size=1, max_size=3))
def test_errors_within_the_tolerance_are_none_whatever_their_order(errors: list[float]) -> None:
    assert judge(STEPS[: len(errors)], errors, TOLERANCE).kind == "within"


def test_noise_below_the_tolerance_hides_no_order() -> None:
    trend = judge((8e-3, *STEPS), [4e-3, 1e-3, 2e-7, 9e-7], TOLERANCE)
    assert trend.kind == "falls"
    # The errors below the tolerance count as the tolerance in the slope of all.
    sizes, logs = np.log((8e-3, *STEPS)), np.log([4e-3, 1e-3, TOLERANCE, TOLERANCE])
    assert trend.order == pytest.approx(np.polyfit(sizes, logs, 1)[0])
    assert judge(STEPS, [1e-7, 1e-2, 1e-7], TOLERANCE).kind == "stays"


def test_a_fall_to_the_tolerance_is_a_fall_whatever_its_order() -> None:
    assert judge(STEPS, [4e-6, 1.1e-6, 0.0], TOLERANCE).kind == "falls"
    assert judge(STEPS, [4e-6, 0.9e-6, 1.1e-6], TOLERANCE).kind == "stays"


def test_an_error_that_stops_falling_stays() -> None:
    assert judge(STEPS, [8e-2, 2e-2, 1.9e-2], TOLERANCE).kind == "stays"
    assert judge(STEPS, [8e-2, 2e-2, 2e-2 / 2**MIN_ORDER * 0.999], TOLERANCE).kind == "falls"


def test_one_step_shows_no_order_and_nan_is_an_error() -> None:
    assert judge((1e-3,), [1e-2], TOLERANCE).kind == "stays"
    assert judge(STEPS, [1e-2, float("nan"), 1e-9], TOLERANCE).kind == "stays"
