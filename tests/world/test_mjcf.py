"""Scenes as MJCF: what MuJoCo alone reads back, and that it is the world of dynx."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import dynx
from dynx import Model, Pose
from dynx.cli.shell.main import cli
from dynx.engines.mujoco import materials
from dynx.errors import ArgumentError, EngineLimitError, UnknownNameError, UnsupportedFeatureError
from dynx.model import Inertial, Link
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Ellipsoid, HeightField, Sphere
from dynx.spatial.so3 import rotation_from_quat, skew
from dynx.steppers.registry import world_class
from dynx.world import (
    Material,
    PointToPoint,
    Scene,
    SceneBody,
    SceneRobot,
    TorqueMotor,
    Weld,
    World,
    box,
    ground,
    read_scene,
    scene_names,
    scene_to_mjcf,
    sphere,
    write_scene,
)
from dynx.world.mjcf import mjcf_remarks
from dynx.world.scene.robots import LinkFrames
from tests.world.engines import WORLDS as ENGINES
from tests.world.materials import four_materials
from tests.world.random_scenes.drawing import scene_of
from tests.world.replay import distance as distance_of
from tests.world.replay import examine
from tests.world.scene.test_files import require_robots

mujoco = pytest.importorskip("mujoco")

INERTIA = '<inertia ixx="1" ixy="0.1" ixz="0.05" iyy="1.2" iyz="-0.02" izz="1.1"/>'
INERTIAL = f'<inertial><origin xyz="0.1 -0.2 0.3" rpy="0.3 0.2 0.1"/><mass value="2"/>{INERTIA}</inertial>'

COLOUR = (0.1, 0.2, 0.3, 1.0)


def load(scene: Scene) -> tuple[Any, Any]:
    """Return MuJoCo's model of an exported scene, and its data at the start of the scene."""
    model = mujoco.MjModel.from_xml_string(scene_to_mjcf(scene))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


def chain(*links: str, joint: str = "", kind: str = "revolute", base: Any = "fixed") -> Model:
    """Return a robot of links in a row, each with this content."""
    limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
    text = "".join(f'<link name="l{k}">{content}</link>' for k, content in enumerate(links))
    for k in range(1, len(links)):
        ends = f'<parent link="l{k - 1}"/><child link="l{k}"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>'
        text += f'<joint name="l{k - 1}" type="{kind}">{ends}<axis xyz="0 1 0"/>{joint or limit}</joint>'
    return dynx.load(f'<robot name="chain">{text}</robot>', base=base)


@pytest.mark.parametrize("name", scene_names())
def test_the_scenes_of_dynx_load_in_mujoco(name: str) -> None:
    if name in ("lifting", "pushing", "standing"):
        require_robots()
    if name in ("duck", "rolling"):
        pytest.importorskip("pybullet_data")
    scene = read_scene(name)
    model, data = load(scene)
    models = [robot.model for robot in scene.robots]
    moving = [body for body in scene.bodies if not body.fixed]
    free = [body for body in moving if any(body.inertial.origin.xyz)]
    carried = [number for number in range(model.nbody) if model.body(number).name.endswith("/shapes")]
    assert model.nbody - len(carried) == 1 + len(scene.robots) + len(scene.parts) + len(free)
    # MuJoCo scales the softness of contacts by the inverse weight at the origin of a geom's body.
    places = data.xpos[model.body_weldid[model.geom_bodyid]]
    np.testing.assert_array_equal(
        data.xpos[model.geom_bodyid][places.any(axis=1)], places[places.any(axis=1)]
    )
    assert model.njnt == sum(len([j for j in m.joints if j.moves]) + m.floating for m in models) + len(moving)
    shapes = [len(m.geometry.collisions(link.name)) for m in models for link in m.links]
    assert model.ngeom == sum(shapes) + sum(len(body.shapes) for body in scene.bodies)
    for robot in scene.robots:
        fixed = 0.0 if robot.model.floating else robot.model.mechanism.root.mass
        total = model.body_subtreemass[model.body(robot.name).id] + fixed
        assert total == pytest.approx(robot.model.total_mass, rel=1e-12)
        frames = LinkFrames(robot.model)
        for link in robot.model.links:
            T = frames.pose(np.array(robot.q), link.name)
            found = data.body(f"{robot.name}/{link.name}")
            np.testing.assert_allclose(found.xpos, T[:3, 3], atol=1e-12)
            np.testing.assert_allclose(found.xmat.reshape(3, 3), T[:3, :3], atol=1e-12)
    for body in moving:
        assert model.body_subtreemass[model.body(body.name).rootid[0]] == body.mass
        np.testing.assert_allclose(data.body(body.name).xpos, body.pose.xyz, atol=1e-15)


