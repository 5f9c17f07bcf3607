"""Worlds in Drake: contacts, filters, distances, constraints, rays, refused features, saved states."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.engines.drake.build import build_scene
from dynx.engines.drake.stepper import DrakeStepper, parts_of_force
from dynx.errors import SingularMassMatrixError, UnsupportedFeatureError
from dynx.model.geometry import Collision, HeightField
from dynx.steppers.forces import Forces
from dynx.steppers.layout import Layout
from dynx.world import Material, Scene, SceneBody, SceneRobot, World, box, ground, sphere
from dynx.world.preparation import prepare

G = 9.81
SWITCHES = {
    "collisions": True,
    "joint_limits": True,
    "joint_damping": True,
    "joint_friction": False,
    "joint_armature": True,
    "joint_springs": True,
}
DEFAULTS = {name: setting.default for name, setting in DrakeStepper.settings.items()}


def layout_of(scene: Scene) -> Layout:
    return prepare(scene, **SWITCHES)


def test_exactly_the_pairs_of_the_scene_collide() -> None:
    other = dynx.load("panda").with_base_pose(Pose((0.6, 0.0, 0.0)))
    robots = (SceneRobot("a", dynx.load("ur5")), SceneRobot("b", other, self_collision=True))
    scene = Scene("s", robots=robots, bodies=(ground(), box("cube", (0.1,) * 3, mass=1.0)))
    layout = layout_of(scene)
    built = build_scene(layout, 1e-3, DEFAULTS)
    inspector = built.scene_graph.model_inspector()
    for a, first in enumerate(built.geometries):
        for b, second in enumerate(built.geometries):
            if a != b:
                # Drake never tests two shapes that are fixed in the world.
                tested = not inspector.CollisionFiltered(first[0], second[0])
                assert tested == layout.collides[a, b]


def test_a_box_rests_on_the_ground_with_its_weight() -> None:
    cube = box("cube", (0.2, 0.2, 0.2), mass=2.0, pose=Pose((0, 0, 0.1)))
    with World(Scene("s", bodies=(ground(), cube)), "drake") as world:
        before = world.contacts()
        world.step(300)
        contacts = world.contacts()
        height = world.state.bodies["cube"].T_world_body[2, 3]
    assert all(contact.normal_force == 0.0 for contact in before)
    (contact,) = contacts
    assert (contact.a, contact.b) == ("ground", "cube")
    assert_allclose(contact.normal, [0, 0, -1.0], atol=1e-9)
    assert_allclose(contact.force, [0, 0, -2.0 * G], atol=1e-3)
    # The pressure of the modulus, over half of the edge, at this depth carries the weight.
    assert contact.distance == pytest.approx(-2.0 * G / (3e6 / 0.1 * 0.2**2), rel=0.02)
    assert height == pytest.approx(0.1 + contact.distance, abs=1e-7)


def test_a_point_is_as_stiff_as_two_shapes_in_series() -> None:
    ball = sphere("ball", 0.1, mass=2.0, pose=Pose((0, 0, 0.1)))
    with World(Scene("s", bodies=(ground(), ball)), "drake", stiffness=1e5) as world:
        world.step(300)
        (contact,) = world.contacts()
    assert contact.distance == pytest.approx(-2.0 * G / 0.5e5, rel=1e-3)
    assert contact.normal_force == pytest.approx(2.0 * G, rel=1e-3)


@pytest.mark.parametrize("approximation", ["sap", "lagged", "similar"])
def test_a_stack_stands_still(approximation: str) -> None:
    boxes = [
        box(f"box_{k}", (0.1,) * 3, mass=1.0, pose=Pose((0.01 * (k % 2), 0, 0.05 + 0.1 * k)))
        for k in range(3)
    ]
    with World(Scene("s", bodies=(ground(), *boxes)), "drake", contact_approximation=approximation) as world:
        world.step(500)
        top = world.state.bodies["box_2"].T_world_body[:3, 3]
        forces = {contact.a: contact.normal_force for contact in world.contacts()}
    assert_allclose(top, [0, 0, 0.25], atol=5e-4)
    assert_allclose([forces["ground"], forces["box_0"], forces["box_1"]], [3 * G, 2 * G, G], rtol=1e-2)


@pytest.mark.parametrize("approximation", ["sap", "lagged", "similar"])
def test_friction_on_a_slope_slows_a_sliding_ball(approximation: str) -> None:
    slope, mu = float(np.arctan(0.4)), 0.3
    tilted = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    material = Material(friction=mu)
    # Too hard to turn to roll.
    ball = sphere("ball", 0.1, mass=1.0, inertia=1e3 * np.eye(3), pose=Pose((0, 0, 0.1)), material=material)
    scene = Scene("slope", bodies=(ground(material=material), ball), gravity=tilted)
    with World(scene, "drake", contact_approximation=approximation) as world:
        world.step(400)
        speed = world.state.bodies["ball"].twist[0]
    assert speed == pytest.approx(0.4 * G * (np.sin(slope) - mu * np.cos(slope)), rel=0.02)


def test_mimic_joints_stay_coupled() -> None:
    model = dynx.load("panda")
    engine = DrakeStepper(layout_of(Scene("s", robots=(SceneRobot("r", model),))), 1e-3, DEFAULTS)
    tau = np.zeros(model.nv)
    tau[-1] = 1.0
    engine.step(200, Forces([(0, tau)]))
    q, _ = engine._state()
    assert q[-1] > 1e-3
    assert_allclose(q[-1], q[-2], atol=1e-6)


def test_distances_to_the_ground_and_to_one_another() -> None:
    bodies = (
        ground(),
        sphere("ball", 0.1, mass=1.0, pose=Pose((0, 0, 0.5))),
        box("cube", (0.2,) * 3, mass=1.0, pose=Pose((1.0, 0, 0.3))),
    )
    with World(Scene("s", bodies=bodies), "drake") as world:
        (down,) = world.closest_points("ball", "ground", 1.0, native=True)
        (aside,) = world.closest_points("cube", "ball", 1.0, native=True)
        assert world.closest_points("cube", "ball", 0.1, native=True) == ()
    assert down.distance == pytest.approx(0.4)
    assert_allclose(down.normal, [0, 0, 1.0], atol=1e-9)
    assert_allclose(down.point_b, [0, 0, 0], atol=1e-9)
    # The nearest point of the cube is on its edge.
    assert aside.distance == pytest.approx(np.hypot(0.9, 0.1) - 0.1, abs=1e-5)
    assert_allclose(aside.normal, np.array([0.9, 0, -0.1]) / np.hypot(0.9, 0.1), atol=1e-3)


def test_a_ball_on_a_height_field_and_rays_at_its_points() -> None:
    field = HeightField(((0.1, 0.1, 0.1), (0.1, 0.1, 0.1)), (4.0, 4.0))
    land = SceneBody("land", (Collision(field),), pose=Pose((0, 0, 0.2)))
    ball = sphere("ball", 0.1, mass=1.0, pose=Pose((0.4, 0.3, 0.4)))
    with World(Scene("s", bodies=(land, ball)), "drake") as world:
        world.step(300)
        assert world.state.bodies["ball"].T_world_body[2, 3] == pytest.approx(0.4, abs=1e-4)
        hits = world.cast_rays([[0, 0, 3.0], [0.4, 0.3, 3.0]], [[0, 0, -1.0]])
    assert hits.names == ("land", "ball")
    assert_allclose(hits.distance, [2.7, 2.5], atol=1e-4)


def test_what_drake_lacks_is_refused_where_asked() -> None:
    for material, lacks in (
        (Material(restitution=0.5), "restitution"),
        (Material(rolling_friction=0.01), "rolling_friction"),
    ):
        bodies = (ground(material=material), sphere("ball", 0.1, mass=1.0, material=material))
        scene = Scene("s", bodies=bodies)
        with pytest.raises(UnsupportedFeatureError, match=lacks):
            World(scene, "drake", strict_materials=True)
        World(scene, "drake").close()
    with pytest.raises(SingularMassMatrixError, match="LHand"):
        World(Scene("s", robots=(SceneRobot("r", dynx.load("romeo")),)), "drake")


def test_a_long_spin_keeps_quaternions_near_unit_length() -> None:
    brick = box("brick", (0.3, 0.2, 0.1), mass=1.0, twist=(0, 0, 0, 0, 0, 40.0))
    engine = DrakeStepper(layout_of(Scene("s", bodies=(brick,), gravity=(0, 0, 0))), 1e-3, DEFAULTS)
    engine.step(2000)
    q, _ = engine._state()
    assert abs(float(q[:4] @ q[:4]) - 1.0) < 1e-2
    T = engine.body_state(0).T_world_body
    assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-12)


@pytest.mark.parametrize("force", [(1.0, 2.0, 3.0), (1.0, 2.0, -3.0)])
def test_the_parts_of_a_contact_force_add_up_to_it(force: tuple[float, float, float]) -> None:
    normal = np.array([0.0, 0.0, 1.0])
    along, rest = parts_of_force(np.array(force), normal)
    assert along == max(0.0, force[2])
    assert_allclose(along * normal + rest, force)


@pytest.mark.parametrize("model", ["hydroelastic", "point"])
def test_touching_pairs_are_those_of_the_contacts_in_every_step(model: str) -> None:
    shapes = [
        sphere("ball", 0.1, mass=0.5, pose=Pose((0.02, 0, 0.45))),
        box("crate", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0, 0, 0.15))),
        box("tilted", (0.2, 0.1, 0.1), mass=1.0, pose=Pose((0.5, 0, 0.2), (0.3, 0.4, 0.0))),
    ]
    seen = set()
    with World(Scene("s", bodies=(ground(), *shapes)), "drake", 0.01, contact_model=model) as world:
        for _ in range(40):
            world.step()
            touching = world.touching_pairs()
            assert touching == {(contact.a, contact.b) for contact in world.contacts()}
            assert world.touching_pairs() == touching
            seen.add(touching)
    assert len(seen) > 2
