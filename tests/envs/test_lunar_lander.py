"""The lunar lander beside Gymnasium's: flights in Box2D, landings, rewards, and the order of its rules.

``data/lunar_lander_flights.json`` has 45 steps each of ``LunarLander-v3`` (Gymnasium 1.4, Box2D 2.3.10) with
its engines' noise, for some seeds, actions and options.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx.envs  # noqa: F401  (registers the environments)
from dynx.envs.environment import TaskEnvironment
from dynx.envs.tasks.lunar_lander.craft import (
    CENTER,
    EDGES,
    HEIGHT,
    HULL_MASS,
    LANDER,
    LEG_LIMITS,
    LEG_MASS,
    MOON,
    WIDTH,
    area_properties,
    clearance,
    force_at_center,
    ground_body,
    ground_heights,
    lander_model,
    main_thrust,
    side_thrust,
)
from dynx.envs.tasks.lunar_lander.task import LunarLander
from dynx.errors import ArgumentError
from dynx.model.geometry import Box
from dynx.steppers.registry import installed_worlds
from dynx.steppers.state import BodyState, WorldState
from dynx.world import Scene
from dynx.world.camera import draw_picture

FLIGHTS = json.loads((Path(__file__).parent / "data" / "lunar_lander_flights.json").read_text())
FLIGHT_TOLERANCE = (0.001, 0.002, 0.005, 0.01, 0.005, 0.008, 0.0, 0.0)
"""Largest difference of an observation from Gymnasium's in 45 steps. Box2D integrates in float32 and moves
the lander when it corrects the hips; engines differ in the step in which the legs reach their limits."""
ENGINES = installed_worlds()
BENCH = ("pybullet", "mujoco")


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def env(engine: str) -> Iterator[TaskEnvironment]:
    with TaskEnvironment(LunarLander(), engine) as made:
        yield made


def land(env: TaskEnvironment, seed: int) -> tuple[float, bool]:
    """Fly down with a controller of position and angle; return the return, and whether it terminated."""
    observation, _ = env.reset(seed=seed)
    total = 0.0
    for _ in range(600):
        x, z, vx, vz, angle, rate, right, left = (float(each) for each in observation)
        lean = float(np.clip(0.5 * x + vx, -0.4, 0.4))
        turn = 0.0 if right or left else 0.5 * (lean - angle) - rate
        lift = -0.5 * vz if right or left else 0.5 * (0.55 * abs(x) - z) - 0.5 * vz
        action = 0
        if lift > max(abs(turn), 0.05):
            action = 2
        elif abs(turn) > 0.05:
            action = 3 if turn < 0.0 else 1
        observation, reward, terminated, _, _ = env.step(action)
        total += reward
        if terminated:
            return total, True
    return total, False


def test_the_ground_is_a_broken_line_through_the_heights() -> None:
    heights = ground_heights(np.random.default_rng(0).uniform(0.0, HEIGHT / 2, EDGES + 2))
    ends = zip(np.linspace(-WIDTH / 2, WIDTH / 2, EDGES + 1), heights, strict=True)
    for each, (left, right) in zip(ground_body(heights).shapes, pairwise(ends), strict=True):
        assert isinstance(each.shape, Box)
        length, _, depth = each.shape.size
        for side, (x, z) in ((-1.0, left), (1.0, right)):
            corner = each.origin.matrix @ (0.5 * side * length, 0.0, 0.5 * depth, 1.0)
            assert corner[:3] == pytest.approx((x, 0.0, z), abs=1e-12)


def test_area_and_second_moments_of_a_polygon_are_the_integrals() -> None:
    # A trapezium is the union of a rectangle and two triangles.
    a, b, h, z = 0.3, 0.7, 0.4, 0.2
    area, center, xx, zz = area_properties([(-b, z), (b, z), (a, z + h), (-a, z + h)])
    widths, dz = np.linspace(b, a, 20001), h / 20000
    at = z + np.linspace(0.0, h, 20001)

    def integral(of_height: Any) -> float:
        return float(np.sum((of_height[1:] + of_height[:-1]) / 2.0) * dz)

    assert area == pytest.approx(integral(2.0 * widths), rel=1e-8)
    assert center == pytest.approx(integral(2.0 * widths * at) / area, rel=1e-8)
    assert xx == pytest.approx(integral(2.0 * widths**3 / 3.0), rel=1e-8)
    assert zz == pytest.approx(integral(2.0 * widths * (at - center) ** 2), rel=1e-6)


@pytest.mark.parametrize("flight", FLIGHTS, ids=lambda each: f"seed {each['seed']}")
def test_flights_are_those_of_gymnasium(flight: dict[str, Any], engine: str) -> None:
    with TaskEnvironment(LunarLander(**flight["options"]), engine) as env:
        seen = [env.reset(seed=flight["seed"])[0]]
        for action in flight["actions"]:
            given = action if isinstance(action, int) else np.array(action, dtype=np.float32)
            seen.append(env.step(given)[0])
    difference = np.abs(np.array(seen) - flight["observations"]).max(axis=0)
    assert (difference <= FLIGHT_TOLERANCE).all(), difference


def test_drake_parts_from_mujoco_where_legs_are_held_before_their_limits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The cause that docs/reinforcement_learning.md names: MuJoCo's limit acts on a leg beyond it."""
    if not {"drake", "mujoco"} <= set(ENGINES):
        pytest.skip("needs Drake and MuJoCo")

    def difference() -> list[float]:
        flights = []
        for name in ("drake", "mujoco"):
            with TaskEnvironment(LunarLander(), name) as env:
                env.reset(seed=0)
                flights.append([env.step(0)[0] for _ in range(45)])
        apart = np.abs(np.array(flights[0]) - np.array(flights[1]))
        return [float(each) for each in apart.max(axis=1)]

    held_before = difference()
    assert max(held_before[:21]) < 1e-6
    assert held_before[21] > 5e-3
    monkeypatch.setattr("dynx.envs.tasks.lunar_lander.task.SPREAD_TOLERANCE", 0.0)
    assert max(difference()) < 7e-4