@pytest.mark.parametrize(("name", "base"), [("ur5", "fixed"), ("a1", "floating")])
def test_the_mass_matrix_and_bias_are_those_of_the_robot(name: str, base: Any) -> None:
    require_robots()
    robot = dynx.load(name, base=base)
    rng = np.random.default_rng(4)
    q, v = robot.random(rng), rng.normal(size=robot.nv)
    scene = Scene("s", robots=(SceneRobot("r", robot, q=tuple(q), v=tuple(v)),), gravity=robot.gravity)
    model, data = load(scene)
    to_mujoco = np.eye(robot.nv)
    if robot.floating:
        to_mujoco[:3, :3] = R = rotation_from_quat(q[3:7])
        to_mujoco[:3, 3:6] = -R @ skew(robot.mechanism.root_center)
        np.testing.assert_allclose(data.qvel[:6], to_mujoco[:6, :6] @ v[:6], atol=1e-14)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    reference = dynx.backend("reference", robot)
    armature = np.diag(model.dof_armature)
    found = to_mujoco.T @ (M - armature) @ to_mujoco
    np.testing.assert_allclose(found, reference.mass_matrix(q), atol=1e-10)
    if not robot.floating:
        np.testing.assert_allclose(data.qfrc_bias, reference.inverse_dynamics(q, v, 0.0 * v), atol=1e-9)


def test_a_falling_box_falls() -> None:
    start = (0.3, -0.2, 1.0, 0.0, 0.0, 2.0)
    cube = box("cube", (0.1, 0.2, 0.3), mass=2.0, pose=Pose((1, 2, 50), (0.1, 0.2, 0.3)), twist=start)
    model, data = load(Scene("s", bodies=(cube,)))
    mujoco.mj_resetDataKeyframe(model, data, 0)
    n, dt = 100, model.opt.timestep
    for _ in range(n):
        mujoco.mj_step(model, data)
    fallen = -9.81 * dt**2 * n * (n + 1) / 2
    expected = np.array([1, 2, 50]) + n * dt * np.array(start[:3]) + [0, 0, fallen]
    np.testing.assert_allclose(data.body("cube").xpos, data.qpos[:3], atol=0.01)
    np.testing.assert_allclose(data.qpos[:3], expected, atol=1e-12)


def test_names_are_escaped() -> None:
    name = "a \"b\" 'c' <d> & é"
    link = "<link name='l &lt; &amp; \"'/>"
    robot = dynx.load(f"<robot name='r'>{link}</robot>")
    scene = Scene(name, robots=(SceneRobot("it's", robot),), bodies=(box(name, (1, 1, 1), mass=1.0),))
    model, _ = load(scene)
    assert model.body(name).mass[0] == 1.0
    assert model.body("it's/l < & \"").id > 0


def test_every_shape_has_its_size_pose_and_material() -> None:
    material = Material(friction=0.7, torsional_friction=0.02, rolling_friction=0.001, rgba=COLOUR)
    shapes = (Box((1, 2, 3)), Sphere(0.3), Cylinder(0.2, 0.6), Capsule(0.1, 0.5), Ellipsoid((0.1, 0.2, 0.3)))
    placed = tuple(Collision(shape, Pose((0.1, 0.2, 0.3), (0.5, 0, 0))) for shape in shapes)
    scene = Scene(
        "s", bodies=(SceneBody("b", placed, mass=1.0, material=material), ground("g", material=material))
    )
    model, data = load(scene)
    sizes = [[0.5, 1, 1.5], [0.3, 0, 0], [0.2, 0.3, 0], [0.1, 0.25, 0], [0.1, 0.2, 0.3]]
    for number, size in enumerate(sizes):
        geom = model.geom(f"b/{number}")
        np.testing.assert_array_equal(geom.size, size)
        np.testing.assert_allclose(data.geom(geom.id).xpos, (0.1, 0.2, 0.3), atol=1e-15)
        np.testing.assert_allclose(geom.quat, (np.cos(0.25), np.sin(0.25), 0, 0), atol=1e-12)
        np.testing.assert_allclose(geom.friction, (0.7, 0.02, 0.001), rtol=1e-15)
        np.testing.assert_allclose(geom.rgba, COLOUR, rtol=1e-6)
        assert geom.condim[0] == 6
    inertial = scene.body("b").inertial
    np.testing.assert_allclose(model.body("b").pos, -np.array(inertial.origin.xyz), atol=1e-15)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.body("b/center").iquat)
    axes = R.reshape(3, 3)
    tensor = axes @ np.diag(model.body("b/center").inertia) @ axes.T
    np.testing.assert_allclose(tensor, inertial.tensor, atol=1e-14)
    assert model.geom("g/0").type[0] == mujoco.mjtGeom.mjGEOM_PLANE


