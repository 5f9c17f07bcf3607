"""Scenes as MJCF and bodies as URDF: what MuJoCo and `dynx.load` read back."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx import Model, Pose
from dynx.errors import DescriptionError, EngineLimitError, UnsupportedFeatureError
from dynx.model import Inertial, Link
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, HeightField, Plane, Sphere
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import (
    Material,
    PointToPoint,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    body_to_urdf,
    box,
    ground,
    read_scene,
    scene_names,
    scene_to_mjcf,
    sphere,
)
from dynx.world.scene.robots import LinkFrames
from tests.world.materials import four_materials
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
    assert model.nbody == 1 + len(scene.parts)
    assert model.njnt == sum(len([j for j in m.joints if j.moves]) + m.floating for m in models) + len(moving)
    shapes = [len(m.geometry.collisions(link.name)) for m in models for link in m.links]
    assert model.ngeom == sum(shapes) + sum(len(body.shapes) for body in scene.bodies)
    for robot in scene.robots:
        root = model.body(f"{robot.name}/{robot.model.root}").id
        assert model.body_subtreemass[root] == pytest.approx(robot.model.total_mass, rel=1e-12)
        frames = LinkFrames(robot.model)
        for link in robot.model.links:
            T = frames.pose(np.array(robot.q), link.name)
            found = data.body(f"{robot.name}/{link.name}")
            np.testing.assert_allclose(found.xpos, T[:3, 3], atol=1e-12)
            np.testing.assert_allclose(found.xmat.reshape(3, 3), T[:3, :3], atol=1e-12)
    for body in moving:
        assert model.body(body.name).mass[0] == body.mass
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
        np.testing.assert_allclose(data.qvel[:3], R @ v[:3], atol=1e-14)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    reference = dynx.backend("reference", robot)
    np.testing.assert_allclose(to_mujoco.T @ M @ to_mujoco, reference.mass_matrix(q), atol=1e-10)
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
    shapes = (Box((1, 2, 3)), Sphere(0.3), Cylinder(0.2, 0.6), Capsule(0.1, 0.5))
    placed = tuple(Collision(shape, Pose((0.1, 0.2, 0.3), (0.5, 0, 0))) for shape in shapes)
    scene = Scene(
        "s", bodies=(SceneBody("b", placed, mass=1.0, material=material), ground("g", material=material))
    )
    model, _ = load(scene)
    sizes = [[0.5, 1, 1.5], [0.3, 0, 0], [0.2, 0.3, 0], [0.1, 0.25, 0]]
    for number, size in enumerate(sizes):
        geom = model.geom(f"b/{number}")
        np.testing.assert_array_equal(geom.size, size)
        np.testing.assert_allclose(geom.pos, (0.1, 0.2, 0.3), atol=1e-15)
        np.testing.assert_allclose(geom.quat, (np.cos(0.25), np.sin(0.25), 0, 0), atol=1e-12)
        np.testing.assert_allclose(geom.friction, (0.7, 0.02, 0.001), rtol=1e-15)
        np.testing.assert_allclose(geom.rgba, COLOUR, rtol=1e-6)
        assert geom.condim[0] == 6
    inertial = scene.body("b").inertial
    np.testing.assert_allclose(model.body("b").ipos, inertial.origin.xyz, atol=1e-15)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, model.body("b").iquat)
    axes = R.reshape(3, 3)
    tensor = axes @ np.diag(model.body("b").inertia) @ axes.T
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
    assert (model.neq, model.nexclude, data.ncon) == (2, 1, 0)
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
    assert model.nexclude == (2 if self_collision else 3)
    assert data.ncon == self_collision


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
        assert model.body_subtreemass[1] == 4.5
        return
    assert model.body("r/l0").mass[0] == pytest.approx(6.5)
    M = np.zeros((6, 6))
    mujoco.mj_fullM(model, data, M)
    reference = dynx.backend("reference", robot)
    np.testing.assert_allclose(M, reference.mass_matrix(robot.neutral()), atol=1e-12)


def test_the_depth_of_a_robot_is_bounded() -> None:
    deep = chain(*[INERTIAL] * 490, kind="fixed")
    assert load(Scene("s", robots=(SceneRobot("r", deep),)))[0].nbody == 491
    with pytest.raises(EngineLimitError, match="more than 490 links in a row"):
        scene_to_mjcf(Scene("s", robots=(SceneRobot("r", chain(*[INERTIAL] * 491, kind="fixed")),)))


def test_a_body_is_loaded_from_its_urdf() -> None:
    placed = (
        Collision(Box((1, 2, 3)), Pose((0.1, 0, 0))),
        Collision(Cylinder(0.2, 1.0), Pose((0, 1, 0), (0.3, 0, 0))),
    )
    body = SceneBody('a "<b>"', placed, mass=3.0, material=Material(rgba=COLOUR))
    model = dynx.load(body_to_urdf(body), base="floating")
    assert model.root == body.name
    assert model.links[0].inertial == body.inertial
    assert model.geometry.collisions(body.name) == body.shapes
    visual = model.geometry.visuals(body.name)[0]
    assert visual.material is not None
    assert visual.material.rgba == body.material.rgba
    fixed = dynx.load(body_to_urdf(SceneBody("floor", Plane())))
    assert fixed.links[0].inertial is None
    hills = SceneBody("hills", HeightField(((0, 0), (0, 0)), (1, 1)))
    with pytest.raises(DescriptionError, match="HeightField of link 'hills'"):
        body_to_urdf(hills)


def test_a_document_slides_and_rebounds_by_the_means_of_its_materials() -> None:
    model, data = load(four_materials())
    model.opt.timestep = 1e-3
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
        for _ in range(500):
            mujoco.mj_step(model, data)
            z.append(data.qpos[2] - 0.1)
        heights.append(max(z[int(np.argmin(z)) :]) / height)
    assert np.mean(heights) == pytest.approx(0.64, abs=0.05)
