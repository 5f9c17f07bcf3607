"""Scenes are read of MJCF as MuJoCo reads it, and what a scene cannot say is named."""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import dynx
from dynx import Pose
from dynx.errors import ArgumentError, DescriptionError, UnknownNameError, UnsupportedFeatureError
from dynx.model.geometry import Box, Capsule, HeightField
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import (
    Material,
    PointToPoint,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    World,
    box,
    ground,
    read_scene,
    scene_to_mjcf,
    sphere,
    write_scene,
)
from dynx.world.scene.mjcf_reading import scene_from_mjcf
from tests.world.scene.mjcf_scenes import differences, scenes

mujoco = pytest.importorskip("mujoco")

EXACT = 1e-12
"""Largest difference from MuJoCo, relative to the largest entry: both compute in double precision."""

IN_MOTION = 1e-9
"""Largest difference from MuJoCo after some steps [m]: free joints are elsewhere in the two models."""

LARGEST_CONDITION = 1e7
"""Largest condition number of a mass matrix with which accelerations have the digits of `IN_MOTION`."""

TWO = """<mujoco model="two">
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="arm" pos="0 0 1">
      <body name="link"><joint name="hinge" axis="0 1 0" ref="30"/><geom size="0.1"/></body>
    </body>
    <body name="ball" pos="1 2 3"><freejoint/><geom size="0.1"/></body>
  </worldbody>
</mujoco>"""


def read(text: str, keyframe: str | None = None) -> Scene:
    scene = scene_from_mjcf(text, "two.xml", keyframe=keyframe)
    assert scene is not None
    return scene


def require_close(got: object, want: object, tolerance: float = EXACT) -> None:
    one, two = np.array(got), np.array(want)
    assert np.abs(one - two).max(initial=0.0) <= tolerance * max(np.abs(two).max(initial=0.0), 1.0)


@given(scenes())
def test_random_scenes_are_read_as_mujoco_reads_them(text: str) -> None:
    found = differences(mujoco, mujoco.MjModel.from_xml_string(text), read(text))
    assert max(found.values()) <= EXACT, found


@given(scenes())
def test_what_is_read_can_be_written_as_a_scene(text: str) -> None:
    scene = read(text)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "scene.json"
        write_scene(scene, file)
        back = read_scene(file)
    assert (back.bodies, back.ignored, back.groups) == (scene.bodies, scene.ignored, scene.groups)
    for one, two in zip(back.robots, scene.robots, strict=True):
        assert one.model.joint_names == two.model.joint_names
        require_close(one.q, two.q)
        assert one.materials == two.materials


@given(scenes())
def test_a_scene_falls_as_its_file_does_in_mujoco(text: str) -> None:
    dt, steps = 1e-4, 10
    compiled, scene = mujoco.MjModel.from_xml_string(text), read(text)
    compiled.opt.timestep = dt
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    compiled.dof_frictionloss[:], compiled.jnt_limited[:] = 0.0, 0
    data = mujoco.MjData(compiled)
    # Joints that turn about nearly one axis fall as rounding decides.
    for prepare in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb):
        prepare(compiled, data)
    M = np.zeros((compiled.nv, compiled.nv))
    mujoco.mj_fullM(compiled, data, M)
    assume(np.linalg.cond(M) < LARGEST_CONDITION)
    mujoco.mj_step(compiled, data, steps)
    mujoco.mj_kinematics(compiled, data)
    options = {"collisions": False, "joint_limits": False, "joint_friction": False}
    with World(scene, "mujoco", dt, **options) as world:
        world.step(steps)
        for body in scene.bodies:
            if not body.fixed:
                T = world.state.bodies[body.name].T_world_body
                require_close(T[:3, 3], data.body(body.name).xpos, IN_MOTION)
                require_close(T[:3, :3].ravel(), data.body(body.name).xmat, IN_MOTION)
        for robot in scene.robots:
            poses = dynx.backend("reference", robot.model).forward_kinematics(
                world.state.robots[robot.name].q
            )
            for link in robot.model.links:
                if mujoco.mj_name2id(compiled, mujoco.mjtObj.mjOBJ_BODY, link.name) > 0:
                    T = poses[robot.model.frame_index(link.name)]
                    require_close(T[:3, 3], data.body(link.name).xpos, IN_MOTION)


