"""Contacts and constraints of dynx's own stepper: closed forms, laws of mechanics, saved worlds, refusals."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.engines.own.impulses import MAX_RESIDUAL
from dynx.engines.own.stepper import OwnStepper
from dynx.model.geometry import Collision, Cylinder, HeightField, Mesh
from dynx.rbd.constraints import ConstraintSets, Residuals, Solution, solve
from dynx.spatial.scalar import Floats
from dynx.world import (
    Material,
    PDMotor,
    PointToPoint,
    PositionMotor,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    World,
    box,
    ground,
    sphere,
)

G = 9.81


def cubes(masses: Sequence[float], material: Material | None = None) -> list[SceneBody]:
    """Return cubes of 0.2 m on one another."""
    made = Material() if material is None else material
    return [
        box(f"cube {k}", (0.2, 0.2, 0.2), mass=mass, pose=dynx.Pose((0, 0, 0.1 + 0.2 * k)), material=made)
        for k, mass in enumerate(masses)
    ]


def on_slope(angle: float, friction: float) -> Scene:
    """Return a cube at rest on level ground, with gravity as on a slope [rad]."""
    gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
    material = Material(friction=friction)
    return Scene("slope", bodies=(ground(material=material), *cubes([2.0], material)), gravity=gravity)


@pytest.mark.parametrize("masses", [[1.0] * 5, [1.0, 1000.0], [1000.0, 1.0]], ids=str)
def test_stacks_stand_still_on_the_sum_of_their_weights(masses: list[float]) -> None:
    with World(Scene("stack", bodies=(ground(), *cubes(masses))), "dynx", 2e-3) as world:
        world.step(200)
        state, forces = world.state, world.contacts("ground")
        assert not world.notes
    for k in range(len(masses)):
        assert state.bodies[f"cube {k}"].position == pytest.approx([0, 0, 0.1 + 0.2 * k], abs=1e-9)
        assert np.abs(state.bodies[f"cube {k}"].twist).max() < 1e-9
    weight = -sum(contact.force[2] for contact in forces)
    assert weight == pytest.approx(G * sum(masses), rel=1e-9)


@pytest.mark.parametrize("rows", [3, 4])
def test_impulses_of_a_wall_at_rest_are_those_of_the_step_before(
    rows: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[int] = []

    def counted(*arguments: Any, **options: Any) -> Solution:
        found = solve(*arguments, **options)
        taken.append(found.iterations)
        return found

    monkeypatch.setattr("dynx.engines.own.impulses.solve", counted)
    bricks = [
        box(
            f"{i} {k}",
            (0.2, 0.1, 0.1),
            mass=1.0,
            pose=dynx.Pose((0.21 * k + 0.1 * (i % 2), 0, 0.1 * i + 0.05)),
        )
        for i, k in np.ndindex(rows, rows)
    ]
    with World(Scene("wall", bodies=(ground(), *bricks)), "dynx", 1e-3) as world:
        world.step(40)
        assert max(np.abs(body.twist).max() for body in world.state.bodies.values()) < 1e-9
    # Four contacts of a face carry more than the weight determines. By rounding alone, 39 steps and more.
    assert len(taken) == 40
    assert sum(taken[20:]) <= 20


@pytest.mark.parametrize("share", [0.5, 0.99])
def test_a_cube_on_a_slope_within_the_cone_does_not_creep(share: float) -> None:
    with World(on_slope(math.atan(0.5 * share), 0.5), "dynx", 1e-3) as world:
        world.step(300)
        assert np.abs(world.state.bodies["cube 0"].twist).max() < 1e-10
        assert np.abs(world.state.bodies["cube 0"].position[:2]).max() < 1e-10


@pytest.mark.parametrize("heading", [0.3, 2.0])
def test_a_sliding_plate_stops_where_coulombs_law_has_it(heading: float) -> None:
    speed, friction, h = 2.0, 0.4, 1e-3
    twist = (speed * math.cos(heading), speed * math.sin(heading), 0.0, 0.0, 0.0, 0.0)
    rough = Material(friction=friction)
    plate = box("plate", (0.4, 0.3, 0.1), mass=3.0, pose=dynx.Pose((0, 0, 0.05)), twist=twist, material=rough)
    with World(Scene("slide", bodies=(ground(material=rough), plate)), "dynx", h) as world:
        world.step(600)
        x, y, z = world.state.bodies["plate"].position
        assert np.abs(world.state.bodies["plate"].twist).max() < 1e-9
    assert math.hypot(x, y) == pytest.approx(speed**2 / (2 * friction * G) - speed * h / 2, rel=1e-4)
    assert math.atan2(y, x) == pytest.approx(heading if heading < 3 else heading - 2 * math.pi, abs=1e-8)
    assert z == pytest.approx(0.05, abs=1e-9)


def polygon(folder: Path, corners: int, height: float) -> Mesh:
    """Return a prism about z above the plane z = 0, whose corners are at 0.1 m from the axis."""
    angles = 2.0 * math.pi * np.arange(corners) / corners + 0.1
    lines = [f"v {0.1 * math.cos(a)} {0.1 * math.sin(a)} {z}" for z in (0.0, height) for a in angles.tolist()]
    lines += [f"f {k + 1} {k + 2} {corners + k + 1}" for k in range(corners)]
    file = folder / "prism.obj"
    file.write_text("\n".join(lines) + "\n")
    return Mesh(str(file))


@pytest.mark.parametrize("corners", [0, 6, 11])
def test_a_load_near_the_edge_of_a_face_with_many_vertices_neither_tips_nor_turns_it(
    corners: int, tmp_path: Path
) -> None:
    """Four points of a face do not bear the load of a body that slides with 0.95 of the friction at which it
    tips; those of the edge that the load is near do."""
    height = 0.2
    cosine = math.cos(math.pi / corners) if corners else 1.0
    rough = Material(friction=0.95 * cosine * 0.1 / (0.5 * height))
    speed, heading, h = 0.8, 0.7, 2e-3
    twist = (speed * math.cos(heading), speed * math.sin(heading), 0.0, 0.0, 0.0, 0.0)
    shape = polygon(tmp_path, corners, height) if corners else Cylinder(0.1, height)
    pose = dynx.Pose((0, 0, 0.0 if corners else 0.5 * height))
    body = SceneBody("body", shape, pose, 2.0, twist=twist, material=rough)
    with World(Scene("slide", bodies=(ground(material=rough), body)), "dynx", h) as world:
        world.step(60)
        T, twist_at_end = world.state.bodies["body"]
    assert np.abs(twist_at_end).max() < 1e-9
    assert T[:3, :3] == pytest.approx(np.eye(3), abs=1e-8)
    assert math.atan2(T[1, 3], T[0, 3]) == pytest.approx(heading, abs=1e-8)
    assert math.hypot(T[0, 3], T[1, 3]) == pytest.approx(
        speed**2 / (2 * rough.friction * G) - speed * h / 2, rel=1e-3
    )


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_ball_meets_the_wall_and_another_ball_by_newtons_law(restitution: float) -> None:
    made = Material(friction=0.0, restitution=restitution)
    left = sphere("left", 0.1, mass=1.0, twist=(2.0, 0, 0, 0, 0, 0), material=made)
    right = sphere("right", 0.1, mass=3.0, pose=dynx.Pose((0.3005, 0, 0)), material=made)
    with World(Scene("impact", bodies=(left, right), gravity=(0, 0, 0)), "dynx", 1e-3) as world:
        world.step(100)
        v = [world.state.bodies[name].twist[0] for name in ("left", "right")]
    assert v[1] - v[0] == pytest.approx(2.0 * restitution, abs=1e-9)
    assert v[0] + 3.0 * v[1] == pytest.approx(2.0, abs=1e-12)


def test_a_ball_that_bounces_gains_no_energy_and_comes_to_rest() -> None:
    made = Material(restitution=0.8)
    ball = sphere("ball", 0.1, mass=1.0, pose=dynx.Pose((0, 0, 0.5)), material=made)
    h, tops = 1e-3, [0.4]
    with World(Scene("bounce", bodies=(ground(material=made), ball)), "dynx", h) as world:
        rises = False
        for _ in range(3500):
            world.step()
            state = world.state.bodies["ball"]
            assert state.position[2] > 0.1 - 1e-9
            if rises and state.twist[2] <= 0.0:
                tops.append(state.position[2] - 0.1)
            rises = state.twist[2] > 0.0
        assert np.abs(state.twist).max() < 1e-9
    ratios = np.array(tops[1:5]) / tops[:4]
    assert (ratios <= 0.64 + 1e-12).all()
    # A step of gravity at the speed of the impact is the error of the integrator.
    assert ratios == pytest.approx(0.64, abs=4 * h * math.sqrt(2 * G / min(tops[:5])))


def test_bodies_in_the_air_move_with_the_bits_of_a_world_without_contacts() -> None:
    high = dynx.Pose((0, 0, 5.0), (0.1, 0.2, 0.3))
    brick = box("brick", (0.1, 0.2, 0.3), mass=1.0, pose=high, twist=(1, 0, 0, 3, 2, 1))
    # Within its limits: only with contacts or constraints they are rows of impulses.
    pendulum = SceneRobot("arm", dynx.load("panda"), q=(0.0, 0.3, 0.0, -1.5, 0.0, 1.5, 0.0, 0.02))
    scene = Scene("air", bodies=(ground(pose=dynx.Pose((0, 0, -2))), brick), robots=(pendulum,))
    states = []
    for collisions in (True, False):
        with World(scene, "dynx", 1e-3, collisions=collisions) as world:
            world.step(30)
            states.append(world.state)
    for name in ("q", "v"):
        ours, theirs = (getattr(state.robots["arm"], name) for state in states)
        assert ours.tobytes() == theirs.tobytes()
    assert states[0].bodies["brick"].twist.tobytes() == states[1].bodies["brick"].twist.tobytes()
    assert (
        states[0].bodies["brick"].T_world_body.tobytes() == states[1].bodies["brick"].T_world_body.tobytes()
    )


def tumbling() -> Scene:
    """Return bodies that fall on the ground and on one another, and slide."""
    made = Material(friction=0.4, torsional_friction=0.01, rolling_friction=0.002, restitution=0.3)
    bodies = [
        replace(each, twist=(1.0, 0.5 * k, 0.0, 1.0, 2.0, 3.0))
        for k, each in enumerate(cubes([1.0, 2.0, 0.5], made))
    ]
    ball = sphere("ball", 0.1, mass=1.0, pose=dynx.Pose((0.3, 0.1, 0.3)), material=made)
    return Scene("tumble", bodies=(ground(material=made), *bodies, ball))


def test_a_written_world_continues_bit_for_bit_with_its_warm_start(tmp_path: Path) -> None:
    with World(tumbling(), "dynx", 2e-3) as world:
        world.step(40)
        world.write(tmp_path / "tumble.world")
        snapshot = world.save()
        world.step(20)
        expected = world.state
        world.restore(snapshot)
        world.step(20)
        assert world.state == expected
    with World.read(tmp_path / "tumble.world") as again:
        again.step(20)
        assert again.state == expected


def test_contacts_keep_momentum_and_take_energy() -> None:
    scene = replace(tumbling(), gravity=(0.0, 0.0, 0.0))
    scene = replace(scene, bodies=scene.bodies[1:])
    with World(scene, "dynx", 1e-3) as world:
        before = _momentum_and_energy(scene, world)
        energies = [before[1]]
        for _ in range(10):
            world.step(20)
            momentum, energy = _momentum_and_energy(scene, world)
            assert momentum == pytest.approx(before[0], abs=1e-10)
            energies.append(energy)
    assert (np.diff(energies) <= 1e-9).all()
    assert energies[-1] < 0.9 * energies[0]


def _momentum_and_energy(scene: Scene, world: World) -> tuple[Floats, float]:
    momentum, energy = np.zeros(3), 0.0
    for body in scene.bodies:
        T, twist = world.state.bodies[body.name]
        inertia = T[:3, :3] @ np.array(body.inertial.tensor) @ T[:3, :3].T
        momentum += body.inertial.mass * twist[:3]
        energy += 0.5 * body.inertial.mass * twist[:3] @ twist[:3] + 0.5 * twist[3:] @ inertia @ twist[3:]
    return momentum, float(energy)


def test_a_robot_stands_on_its_feet_with_joint_friction_and_limits() -> None:
    dog = dynx.load("a1", base="floating")
    q = np.array([0, 0, 0.32, 0, 0, 0, 1, *[0.0, 0.8, -1.6] * 4])
    scene = Scene("stand", robots=(SceneRobot("dog", dog, q=tuple(q)),), bodies=(ground(),))
    stand = PDMotor(q[7:], kp=100.0, kd=2.0, max_force=30.0)
    with World(scene, "dynx", 1e-3) as world:
        world.run(1.0, motors={"dog": stand})
        feet = world.contacts("dog")
        assert len(feet) == 4
        assert sum(each.force[2] for each in feet) == pytest.approx(G * dog.total_mass, rel=2e-2)
        assert not world.notes


def test_a_joint_in_contact_stops_at_its_limit_and_sticks_by_dry_friction() -> None:
    """A slider that a ball pushes: its dry friction holds it, or it moves to its limit."""
    text = """<robot name="slider"><link name="base"/><link name="block">
      <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
      <joint name="slide" type="prismatic"><parent link="base"/><child link="block"/><axis xyz="1 0 0"/>
      <limit lower="-0.1" upper="0.05" effort="1" velocity="1"/><dynamics friction="{friction}"/></joint>
      </robot>"""
    for friction, held in ((70.0, True), (10.0, False)):
        robot = SceneRobot("slider", dynx.load(text.format(friction=friction)))
        ball = sphere("ball", 0.1, mass=1.0, pose=dynx.Pose((-0.2, 0, 0)))
        with World(
            Scene("push", robots=(robot,), bodies=(ball,), gravity=(30.0, 0, 0)), "dynx", 1e-3
        ) as world:
            world.step(200)
            q, v = world.state.robots["slider"]
            x = world.state.bodies["ball"].position[0]
        assert v[0] == pytest.approx(0.0, abs=1e-12)
        assert q[0] == pytest.approx(0.0 if held else 0.05, abs=1e-12)
        assert x == pytest.approx(q[0] - 0.2, abs=1e-9)


def test_a_joint_stops_at_its_limit_by_the_law_of_contacts_where_nothing_touches() -> None:
    """It reaches the limit at the end of a step, and has no velocity after the next one."""
    text = """<robot name="slider"><link name="base"/><link name="block">
      <inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
      <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
      <joint name="slide" type="prismatic"><parent link="base"/><child link="block"/><axis xyz="1 0 0"/>
      <limit lower="-0.1" upper="0.05" effort="1" velocity="1"/></joint></robot>"""
    h, start = 1e-3, 0.05 - 2.5e-3
    robot = SceneRobot("slider", dynx.load(text), q=(start,), v=(1.0,))
    far = sphere("ball", 0.1, mass=1.0, pose=dynx.Pose((5.0, 0, 0)))
    for bodies in ((far,), (ground(pose=dynx.Pose((0, 0, -1))), far)):
        scene = Scene("stop", robots=(robot,), bodies=bodies, gravity=(0.0, 0.0, 0.0))
        found = []
        with World(scene, "dynx", h) as world:
            for _ in range(4):
                world.step()
                found.append((*world.state.robots["slider"].q, *world.state.robots["slider"].v))
        wanted = [(start + h, 1.0), (start + 2.0 * h, 1.0), (0.05, 0.5), (0.05, 0.0)]
        assert np.array(found) == pytest.approx(np.array(wanted), abs=1e-9)


def test_impulses_that_miss_their_conditions_are_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    def unsolved(sets: ConstraintSets, G: Floats, c: Floats, *_: object, **__: object) -> Solution:
        residuals = Residuals(2.0 * MAX_RESIDUAL, 0.0, 0.0, 0.0, 0.0)
        return Solution(np.zeros(sets.size), c, residuals, 0)

    with World(Scene("one", bodies=(ground(), *cubes([1.0]))), "dynx", 1e-3) as world:
        world.step()
        assert not world.notes
        monkeypatch.setattr("dynx.engines.own.impulses.solve", unsolved)
        world.step(3)
        assert any("3 times by more than 1e-06 m/s, at most by 2e-06" in note for note in world.notes)


def test_a_box_and_a_ball_rest_on_a_height_field() -> None:
    flat = tuple((0.3,) * 9 for _ in range(9))
    field = HeightField(flat, (2.0, 2.0))
    hill = SceneBody("hill", (Collision(field),))
    at = (dynx.Pose((0.03, 0.02, 0.5)), dynx.Pose((0.6, 0.5, 0.55)))
    bodies = (
        hill,
        box("box", (0.3, 0.3, 0.2), mass=2.0, pose=at[0]),
        sphere("ball", 0.1, mass=1.0, pose=at[1]),
    )
    with World(Scene("hills", bodies=bodies), "dynx", 1e-3) as world:
        world.run(0.5)
        assert world.state.bodies["box"].position == pytest.approx([0.03, 0.02, 0.4], abs=1e-6)
        assert world.state.bodies["ball"].position == pytest.approx([0.6, 0.5, 0.4], abs=1e-6)
        weight = -sum(contact.force[2] for contact in world.contacts("hill"))
    assert weight == pytest.approx(3.0 * G, rel=1e-6)


def test_bodies_that_touch_without_a_force_have_a_contact() -> None:
    pair = sphere("a", 0.1, mass=1.0), sphere("b", 0.1, mass=1.0, pose=dynx.Pose((0.2, 0, 0)))
    with World(Scene("pair", bodies=pair, gravity=(0, 0, 0)), "dynx", 1e-3) as world:
        for _ in range(2):
            (contact,) = world.contacts()
            assert (contact.a, contact.b, contact.normal_force) == ("a", "b", 0.0)
            assert contact.normal == pytest.approx([-1.0, 0.0, 0.0])
            world.step()


def test_materials_are_those_of_the_scene() -> None:
    with World(tumbling(), "dynx", 1e-3) as world:
        assert not world.inexact_materials()
    assert OwnStepper.name == "dynx"


def test_overlaps_are_taken_back_where_nothing_presses_the_parts_together() -> None:
    balls = (sphere("a", 0.1, mass=1.0), sphere("b", 0.1, mass=3.0, pose=dynx.Pose((0.19, 0, 0))))
    with World(Scene("afloat", bodies=balls, gravity=(0, 0, 0)), "dynx", dt=1e-2) as world:
        world.step(100)
        a, b = (world.state.bodies[name] for name in "ab")
    # The displacement moves the centre of mass by nothing, and leaves no velocity.
    assert b.position[0] - a.position[0] == pytest.approx(0.2, abs=1e-9)
    assert a.position[0] + 3.0 * b.position[0] == pytest.approx(3.0 * 0.19, abs=1e-12)
    assert np.abs([a.twist, b.twist]).max() == 0.0


def test_overlaps_that_contradict_each_other_are_noted() -> None:
    walls = [box(name, (0.1, 1.0, 1.0), pose=dynx.Pose((x, 0, 0.5))) for name, x in (("l", -0.1), ("r", 0.1))]
    held = box("held", (0.102, 0.1, 0.1), mass=1.0, pose=dynx.Pose((0, 0, 0.5)))
    with World(Scene("vice", bodies=(*walls, held)), "dynx", dt=1e-3) as world:
        assert not any("contradicted" in note for note in world.notes)
        world.step(2)
        wanted = "contradicted each other 2 times, first the contact of "
        (note,) = (note for note in world.notes if wanted in note)
        assert {"'l' and 'held'", "'r' and 'held'"} == set(re.findall(r"'[lr]' and 'held'", note))
        assert abs(world.state.bodies["held"].position[0]) < 1e-6


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1 / 240, 1e-3]))
def test_a_weld_through_a_contact_makes_no_kinetic_energy(seed: int, dt: float) -> None:
    """The kinetic energy of cubes depends on their twists alone."""
    random = np.random.default_rng(seed)
    way = random.normal(size=3)
    place = dynx.Pose(tuple(0.22 * way / np.linalg.norm(way)), tuple(random.uniform(-3.0, 3.0, 3)))
    a = box("a", (0.2, 0.2, 0.2), mass=2.0, twist=tuple(random.uniform(-1.0, 1.0, 6)))
    b = box("b", (0.1, 0.1, 0.1), mass=0.3, pose=place, twist=tuple(random.uniform(-1.0, 1.0, 6)))
    weld = Weld("a", "b", dynx.Pose())
    scene = Scene("drawn", bodies=(a, b), constraints=(weld,), gravity=(0, 0, 0))
    inertias = {"a": (2.0, 2.0 * 0.2**2 / 6.0), "b": (0.3, 0.3 * 0.1**2 / 6.0)}
    with World(scene, "dynx", dt) as world:
        energy, gap = math.inf, 0.22
        for _ in range(20):
            world.step()
            twists = {name: world.state.bodies[name].twist for name in inertias}
            now = 0.0
            for name, (mass, inertia) in inertias.items():
                linear, angular = twists[name][:3], twists[name][3:]
                now += 0.5 * float(mass * linear @ linear + inertia * angular @ angular)
            assert now <= energy + 1e-12
            energy = now
        state = world.state
    assert np.linalg.norm(state.bodies["a"].position - state.bodies["b"].position) <= gap + 1e-9


@pytest.mark.parametrize("dt", [1 / 240, 1e-3])
def test_a_weld_through_a_contact_moves_an_arm_little_and_is_named(dt: float) -> None:
    """The displacement that ends the error of the weld turns the whole arm for each millimetre."""
    links = "".join(
        f'<link name="l{k}"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>'
        '<inertia ixx="0.005" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial><collision>'
        '<origin xyz="0.2 0 0"/><geometry><box size="0.36 0.08 0.08"/></geometry></collision></link>'
        f'<joint name="j{k}" type="continuous"><parent link="{parent}"/><child link="l{k}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/></joint>'
        for k, (parent, x, axis) in enumerate(
            [("base", 0.0, "0 1 0"), ("l0", 0.4, "1 0 0"), ("l1", 0.4, "0 1 0")]
        )
    )
    model = dynx.load(f'<robot name="arm"><link name="base"/>{links}</robot>')
    kinematics = dynx.backend("reference", model)
    q = np.array([0.3, 0.4, -0.5])
    T = kinematics.forward_kinematics(q, "l2")
    beside = dynx.Pose(tuple(T[:3, 3] + T[:3, :3] @ [0.2, 0.03, 0.12]), (3.1, 0, 0))
    block = box("block", (0.05, 0.05, 0.05), mass=0.1, pose=beside)
    arm = SceneRobot("arm", model, q=q, motors=(PositionMotor(q, kp=2000.0, kd=200.0),))
    weld = Weld("arm/l2", "block", dynx.Pose((0.2, 0, 0)))
    scene = Scene("grasp", robots=(arm,), bodies=(block,), constraints=(weld,), gravity=(0, 0, 0))
    with World(scene, "dynx", dt) as world:
        world.run(0.15)
        assert np.abs(world.state.robots["arm"].q - q).max() < 0.1
        T = kinematics.forward_kinematics(world.state.robots["arm"].q, "l2")
        middle = T[:3, 3] + T[:3, :3] @ [0.2, 0, 0]
        # At the start it is 0.124 m.
        assert np.linalg.norm(middle - world.state.bodies["block"].position) < 0.1
        named = "first the weld of 'arm/l2' and 'block' and the contact of 'arm/l2' and 'block'"
        assert any(named in note for note in world.notes)


@pytest.mark.parametrize("dt", [4e-3, 1e-3])
def test_a_body_on_a_point_swings_without_losing_energy(dt: float) -> None:
    post = box("post", (0.1, 0.1, 0.1), pose=dynx.Pose((-0.5, 0, 1.0)))
    bob = box("bob", (0.1, 0.1, 0.1), mass=1.0, pose=dynx.Pose((0, 0, 1.0)))
    joint = PointToPoint("post", "bob", point_a=(0.0, 0, 0), point_b=(-0.5, 0, 0))
    # Half a period from horizontal: 2 K(1/2) sqrt(I / (m g l)) with K(1/2) = 1.8540746773.
    half = 2.0 * 1.8540746773 * math.sqrt((0.25 + 0.01 / 6.0) / (G * 0.5))
    with World(Scene("pendulum", bodies=(post, bob), constraints=(joint,)), "dynx", dt) as world:
        heights = []
        for _ in range(round(4.5 * half / dt)):
            world.step()
            heights.append(world.state.bodies["bob"].position[2])
    rises = np.array(heights)
    tops = 1 + np.flatnonzero((rises[1:-1] > rises[:-2]) & (rises[1:-1] >= rises[2:]))
    assert len(tops) == 4
    assert rises[tops] == pytest.approx(1.0, abs=3.0 * dt**2 * G**2)
    assert (tops + 1) * dt == pytest.approx(half * np.arange(1, 5), abs=1.01 * dt)


def test_a_link_on_a_point_swings_as_on_a_joint() -> None:
    """A double pendulum of two links that a floating base and points hold, against one with joints."""
    rod = (
        '<inertial><origin xyz="0.25 0 0"/><mass value="1"/>'
        '<inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    joint = (
        '<joint name="{}" type="continuous"><parent link="{}"/><child link="{}"/>{}'
        '<axis xyz="0 1 0"/></joint>'
    )
    elbow = joint.format("elbow", "a", "b", '<origin xyz="0.5 0 0"/>')
    links = f'<link name="a">{rod}</link><link name="b">{rod}</link>'
    shoulder = joint.format("shoulder", "post", "a", "")
    jointed = dynx.load(f'<robot name="r"><link name="post"/>{links}{shoulder}{elbow}</robot>')
    floating = dynx.load(f'<robot name="r">{links}{elbow}</robot>', base="floating")
    post = sphere("post", 0.01)
    held = Scene(
        "held",
        robots=(SceneRobot("r", floating),),
        bodies=(post,),
        constraints=(PointToPoint("post", "r/a", point_a=(0.0, 0, 0), point_b=(0.0, 0, 0)),),
    )
    errors = []
    for dt in (2e-3, 1e-3):
        worlds = [
            World(each, "dynx", dt, collisions=False)
            for each in (held, Scene("j", robots=(SceneRobot("r", jointed),)))
        ]
        with worlds[0], worlds[1]:
            for world in worlds:
                world.run(0.8)
            (q, _), (wanted, _) = (world.state.robots["r"] for world in worlds)
        errors.append(abs(q[-1] - wanted[-1]))
        assert np.abs(q[:3]).max() < 10.0 * dt**2
    assert errors[1] < 0.7 * errors[0] < 0.02