def test_a_height_field_has_its_heights() -> None:
    heights = HeightField(((-0.5, 0.1, 0.2), (0.4, 0.3, 0.9)), (4.0, 2.0))
    model, data = load(Scene("s", bodies=(SceneBody("hills", heights, Pose((0, 0, 0.5))),)))
    for row, column in np.ndindex(2, 3):
        x, y = 1.999 * (column - 1), 1.998 * (row - 0.5)
        distance = mujoco.mj_ray(model, data, [x, y, 5.0], [0, 0, -1.0], None, 1, -1, np.zeros(1, np.int32))
        assert 5.0 - distance == pytest.approx(0.5 + heights.heights[row][column], abs=2e-3)


def test_joints_have_their_limits_losses_and_coupling() -> None:
    limit = '<limit lower="-1" upper="2" effort="1" velocity="1"/><dynamics damping="0.5" friction="0.2"/>'
    model, _ = load(Scene("s", robots=(SceneRobot("r", chain(INERTIAL, INERTIAL, joint=limit)),)))
    joint = model.joint("r/l0")
    np.testing.assert_array_equal(joint.range, (-1, 2))
    assert (joint.damping[0], joint.frictionloss[0], bool(joint.limited[0])) == (0.5, 0.2, True)
    limit = '<limit lower="0.5" upper="0.5" effort="1" velocity="1"/>'
    model, _ = load(Scene("s", robots=(SceneRobot("r", chain(INERTIAL, INERTIAL, joint=limit)),)))
    np.testing.assert_allclose(model.joint("r/l0").range, (0.5, 0.5), atol=1e-11)
    model, _ = load(
        Scene("s", robots=(SceneRobot("r", chain(INERTIAL, INERTIAL, kind="continuous", base="floating")),))
    )
    assert not model.joint("r/l0").limited[0]
    assert model.joint("r").type[0] == mujoco.mjtJoint.mjJNT_FREE
    parts = [f'<link name="{name}">{INERTIAL}</link>' for name in "abc"]
    for child, mimic in (("b", ""), ("c", '<mimic joint="b" multiplier="-2" offset="0.3"/>')):
        ends = f'<parent link="a"/><child link="{child}"/>'
        parts.append(f'<joint name="{child}" type="continuous">{ends}<axis xyz="0 0 1"/>{mimic}</joint>')
    gripper = dynx.load(f"<robot name='g'>{''.join(parts)}</robot>")
    model, data = load(Scene("s", robots=(SceneRobot("g", gripper, q=(0.4,), v=(1.0,)),)))
    np.testing.assert_allclose(data.qpos, (0.4, -0.5), atol=1e-15)
    np.testing.assert_allclose(data.qvel, (1.0, -2.0), atol=1e-15)
    np.testing.assert_allclose(data.efc_pos[: model.neq], 0.0, atol=1e-14)


def test_constraints_and_filters_hold() -> None:
    bodies = (
        ground(),
        box("a", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0, 0, 1), (0.1, 0.2, 0.3))),
        box("b", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.05, 0, 1))),
        sphere("c", 0.1, mass=1.0, pose=Pose((1, 0, 1))),
    )
    joined = (Weld("a", "b"), PointToPoint("c", "world", (0.1, 0, 0), (1.1, 0, 1)))
    model, data = load(Scene("s", bodies=bodies, constraints=joined, ignored=(("a", "b"),)))
    assert (model.neq, model.npair, data.ncon) == (2, 5, 0)
    np.testing.assert_allclose(data.efc_pos, 0.0, atol=1e-12)
    moved = (Weld("world", "a", Pose((0, 0, 1.5))),)
    _, data = load(Scene("s", bodies=bodies, constraints=moved, ignored=(("a", "b"),)))
    assert np.linalg.norm(data.efc_pos[:3]) == pytest.approx(0.5, abs=1e-12)
    _, data = load(Scene("s", bodies=bodies))
    assert data.ncon > 0


