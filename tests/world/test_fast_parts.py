"""Notes on parts that are too fast for the step: what they warn of happens, and nothing else does."""

from __future__ import annotations

import math
from dataclasses import replace
from importlib.util import find_spec
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import Pose
from dynx.model.geometry import Box, Collision, Cylinder, Shape, Sphere
from dynx.steppers.registry import world_class
from dynx.steppers.stepper import SlidingFace
from dynx.world import (
    Material,
    Scene,
    SceneBody,
    SceneRobot,
    World,
    box,
    capsule,
    ground,
    read_scene,
    sphere,
)
from tests.examples import PROFILE
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

SLIDES = "slides too fast for a step"


class Sled(NamedTuple):
    """A body that slides along x, of which the lowest point is on the ground."""

    shape: Shape
    mass: float
    friction: float
    speed: float

    @property
    def height(self) -> float:
        """Height of the centre [m]."""
        if isinstance(self.shape, Box):
            return 0.5 * self.shape.size[2]
        assert isinstance(self.shape, Cylinder)
        return 0.5 * self.shape.length

    def scene(self, heading: float = 0.0, tilt: float = 0.0) -> Scene:
        """Return the slide in a direction of the plane [rad], with the whole scene tilted [rad]."""
        material = Material(friction=self.friction)
        turned = Pose(rpy=(0.0, tilt, 0.0)).matrix @ Pose(rpy=(0.0, 0.0, heading)).matrix
        R = turned[:3, :3]
        twist = (*(R @ [self.speed, 0.0, 0.0]).tolist(), 0.0, 0.0, 0.0)
        T = turned.copy()
        T[:3, 3] = R @ [0.0, 0.0, self.height]
        body = SceneBody(
            "sled", (Collision(self.shape),), Pose.from_matrix(T), self.mass, twist=twist, material=material
        )
        plane = ground(pose=Pose(rpy=(0.0, tilt, 0.0)), material=material)
        gravity = (-9.81 * Pose(rpy=(0.0, tilt, 0.0)).matrix[:3, 2]).tolist()
        return Scene("sled", bodies=(plane, body), gravity=tuple(gravity))


BRICK = Sled(Box((0.3, 0.12, 0.15)), 6.0, 0.6, 12.0)
PUCK = Sled(Cylinder(0.09, 0.07), 1.3, 0.45, 9.0)
TOWER = Sled(Box((0.16, 0.16, 0.2)), 2.0, 0.55, 8.0)
CUBE = Sled(Box((0.1, 0.1, 0.1)), 1.0, 0.65, 8.0)
DRUM = Sled(Cylinder(0.15, 0.22), 3.0, 0.75, 3.0)
SLOW = Sled(Box((0.3, 0.12, 0.15)), 6.0, 0.6, 0.6)

CASES = [
    *(("mujoco", sled, 4e-3, True) for sled in (BRICK, PUCK, TOWER)),
    *(("mujoco", sled, 2.5e-4, False) for sled in (BRICK, PUCK, TOWER)),
    ("mujoco", SLOW, 2e-3, False),
    *(("drake", sled, 4e-3, True) for sled in (TOWER, CUBE)),
    *(("drake", sled, 5e-4, False) for sled in (DRUM, CUBE)),
    *(("drake", sled, 3e-3, False) for sled in (PUCK, SLOW)),
    *(("pybullet", sled, 4e-3, False) for sled in (BRICK, PUCK, TOWER, DRUM)),
]
"""Engine, body, step [s], and whether the slide is too fast for it; the rules were found on other bodies."""


@pytest.mark.parametrize(("engine", "sled", "dt", "noted"), CASES)
def test_a_slide_that_is_noted_goes_wrong_and_one_that_is_not_goes_right(
    engine: str, sled: Sled, dt: float, noted: bool
) -> None:
    if engine not in ENGINES:
        pytest.skip(f"needs {engine}")
    # No body may tip: the load is within its base.
    with World(sled.scene(), engine, dt) as world:
        found = [note for note in world.notes if SLIDES in note]
        assert bool(found) == noted
        if noted:
            assert found[0].startswith(f"'sled' slides too fast for a step of {dt:g} s: it ")
            assert found[0].endswith("; try a smaller dt or more substeps")
        tilt = lift = 0.0
        duration = min(0.3, 0.8 * sled.speed / (9.81 * sled.friction))
        for _ in range(round(duration / dt)):
            world.step()
            T = world.state.bodies["sled"].T_world_body
            tilt = max(tilt, math.acos(max(-1.0, min(1.0, float(T[2, 2])))))
            lift = max(lift, float(T[2, 3]) - sled.height)
        slowed = sled.speed - float(world.state.bodies["sled"].twist[0])
        error = abs(slowed / (9.81 * sled.friction * world.time) - 1.0)
    wrong = tilt > 0.05 or lift > 0.05 * sled.height or error > 0.05
    assert wrong == noted, (tilt, lift, error)