def test_equal_seeds_and_actions_give_the_same_bits(engine: str) -> None:
    def episode(env: TaskEnvironment) -> list[Any]:
        seen = [env.reset(seed=2)[0].tobytes()]
        for k in range(110):
            observation, reward, terminated, _, _ = env.step((0, 2, 0, 3)[k % 4])
            seen += [observation.tobytes(), reward]
            if terminated:
                break
        return seen

    with TaskEnvironment(LunarLander(), engine) as first, TaskEnvironment(LunarLander(), engine) as second:
        expected = episode(first)
        first.reset(seed=5)
        assert episode(first) == expected
        assert episode(second) == expected


@pytest.mark.parametrize("seed", [3, 4])
def test_a_controller_lands_and_comes_to_rest(env: TaskEnvironment, seed: int) -> None:
    total, terminated = land(env, seed)
    assert terminated
    assert total > 200.0


def test_a_fall_is_a_crash(env: TaskEnvironment) -> None:
    env.reset(seed=1)
    for _ in range(300):
        *_, reward, terminated, _, _ = env.step(1)
        if terminated:
            break
    assert terminated
    assert reward == -100.0


def test_inertia_is_that_of_box2d() -> None:
    """Box2D states the mass 4.81667, the centre 0.101307, the moment 0.833315 about the origin."""
    assert pytest.approx(4.816667, abs=1e-6) == HULL_MASS
    assert pytest.approx(0.101307, abs=1e-6) == CENTER
    assert pytest.approx(0.0711111, abs=1e-7) == LEG_MASS
    inertial = next(link for link in lander_model().links if link.name == "body").inertial
    assert inertial is not None
    assert inertial.iyy + HULL_MASS * CENTER**2 == pytest.approx(0.833315, abs=1e-6)


