"""Worlds in MuJoCo: contacts, filters, constraints, mimic joints, rays on height fields, saved states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.engines.mujoco.build import build_scene
from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.mjcf import collision_masks, pairs_to_exclude
from dynx.engines.mujoco.stepper import MujocoStepper
from dynx.errors import SingularMassMatrixError
from dynx.model.geometry import Collision, HeightField, Sphere
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
DEFAULTS = {name: setting.default for name, setting in MujocoStepper.settings.items()}


def two_arms() -> Scene:
    arm = dynx.load("ur5")
    other = dynx.load("panda").with_base_pose(Pose((0.6, 0.0, 0.0)))
    robots = (SceneRobot("a", arm), SceneRobot("b", other, self_collision=True))
    return Scene("arms", robots=robots, bodies=(ground(), box("cube", (0.1, 0.1, 0.1), mass=1.0)))


def layout_of(scene: Scene) -> Layout:
    return prepare(scene, **SWITCHES)


def test_masks_and_excluded_pairs_are_the_filter_of_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    layout = layout_of(two_arms())
    masks = collision_masks(layout)
    excluded = set(pairs_to_exclude(layout, masks))
    for a in range(len(layout.colliders)):
        for b in range(a + 1, len(layout.colliders)):
            owners = layout.colliders[a].owner, layout.colliders[b].owner
            rigid = owners[0] == owners[1] or all(map(layout.is_fixed, owners))
            tested = bool(masks[a][0] & masks[b][1] or masks[b][0] & masks[a][1])
            assert (tested and not rigid and (a, b) not in excluded) == layout.collides[a, b]
    assert build_scene(layout, 1e-3, DEFAULTS).model.nexclude == 0
    monkeypatch.setattr("dynx.engines.mujoco.materials.MAX_PAIRS", 0)
    built = build_scene(layout, 1e-3, DEFAULTS)
    assert (built.model.npair, built.model.nexclude) == (0, len(excluded))
    # The arm without self-collision needs no excluded pairs.
    arm = {k for k, collider in enumerate(layout.colliders) if collider.name.startswith("a/")}
    assert not any(a in arm and b in arm for a, b in excluded)


@pytest.mark.parametrize("wanted", [0.2, 0.5, 0.8, 0.95])
def test_a_ball_bounces_with_the_restitution_of_its_material(wanted: float) -> None:
    bouncy = Material(restitution=wanted)
    ball = sphere(
        "ball", 0.1, mass=0.3, pose=Pose((0, 0, 0.1002)), twist=(0, 0, -2, 0, 0, 0), material=bouncy
    )
    scene = Scene("s", bodies=(ground(material=bouncy), ball), gravity=(0.0, 0.0, 0.0))
    with World(scene, "mujoco", 2e-4) as world:
        world.step(200)
        assert world.state.bodies["ball"].twist[2] / 2.0 == pytest.approx(wanted, abs=0.02)


def test_a_box_on_a_slope_creeps_less_than_a_tenth_of_a_millimetre_per_second() -> None:
    slope = float(np.arctan(0.4))
    tilted = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    scene = Scene(
        "slope", bodies=(ground(), box("box", (0.2,) * 3, mass=1.0, pose=Pose((0, 0, 0.1)))), gravity=tilted
    )
    with World(scene, "mujoco") as world:
        world.step(500)
        before = world.state.bodies["box"].T_world_body[0, 3]
        world.step(500)
        assert 0.0 <= world.state.bodies["box"].T_world_body[0, 3] - before < 0.5e-4
        force = sum(contact.force for contact in world.contacts())
    assert_allclose(-np.asarray(force), -np.array(tilted), atol=1e-3)


def test_mimic_joints_stay_coupled_under_contact() -> None:
    model = dynx.load("panda")
    assert model.mechanism.coupling is not None
    q = model.clip(model.neutral())
    q[-1] = 0.03
    scene = Scene("s", robots=(SceneRobot("r", model, q=tuple(q)),), bodies=(ground(),))
    layout = layout_of(scene)
    engine = MujocoStepper(layout, 1e-3, DEFAULTS)
    tau = np.zeros(model.nv)
    tau[-1] = -5.0  # closes the gripper, against the lower limit of both fingers
    engine.step(500, Forces([(0, tau)]))
    positions = np.array(engine.data.qpos[-2:])
    assert_allclose(positions[0], positions[1], atol=1e-4)
    assert engine.robot_state(0).q[-1] < 1e-3


def test_rays_meet_a_height_field_at_its_points_and_between() -> None:
    field = HeightField(((0.0, 0.1, 0.0), (0.2, 0.3, 0.1), (0.0, 0.0, 0.4)), (2.0, 4.0))
    land = SceneBody("land", (Collision(field),), pose=Pose((1.0, 0.0, 0.5)))
    vertices, _ = field.triangles()
    with World(Scene("s", bodies=(land, ground())), "mujoco") as world:
        above = vertices + np.array([1.0, 0.0, 3.0])
        hits = world.cast_rays(above, np.tile([0.0, 0.0, -1.0], (len(above), 1)))
        outside = world.cast_rays([[5.0, 5.0, 2.0]], [[0.0, 0.0, -1.0]])
    assert set(hits.names) == {"land"}
    assert_allclose(hits.distance, 2.5, atol=1e-9)
    assert outside.names == ("ground",)
    assert outside.distance[0] == pytest.approx(2.0)


def test_the_normal_of_shapes_that_just_touch() -> None:
    bodies = (ground(), SceneBody("ball", (Collision(Sphere(0.5)),), mass=1.0, pose=Pose((0.3, 0, 0.5))))
    other = SceneBody("other", (Collision(Sphere(0.5)),), mass=1.0, pose=Pose((0.3, 1.0, 0.5)))
    with World(Scene("s", bodies=(*bodies, other)), "mujoco") as world:
        (below,) = world.closest_points("ground", "ball", 1.0, native=True)
        (beside,) = world.closest_points("ball", "other", 1.0, native=True)
    assert_allclose(below.normal, [0, 0, -1.0], atol=1e-6)
    assert_allclose(beside.normal, [0, -1.0, 0], atol=1e-4)
    assert_allclose([below.distance, beside.distance], 0.0, atol=1e-9)


def test_a_robot_without_a_unique_acceleration_is_refused() -> None:
    robot = SceneRobot("r", dynx.load("romeo"))
    with pytest.raises(SingularMassMatrixError, match="LHand"):
        World(Scene("s", robots=(robot,)), "mujoco")


@pytest.mark.parametrize("changed", [{}, {"time_constant": 1e-4}, {"slip_time_constant": 1.0}])
@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_references_are_of_one_format_which_mujoco_does_not_replace(
    changed: dict[str, float], restitution: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = two_arms()
    material = Material(restitution=restitution)
    layout = layout_of(
        replace(scene, bodies=tuple(replace(each, material=material) for each in scene.bodies))
    )
    for pairs in (2000, 0):
        monkeypatch.setattr("dynx.engines.mujoco.materials.MAX_PAIRS", pairs)
        model = build_scene(layout, 1e-3, {**DEFAULTS, **changed}).model
        for name in (
            "geom_solref",
            "pair_solref",
            "pair_solreffriction",
            "jnt_solref",
            "dof_solref",
            "eq_solref",
        ):
            first, second = getattr(model, name).reshape(-1, 2).T
            assert ((first > 0.0) == (second > 0.0)).all(), name


def test_a_state_with_the_forces_of_its_last_step_as_files_of_earlier_versions_have_it_is_loaded() -> None:
    layout = layout_of(two_arms())
    engine = MujocoStepper(layout, 1e-3, DEFAULTS)
    engine.step(20, Forces([(0, np.ones(layout.robots[0].model.nv))]))
    whole = int(mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.zeros(mujoco.mj_stateSize(engine.model, whole))
    mujoco.mj_getState(engine.model, engine.data, state, whole)
    engine.step(20)
    expected = engine.dump()
    engine.load(state.tobytes())
    engine.step(20)
    assert engine.dump() == expected