@pytest.mark.parametrize("engine", [name for name in ("mujoco", "drake") if name in ENGINES])
def test_substeps_and_frames_count_as_the_mechanics_they_are(engine: str) -> None:
    sled = TOWER

    def noted(scene: Scene, substeps: int = 1) -> bool:
        with World(scene, engine, 4e-3, substeps=substeps) as world:
            return any(SLIDES in note for note in world.notes)

    assert noted(sled.scene())
    assert not noted(sled.scene(), substeps=16)
    # The whole scene turned: the same mechanics.
    assert noted(sled.scene(heading=1.1))
    assert noted(sled.scene(tilt=0.4))
    # Without friction, at rest, or above the ground nothing slides.
    assert not noted(sled._replace(friction=0.0).scene())
    assert not noted(sled._replace(speed=0.0).scene())
    raised = sled.scene()
    (plane, body) = raised.bodies
    higher = Pose((0.0, 0.0, body.pose.xyz[2] + 0.01))
    assert not noted(Scene("s", bodies=(plane, replace(body, pose=higher))))


@pytest.mark.skipif("mujoco" not in ENGINES, reason="needs MuJoCo")
@settings(max_examples=min(PROFILE, 20))
@given(st.floats(-3.0, 3.0), st.floats(-0.5, 0.5), st.floats(0.2, 0.9))
def test_an_engine_gets_the_mechanics_of_the_slide_in_any_frame(
    heading: float, tilt: float, friction: float
) -> None:
    sled = Sled(Box((0.3, 0.12, 0.15)), 6.0, friction, 5.0)
    faces: list[SlidingFace] = []
    with (
        patch.object(world_class("mujoco"), "sliding_fault", lambda _, face: faces.append(face)),
        World(sled.scene(heading, tilt), "mujoco"),
    ):
        (face,) = faces
    expected = (6.0, 9.81, friction, 5.0)
    assert face[:4] == pytest.approx(expected, rel=1e-6)
    assert face.size == pytest.approx((0.3, 0.12, 0.15), rel=1e-6)
    assert face.load == pytest.approx(friction * 0.075 / 0.15, rel=1e-6)
    assert face.flat


def test_a_robot_without_joints_slides_as_a_body_of_its_mass() -> None:
    friction = Material(friction=0.6)
    tensor = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    brick = dynx.load(
        f"""<robot name="brick"><link name="body">
          <inertial><origin xyz="0.02 0 -0.01"/><mass value="2"/>{tensor}</inertial>
          <collision><geometry><box size="0.2 0.1 0.2"/></geometry></collision></link></robot>""",
        base="floating",
    )
    at, speed = Pose((0.0, 0.0, 0.1), (0.0, 0.0, 0.4)), (10.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    robot = SceneRobot("brick", brick, v=speed, material=friction).at(at)
    turned = (10.0 * math.cos(0.4), 10.0 * math.sin(0.4), 0.0, 0.0, 0.0, 0.0)
    body = box("brick", (0.2, 0.1, 0.2), mass=2.0, pose=at, twist=turned, material=friction)
    moments = ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.01))
    body = replace(body, center_of_mass=(0.02, 0.0, -0.01), inertia=moments)
    plane = ground(material=friction)
    scenes = Scene("s", (robot,), (plane,)), Scene("s", bodies=(plane, body))
    faces: list[SlidingFace] = []
    with patch.object(world_class(ENGINES[0]), "sliding_fault", lambda _, face: faces.append(face)):
        for scene in scenes:
            World(scene, ENGINES[0]).close()
    one, other = faces
    assert one[:4] == pytest.approx(other[:4])
    assert one.size == pytest.approx(other.size)
    assert one.load == pytest.approx(other.load)
    for engine in ENGINES:
        counts = []
        for scene in scenes:
            with World(scene, engine, 4e-3) as world:
                counts.append(sum("slides too fast" in note for note in world.notes))
        assert counts[0] == counts[1]