# -- what becomes what ------------------------------------------------------------------------------


def test_trees_are_robots_and_bodies() -> None:
    scene = read(TWO)
    assert scene.name == "two"
    assert [each.name for each in scene.robots] == ["arm"]
    assert [each.name for each in scene.bodies] == ["floor", "ball"]
    arm = scene.robot("arm")
    assert arm.model.base == "fixed"
    assert arm.model.base_pose == Pose((0.0, 0.0, 1.0))
    assert arm.model.root == "arm"
    require_close(arm.q, [np.pi / 6])
    assert scene.body("floor").fixed
    assert scene.body("ball").pose == Pose((1.0, 2.0, 3.0))
    require_close(scene.body("ball").mass, 1000.0 * 4.0 / 3.0 * np.pi * 1e-3)


def test_load_refuses_several_and_names_read_scene() -> None:
    with pytest.raises(UnsupportedFeatureError, match="read_scene") as caught:
        dynx.load(TWO)
    assert caught.value.line == 4


def test_names_with_a_slash_and_equal_names() -> None:
    text = TWO.replace('body name="ball"', 'body name="floor/"').replace('name="arm"', 'name="a/arm"')
    scene = read(text)
    assert [each.name for each in scene.bodies] == ["floor", "floor_2"]
    assert [each.name for each in scene.robots] == ["a_arm"]
    assert scene.robots[0].model.root == "a/arm"


def test_a_single_body_without_shapes_that_touch_is_a_robot() -> None:
    scene = read(
        TWO.replace(
            '<freejoint/><geom size="0.1"/>', '<freejoint/><geom size="0.1" contype="0" conaffinity="0"/>'
        )
    )
    assert [each.name for each in scene.robots] == ["arm", "ball"]
    assert scene.robot("ball").model.floating
    require_close(scene.robot("ball").q, [1, 2, 3, 0, 0, 0, 1])


def test_gravity_may_be_disabled() -> None:
    text = TWO.replace("<worldbody>", '<option><flag gravity="disable"/></option><worldbody>')
    assert read(text).gravity == (0.0, 0.0, 0.0)


def test_mocap_bodies_are_fixed_with_a_note() -> None:
    scene = read(
        TWO.replace("</worldbody>", '<body name="m" mocap="true"><geom size="1"/></body></worldbody>')
    )
    assert scene.body("m").fixed
    (note,) = (note for note in scene.notes if "mocap" in note.message)
    assert "'m'" in note.message


def test_notes_have_file_and_line_and_are_those_of_a_world() -> None:
    scene = read(TWO.replace("</mujoco>", '<sensor><jointpos joint="hinge"/></sensor></mujoco>'))
    (note,) = (each for each in scene.notes if "<sensor>" in each.message)
    assert note.line == 9
    assert "two.xml" in note.message
    with World(scene, "mujoco") as world:
        assert str(note) in world.notes


def test_a_static_body_of_two_frictions_is_two_bodies() -> None:
    inside = '<geom type="box" size="1 1 1"/><geom size="0.2" pos="0 0 2" friction="0.3"/>'
    scene = read(TWO.replace("</worldbody>", f'<body name="table">{inside}</body></worldbody>'))
    assert [each.name for each in scene.bodies] == ["floor", "ball", "table", "table_2"]
    assert isinstance(scene.body("table").shapes[0].shape, Box)
    assert [scene.body(each).material.friction for each in ("table", "table_2")] == [1.0, 0.3]


def test_height_fields_of_the_world() -> None:
    asset = '<asset><hfield name="h" nrow="2" ncol="3" size="1 2 3 0.5" elevation="1 2 3 4 5 7"/></asset>'
    geom = '<geom name="hill" type="hfield" hfield="h"/></worldbody>'
    text = TWO.replace("<worldbody>", f"{asset}<worldbody>").replace("</worldbody>", geom)
    (placed,) = read(text).body("hill").shapes
    assert isinstance(placed.shape, HeightField)
    assert placed.shape.size == (2.0, 4.0)
    data = mujoco.MjModel.from_xml_string(text).hfield_data.reshape(2, 3)
    require_close(placed.shape.heights, 3.0 * data, 1e-6)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "LA", "P", "1", "I;16"])