@pytest.mark.parametrize("self_collision", [False, True])
def test_links_collide_as_the_scene_says(self_collision: bool) -> None:
    ball = INERTIAL + '<collision><geometry><sphere radius="0.5"/></geometry></collision>'
    robot = SceneRobot("r", chain(ball, ball, ball), self_collision=self_collision)
    model, data = load(Scene("s", robots=(robot,)))
    assert data.ncon == model.npair == self_collision


@pytest.mark.parametrize(
    ("robot", "message"),
    [
        (chain(INERTIAL, ""), "'r/l1' moves with a mass of 0 kg and the principal moments 0, 0, 0"),
        (chain("", INERTIAL, base="floating"), "'r/l0' moves with a mass of 0 kg"),
        (
            Model.build("m", [Link("l", Inertial(-2.0))], [], base="floating"),
            "'r/l' has the mass -2 kg and the least moment 0",
        ),
        (chain("", INERTIAL.replace('ixx="1"', 'ixx="9"')), "one exceeds the others' sum"),
        (
            chain(
                INERTIAL + '<collision><geometry><plane normal="0 0 1"/></geometry></collision>',
                base="floating",
            ),
            "'r/l0' moves with a Plane",
        ),
    ],
)
def test_links_that_mujoco_refuses_are_named(robot: Model, message: str) -> None:
    with pytest.raises(UnsupportedFeatureError, match=message):
        scene_to_mjcf(Scene("s", robots=(SceneRobot("r", robot),)))


def test_a_link_without_mass_moves_with_those_fixed_to_it() -> None:
    robot = chain("", "", INERTIAL, kind="fixed", base="floating")
    model, _ = load(Scene("s", robots=(SceneRobot("r", robot),)))
    assert model.body_subtreemass[1] == 2.0


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_links_that_mujoco_refuses_are_merged_with_those_fixed_to_them(base: Any) -> None:
    point = (
        '<inertial><mass value="0.5"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    links = [INERTIAL.replace('ixx="1"', 'ixx="2.5"'), point, INERTIAL, INERTIAL]
    robot = chain(*links, kind="fixed", base=base)
    model, data = load(Scene("s", robots=(SceneRobot("r", robot),)))
    if base == "fixed":
        assert model.body_subtreemass[1] == 0.0
        return
    assert model.body("r").mass[0] == pytest.approx(6.5)
    M = np.zeros((6, 6))
    mujoco.mj_fullM(model, data, M)
    reference = dynx.backend("reference", robot)
    lever = np.eye(6)
    lever[:3, 3:] = -skew(robot.mechanism.root_center)
    np.testing.assert_allclose(lever.T @ M @ lever, reference.mass_matrix(robot.neutral()), atol=1e-12)


def test_the_depth_of_a_robot_is_bounded() -> None:
    ball = INERTIAL + '<collision><geometry><sphere radius="0.01"/></geometry></collision>'
    deep = chain(*[INERTIAL] * 490, ball)
    assert load(Scene("s", robots=(SceneRobot("r", deep),)))[0].nbody == 493
    with pytest.raises(EngineLimitError, match="more than 490 moving links in a row"):
        scene_to_mjcf(Scene("s", robots=(SceneRobot("r", chain(*[INERTIAL] * 492)),)))
    assert "r/l599" in scene_to_mjcf(Scene("s", robots=(SceneRobot("r", chain(*[""] * 600, kind="fixed")),)))


def test_a_document_slides_and_rebounds_by_the_means_of_its_materials() -> None:
    model, data = load(four_materials())
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 100)
    before = [data.joint(f"slab{k}").qvel[0] for k in range(3)]
    mujoco.mj_step(model, data, 400)
    after = [data.joint(f"slab{k}").qvel[0] for k in range(3)]
    slowed = (np.array(before) - after) / 0.4 / 9.81
    np.testing.assert_allclose(slowed, 0.5 * np.sqrt([0.1, 0.4, 0.9]), rtol=0.05)

    bouncy = Material(restitution=0.8)
    heights = []
    for height in (0.97, 0.99, 1.01):
        ball = sphere("ball", 0.1, mass=1.0, pose=Pose((0, 0, 0.1 + height)), material=bouncy)
        model, data = load(Scene("s", bodies=(ground(material=bouncy), ball)))
        mujoco.mj_resetDataKeyframe(model, data, 0)
        z = []
        for _ in range(1000):
            mujoco.mj_step(model, data)
            z.append(data.qpos[2] - 0.1)
        heights.append(max(z[int(np.argmin(z)) :]) / height)
    assert np.mean(heights) == pytest.approx(0.64, abs=0.05)


