"""Notes on the start of a world: parts that overlap, constraints that are violated."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.model import Inertial, Joint, Link, Model
from dynx.model.elements import JointType, Limits, Mimic
from dynx.world import (
    Encoder,
    Imu,
    PDMotor,
    PointToPoint,
    PositionMotor,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    World,
    box,
    ellipsoid,
    ground,
    read_scene,
    scene_names,
    sphere,
)
from tests.world.engines import WORLDS


def brick(name: str, x: float = 0.0) -> SceneBody:
    return box(name, (0.2, 0.2, 0.2), mass=1.0, pose=Pose((x, 0.0, 0.0)))


@pytest.mark.parametrize("engine", WORLDS)
def test_parts_that_overlap_at_the_start_are_noted_with_their_depth(engine: str) -> None:
    bodies = (brick("a"), brick("b", 0.15), brick("far", 5.0))
    with World(Scene("s", bodies=bodies), engine) as world:
        assert len(world.notes) == 1
        assert world.notes[0].startswith("'a' and 'b' overlap by 50 mm at the start")
        assert "1 note" in repr(world)
        ((a, b, depth),) = world.overlaps()
        assert (a, b) == ("a", "b")
        assert depth == pytest.approx(0.05, abs=1e-6)
    with World(Scene("s", bodies=bodies, ignored=(("a", "b"),)), engine) as world:
        assert world.notes == ()
        assert world.overlaps() == ()


@pytest.mark.parametrize("engine", WORLDS)
def test_a_gravity_of_a_model_that_the_scene_replaces_is_noted(engine: str) -> None:
    def notes(own: tuple[float, float, float], of_scene: tuple[float, float, float]) -> tuple[str, ...]:
        robot = SceneRobot("arm", dynx.load("ur5").with_gravity(own))
        with World(Scene("s", robots=(robot,), gravity=of_scene), engine) as world:
            return tuple(each for each in world.notes if "gravity" in each)

    moon, standard = (0.0, 0.0, -1.62), (0.0, 0.0, -9.81)
    assert notes(moon, standard) == (
        "gravity is (0, 0, -9.81) m/s^2, that of the scene, and not the (0, 0, -1.62) of the model of 'arm'",
    )
    assert notes(moon, moon) == notes(standard, moon) == ()


@pytest.mark.parametrize("engine", WORLDS)
def test_parts_at_rest_on_one_another_are_not_noted(engine: str) -> None:
    bodies = (
        ground(),
        box("cube", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.1))),
        box("upper", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.3))),
    )
    with World(Scene("s", bodies=bodies), engine) as world:
        assert world.notes == ()
        world.run(0.5)
        assert world.overlaps() == ()


def test_overlaps_of_small_parts_count_relative_to_their_size() -> None:
    marbles = (sphere("a", 1e-3, mass=0.1), sphere("b", 1e-3, mass=0.1, pose=Pose((1.5e-3, 0, 0))))
    with World(Scene("s", bodies=marbles), "mujoco") as world:
        assert "overlap by 0.5 mm" in world.notes[0]


@pytest.mark.parametrize("engine", WORLDS)
def test_constraints_that_the_start_violates_are_noted(engine: str) -> None:
    bodies = (brick("a"), brick("b", 0.5))
    at = Pose((0.4, 0.0, 0.0), (0.0, 0.0, math.pi / 2))
    with World(Scene("s", bodies=bodies, constraints=(Weld("a", "b", at),)), engine) as world:
        (note,) = world.notes
        assert note.startswith("the ends of the weld of 'a' and 'b' are 100 mm apart and turned by 1.57 rad")
    point = PointToPoint("a", "world", (0.0, 0.0, 0.1), (0.0, 0.3, 0.1))
    with World(Scene("s", bodies=bodies, constraints=(point,)), engine) as world:
        (note,) = world.notes
        assert note.startswith(
            "the ends of the point-to-point constraint of 'a' and 'world' are 300 mm apart at the start"
        )
    met = (Weld("a", "b"), PointToPoint("a", "world", (0.0, 0.0, 0.1), (0.0, 0.0, 0.1)))
    with World(Scene("s", bodies=bodies, constraints=met), engine) as world:
        assert world.notes == ()


@pytest.mark.parametrize("name", scene_names())
def test_the_scenes_of_dynx_have_no_notes(name: str) -> None:
    with World(read_scene(name), "pybullet") as world:
        # Nothing is amiss in a scene; what the engine has with an error is not the scene's fault.
        assert [note for note in world.notes if " in pybullet: " not in note] == []


@pytest.mark.parametrize("engine", WORLDS)
def test_joints_beyond_their_limits_at_the_start_are_noted(engine: str) -> None:
    robot = SceneRobot("arm", dynx.load("planar_2r"), q=(0.0, -3.0))
    with World(Scene("s", robots=(robot,)), engine) as world:
        (note,) = world.notes
        assert note.startswith("'arm/elbow' is at -3, beyond its limits -2.6 to 2.6, at the start")
    with World(Scene("s", robots=(robot,)), engine, joint_limits=False) as world:
        assert world.notes == ()


@pytest.mark.parametrize(
    ("kinds", "masses", "ends"),
    [
        ("rrr", "001", ("j0", "j2")),
        ("rrr", "011", None),
        ("rrr", "101", None),
        ("prrr", "0001", ("j1", "j3")),
        ("rrrr", "1001", ("j1", "j3")),
        ("rrpr", "0011", None),
        ("rpr", "001", None),
    ],
)
def test_three_hinges_without_mass_between_them_are_noted(
    kinds: str, masses: str, ends: tuple[str, str] | None
) -> None:
    links = [Link("base")]
    joints = []
    for k, (kind, mass) in enumerate(zip(kinds, masses, strict=True)):
        body = Inertial(1.0, Pose((0.1, 0.2, 0.3)), ixx=0.1, iyy=0.2, izz=0.15)
        links.append(Link(f"l{k}", body if mass == "1" else None))
        axis = tuple(np.eye(3)[(2 - k) % 3].tolist())
        type_: JointType = "continuous" if kind == "r" else "prismatic"
        joints.append(Joint(f"j{k}", type_, links[k].name, f"l{k}", Pose((0.0, 0.1, 0.05)), axis))
    robot = SceneRobot("wrist", Model.build("wrist", links, joints), q=(0.1, 0.3, -0.2, 0.4)[: len(kinds)])
    with World(Scene("s", robots=(robot,)), "pybullet" if "pybullet" in WORLDS else WORLDS[0]) as world:
        found = [note for note in world.notes if "no bound" in note]
    if ends is None:
        assert found == []
    else:
        (note,) = found
        assert all(f"'wrist/{name}'" in note for name in ends)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_step_in_which_bodies_miss_each_other_is_noted(engine: str) -> None:
    with World(Scene("s", bodies=(brick("a"),)), engine, dt=100.0) as world:
        (note,) = world.notes
        assert note.startswith("a step of 100 s is longer than 0.1 s")


@pytest.mark.skipif("mujoco" not in WORLDS, reason="needs MuJoCo")
def test_time_constants_that_mujoco_raises_are_noted_where_they_are_given() -> None:
    scene = Scene("s", bodies=(brick("a"),))
    with World(scene, "mujoco", dt=4e-3, time_constant=1e-3, slip_time_constant=4e-3) as world:
        (note,) = world.notes
        assert note.startswith("setting time_constant is 0.001, but 0.008 in effect")
    with World(scene, "mujoco", dt=4e-3) as world:
        assert world.notes == ()
    with World(scene, "mujoco", dt=4e-3, substeps=8, time_constant=1e-3) as world:
        assert world.notes == ()


@pytest.mark.parametrize("engine", WORLDS)
def test_a_world_read_from_a_file_has_the_notes_that_hold_past_its_start(engine: str, tmp_path: Path) -> None:
    with World(Scene("s", bodies=(brick("a"), brick("b", 0.15))), engine, dt=0.2, substeps=1) as world:
        assert len(world.notes) == 2
        world.write(tmp_path / "saved.world")
        with World.read(tmp_path / "saved.world") as read:
            assert read.notes == world.notes[1:]
            assert "longer than 0.1 s" in read.notes[0]


def test_a_robot_without_collision_shapes_is_noted_where_there_is_something_to_pass_through() -> None:
    robot = SceneRobot("arm", dynx.load("planar_2r"))
    with World(Scene("s", robots=(robot,), bodies=(brick("a"),)), "pybullet") as world:
        assert world.notes == ("no link of 'arm' has a collision shape: it passes through everything",)
    with World(Scene("s", robots=(robot,), bodies=(brick("a"),)), "pybullet", collisions=False) as world:
        assert world.notes == ()
    with World(Scene("s", robots=(robot,)), "pybullet") as world:
        assert world.notes == ()


def test_angles_of_a_scene_that_look_like_degrees_are_noted() -> None:
    """Rotations of bodies and sensors beyond a full turn, and targets of motors far beyond limits; not those
    of motors without stiffness, nor of angles that are in radians."""
    arm = dynx.load("ur5").with_base_pose(Pose((0.0, 0.0, 2.0)))
    turned, level = Pose((2.0, 0.0, 0.0), (0.0, 0.0, 90.0)), Pose((4.0, 0.0, 0.0), (0.0, 0.0, 6.2))
    target = np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    bodies = (
        box("turned", (0.1, 0.1, 0.1), mass=1.0, pose=turned),
        box("level", (0.1, 0.1, 0.1), mass=1.0, pose=level),
    )
    sensors = (Imu("imu", "arm/tool0", pose=Pose(rpy=(0.0, -180.0, 0.0))), Encoder("e", "arm/elbow_joint"))
    for motor, noted in (
        (PDMotor(target, 100.0, 10.0), True),
        (PositionMotor(target, 100.0, 10.0), True),
        (PDMotor(target, 0.0, 10.0), False),
        (PDMotor(np.radians(target), 100.0, 10.0), False),
    ):
        robot = SceneRobot("arm", arm, motors=motor)
        with World(Scene("s", robots=(robot,), bodies=bodies, sensors=sensors), "mujoco") as world:
            assert [each.partition(", more than a full turn; ")[::2] for each in world.notes[:2]] == [
                ("rpy of the pose of 'turned' holds 90 rad", "90 degrees are 1.5708 rad"),
                ("rpy of the pose of 'imu' holds -180 rad", "-180 degrees are -3.1416 rad"),
            ]
            of_motors = [each for each in world.notes if "the target of the motors of 'arm'" in each]
            assert len(of_motors) == (2 if noted else 0)
            if noted:
                assert "'elbow_joint' is at 90 rad, far beyond its limits" in of_motors[1]
                assert "90 degrees are 1.5708 rad" in of_motors[1]


def test_targets_of_motors_in_steps_are_noted_once_where_they_look_like_degrees() -> None:
    arm = dynx.load("ur5")
    target = np.array([0.0, -90.0, 0.0, 0.0, 0.0, 0.0])
    with World(Scene("s", robots=[SceneRobot("arm", arm)]), "mujoco", dt=1e-3) as world:
        before = world.notes
        # Neither a target in radians, a little beyond a limit, nor one without stiffness.
        for motor in (np.radians(target), np.array([6.9, 0.0, 0.0, 0.0, 0.0, 0.0]), target):
            world.step(motors={"arm": PDMotor(motor, 0.0 if motor is target else 1.0, 10.0)})
        assert world.notes == before
        for _ in range(3):
            world.step(motors={"arm": PositionMotor(target, 100.0, 10.0)})
        assert world.notes == (
            *before,
            "the target of the motors of 'arm': 'shoulder_lift_joint' is at -90 rad, far beyond its limits "
            "-6.283 to 6.283; -90 degrees are -1.5708 rad",
        )


@pytest.mark.parametrize("engine", WORLDS)
def test_gains_that_are_unstable_in_steps_are_noted_from_the_first_step(engine: str) -> None:
    dog = dynx.load("a1", base="floating")
    q = np.array([0, 0, 1.0, 0, 0, 0, 1, *[0.0, 0.8, -1.6] * 4])
    with World(Scene("s", robots=[SceneRobot("dog", dog, q=tuple(q))]), engine, dt=4e-3) as world:
        before = world.notes
        # Neither gains within the bound nor those of a motor at the end of the step.
        for motor in (PDMotor(q[7:], 100.0, 2.0), PositionMotor(q[7:], 100.0, 8.0)):
            world.step(motors={"dog": motor})
        assert world.notes == before
        for _ in range(2):
            world.step(motors={"dog": PDMotor(q[7:], 100.0, 8.0)})
        M = dynx.backend("reference", dog).mass_matrix(q)
        ratio = 8.0 * 4e-3 * np.linalg.inv(M).diagonal()[6:].max()
        (note,) = set(world.notes) - set(before)
        assert f"kd dt is {ratio:.3g} times the inertia, and such a motor is unstable above 2" in note


@pytest.mark.parametrize("engine", WORLDS)
def test_an_ellipsoid_rests_on_its_shortest_half_axis_and_bullet_says_what_it_has(engine: str) -> None:
    lens = ellipsoid("lens", (0.2, 0.3, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.11)))
    with World(Scene("s", bodies=(ground(), lens)), engine) as world:
        named = [note for note in world.notes if "Ellipsoid" in note]
        assert (len(named) == 1) == (engine == "pybullet")
        assert all("'lens' as polyhedra, within 0.2 %" in note for note in named)
        world.run(1.0)
        # A polyhedron within 0.2 % of the half axes, and contacts that yield by less than half a millimetre.
        assert world.state.bodies["lens"].position[2] == pytest.approx(0.1, abs=0.002 * 0.1 + 5e-4)


def test_joints_that_limits_hold_are_noted_alike_in_worlds_and_rollouts() -> None:
    body = Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    links = [Link("base"), *(Link(name, body) for name in ("a", "b", "c", "d"))]
    held, free = Limits(0.2, 0.2, 1.0, 1.0), Limits(-1.0, 1.0, 1.0, 1.0)
    joints = [
        Joint("held", "revolute", "base", "a", limits=held),
        Joint("free", "revolute", "a", "b", limits=free),
        Joint("driver", "revolute", "b", "c", limits=free),
        Joint("follower", "revolute", "c", "d", limits=held, mimic=Mimic("driver", 1.0, 0.0)),
    ]
    model = Model.build("held", links, joints)
    rollout = dynx.simulate(model, duration=0.01, plant="reference")
    assert [note for note in rollout.notes if "without a range" in note] == [
        "limits without a range hold 'held', 'driver'; joint_limits=False switches them off"
    ]
    with World(Scene("s", robots=[SceneRobot("arm", model)]), "dynx") as world:
        (note,) = (note for note in world.notes if "without a range" in note)
    assert note.startswith("limits without a range hold 'arm/held', ")


def test_a_ball_joint_of_largest_angle_zero_is_held() -> None:
    body = Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    joint = Joint("shoulder", "ball", "base", "a", limits=Limits(0.0, 0.0))
    model = Model.build("ball", [Link("base"), Link("a", body)], [joint])
    with World(Scene("s", robots=[SceneRobot("arm", model)]), "dynx") as world:
        assert any("hold 'arm/shoulder'" in note for note in world.notes)
    assert any("hold 'shoulder'" in note for note in dynx.simulate(model, duration=0.01).notes)