def test_ground_is_flat_at_the_pad_and_bounded() -> None:
    heights = ground_heights(np.random.default_rng(0).uniform(0.0, 20.0 / 3.0, EDGES + 2))
    assert len(heights) == EDGES + 1
    assert heights[4:7] == pytest.approx([-0.01 * 10.0 / 3.0] * 3)
    assert max(heights) < 0.99 * 20.0 / 3.0 - 10.0 / 3.0


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.3])
def test_forces_of_the_engines(angle: float) -> None:
    up = np.array([-math.sin(angle), math.cos(angle)])
    fx, fz, moment = main_thrust(angle, 0.5, (0.0, 0.0), 0.02)
    assert moment == 0.0
    assert [fx, fz] == pytest.approx(13.0 * 0.5 * 4.0 / 30.0 / 0.02 * up)
    for power in (-1.0, 1.0):
        fx, fz, _ = side_thrust(angle, power, (0.0, 0.0), 0.02)
        across = power * 0.6 * 0.4 / 0.02 * np.array([math.cos(angle), math.sin(angle)])
        assert [fx, fz] == pytest.approx(across)
    # Upright, the side engine is above the origin: the left one turns to the left, the right one back.
    assert side_thrust(0.0, 1.0, (0.0, 0.0), 0.02)[2] == pytest.approx(-12.0 * 14.0 / 30.0)
    center = CENTER * up
    assert force_at_center(angle, 3.0, -2.0)[2] == pytest.approx(center[0] * -2.0 - center[1] * 3.0)


def test_throttles_have_thresholds() -> None:
    task = LunarLander(continuous=True)
    assert task.powers(np.array([0.0, 0.5], dtype=np.float32)) == (0.0, 0.0)
    assert task.powers(np.array([1.0, -1.0], dtype=np.float32)) == (1.0, -1.0)
    assert task.powers(np.array([0.5, 0.75], dtype=np.float32)) == (0.75, 0.75)
    assert [LunarLander().powers(k) for k in range(4)] == [(0.0, 0.0), (0.0, -1.0), (1.0, 0.0), (0.0, 1.0)]


def test_clearance_is_a_lower_bound() -> None:
    rng = np.random.default_rng(3)
    task = LunarLander()
    with TaskEnvironment(task, BENCH[0]) as env:
        env.reset(seed=7)
        episodes: Any = env.episodes
        memory, world = episodes.episode.memory, episodes.world
        for _ in range(30):
            hip = rng.uniform(*LEG_LIMITS, 2)
            q = np.array([rng.uniform(-9, 9), rng.uniform(0.5, 4), rng.uniform(-2, 2), hip[0], -hip[1]])
            world.set_state(robots={LANDER: (q, np.zeros(5))})
            near = world.closest_points(LANDER, "moon", within=20.0)[0].distance
            assert clearance(memory.heights, q.tolist(), 0.4) <= near + 1e-9


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gravity": 1.0}, "between -12 and 0"),
        ({"gravity": "-10"}, "between -12 and 0"),
        ({"continuous": 1}, "continuous is '1'; wanted a bool"),
        ({"wind_power": -1.0}, "wind_power is '-1.0'; wanted a number of at least 0"),
        ({"turbulence_power": math.nan}, "turbulence_power is 'nan'"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        LunarLander(**options)


def test_pictures_show_lander_and_ground() -> None:
    with TaskEnvironment(LunarLander(), BENCH[0], "rgb_array", width=90, height=60) as made:
        made.reset(seed=0)
        picture = made.render()
    assert picture is not None
    assert picture.shape == (60, 90, 3)
    assert len(np.unique(picture.reshape(-1, 3), axis=0)) > 2


@pytest.mark.parametrize("seed", range(4))
def test_the_ground_is_drawn_without_gaps_and_flags_stand_at_the_pad(seed: int) -> None:
    heights = ground_heights(np.random.default_rng(seed).uniform(0.0, HEIGHT / 2, EDGES + 2))
    camera = replace(LunarLander().camera, size=(180, 120))
    scene = Scene(bodies=(ground_body(heights),))
    picture = draw_picture(scene, WorldState(0.0, {}, {MOON: BodyState(np.eye(4), np.zeros(6))}), camera)
    seen = picture.segmentation == 0
    spread = np.ptp(picture.rgb.astype(int), axis=2)
    white, yellow = spread < 5, spread > 100
    flags = seen & yellow
    # Below its surface the ground goes down to the end of the picture.
    first = np.argmax(seen & ~yellow & ~white, axis=0)
    below = np.arange(120)[:, None] >= first
    assert (seen | ~below).all()
    columns = np.flatnonzero(flags.any(axis=0)) - 90
    pixels = camera.focal_length / 30.0
    for x in (-WIDTH / EDGES, WIDTH / EDGES):
        assert np.abs(columns - pixels * x).min() < 3.0
    assert not (flags & below).any()