WORLDS = {
    "defaults": {},
    "step": {"dt": 2e-3, "substeps": 4},
    "joints": {
        "joint_damping": False,
        "joint_friction": False,
        "joint_armature": False,
        "joint_limits": False,
    },
    "settings": {
        "cone": "pyramidal",
        "solver": "cg",
        "integrator": "implicitfast",
        "impratio": 3.0,
        "margin": 1e-3,
        "time_constant": 0.02,
        "impedance": (0.8, 0.9, 0.002, 0.5, 2.0),
        "joint_friction_impedance": 0.99,
        "constraint_time_constant": 0.03,
    },
    "apart": {"collisions": False},
}
"""Options of worlds, all of which a document has."""


@pytest.mark.parametrize("options", WORLDS.values(), ids=WORLDS)
@pytest.mark.parametrize("number", [4, 11, 13, 21])
def test_every_field_of_the_model_of_a_document_is_that_of_the_world(
    number: int, options: dict[str, Any], tmp_path: Path
) -> None:
    distance, differing = examine(scene_of(number), tmp_path / "scene.xml", 50, seed=number, **options)
    assert not differing
    if options.get("substeps", 1) == 1:
        assert distance <= 1e-9


@pytest.mark.parametrize("name", ["bowling", "lifting", "pushing", "slope", "standing"])
def test_recorded_torques_move_a_scene_in_mujoco_alone_as_in_the_world(name: str, tmp_path: Path) -> None:
    """``python -m benchmarks.surveys.exported_mjcf`` does so for all scenes and random ones, for a second."""
    require_robots()
    distance, differing = examine(read_scene(name), tmp_path / "scene.xml", 300, seed=1)
    assert distance <= 1e-9
    assert not differing


OTHERS = [name for name in ENGINES if name != "mujoco" and find_spec(name) is not None]
"""Engines with contacts other than MuJoCo."""

OF_OTHERS = {"pybullet": ("erp", 0.3), "drake": ("dissipation", 7.0)}
"""A setting of each, with a value that is not the default."""


def lossy(base: Any = "fixed") -> Scene:
    """Return an arm with damping, dry friction, armature and limits above a ground of another material."""
    losses = '<dynamics damping="0.3" friction="0.2" armature="0.05"/>'
    limit = f'<limit lower="-1" upper="2" effort="1" velocity="1"/>{losses}'
    ball = INERTIAL + '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
    slippery = Material(friction=0.2, torsional_friction=0.01, restitution=0.5)
    model = chain(INERTIAL, ball, joint=limit, base=base)
    arm = SceneRobot("r", model, material=slippery).at(Pose((0.0, 0.0, 1.0)))
    bodies = (ground(material=slippery), sphere("ball", 0.1, mass=1.0, pose=Pose((2.0, 0.0, 0.1))))
    return Scene("lossy", robots=(arm,), bodies=bodies, gravity=(0.3, 0.0, -3.7))


OTHER_SCENES: dict[str, Callable[[], Scene]] = {
    "stack": partial(read_scene, "stack"),
    "slope": partial(read_scene, "slope"),
    "bowling": partial(read_scene, "bowling"),
    "arm": lossy,
    "floating": partial(lossy, "floating"),
    "materials": four_materials,
    "random": partial(scene_of, 4),
}
"""Scenes that every engine takes, by name."""