def test_height_fields_of_images_have_the_heights_of_mujoco(tmp_path: Path, mode: str) -> None:
    images = pytest.importorskip("PIL.Image")
    rng = np.random.default_rng(0)
    if mode == "I;16":
        image = images.fromarray(rng.integers(0, 2**16, (3, 4), dtype=np.uint16))
    else:
        image = images.fromarray(rng.integers(0, 256, (3, 4, 3), dtype=np.uint8)).convert(mode)
    image.save(tmp_path / "hills.png")
    asset = '<asset><hfield file="hills.png" size="1 2 3 0.5"/></asset>'
    geom = '<geom name="hill" type="hfield" hfield="hills"/></worldbody>'
    path = tmp_path / "scene.xml"
    path.write_text(TWO.replace("<worldbody>", f"{asset}<worldbody>").replace("</worldbody>", geom))
    (placed,) = read_scene(path).body("hill").shapes
    assert isinstance(placed.shape, HeightField)
    data = mujoco.MjModel.from_xml_path(str(path)).hfield_data.reshape(3, 4)
    require_close(placed.shape.heights, 3.0 * data, 1e-6)
    (tmp_path / "hills.png").write_bytes(b"no image")
    with pytest.raises(
        DescriptionError, match="the image of height field 'hills': it cannot be read"
    ) as caught:
        read_scene(path)
    assert caught.value.line is not None


@pytest.mark.parametrize("counts", [(10**6, 10**6), (2000, 1500)])
def test_height_fields_are_bounded(counts: tuple[int, int]) -> None:
    """Together, because a few lines may ask for any number of them."""
    rows, columns = counts
    fields = "".join(f'<hfield name="h{k}" nrow="{rows}" ncol="{columns}" size="1 1 1 1"/>' for k in range(2))
    geoms = '<geom type="hfield" hfield="h{}"/>'
    text = TWO.replace("<worldbody>", f"<asset>{fields}</asset><worldbody>")
    both = "".join(map(geoms.format, range(2)))
    with pytest.raises(DescriptionError, match="the model has more than 4000000 heights; height field 'h"):
        read(text.replace("</worldbody>", f"{both}</worldbody>"))


def test_geoms_of_one_height_field_share_its_heights() -> None:
    asset = '<asset><hfield name="h" nrow="2000" ncol="1500" size="1 1 1 1"/></asset>'
    geoms = "".join(f'<geom name="g{k}" type="hfield" hfield="h"/>' for k in range(2))
    text = TWO.replace("<worldbody>", f"{asset}<worldbody>").replace("</worldbody>", f"{geoms}</worldbody>")
    (first,), (second,) = (read(text).body(name).shapes for name in ("g0", "g1"))
    assert first.shape == second.shape


# -- contacts ---------------------------------------------------------------------------------------


@st.composite
def overlapping(draw: st.DrawFn) -> str:
    """Balls around one point, in trees of bodies, with masks and exclusions."""
    count = 0

    def body(free: bool, depth: int) -> str:
        nonlocal count
        count += 1
        name = f"b{count}"
        joint = (
            "<freejoint/>"
            if free
            else draw(st.sampled_from(["", '<joint type="hinge"/>', '<joint/><joint axis="1 0 0"/>']))
        )
        masks = f'contype="{draw(st.integers(0, 3))}" conaffinity="{draw(st.integers(0, 3))}"'
        inside = "".join(body(False, depth - 1) for _ in range(draw(st.integers(0, 2)) if depth else 0))
        return f'<body name="{name}">{joint}<geom size="1" {masks}/>{inside}</body>'

    trees = "".join(body(draw(st.booleans()), 2) for _ in range(draw(st.integers(1, 3))))
    excluded = ""
    if count > 1:
        pairs = draw(st.sets(st.sampled_from([*combinations(range(1, count + 1), 2)]), max_size=2))
        excluded = "".join(f'<exclude body1="b{a}" body2="b{b}"/>' for a, b in pairs)
    flag = draw(st.sampled_from(["", '<option><flag filterparent="disable"/></option>']))
    return f"<mujoco>{flag}<worldbody>{trees}</worldbody><contact>{excluded}</contact></mujoco>"


