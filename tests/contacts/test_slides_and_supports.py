"""Slides, spins, oblique impacts and moving supports: closed forms against mechanics, and faults noticed."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.contacts import ContactCase, Figure, find_case
from dynx.contacts.cases import collisions, friction, supports
from dynx.contacts.motion import G
from dynx.errors import ArgumentError
from dynx.spatial.scalar import Floats
from dynx.world import Scene, World
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]


def test_a_figure_with_bounds_has_no_error_between_them() -> None:
    def error(measured: float) -> float:
        return Figure("distance", measured, 1.0, "m", 2.0, most=3.0).error

    assert [error(x) for x in (1.0, 2.0, 3.0)] == [0.0, 0.0, 0.0]
    assert [error(x) for x in (0.0, 4.0)] == [0.5, 0.5]
    # Without bounds the error is the distance from the exact value, on both sides.
    assert [Figure("distance", x, 1.0, "m", 2.0).error for x in (0.0, 1.0, 4.0)] == [0.5, 0.0, 1.5]


@pytest.mark.parametrize("most", [1.0, 0.5, math.inf, math.nan])
def test_bounds_are_an_interval(most: float) -> None:
    with pytest.raises(ArgumentError, match="most of the figure 'distance'"):
        Figure("distance", 1.0, 1.0, "m", 1.0, most=most)


@given(st.floats(0.1, 3.0), st.floats(0.0, 1.0))
def test_an_oblique_impact_is_the_integral_of_friction_over_the_normal_impulse(
    slip: float, mu: float
) -> None:
    graze = collisions.Graze(slip, mu)
    (m1, m2), (r1, r2) = collisions.OBLIQUE_MASSES, collisions.OBLIQUE_RADII
    moving, hit = np.zeros(6), np.zeros(6)
    moving[:2], n = (collisions.OBLIQUE_APPROACH, slip), 500
    normal = 2.0 * m1 * m2 / (m1 + m2) * collisions.OBLIQUE_APPROACH / n
    for _ in range(n):
        # Friction of one part of the impulse reverses no slip: it ends it.
        left = collisions.slip_of(moving, hit)
        across = min(mu * normal, left / (3.5 * (1.0 / m1 + 1.0 / m2)))
        moving[[0, 1, 5]] -= normal / m1, across / m1, 2.5 * across / (m1 * r1)
        hit[[0, 1, 5]] += normal / m2, across / m2, -2.5 * across / (m2 * r2)
    assert math.isclose(hit[0] - moving[0], collisions.OBLIQUE_APPROACH)
    left = collisions.slip_of(moving, hit)
    if collisions.slides_to_the_end(graze):
        assert math.isclose(hit[1], mu * hit[0], rel_tol=1e-9)
        assert left > -1e-12
    else:
        assert abs(left) <= 1e-12


def test_oblique_impacts_are_on_the_sides_of_the_threshold_that_their_names_say() -> None:
    trials = collisions.ObliqueImpact.trials
    assert collisions.slides_to_the_end(trials["slides"])
    assert not collisions.slides_to_the_end(trials["sticks"])


@given(st.floats(0.0, 0.49))
def test_a_free_wedge_accelerates_as_the_two_joints_of_a_robot(mu: float) -> None:
    s, c = math.sin(supports.WEDGE_ANGLE), math.cos(supports.WEDGE_ANGLE)
    robot = dynx.load(f"""<robot name="wedge">
      <link name="ground"/>
      <joint name="slide" type="prismatic"><parent link="ground"/><child link="wedge"/><axis xyz="1 0 0"/>
        <limit lower="-9" upper="9" effort="9" velocity="9"/></joint>
      <link name="wedge"><inertial><mass value="{supports.WEDGE}"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="face" type="prismatic"><parent link="wedge"/><child link="block"/><axis xyz="{c} 0 {-s}"/>
        <limit lower="-9" upper="9" effort="9" velocity="9"/></joint>
      <link name="block"><inertial><mass value="{supports.BLOCK}"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    </robot>""")
    wedge, block = supports.wedge_accelerations(mu)
    a, rest = np.array([wedge, block]), np.zeros(2)
    engine = dynx.backend("reference", robot)
    normal = float(engine.joint_wrenches(rest, rest, a)[1, :3] @ (s, 0.0, c))
    # Friction is the only force along the face beside gravity, and nothing pushes the wedge.
    assert np.allclose(engine.inverse_dynamics(rest, rest, a), [0.0, -mu * normal], atol=1e-12)


def mean_distance(points: Floats, pressure: Floats) -> float:
    return float(np.linalg.norm(points, axis=1) @ pressure / pressure.sum())


def test_uniform_pressure_below_a_plate_has_the_distances_that_the_law_names() -> None:
    middles = (np.arange(400) + 0.5) / 200.0 - 1.0
    points = friction.PLATE_RADIUS * np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    within = np.linalg.norm(points, axis=1) <= friction.PLATE_RADIUS
    for plate in friction.SpinningPlate.trials.values():
        inside = points[within] if plate.round else points
        share = mean_distance(inside, np.ones(len(inside))) / plate.farthest
        assert share == pytest.approx(2.0 / 3.0 if plate.round else 0.541, abs=5e-4)
        # The radius of gyration is that of a homogeneous plate.
        assert plate.gyration == pytest.approx(float(np.mean(np.sum(inside**2, axis=1))), rel=1e-3)
        body = friction.SpinningPlate().scene(plate).bodies[1]
        assert body.inertial.tensor[2, 2] == pytest.approx(plate.gyration * body.inertial.mass)
        # All pressure at the farthest points is the bound.
        far = np.linalg.norm(inside, axis=1)
        assert far.max() == pytest.approx(plate.farthest, rel=5e-3)


def test_a_box_that_slides_fast_must_not_tip() -> None:
    for slider in friction.FastSlide.trials.values():
        assert slider.friction * 0.5 * slider.height < 0.5 * slider.width
        stop = friction.FAST_SLIDE_SPEED / (slider.friction * G)
        assert stop > friction.FAST_SLIDE_STARTING + friction.FAST_SLIDE_DURATION


def falsified(scene: Scene, friction_factor: float, mass_factor: float) -> Scene:
    """Return a scene with other friction of every part, and another mass of the first body that moves."""
    first = next((body.name for body in scene.bodies if not body.fixed), None)
    bodies = []
    for body in scene.bodies:
        material = replace(body.material, friction=friction_factor * body.material.friction)
        mass = body.inertial.mass * (mass_factor if body.name == first else 1.0) if not body.fixed else None
        bodies.append(replace(body, material=material, mass=mass))
    robots = [
        replace(robot, material=replace(robot.material, friction=friction_factor * robot.material.friction))
        for robot in scene.robots
    ]
    return replace(scene, bodies=tuple(bodies), robots=tuple(robots))


FAULTS = [
    ("fast_slide", "flat", 0.9, 1.0),
    ("fast_slide", "flat", 1.1, 1.0),
    ("spinning_plate", "square", 1.5, 1.0),
    ("spinning_plate", "disc", 1.5, 1.0),
    ("oblique_impact", "slides", 0.8, 1.0),
    ("oblique_impact", "sticks", 0.1, 1.0),
    ("oblique_impact", "slides", 1.0, 1.5),
    ("free_wedge", "friction 0", 1.0, 1.5),
    ("free_wedge", "friction 0.2", 0.8, 1.0),
    ("free_wedge", "friction 0.2", 1.0, 1.5),
    ("conveyor", "", 0.8, 1.0),
    ("turntable", "block", 0.2, 1.0),
    ("turntable", "block", 1.0, 1.5),
    ("turntable", "ball", 0.01, 1.0),
    ("capstan", "towards the pull", 0.9, 1.0),
    ("capstan", "against the pull", 1.1, 1.0),
    ("falling_rod", "friction 0", 1.0, 1.5),
    ("falling_rod", "friction 0.1", 0.5, 1.0),
    ("falling_rod", "friction 1", 0.05, 1.0),
    ("falling_rod", "friction 1", 1.0, 1.5),
    ("tippe_top", "", 0.8, 1.0),
    ("tippe_top", "", 1.0, 1.2),
]
"""Case, trial, factor of friction, factor of the mass of the first body that moves."""

ENGINE_OF = {"capstan": ("drake", 4e-3)}
"""Engine and step [s] at which a case is exact enough, where these are not PyBullet and 1 ms."""

NOTICED = 0.02
"""Error above which a fault counts as noticed."""


def worst(case: ContactCase, trial: str, scene: Scene, engine: str, dt: float) -> float:
    with World(scene, engine, dt, contact_interval=case.contact_interval) as world:
        return max(figure.error for figure in case.measure(world, case.trials[trial]))


@pytest.mark.parametrize(("name", "trial"), [*dict.fromkeys((each[0], each[1]) for each in FAULTS)])
def test_cases_notice_another_friction_and_another_mass(name: str, trial: str) -> None:
    case, (engine, dt) = find_case(name), ENGINE_OF.get(name, ("pybullet", 1e-3))
    if engine not in ENGINES:
        pytest.skip(f"needs {engine}")
    scene = case.scene(case.trials[trial])
    assert worst(case, trial, scene, engine, dt) <= NOTICED
    for case_name, case_trial, by_friction, by_mass in FAULTS:
        if (case_name, case_trial) == (name, trial):
            assert worst(case, trial, falsified(scene, by_friction, by_mass), engine, dt) > NOTICED