@pytest.mark.parametrize("name", OTHER_SCENES)
@pytest.mark.parametrize("engine", OTHERS)
def test_a_document_names_what_the_engine_of_its_world_has_besides(
    name: str, engine: str, tmp_path: Path
) -> None:
    scene = OTHER_SCENES[name]()
    options: dict[str, Any] = {"dt": 2e-3, "substeps": 2}
    setting, value = OF_OTHERS[engine]
    options_of_engine: dict[str, Any] = {setting: value}
    with World(scene, engine, **options, **options_of_engine) as world:
        text, version, inexact = world.to_mjcf(impratio=7.0), world.version, world.inexact_materials()
        in_use = dict(world.settings)
        law = world_class(engine).contact_law
    # The model is that of MuJoCo's world: step, gravity, friction and joint dynamics of the scene.
    expected = scene_to_mjcf(scene, **options, impratio=7.0)
    assert text.partition("<mujoco")[2] == expected.partition("<mujoco")[2]
    model = mujoco.MjModel.from_xml_string(text)
    assert model.opt.timestep == 1e-3
    np.testing.assert_array_equal(model.opt.gravity, scene.gravity)
    remarks = " ".join(mjcf_remarks(text))
    named = version if version.startswith(engine) else f"{engine} {version}"
    assert f"The world runs in {named}, which has {law}. MJCF cannot carry that" in remarks
    assert f"{setting} {value}" in remarks
    assert all(f"{each} " in remarks for each in in_use if each != "strict_materials")
    assert "A step of the world, 0.002 s, is 2 steps of the document." in remarks
    for each in inexact:
        assert f"In {engine} {each}." in remarks
    # The command prints what the document says.
    file, written = tmp_path / "scene.xml", tmp_path / "scene.toml"
    write_scene(scene, written)
    arguments = ["world", str(written), "--export", str(file), "--engine", engine, "--dt", "0.002"]
    changes = ["--substeps", "2", "--set", f"{setting}={value}", "--set", "mujoco.impratio=7"]
    result = CliRunner().invoke(cli, [*arguments, *changes], env={"COLUMNS": "100000"})
    assert result.exit_code == 0, result.output
    assert file.read_text() == text
    for remark in mjcf_remarks(text):
        assert f"note: {remark}" in result.output
    assert CliRunner().invoke(cli, [*arguments, "--quiet"]).output == ""


@pytest.mark.parametrize("engine", OTHERS)
def test_coefficients_and_joint_dynamics_that_an_engine_has_otherwise_are_named(engine: str) -> None:
    with World(lossy(), engine) as world:
        remarks, notes = mjcf_remarks(world.to_mjcf()), world.notes
    torsion = "In drake torsional_friction of 'r/l1' and 'ground' is 0, not 0.01: Drake has none."
    assert (torsion in remarks) == (engine == "drake")
    of_joints = [note for note in notes if "of the joints of" in note or "joint d" in note]
    assert of_joints
    assert all(f"In the world, {note}." in remarks for note in of_joints)
    friction = "r: the dry friction of its joints is MuJoCo's, under which joints that stick creep."
    outside = f"{friction} The world computes it outside of {engine}, as torques."
    assert outside in remarks


def test_a_document_for_a_world_of_dynx_names_its_integrator() -> None:
    scene = Scene("s", robots=(SceneRobot("r", chain(INERTIAL, INERTIAL)),))
    with World(scene, "dynx", integrator="rk4", collisions=False) as world:
        remarks = " ".join(mjcf_remarks(world.to_mjcf()))
    assert "The world runs in dynx" in remarks
    assert "integrator rk4" in remarks


def test_a_document_names_the_rebound_that_its_steps_cannot_have(monkeypatch: pytest.MonkeyPatch) -> None:
    # At 4 ms a ball rebounds with 0.13 at least, of which the height counts as none by default.
    monkeypatch.setattr(materials, "TOLERANCE", 1e-3)
    scene = Scene("s", bodies=(ground(), sphere("b", 0.1, mass=1.0)))
    with World(scene, "mujoco", 4e-3) as world:
        (inexact,) = world.inexact_materials()
    remarks = mjcf_remarks(scene_to_mjcf(scene, 4e-3))
    assert f"In this document {inexact}." in remarks


def test_remarks_are_read_whatever_the_names() -> None:
    losses = '<limit lower="-9" upper="9" effort="1" velocity="1"/><dynamics friction="0.2"/>'
    model = chain(INERTIAL, INERTIAL, joint=losses)
    names = ("<mujoco", "a --> b", "-", "--")
    scene = Scene("s", robots=tuple(SceneRobot(name, model) for name in names))
    remarks = mjcf_remarks(scene_to_mjcf(scene, substeps=2))
    assert [each.partition(": the dry")[0] for each in remarks[1:]] == ["<mujoco", "a - -> b", "-", "- -"]
    assert remarks[0].startswith("A step of the world")