@given(overlapping())
def test_what_may_touch_is_what_mujoco_tests(text: str) -> None:
    compiled = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(compiled)
    mujoco.mj_forward(compiled, data)
    names = [compiled.body(k).name for k in range(compiled.nbody)]
    geoms = [tuple(map(int, each.geom)) for each in data.contact]
    touching = {frozenset(names[compiled.geom_bodyid[g]] for g in pair) for pair in geoms}
    scene = read(text)
    parts = {each.rpartition("/")[2]: each for each in scene.parts}
    geometry = {
        part: True
        for part in scene.parts
        if "/" not in part
        or scene.robot(part.partition("/")[0]).model.geometry.collisions(part.partition("/")[2])
    }
    lost = " ".join(note.message for note in scene.notes if "never touch in the scene" in note.message)
    for a, b in combinations(names[1:], 2):
        if parts.get(a) not in geometry or parts.get(b) not in geometry:
            assert frozenset((a, b)) not in touching
            continue
        may = scene.may_collide(parts[a], parts[b])
        if frozenset((a, b)) in touching and not may:
            # A joint connects them: a scene cannot say it, and a note does.
            assert lost
        else:
            assert may == (frozenset((a, b)) in touching)


def test_many_parts_of_one_mask_are_a_group() -> None:
    balls = "".join(
        f'<body pos="{k} 0 0"><freejoint/><geom size="0.1" contype="0" conaffinity="1"/></body>'
        for k in range(20)
    )
    scene = read(f'<mujoco><worldbody><geom type="plane" size="1 1 1"/>{balls}</worldbody></mujoco>')
    assert len(scene.ignored) == 1
    assert len(dict(scene.groups)[scene.ignored[0][0]]) == 20
    assert scene.may_collide("ground", "body_3")
    assert not scene.may_collide("body_2", "body_3")


def test_friction_acts_in_the_directions_of_condim() -> None:
    text = TWO.replace(
        "<worldbody>", '<default><geom friction="0.6 0.02 0.003" condim="4"/></default><worldbody>'
    )
    scene = read(text)
    assert scene.body("ball").material == Material(0.6, 0.02)
    assert scene.material("arm/link") == Material(0.6, 0.02)
    assert not any("friction" in note.message for note in scene.notes)


def test_friction_that_mujoco_combines_otherwise_has_a_note() -> None:
    scene = read(TWO.replace('plane"', 'plane" friction="0.5"'))
    (note,) = (each for each in scene.notes if "friction" in each.message)
    assert "floor" in note.message


# -- constraints ------------------------------------------------------------------------------------

LOOSE = """<mujoco><worldbody>
  <body name="a" pos="1 2 3" euler="10 20 30"><freejoint/><geom size="0.1"/>
    <site name="s" pos="0.1 0.2 0.3" euler="5 6 7"/></body>
  <body name="b" pos="-1 0 2" euler="0 40 0"><freejoint/><geom size="0.1"/>
    <site name="t" pos="0.3 0 0" euler="0 0 9"/></body>
</worldbody><equality>{}</equality></mujoco>"""


