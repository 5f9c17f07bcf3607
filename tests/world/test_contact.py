"""Contacts in closed form: rest, slope, impact, stack; one sign convention on every engine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dynx import Pose
from dynx.model.geometry import Capsule, Collision, Cylinder, Mesh, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Contact, ExternalForce, Material, Scene, SceneBody, World, box, ground
from tests.world.engines import WORLDS

pytestmark = pytest.mark.parametrize("engine", WORLDS)

G = 9.81
MASS = 2.0


def on_ground(friction: float = 0.5, gravity: tuple[float, float, float] = (0.0, 0.0, -G)) -> Scene:
    material = Material(friction=friction)
    brick = box("brick", (0.4, 0.4, 0.2), mass=MASS, pose=Pose((0, 0, 0.1)), material=material)
    return Scene("rest", bodies=(ground(material=material), brick), gravity=gravity)


def force_on(name: str, contacts: tuple[Contact, ...]) -> Floats:
    """Return the sum of the contact forces on a part."""
    signed = [c.force if c.a == name else -c.force for c in contacts if name in (c.a, c.b)]
    return np.sum(signed, axis=0) if signed else np.zeros(3)


def test_the_ground_carries_the_weight_of_a_box_at_rest(engine: str) -> None:
    with World(on_ground(), engine) as world:
        world.run(1.0)
        contacts = world.contacts()
        T = world.state.bodies["brick"].T_world_body
    assert_allclose(force_on("brick", contacts), [0, 0, MASS * G], rtol=1e-3, atol=0.02)
    assert T[2, 3] == pytest.approx(0.1, abs=1e-3)
    for contact in contacts:
        assert (contact.a, contact.b) == ("ground", "brick")
        # From b to a: downwards, on the ground.
        assert_allclose(contact.normal, [0, 0, -1], atol=1e-3)
        assert contact.normal_force >= 0.0
        assert abs(float(contact.friction_force @ contact.normal)) < 1e-6 + 1e-3 * contact.normal_force
        apart = float((contact.point_a - contact.point_b) @ contact.normal)
        assert contact.distance == pytest.approx(apart, abs=1e-6)


def test_the_moments_of_contact_forces_at_rest_balance(engine: str) -> None:
    center = np.array([0.12, -0.07, -0.05])
    brick = box("brick", (0.4, 0.4, 0.2), mass=MASS, pose=Pose((0, 0, 0.1)), center_of_mass=center)
    with World(Scene("rest", bodies=(ground(), brick)), engine) as world:
        world.run(1.0)
        contacts = world.contacts()
        T = world.state.bodies["brick"].T_world_body
    lever = T[:3, :3] @ center + T[:3, 3]
    moment = np.sum([np.cross(c.point - lever, -c.force) for c in contacts], axis=0)
    # The weight has a moment of 2.7 N m about the middle of the box.
    assert_allclose(force_on("brick", contacts), [0, 0, MASS * G], rtol=1e-3, atol=0.02)
    assert_allclose(moment, [0, 0, 0], atol=0.01)


def test_contact_forces_give_the_change_of_angular_momentum(engine: str) -> None:
    center, size = np.array([0.12, -0.07, -0.05]), (0.4, 0.4, 0.2)
    # It lands on one edge.
    brick = box("brick", size, mass=MASS, pose=Pose((0, 0, 0.12), (0.05, 0.0, 0.0)), center_of_mass=center)
    scene, dt = Scene("tilted", bodies=(ground(), brick)), 1e-3
    inertia = scene.body("brick").inertial.tensor

    def spin() -> tuple[Floats, Floats]:
        T, twist = world.state.bodies["brick"]
        return T[:3, :3] @ center + T[:3, 3], T[:3, :3] @ inertia @ T[:3, :3].T @ twist[3:]

    errors, largest = [], 0.0
    with World(scene, engine, dt) as world:
        at, before = spin()
        for _ in range(200):
            world.step()
            moment = np.zeros(3)
            for contact in world.contacts():
                moment += np.cross(contact.point_b - at, -contact.force)
            at, after = spin()
            # About the normal a surface of Drake has a moment of friction besides.
            errors.append((after - before - dt * moment)[:2])
            largest = max(largest, float(np.abs(after - before).max()))
            before = after
    assert np.abs(errors).max() < 0.02 * largest


@pytest.mark.parametrize(("tangent", "sticks"), [(0.3, True), (0.9, False)])
def test_a_box_on_a_slope_sticks_or_slides(engine: str, tangent: float, sticks: bool) -> None:
    angle, friction = np.arctan(tangent), 0.5
    # A slope is gravity that leans.
    scene = on_ground(friction, (G * np.sin(angle), 0.0, -G * np.cos(angle)))
    with World(scene, engine) as world:
        world.run(0.4)
        forces = []
        for _ in range(100):
            world.step()
            forces.append(force_on("brick", world.contacts()))
        twist = world.state.bodies["brick"].twist
    # The mean, because a sliding box rattles.
    force = np.mean(forces, axis=0)
    weight = MASS * G
    if sticks:
        assert abs(twist[0]) < 5e-3
        assert force[0] == pytest.approx(-weight * np.sin(angle), rel=0.05)
        assert force[2] == pytest.approx(weight * np.cos(angle), rel=0.02)
    else:
        expected = G * (np.sin(angle) - friction * np.cos(angle))
        assert twist[0] == pytest.approx(0.5 * expected, rel=0.05)
        assert force[0] == pytest.approx(-friction * force[2], rel=0.02)


def test_an_impact_keeps_the_momentum(engine: str) -> None:
    balls = (
        SceneBody("one", (Collision(Sphere(0.1)),), Pose((-0.3, 0, 0)), 1.0, twist=(2.0, 0, 0, 0, 0, 0)),
        SceneBody("two", (Collision(Sphere(0.1)),), Pose((0.0, 0, 0)), 3.0),
    )
    with World(Scene("impact", bodies=balls, gravity=(0, 0, 0)), engine) as world:
        world.run(0.3)
        one, two = (world.state.bodies[name].twist for name in ("one", "two"))
    assert_allclose(one[:3] + 3.0 * two[:3], [2.0, 0, 0], atol=1e-6)
    assert two[0] > 0.3


@pytest.mark.parametrize("shape", [Sphere(0.1), Cylinder(0.1, 0.2), Capsule(0.1, 0.3)])
def test_a_round_body_rests_at_its_height(engine: str, shape: Shape) -> None:
    height = 0.25 if isinstance(shape, Capsule) else 0.1
    body = SceneBody("round", (Collision(shape),), Pose((0, 0, height)), MASS)
    with World(Scene("s", bodies=(ground(), body)), engine) as world:
        world.run(0.5)
        assert world.state.bodies["round"].T_world_body[2, 3] == pytest.approx(height, abs=1e-3)
        assert force_on("round", world.contacts())[2] == pytest.approx(MASS * G, rel=0.01)


def test_a_mesh_rests_at_its_height(engine: str, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    corners = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["f 1 2 4 3", "f 5 7 8 6", "f 1 5 6 2", "f 3 4 8 7", "f 1 3 7 5", "f 2 6 8 4"]
    file = tmp_path / "cube.obj"
    file.write_text("\n".join([*lines, ""]))
    body = SceneBody("cube", (Collision(Mesh(str(file))),), Pose((0, 0, 0.1)), MASS)
    with World(Scene("s", bodies=(ground(), body)), engine) as world:
        world.run(0.5)
        height = world.state.bodies["cube"].T_world_body[2, 3]
        force = force_on("cube", world.contacts())[2]
    # Drake's point contact gives a mesh one point at a time, on which it rocks.
    assert engine == "drake" or force == pytest.approx(MASS * G, rel=0.01)
    # A margin around the hull would lift it by a millimetre.
    assert height == pytest.approx(0.1, abs=6e-4)


def test_contacts_before_the_first_step_are_those_of_the_start(engine: str) -> None:
    sunk = box("brick", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.09)))
    with World(Scene("s", bodies=(ground(), sunk)), engine) as world:
        contacts = world.contacts()
        assert contacts
        assert min(c.distance for c in contacts) == pytest.approx(-0.01, abs=1e-3)
        assert all(c.normal_force == 0.0 for c in contacts)


def test_contacts_after_the_state_was_set_are_those_of_the_new_state(engine: str) -> None:
    with World(on_ground(), engine) as world:
        world.step(20)
        assert force_on("brick", world.contacts())[2] > 0.0
        world.set_state(bodies={"brick": (Pose((0, 0, 0.09)).matrix, np.zeros(6))})
        contacts = world.contacts()
    assert min(c.distance for c in contacts) == pytest.approx(-0.01, abs=1e-3)
    assert all(c.normal_force == 0.0 and not c.friction_force.any() for c in contacts)


def test_contacts_after_several_steps_are_those_of_the_last(engine: str) -> None:
    dropped = box("brick", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.105)))
    scene, forces = Scene("s", bodies=(ground(), dropped)), []
    for calls in (1, 60):
        with World(scene, engine) as world:
            for _ in range(calls):
                world.step(60 // calls)
            forces.append(force_on("brick", world.contacts()))
    assert forces[0][2] > 0.0
    assert (forces[0] == forces[1]).all()


def test_bodies_that_ignore_one_another_pass_through(engine: str) -> None:
    brick = box("brick", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.3)))
    scene = Scene("s", bodies=(ground(), brick), ignored=(("ground", "brick"),))
    with World(scene, engine) as world:
        world.step(500)
        assert world.contacts() == ()
        assert world.state.bodies["brick"].T_world_body[2, 3] < -0.5


def test_a_held_push_slides_a_box_against_friction(engine: str) -> None:
    with World(on_ground(0.4), engine) as world:
        world.run(0.2)
        x = world.state.bodies["brick"].twist[0]
        world.step(100, forces=[ExternalForce("brick", (12.0, 0, 0, 0, 0, 0), point=(0, 0, -0.1))])
        gained = world.state.bodies["brick"].twist[0] - x
    assert gained == pytest.approx(0.1 * (12.0 / MASS - 0.4 * G), rel=0.05)