def test_settings_of_a_document_belong_to_the_world_in_mujoco_or_to_the_call() -> None:
    with (
        World(read_scene("stack"), "mujoco") as world,
        pytest.raises(ArgumentError, match="impratio is given to to_mjcf of a world in mujoco"),
    ):
        world.to_mjcf(impratio=7.0)
    with pytest.raises(UnknownNameError, match=r"World\(scene, engine\).to_mjcf\(\)"):
        scene_to_mjcf(read_scene("stack"), engine="pybullet")


def test_a_document_of_a_scene_is_that_of_its_world() -> None:
    scene = scene_of(4)
    with World(scene, "mujoco", 2e-3, substeps=2, joint_friction=False, impratio=7.0) as world:
        expected = world.to_mjcf()
    assert scene_to_mjcf(scene, 2e-3, substeps=2, joint_friction=False, impratio=7.0) == expected
    with pytest.raises(UnknownNameError, match="has no setting 'impratioo'; did you mean 'impratio'"):
        scene_to_mjcf(scene, impratioo=1.0)
    with pytest.raises(ArgumentError, match="joint_friction is '1'"):
        scene_to_mjcf(scene, joint_friction=1)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="scene is 'stack', of type str"):
        scene_to_mjcf("stack")  # type: ignore[arg-type]


@pytest.mark.parametrize("yaw", [0.0, 0.4, np.pi / 4.0])
def test_a_box_slides_in_any_direction_with_its_friction(yaw: float) -> None:
    direction = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    start = (*(2.0 * direction).tolist(), 0.0, 0.0, 0.0)
    slider = box("box", (0.2, 0.2, 0.05), mass=1.0, pose=Pose((0, 0, 0.025)), twist=start)
    model, data = load(Scene("s", bodies=(ground(), slider)))
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, 100)
    before = data.qvel[:3].copy()
    mujoco.mj_step(model, data, 200)
    np.testing.assert_allclose((before - data.qvel[:3]) / 0.2, 0.5 * 9.81 * direction, atol=0.02 * 9.81)
    path = data.qpos[:2]
    aside = path - (direction[:2] @ path) * direction[:2]
    assert np.linalg.norm(aside) < 0.005 * np.linalg.norm(path)


def test_motors_apply_their_ctrl_to_the_joints_with_a_coordinate_of_their_own() -> None:
    robot = dynx.load("panda")
    model, data = load(Scene("s", robots=(SceneRobot("arm", robot),), gravity=(0.0, 0.0, 0.0)))
    assert [model.actuator(k).name for k in range(model.nu)] == [f"arm/{name}" for name in robot.joint_names]
    data.ctrl[:] = np.arange(1.0, model.nu + 1.0)
    mujoco.mj_forward(model, data)
    own = [model.joint(f"arm/{name}").dofadr[0] for name in robot.joint_names]
    np.testing.assert_array_equal(data.qfrc_actuator[own], data.ctrl)
    assert not model.actuator_ctrllimited.any()
    assert not model.actuator_forcelimited.any()