@pytest.mark.parametrize(
    "element",
    [
        '<weld body1="a" body2="b"/>',
        '<weld body1="a" body2="b" anchor="0.1 0.2 0.3"/>',
        '<weld body1="a" body2="b" relpose="0.1 0.2 0.3 1 0.5 0 0"/>',
        '<weld body1="a" body2="b" relpose="0.1 0.2 0.3 1 0.5 0 0" anchor="0.4 0.5 0.6"/>',
        '<weld body1="a"/>',
        '<weld site1="s" site2="t"/>',
        '<connect body1="a" body2="b" anchor="0.1 0.2 0.3"/>',
        '<connect body1="b" anchor="0.1 0.2 0.3"/>',
        '<connect site1="s" site2="t"/>',
    ],
)
def test_constraints_are_met_where_mujoco_meets_them(element: str) -> None:
    text = LOOSE.format(element)
    compiled, scene = mujoco.MjModel.from_xml_string(text), read(text)
    (constraint,) = scene.constraints
    data = mujoco.MjData(compiled)
    T = {each.name: each.pose.matrix for each in scene.bodies} | {"world": np.eye(4)}
    if isinstance(constraint, Weld):
        assert constraint.T_a_b is not None
        if constraint.b == "world":
            T[constraint.a] = inverse(constraint.T_a_b.matrix)
        else:
            T[constraint.b] = T[constraint.a] @ constraint.T_a_b.matrix
    else:
        one = T[constraint.a] @ [*constraint.point_a, 1.0]
        two = T[constraint.b] @ [*constraint.point_b, 1.0]
        T[constraint.a][:3, 3] += (two - one)[:3]
    for k, name in enumerate("ab"):
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, T[name][:3, :3].ravel())
        data.qpos[7 * k : 7 * k + 7] = [*T[name][:3, 3], *quat]
    mujoco.mj_forward(compiled, data)
    rows = [k for k in range(data.nefc) if data.efc_type[k] == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    assert len(rows) == (6 if isinstance(constraint, Weld) else 3)
    require_close(data.efc_pos[rows], np.zeros(len(rows)), 1e-9)


def test_a_linear_coupling_of_joints_is_a_mimic_joint() -> None:
    inside = '<body><joint name="other" ref="10"/><geom size="0.1" pos="0 0 1"/></body>'
    text = TWO.replace('<geom size="0.1"/></body>', f'<geom size="0.1"/>{inside}</body>', 1)
    coupled = '<equality><joint joint1="other" joint2="hinge" polycoef="0.1 -2 0 0 0"/></equality></mujoco>'
    robot = read(text.replace("</mujoco>", coupled)).robot("arm")
    assert robot.q is not None
    mimic = robot.model.joint("other").mimic
    assert mimic is not None
    assert (mimic.joint, mimic.multiplier) == ("hinge", -2.0)
    # At the pose of the file the follower is 0.1 beyond its reference.
    require_close(mimic.multiplier * robot.q[0] + mimic.offset, np.radians(10.0) + 0.1)


@pytest.mark.parametrize(
    ("element", "named"),
    [
        ('<joint joint1="hinge"/>', "hinge"),
        ('<joint joint1="hinge" polycoef="0 1 1"/>', "hinge"),
        ('<tendon tendon1="t"/>', "tendon"),
        ('<joint joint1="hinge" active="false"/>', "joint"),
        ('<weld body1="arm"/>', "weld"),
    ],
)
def test_constraints_that_a_scene_has_not_are_noted(element: str, named: str) -> None:
    scene = read(TWO.replace("</mujoco>", f"\n<equality>{element}</equality></mujoco>"))
    assert not scene.constraints
    assert any(named in note.message and note.line == 10 for note in scene.notes)


def test_inactive_welds_and_connections_are_read_with_their_names() -> None:
    welded = '<weld name="grip" body1="ball" active="false"/>'
    joined = '<connect name="grip" body1="ball" anchor="0 0 0"/>'
    scene = read(TWO.replace("</mujoco>", f"<equality>{welded}{joined}</equality></mujoco>"))
    weld, point = scene.constraints
    assert (weld.name, weld.active, point.name, point.active) == ("grip", False, "grip_2", True)
    assert isinstance(weld, Weld)
    assert weld.T_a_b is not None  # MuJoCo draws the ends to the pose of the file
    pytest.importorskip("mujoco")
    again = read(scene_to_mjcf(scene))
    assert [(each.name, each.active) for each in again.constraints] == [("grip", False), ("grip_2", True)]


# -- keyframes --------------------------------------------------------------------------------------

KEYS = TWO.replace(
    "</mujoco>",
    '<keyframe><key name="home" qpos="0.5 1 2 4 0 1 0 0" qvel="0.1 1 2 3 4 5 6"/></keyframe></mujoco>',
)


def test_a_keyframe_is_the_start_by_its_name() -> None:
    assert any("keyframe" in note.message for note in read(KEYS).notes)
    scene = read(KEYS, "home")
    arm, ball = scene.robot("arm"), scene.body("ball")
    assert (arm.q, arm.v) == ((0.5,), (0.1,))
    assert ball.pose.xyz == (1.0, 2.0, 4.0)
    # MuJoCo's angular velocity is in the axes of the body, half a turn about x.
    require_close(ball.twist, [1, 2, 3, 4, -5, -6])


@given(st.integers(0, 2**32 - 1))
def test_the_twist_of_a_free_body_at_a_keyframe_is_that_of_mujoco(seed: int) -> None:
    q, v = (np.random.default_rng(seed).uniform(-2.0, 2.0, n) for n in (8, 7))
    key = f'qpos="{" ".join(map(repr, q.tolist()))}" qvel="{" ".join(map(repr, v.tolist()))}"'
    text = re.sub(r'qpos="[^"]*" qvel="[^"]*"', key, KEYS)
    compiled = mujoco.MjModel.from_xml_string(text)
    data, twist = mujoco.MjData(compiled), np.zeros(6)
    mujoco.mj_resetDataKeyframe(compiled, data, 0)
    mujoco.mj_forward(compiled, data)
    ball = compiled.body("ball").id
    mujoco.mj_objectVelocity(compiled, data, mujoco.mjtObj.mjOBJ_XBODY, ball, twist, 0)
    require_close(read(text, "home").body("ball").twist, [*twist[3:], *twist[:3]])


def test_another_keyframe_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "two.xml"
    file.write_text(KEYS)
    assert read_scene(file, keyframe="home").robot("arm").q == (0.5,)
    with pytest.raises(UnknownNameError, match="home"):
        read_scene(file, keyframe="hone")
    with pytest.raises(ArgumentError, match="keyframe"):
        read_scene("stack", keyframe="home")
    with pytest.raises(DescriptionError, match="qpos"):
        read(KEYS.replace('qpos="0.5', 'qpos="1 0.5'))


def test_robots_of_a_scene_have_the_keyframes_as_configurations() -> None:
    model = read(KEYS).robot("arm").model
    assert {name: q.tolist() for name, q in model.configurations.items()} == {"home": [0.5]}


def test_keyframes_of_an_aligned_free_body_are_named() -> None:
    aligned = KEYS.replace("<freejoint/>", '<freejoint align="true"/>')
    assert any("does not read keyframes" in note.message for note in read(aligned).notes)
    with pytest.raises(UnsupportedFeatureError, match="keyframe 'home'"):
        read(aligned, "home")


# -- what a scene cannot say ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('<freejoint/><geom size="0.1"/>', '<freejoint/><geom type="sdf" mass="1"/>', "signed distance"),
        ("<freejoint/>", '<freejoint/><joint name="second"/>', "ball"),
        ("</mujoco>", '<equality><weld body1="bal"/></equality></mujoco>', "ball"),
        ("</mujoco>", '<equality><weld site1="s" site2="t"/></equality></mujoco>', "site"),
        ("</mujoco>", '<equality><joint joint1="hing"/></equality></mujoco>', "hinge"),
        ("</mujoco>", '<contact><exclude body1="arm"/></contact></mujoco>', "body2"),
    ],
)
def test_what_cannot_be_read_is_an_error_with_its_line(old: str, new: str, named: str) -> None:
    with pytest.raises(DescriptionError, match=named) as caught:
        read(TWO.replace(old, new, 1))
    assert caught.value.line is not None


