"""Random scenes on every engine: momentum, energy, rest, equal runs, other orders and other places.

``python -m benchmarks.surveys.random_scenes --count 300`` prints for more of them how near each bound is,
and the settings that cause violations.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings

import dynx
from dynx.engines.mujoco.stepper import MujocoStepper
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.stepper import TouchingPoint
from dynx.testing.strategies import scenes
from dynx.world import Material, Scene, SceneRobot, World, box, capsule, ground
from tests.world.engines import WORLDS
from tests.world.random_scenes.attribution import cause_of
from tests.world.random_scenes.drawing import resting_scene_of, scene_of
from tests.world.random_scenes.examination import (
    MOTION,
    distance,
    examine,
    final_state,
    moved,
    numbers,
    permuted,
)
from tests.world.random_scenes.rest import balances, rest_excess

ENGINES = (*WORLDS, "dynx")

EXAMPLES = {"pybullet": 8, "mujoco": 8, "drake": 4, "dynx": 8}
STEPS = 80

RESTING = {"pybullet": range(3), "mujoco": range(3), "drake": range(0), "dynx": range(0)}
"""Numbers of the random scenes of which the parts at rest are examined."""

TRUNK = """
<robot name="trunk">
  <link name="base">
    <inertial><mass value="4"/><inertia ixx="0.05" iyy="0.05" izz="0.05" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.4 0.2 0.2"/></geometry></collision>
  </link>
  <link name="arm">
    <inertial>
      <origin xyz="0.1 0 0"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision><origin xyz="0.1 0 -0.05"/><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</robot>