def test_two_fingers_of_which_one_follows_the_other_share_the_force_of_their_motor() -> None:
    finger = (
        '<inertial><mass value="0.1"/><inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/>'
        '</inertial><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision>'
    )
    text = '<robot name="g"><link name="palm"/>'
    for name, sign, mimic in (("left", -1, ""), ("right", 1, '<mimic joint="left"/>')):
        ends = f'<parent link="palm"/><child link="{name}"/><origin xyz="{0.1 * sign} 0 0"/>'
        text += f'<link name="{name}">{finger}</link><joint name="{name}" type="prismatic">{ends}'
        text += (
            f'<axis xyz="{-sign} 0 0"/><limit lower="-1" upper="1" effort="9" velocity="9"/>{mimic}</joint>'
        )
    gripper = dynx.load(f"{text}</robot>")
    cube = box("cube", (0.04, 0.04, 0.04), mass=0.2)
    scene = Scene("s", robots=(SceneRobot("g", gripper),), bodies=(cube,), gravity=(0.0, 0.0, 0.0))
    model, data = load(scene)
    data.ctrl[:] = 10.0
    mujoco.mj_step(model, data, 1000)
    forces = {"left": 0.0, "right": 0.0}
    for number, contact in enumerate(data.contact):
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, number, wrench)
        bodies = {model.body(model.geom_bodyid[geom]).name for geom in contact.geom}
        forces["left" if "g/left" in bodies else "right"] += float(wrench[0])
    assert forces["left"] == pytest.approx(5.0, rel=1e-3)
    assert forces["right"] == pytest.approx(5.0, rel=1e-3)


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("options", [{}, {"integrator": "implicitfast"}, {"solver": "cg"}, {"solver": "pgs"}])
def test_a_robot_with_damped_mimic_joints_moves_in_mujoco_alone_as_in_the_world(
    base: Any, options: dict[str, Any], tmp_path: Path
) -> None:
    scene = Scene("s", robots=(SceneRobot("r", damped_mimics(base)),))
    distance, differing = examine(scene, tmp_path / "scene.xml", 500, seed=3, **options)
    assert distance <= 1e-9
    assert not differing
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    np.testing.assert_array_equal(model.dof_damping[-3:], (0.7, 0.3, 0.05))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_motors_of_a_document_move_mimic_joints_almost_as_the_world_does(base: Any) -> None:
    scene = Scene("s", robots=(SceneRobot("r", damped_mimics(base)),))
    model, data = load(scene)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    tau = np.array([0.2, 0.1])
    data.ctrl[:] = tau
    with World(scene, "mujoco") as world:
        for _ in range(500):
            world.step(torques={"r": np.concatenate([np.zeros(world.scene.robots[0].model.nv - 2), tau])})
            mujoco.mj_step(model, data)
        assert distance_of(world, data) < 1e-5


def damped_mimics(base: Any) -> Model:
    """Return a robot of which the last joint follows the second at -1.5 times its angle."""
    tensor = '<inertia ixx="0.01" ixy="0.001" ixz="0" iyy="0.012" iyz="0" izz="0.011"/>'
    inertial = f'<inertial><origin xyz="0.1 -0.05 0.1"/><mass value="0.4"/>{tensor}</inertial>'
    parts, damping = [f'<link name="l0">{INERTIAL}</link>'], (0.7, 0.3, 0.05)
    for k in range(3):
        ends = f'<parent link="l{k}"/><child link="l{k + 1}"/><origin xyz="0.1 0 0.2" rpy="0.1 0.2 0.3"/>'
        mimic = '<mimic joint="j1" multiplier="-1.5" offset="0.2"/>' if k == 2 else ""
        losses = f'<dynamics damping="{damping[k]}"/>'
        parts.append(f'<link name="l{k + 1}">{inertial}</link><joint name="j{k}" type="continuous">{ends}')
        parts.append(f'<axis xyz="0 {k % 2} {1 - k % 2}"/>{losses}{mimic}</joint>')
    return dynx.load(f'<robot name="coupled">{"".join(parts)}</robot>', base=base)


def test_a_document_has_the_friction_that_a_world_computes_outside_of_mujoco_and_names_it() -> None:
    losses = '<limit lower="-9" upper="9" effort="1" velocity="1"/><dynamics friction="0.2" damping="0.3"/>'
    scene = Scene("s", robots=(SceneRobot("r", chain(INERTIAL, INERTIAL, joint=losses)),))
    assert (
        "r: the dry friction of its joints is MuJoCo's, under which joints that stick creep. The world "
        "computes it outside of MuJoCo, as torques."
    ) in mjcf_remarks(scene_to_mjcf(scene))
    model, data = load(scene)
    assert model.dof_frictionloss[0] == 0.2
    with World(scene, "mujoco") as world:
        world.step(300)
        mujoco.mj_step(model, data, 300)
        assert distance_of(world, data) < 1e-2


def test_comments_name_what_a_document_cannot_carry() -> None:
    robot = SceneRobot("a---b", dynx.load("panda"), motors=(TorqueMotor(1.0),))
    text = scene_to_mjcf(Scene("s", robots=(robot,)), substeps=3)
    mujoco.MjModel.from_xml_string(text)
    comments = text[: text.index("<mujoco")]
    assert "A step of the world, 0.001 s, is 3 steps of the document." in comments
    assert "a- - -b: equality constraints couple its mimic joints softly" in comments
    assert "a- - -b: the laws of its motors (TorqueMotor) are not in the document" in comments
    assert "softly" not in scene_to_mjcf(Scene("s", robots=(SceneRobot("r", dynx.load("ur5")),)))