def test_a_file_that_is_no_scene(tmp_path: Path) -> None:
    file = tmp_path / "robot.xml"
    file.write_text('<robot name="r"><link name="l"/></robot>')
    with pytest.raises(ArgumentError, match=r"dynx\.load"):
        read_scene(file)


# -- what dynx writes is read back ------------------------------------------------------------------


def arm(base: str = "fixed") -> SceneRobot:
    text = """<robot name="r"><link name="foot"><inertial><origin xyz="0.1 0 0"/><mass value="3"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="leg"><inertial><origin xyz="0 0.1 0.2"/><mass value="2"/>
    <inertia ixx="1" iyy="1.1" izz="0.9" ixy="0.1" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
    <link name="pad"><collision><origin xyz="0 0 1"/>
    <geometry><box size="1 2 3"/></geometry></collision></link>
    <link name="toe"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="knee" type="revolute"><origin xyz="0 0 1" rpy="0.1 0.2 0.3"/><parent link="foot"/>
    <child link="leg"/><axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="1"/>
    <dynamics damping="0.2"/></joint>
    <joint name="glue" type="fixed"><origin xyz="0.5 0 0" rpy="0 0.5 0"/><parent link="leg"/>
    <child link="pad"/></joint>
    <joint name="ankle" type="prismatic"><parent link="leg"/><child link="toe"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/>
    <mimic joint="knee" multiplier="2" offset="0.1"/></joint>
    </robot>"""
    model = dynx.load(text, base=base)  # type: ignore[arg-type]
    return SceneRobot("arm", model).at(Pose((0.3, 0.2, 0.1), (0.3, 0.2, 0.1)))