"""

LARGEST_DISTANCE = 5e-3
"""Distance [m] after 0.08 s between runs in another order of the parts or at another place."""


@pytest.mark.parametrize("engine", ENGINES)
def test_momentum_and_energy_stay_within_the_bounds_of_the_engine(engine: str) -> None:
    @settings(max_examples=EXAMPLES[engine])
    @given(scenes())
    def check(scene: Scene) -> None:
        found = examine(scene, engine, STEPS)
        for law, excess in found.items():
            assert excess <= 1.0 or cause_of(scene, engine, law, examine, found) is not None, (law, excess)

    check()


def sliding_stick(angle: float, speed: float, restitution: float) -> Scene:
    """Return a stick that hits the ground with one end while it slides, without gravity."""
    material = Material(friction=1.0, restitution=restitution)
    T = _at(0.25 * math.sin(angle) + 0.06)
    T[:3, :3] = rotation_from_rpy(np.array([0.0, 0.5 * math.pi - angle, 0.0]))
    stick = capsule("stick", 0.05, 0.5, mass=1.0, pose=T, twist=(speed, 0, -2, 0, 0, 0), material=material)
    return Scene("stick", bodies=(ground(material=material), stick), gravity=(0.0, 0.0, 0.0))


def test_mujoco_gains_energy_where_slip_decays_more_slowly_than_an_impact_takes_it() -> None:
    scene = sliding_stick(0.6, 3.0, 0.0)
    times = (0.1, 0.01, 0.002)
    excess = [examine(scene, "mujoco", STEPS, slip_time_constant=each)["energy"] for each in times]
    assert excess[0] > excess[1] > 1.0 >= excess[2]
    cause = cause_of(scene, "mujoco", "energy", examine, {})
    assert cause is not None
    assert cause.setting == "slip_time_constant"
    assert examine(scene, "pybullet", STEPS)["energy"] <= 1.0
    assert examine(scene, "drake", STEPS)["energy"] <= 1.0


def test_bullet_gains_energy_in_a_rebound_with_friction() -> None:
    scene = sliding_stick(0.9, 1.5, 1.0)
    assert examine(scene, "pybullet", STEPS)["energy"] > 1.0
    cause = cause_of(scene, "pybullet", "energy", examine, {})
    assert cause is not None
    assert cause.setting == "restitution_speed"


@pytest.mark.parametrize("engine", ENGINES)
def test_runs_are_equal_and_depend_little_on_order_and_place(engine: str) -> None:
    @settings(max_examples=EXAMPLES[engine] // 2)
    @given(scenes())
    def check(scene: Scene) -> None:
        state = final_state(scene, engine, STEPS)
        assert (numbers(state) == numbers(final_state(scene, engine, STEPS))).all()
        assert distance(state, final_state(permuted(scene), engine, STEPS)) < LARGEST_DISTANCE
        elsewhere = final_state(moved(scene), engine, STEPS)
        assert distance(state, elsewhere, MOTION.matrix) < LARGEST_DISTANCE

    check()


@pytest.mark.parametrize("engine", ENGINES)
def test_forces_on_what_has_come_to_rest_balance_weights_and_moments(engine: str) -> None:
    found = [each for number in RESTING[engine] for each in balances(resting_scene_of(number), engine)]
    found += balances(leaning_scene(), engine)
    assert {"plank", "post", "robot"} <= {each.part for each in found}
    assert all(each.force <= 1.0 and each.moment <= 1.0 for each in found), found


def leaning_scene() -> Scene:
    """Return a plank across two posts, a box on it beside its middle, and a robot that lies on the ground."""
    posts = [
        box(name, (0.1, 0.1, 0.3), mass=2.0, pose=_at(0.15, x)) for name, x in (("post", 0.3), ("b", -0.3))
    ]
    plank = box("plank", (0.8, 0.1, 0.05), mass=1.0, pose=_at(0.325))
    load = box("load", (0.1, 0.1, 0.1), mass=3.0, pose=_at(0.4, 0.1))
    robot = SceneRobot("robot", dynx.load(TRUNK, base="floating"), q=(0, 1, 0.1, 0, 0, 0, 1, 0))
    return Scene("leaning", robots=(robot,), bodies=(ground(), *posts, plank, load))


def _at(height: float, x: float = 0.0) -> Floats:
    T = np.eye(4)
    T[0, 3], T[2, 3] = x, height
    return T


def _faster(world: MujocoStepper) -> None:
    for number, body in enumerate(world.layout.bodies):
        if not body.fixed:
            state = world.body_state(number)
            world.set_body_state(number, state.T_world_body, 1.002 * state.twist)


def _reversed_friction(point: TouchingPoint) -> TouchingPoint:
    assert point.friction_force is not None
    return point._replace(friction_force=-point.friction_force)


def _heavier(point: TouchingPoint) -> TouchingPoint:
    return point._replace(normal_force=1.01 * point.normal_force)


def _displaced(point: TouchingPoint) -> TouchingPoint:
    aside = np.array([0.005, 0.0, 0.0])
    return point._replace(point_a=point.point_a + aside, point_b=point.point_b + aside)


def thrown() -> Scene:
    """Return a box thrown on the ground, along which it slides."""
    return Scene(
        "thrown", bodies=(ground(), box("box", (0.2, 0.3, 0.1), mass=1.0, pose=_at(0.06), twist=SLIDING))
    )


SLIDING = (2.0, 0.5, -0.5, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("law", "fault"),
    [
        ("linear momentum", _reversed_friction),
        ("angular momentum", _displaced),
        ("resting force", _heavier),
        ("resting moment", _displaced),
    ],
)
def test_wrong_contacts_violate_a_law(
    law: str, fault: Callable[[TouchingPoint], TouchingPoint], monkeypatch: pytest.MonkeyPatch
) -> None:
    examination = rest_excess if law.startswith("resting") else examine
    assert examination(thrown(), "mujoco")[law] <= 1.0
    right = MujocoStepper.contacts
    monkeypatch.setattr(MujocoStepper, "contacts", lambda self: [fault(each) for each in right(self)])
    assert examination(thrown(), "mujoco")[law] > 1.0


def test_an_engine_that_adds_energy_violates_a_law(monkeypatch: pytest.MonkeyPatch) -> None:
    assert examine(thrown(), "mujoco")["energy"] <= 1.0
    right = MujocoStepper.step

    def step(self: MujocoStepper, n: int, forces: Forces = NO_FORCES) -> None:
        right(self, n, forces)
        _faster(self)

    monkeypatch.setattr(MujocoStepper, "step", step)
    assert examine(thrown(), "mujoco")["energy"] > 1.0


def test_scenes_by_number_are_the_same_in_every_order() -> None:
    first = [repr(scene_of(number)) for number in (3, 4, 5)]
    assert len(set(first)) == 3
    assert [repr(scene_of(number)) for number in (5, 3, 4)] == [first[2], first[0], first[1]]


@pytest.mark.parametrize(
    ("changed", "error"),
    [
        ({"modulus": 1e8}, "rattles"),
        ({}, ""),
        ({"modulus": 1e8, "contact_approximation": "sap"}, ""),
    ],
)
def test_drake_rattles_under_uneven_pressure_with_a_stiff_modulus(
    changed: dict[str, object], error: str
) -> None:
    brick = box("brick", (0.4, 0.4, 0.2), mass=2.0, pose=_at(0.1), center_of_mass=(0.12, -0.07, -0.05))
    with World(Scene("rest", bodies=(ground(), brick)), "drake", **changed) as world:  # type: ignore[arg-type]
        world.run(1.0)
        speeds = []
        for _ in range(50):
            world.step()
            speeds.append(float(np.abs(world.state.bodies["brick"].twist).max()))
    assert (max(speeds) > 5e-3) == bool(error)