def test_round_bodies_have_no_face() -> None:
    faces: list[SlidingFace] = []
    ball = sphere("ball", 0.1, mass=1.0, pose=Pose((0.0, 0.0, 0.1)), twist=(2.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    with (
        patch.object(world_class(ENGINES[0]), "sliding_fault", lambda _, face: faces.append(face)),
        World(Scene("s", bodies=(ground(), ball)), ENGINES[0]),
    ):
        (face,) = faces
    assert not face.flat
    assert face.slip == pytest.approx(2.0)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_body_that_carries_another_with_it_does_not_slide(engine: str) -> None:
    material = Material(friction=0.6)
    twist = (9.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    tray = box("tray", (1.0, 1.0, 0.1), mass=5.0, pose=Pose((0, 0, 0.55)), twist=twist, material=material)
    cup = box("cup", (0.1, 0.1, 0.1), mass=0.3, pose=Pose((0, 0, 0.65)), twist=twist, material=material)
    with World(Scene("s", bodies=(ground(), tray, cup)), engine, 2e-3) as world:
        assert world.notes == ()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_scene_of_dynx_that_begins_in_motion_is_slow_enough(engine: str) -> None:
    scene = read_scene("bowling")
    assert any(any(body.twist) for body in scene.bodies)
    with World(scene, engine) as world:
        assert [note for note in world.notes if "step of" in note] == []


@pytest.mark.parametrize("engine", ENGINES)
def test_a_part_that_moves_by_half_of_its_length_in_a_step_is_noted(engine: str) -> None:
    h = 2e-3

    def notes(body: SceneBody) -> tuple[str, ...]:
        with World(Scene("s", bodies=(body,)), engine, h) as world:
            return world.notes

    # Along its length a stick is long, across it is short.
    radius, straight = 0.02, 0.36
    for direction, length in ((0, 0.04), (2, 0.4)):
        for share, noted in ((0.45, False), (0.55, True)):
            twist = np.zeros(6)
            twist[direction] = share * length / h
            found = notes(capsule("rod", radius, straight, mass=1.0, twist=tuple(twist.tolist())))
            assert len(found) == noted
            if noted:
                assert found[0].startswith(
                    f"'rod' moves by {share:.2g} of its own length in a step of 0.002 s"
                )
    # The substeps are the steps of the engine.
    fast = capsule("rod", radius, straight, mass=1.0, twist=(0.55 * 0.04 / h, 0.0, 0.0, 0.0, 0.0, 0.0))
    with World(Scene("s", bodies=(fast,)), engine, h, substeps=2) as world:
        assert world.notes == ()


def test_links_of_robots_that_swing_fast_are_noted() -> None:
    arm = dynx.load("ur5")
    engine = ENGINES[0]
    for rate, noted in ((3.0, False), (300.0, True)):
        robot = SceneRobot("arm", arm, q=(0.0,) * 6, v=(rate, 0.0, 0.0, 0.0, 0.0, 0.0))
        with World(Scene("s", robots=(robot,)), engine, 1e-3) as world:
            found = [note for note in world.notes if "of its own length in a step" in note]
            assert bool(found) == noted
            assert all(note.startswith("'arm/") for note in found)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_free_body_that_turns_far_in_a_step_is_noted_and_gains_energy(engine: str) -> None:
    h = 2e-3
    for turn, noted in ((0.02, False), (0.15, True)):
        spin = np.array([0.1, 1.0, 0.05])
        spin *= turn / h / np.linalg.norm(spin)
        body = box("brick", (0.1, 0.24, 0.3), mass=2.0, twist=(0.0, 0.0, 0.0, *spin.tolist()))
        with World(Scene("s", bodies=(body,), gravity=(0.0, 0.0, 0.0)), engine, h) as world:
            found = [note for note in world.notes if "rad in a step" in note]
            assert bool(found) == noted
            before = energy(world, body)
            world.step(round(4.0 * math.pi / turn))
            assert (energy(world, body) > 1.04 * before) == noted


def energy(world: World, body: SceneBody) -> float:
    """Return twice the rotational energy of a body [J]."""
    T, twist = world.state.bodies[body.name]
    local = T[:3, :3].T @ twist[3:]
    return float(local @ body.inertial.tensor @ local)


def test_balls_and_wheels_that_spin_about_their_axis_are_not_noted() -> None:
    spin = (0.0, 0.0, 0.0, 0.0, 0.0, 400.0)
    wheel = SceneBody("wheel", (Collision(Cylinder(0.2, 0.05)),), mass=1.0, twist=spin)
    ball = sphere("ball", 0.1, mass=1.0, pose=Pose((1.0, 0.0, 0.0)), twist=(0.0, 0.0, 0.0, 0.0, 300.0, 300.0))
    lame = SceneBody("lame", (Collision(Sphere(0.1)),), Pose((2.0, 0.0, 0.0)), 1.0, np.diag([1.0, 1.0, 1.9]))
    tumbling = replace(lame, twist=(0.0, 0.0, 0.0, 0.0, 300.0, 300.0))
    with World(Scene("s", bodies=(wheel, ball, lame, ground(pose=Pose((0, 0, -9))))), ENGINES[0]) as world:
        assert world.notes == ()
    with World(Scene("s", bodies=(tumbling,)), ENGINES[0]) as world:
        assert "'lame' turns by 0.42 rad in a step of 0.001 s" in world.notes[0]