def own_scenes() -> list[Scene]:
    """Scenes with bodies, robots, constraints, filters and velocities."""
    pill = SceneBody(
        "pill",
        Capsule(0.1, 0.4),
        pose=Pose((0, 1, 2), (0.1, 0.2, 0.3)),
        mass=2.0,
        inertia=np.diag([1.0, 1.1, 1.2]),
        center_of_mass=(0.1, 0.0, 0.2),
        twist=(1, 2, 3, 4, 5, 6),
    )
    table = box("table", (1, 1, 0.1), pose=Pose((0, 0, 0.5)))
    constraints = (
        Weld("arm/leg", "ball", Pose((0, 0, 0.5), (0.1, 0, 0))),
        PointToPoint("pill", "world", (0.1, 0, 0), (0, 1, 2)),
    )
    bodies = (ground(), table, pill, sphere("ball", 0.2, mass=1.5, pose=Pose((2, 0, 1))))
    return [
        Scene(
            "own",
            (robot,),
            bodies,
            constraints,
            ignored=[("arm", "table"), ("ball", "pill")],
            gravity=(0.1, 0.2, -3.0),
        )
        for robot in (arm(), arm("floating"))
    ]


@pytest.mark.parametrize(
    "scene", [*own_scenes(), read_scene("stack"), read_scene("bowling")], ids=lambda s: s.name
)
def test_an_exported_scene_is_read_back(scene: Scene) -> None:
    back = read(scene_to_mjcf(scene), "start")
    assert (back.name, back.gravity) == (scene.name, scene.gravity)
    assert [each.name for each in back.bodies] == [each.name for each in scene.bodies]
    assert [each.name for each in back.robots] == [each.name for each in scene.robots]
    for one, two in zip(back.bodies, scene.bodies, strict=True):
        assert [type(each.shape) for each in one.shapes] == [type(each.shape) for each in two.shapes]
        require_close(
            [each.origin.matrix for each in one.shapes], [each.origin.matrix for each in two.shapes]
        )
        require_close(one.pose.matrix, two.pose.matrix)
        require_close(one.twist, two.twist)
        assert (one.mass, one.fixed) == (two.mass, two.fixed)
        require_close(one.inertial.tensor, two.inertial.tensor)
        require_close(one.inertial.origin.xyz, two.inertial.origin.xyz)
    for robot, own in zip(back.robots, scene.robots, strict=True):
        _require_equal_robots(robot, own)
    for constraint, stated in zip(back.constraints, scene.constraints, strict=True):
        assert (constraint.a, constraint.b) == (stated.a, stated.b)
        if isinstance(constraint, Weld):
            assert isinstance(stated, Weld)
            assert constraint.T_a_b is not None
            assert stated.T_a_b is not None
            require_close(constraint.T_a_b.matrix, stated.T_a_b.matrix)
        else:
            assert isinstance(stated, PointToPoint)
            require_close((constraint.point_a, constraint.point_b), (stated.point_a, stated.point_b))
    for a, b in combinations(scene.parts, 2):
        if all(_has_shapes(scene, part) for part in (a, b)):
            assert back.may_collide(a, b) == scene.may_collide(a, b)


def _has_shapes(scene: Scene, part: str) -> bool:
    robot, _, link = part.partition("/")
    return not link or bool(scene.robot(robot).model.geometry.collisions(link))


def _require_equal_robots(one: SceneRobot, two: SceneRobot) -> None:
    assert one.model.joint_names == two.model.joint_names
    assert [each.name for each in one.model.links] == [each.name for each in two.model.links]
    assert (one.model.root, one.model.base) == (two.model.root, two.model.base)
    require_close(one.q, two.q)
    require_close(one.model.base_pose.matrix, two.model.base_pose.matrix)
    # Links that do not move have no mass in the document.
    random = np.random.default_rng(0)
    engines = [dynx.backend("reference", each.model) for each in (one, two)]
    q = two.model.random(random)
    matrices = [engine.mass_matrix(q) for engine in engines]
    require_close(matrices[0], matrices[1])
    names = [link.name for link in two.model.links]
    poses = [[engine.forward_kinematics(q, name) for name in names] for engine in engines]
    require_close(poses[0], poses[1])
    if two.model.floating:
        require_close(one.model.total_mass, two.model.total_mass)
        assert np.abs(rotation_from_quat(np.array(one.q)[3:7])).max() <= 1.0 + EXACT
