"""MJCF is read as MuJoCo reads it, and what a model cannot say is named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import dynx
from dynx.errors import ArgumentError, DescriptionError, UnsupportedFeatureError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, Mesh, Sphere
from dynx.model.geometry.shells import SHELL_THICKNESS
from tests.model.mjcf.models import compute, models

mujoco = pytest.importorskip("mujoco")

EXACT = 1e-12
"""Largest difference from MuJoCo, relative to the largest entry: both compute in double precision."""

ARM = """<mujoco model="arm">
  <compiler angle="radian"/>
  <worldbody>
    <body name="link" pos="0 0 1">
      <joint name="hinge" axis="0 1 0"/>
      <geom size="0.1"/>
    </body>
  </worldbody>
</mujoco>"""


def require_close(got: np.ndarray, want: np.ndarray, tolerance: float = EXACT) -> None:
    assert np.abs(got - want).max(initial=0.0) <= tolerance * max(np.abs(want).max(initial=0.0), 1e-3)


@given(models())
def test_random_models_are_read_as_mujoco_reads_them(text: str) -> None:
    compiled = mujoco.MjModel.from_xml_string(text)
    model = dynx.load(text)
    free = "<freejoint" in text
    assert model.base == ("floating" if free else "fixed")
    assert model.nv == compiled.nv
    assert list(model.gravity) == list(compiled.opt.gravity)
    first = 1 if free else 0
    joints = [compiled.joint(k) for k in range(first, compiled.njnt)]
    assert list(model.joint_names) == [joint.name for joint in joints]
    for joint in joints:
        mine = model.joint(joint.name)
        # The angle of a ball joint is never below 0.
        unlimited = (0.0 if mine.type == "ball" else -np.inf, np.inf)
        lower, upper = joint.range if compiled.jnt_limited[joint.id] else unlimited
        require_close(
            np.array([mine.limits.lower, mine.limits.upper]), np.array([lower, upper])
        ) if np.isfinite(upper) else None
        assert np.isinf([lower, upper]).tolist() == np.isinf([mine.limits.lower, mine.limits.upper]).tolist()
        force = compiled.jnt_actfrcrange[joint.id][1] if compiled.jnt_actfrclimited[joint.id] else np.inf
        assert mine.limits.effort == force
        stated = (joint.damping[0], joint.frictionloss[0], joint.armature[0])
        assert (mine.dynamics.damping, mine.dynamics.friction, mine.dynamics.armature) == stated
    engine = dynx.backend("reference", model)
    for seed in range(2):
        want = compute(mujoco, compiled, seed, free=free)
        require_close(engine.mass_matrix(want.q), want.mass_matrix)
        require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques)
        poses = dict(zip(model.frame_names, engine.forward_kinematics(want.q), strict=True))
        for name, T in (want.bodies | want.sites).items():
            require_close(poses[name], T)


def test_a_body_off_the_axis_keeps_its_frame() -> None:
    text = ARM.replace('axis="0 1 0"', 'axis="0 1 0" pos="0.5 0 0"')
    model = dynx.load(text)
    T = dynx.backend("reference", model).forward_kinematics([np.pi / 2])[model.frame_index("link")]
    # About (0.5, 0, 1), the origin of the body goes from -x to +z.
    require_close(T[:3, 3], np.array([0.5, 0.0, 1.5]))


def test_shapes_colours_and_groups() -> None:
    text = ARM.replace(
        '<geom size="0.1"/>',
        '<geom name="ball" size="0.1" rgba="1 0 0 1"/>'
        '<geom name="seen" type="box" size="1 2 3" contype="0" conaffinity="0" material="blue"/>'
        '<geom name="felt" type="capsule" size="0.1" fromto="0 0 0 0 0 1" group="3"/>',
    ).replace("<worldbody>", '<asset><material name="blue" rgba="0 0 1 0.5"/></asset><worldbody>')
    geometry = dynx.load(text).geometry
    ball, seen = geometry.visuals("link")
    assert (ball.shape, seen.shape) == (Sphere(0.1), Box((2.0, 4.0, 6.0)))
    assert ball.material is not None
    assert seen.material is not None
    assert (ball.material.rgba, seen.material.rgba) == ((1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.5))
    first, felt = geometry.collisions("link")
    assert (first.shape, felt.shape) == (Sphere(0.1), Capsule(0.1, 1.0))
    assert felt.origin.xyz == (0.0, 0.0, 0.5)


def write_an_l(folder: Path) -> None:
    """Write parts/l.obj: an L of two boxes without the faces between them, closed and not convex."""
    corners = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)]
    lines = [f"v {x} {y} {z}" for z in (0.0, 0.5) for x, y in corners]
    triangles = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in triangles] + [(a + 6, b + 6, c + 6) for a, b, c in triangles]
    for k in range(6):
        n = (k + 1) % 6
        faces += [(k, n, n + 6), (k, n + 6, k + 6)]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    (folder / "parts").mkdir()
    (folder / "parts" / "l.obj").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    "placed",
    ['scale="1 0.5 2" refpos="0.2 0.1 0"', 'scale="0.5 0.5 0.5" refpos="0.2 0 0.1" refquat="1 0.2 0 0"'],
)
@pytest.mark.parametrize("kind", ["convex", "exact", "legacy", "shell"])
def test_inertias_of_meshes(tmp_path: Path, kind: str, placed: str) -> None:
    write_an_l(tmp_path)
    path = tmp_path / "arm.xml"
    path.write_text(
        ARM.replace('<geom size="0.1"/>', '<geom type="mesh" mesh="l" pos="0.1 0 0" euler="0.1 0.2 0.3"/>')
        .replace(
            "<worldbody>",
            f'<asset><mesh file="l.obj" inertia="{kind}" {placed}/></asset><worldbody>',
        )
        .replace('angle="radian"', 'angle="radian" meshdir="parts"')
    )
    compiled = mujoco.MjModel.from_xml_path(str(path))
    model = dynx.load(path)
    want = compute(mujoco, compiled, 0, free=False)
    engine = dynx.backend("reference", model)
    # MuJoCo holds vertices in single precision.
    require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques, 1e-6)
    (visual,) = model.geometry.visuals("link")
    assert isinstance(visual.shape, Mesh)
    vertices = visual.shape.triangles[0] @ visual.origin.matrix[:3, :3].T + visual.origin.matrix[:3, 3]
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, compiled.geom_quat[0])
    theirs = compiled.mesh_vert @ R.reshape(3, 3).T + compiled.geom_pos[0]
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(vertices, axis=0), end(theirs, axis=0), atol=1e-6)


@pytest.mark.parametrize("kind", ["convex", "shell"])
@pytest.mark.parametrize("flag", ["", ' fitaabb="true"'])
@pytest.mark.parametrize("shape", ["sphere", "capsule", "cylinder", "box", "ellipsoid"])
def test_primitives_fitted_to_meshes(tmp_path: Path, shape: str, flag: str, kind: str) -> None:
    write_an_l(tmp_path)
    path = tmp_path / "arm.xml"
    fitted = f'<geom type="{shape}" mesh="l" pos="0.1 0 0" euler="0.1 0.2 0.3" fitscale="0.9"/>'
    asset = f'<asset><mesh file="l.obj" inertia="{kind}" scale="0.2 0.1 1.5" refpos="0.2 0.1 0"/></asset>'
    text = ARM.replace('<geom size="0.1"/>', fitted).replace("<worldbody>", f"{asset}<worldbody>")
    path.write_text(text.replace('angle="radian"', f'angle="radian" meshdir="parts"{flag}'))
    compiled, model = mujoco.MjModel.from_xml_path(str(path)), dynx.load(path)
    want = compute(mujoco, compiled, 0, free=False)
    engine = dynx.backend("reference", model)
    require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques, 1e-6)
    require_close(engine.mass_matrix(want.q), want.mass_matrix, 1e-6)
    (placed,) = model.geometry.collisions("link")
    np.testing.assert_allclose(placed.origin.xyz, compiled.geom_pos[0], atol=1e-6)
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, compiled.geom_quat[0])
    # Axes are those of the file or their opposites.
    np.testing.assert_allclose(np.abs(placed.origin.matrix[:3, :3].T @ R.reshape(3, 3)), np.eye(3), atol=1e-5)
    x, y, z = compiled.geom_size[0]
    makers: dict[str, Callable[[], Box | Capsule | Cylinder | Ellipsoid | Sphere]] = {
        "sphere": lambda: Sphere(x),
        "capsule": lambda: Capsule(x, 2 * y),
        "cylinder": lambda: Cylinder(x, 2 * y),
        "box": lambda: Box((2 * x, 2 * y, 2 * z)),
        "ellipsoid": lambda: Ellipsoid((x, y, z)),
    }
    expected = makers[shape]()
    assert type(placed.shape) is type(expected)
    for each in fields(expected):
        got, wanted = getattr(placed.shape, each.name), getattr(expected, each.name)
        np.testing.assert_allclose(got, wanted, rtol=1e-6)


CORNERS = "0 0 0 0.4 0 0 0 0.3 0 0.1 0.1 0.5 0.4 0.4 0.1"
"""Vertices of a mesh; all of them are on their hull."""


@pytest.mark.parametrize("faces", ["", ' face="0 2 1 0 1 3 0 3 2 1 2 4 1 4 3 2 3 4"'])
@pytest.mark.parametrize("kind", ["convex", "exact", "legacy", "shell"])
@pytest.mark.parametrize("turned", ['refpos="0.1 0 0"', 'refpos="0.1 0 0" refquat="1 0.5 0.2 0.1"'])
def test_meshes_by_their_vertices_are_those_of_mujoco(turned: str, faces: str, kind: str) -> None:
    mesh = f'<mesh name="m" vertex="{CORNERS}"{faces} inertia="{kind}" scale="1 2 0.5" {turned}/>'
    geom = '<geom type="mesh" mesh="m" pos="0.1 0.2 0.3" euler="0.1 0.2 0.3"/>'
    text = ARM.replace('<geom size="0.1"/>', geom).replace("<worldbody>", f"<asset>{mesh}</asset><worldbody>")
    compiled, model = mujoco.MjModel.from_xml_string(text), dynx.load(text)
    want = compute(mujoco, compiled, 0, free=False)
    engine = dynx.backend("reference", model)
    require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques, 1e-6)
    require_close(engine.mass_matrix(want.q), want.mass_matrix, 1e-6)
    (placed,) = model.geometry.collisions("link")
    assert isinstance(placed.shape, Mesh)
    vertices = placed.shape.triangles[0] @ placed.origin.matrix[:3, :3].T + placed.origin.xyz
    R = np.zeros(9)
    mujoco.mju_quat2Mat(R, compiled.geom_quat[0])
    theirs = compiled.mesh_vert @ R.reshape(3, 3).T + compiled.geom_pos[0]
    for end in (np.min, np.max):
        np.testing.assert_allclose(end(vertices, axis=0), end(theirs, axis=0), atol=1e-6)


@pytest.mark.parametrize(
    ("stated", "named"),
    [
        ('vertex="0 0 0 1 0 0"', "vertex of mesh 'm' has 6 numbers"),
        (f'vertex="{CORNERS} 1"', "vertex of mesh 'm' has 16 numbers"),
        (f'vertex="{CORNERS}" face="0 1"', "face of mesh 'm' has 2 numbers"),
        (f'vertex="{CORNERS}" face="0 1 9"', "vertex 9; wanted 0 to 4"),
        (f'vertex="{CORNERS}" face="0 1 1.5"', "not whole"),
        ('builtin="sphere" params="1"', "is made by the compiler"),
        ("", "has no file and no vertices"),
    ],
)
def test_faults_of_meshes_by_their_vertices(stated: str, named: str) -> None:
    text = ARM.replace('<geom size="0.1"/>', '<geom type="mesh" mesh="m"/>')
    text = text.replace("<worldbody>", f'<asset>\n<mesh name="m" {stated}/></asset><worldbody>')
    with pytest.raises(DescriptionError, match=named) as caught:
        dynx.load(text)
    assert caught.value.line == 4


@pytest.mark.parametrize("stated", ["", ' mass="3"', ' density="70"'])
def test_the_shell_of_an_ellipsoid_is_that_of_mujoco(stated: str) -> None:
    geom = f'<geom type="ellipsoid" size="0.1 0.3 0.2" shellinertia="true"{stated}/>'
    text = ARM.replace('<geom size="0.1"/>', geom)
    compiled, inertial = mujoco.MjModel.from_xml_string(text), dynx.load(text).inertial("link")
    assert inertial.mass == pytest.approx(compiled.body_mass[1], rel=EXACT)
    # MuJoCo subtracts two volumes that agree but for this share, and loses as many digits.
    lost = np.finfo(float).eps * 0.1 / SHELL_THICKNESS
    moments = sorted((inertial.ixx, inertial.iyy, inertial.izz))
    np.testing.assert_allclose(moments, sorted(compiled.body_inertia[1]), rtol=10.0 * lost)


def test_files_are_included_once_and_from_the_folder_alone(tmp_path: Path) -> None:
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "package.xml").write_text("<package/>")
    (folder / "geom.xml").write_text('<mujocoinclude>\n<geom size="0.1"\n mass="x"/></mujocoinclude>')
    path = folder / "arm.xml"
    path.write_text(ARM.replace('<geom size="0.1"/>', '<include file="geom.xml"/>'))
    with pytest.raises(DescriptionError, match=r"geom\.xml:2: mass in <geom>"):
        dynx.load(path)
    (folder / "geom.xml").write_text('<mujocoinclude><geom size="0.1" mass="2"/></mujocoinclude>')
    assert dynx.load(path).total_mass == 2.0
    path.write_text(ARM.replace('<geom size="0.1"/>', 2 * '<include file="geom.xml"/>'))
    with pytest.raises(DescriptionError, match="included twice"):
        dynx.load(path)
    (folder / "geom.xml").write_text('<mujocoinclude><include file="geom.xml"/></mujocoinclude>')
    path.write_text(ARM.replace('<geom size="0.1"/>', '<include file="geom.xml"/>'))
    with pytest.raises(DescriptionError, match="included twice"):
        dynx.load(path)
    (tmp_path / "outside.xml").write_text("<x/>")
    for name in ("../outside.xml", str(tmp_path / "outside.xml"), "/etc/passwd", "none.xml", ""):
        path.write_text(ARM.replace('<geom size="0.1"/>', f'<include file="{name}"/>'))
        with pytest.raises(DescriptionError, match="is not included"):
            dynx.load(path)


def test_the_base_is_the_files() -> None:
    free = ARM.replace('<joint name="hinge" axis="0 1 0"/>', "<freejoint/>")
    assert dynx.load(free, base="floating").floating
    assert dynx.load(ARM).root == "world"
    with pytest.raises(ArgumentError, match="with_base"):
        dynx.load(free, base="fixed")
    with pytest.raises(ArgumentError, match="with_base"):
        dynx.load(ARM, base="floating")
    assert not dynx.load(free).with_base("fixed").floating


WITHOUT = '<geom size="0.1"/>'
FAULTS = {
    "ball range": (
        'axis="0 1 0"',
        'type="ball" range="-1 1"',
        DescriptionError,
        "largest angle of a ball joint",
    ),
    "after ball": (
        WITHOUT,
        '<joint name="ball" type="ball"/><joint name="next"/>',
        DescriptionError,
        "6: joint 'next' turns the body 'link', which a ball joint turns already",
    ),
    "flex": (WITHOUT, "<flexcomp/>", UnsupportedFeatureError, "6: dynx does not read <flexcomp>"),
    "two": (
        "</worldbody>",
        '<body name="other"><freejoint/></body></worldbody>',
        UnsupportedFeatureError,
        "2 robots or bodies",
    ),
    "global": ('angle="radian"', 'coordinate="global"', UnsupportedFeatureError, "2: coordinate"),
    "angle": ('"radian"', '"radians"', DescriptionError, "did you mean 'radian'"),
    "sequence": ('angle="radian"', 'eulerseq="xy"', DescriptionError, "2: eulerseq"),
    "type": ("<geom", '<geom type="bx"', DescriptionError, "6: type of a geom is 'bx'"),
    "size": ('size="0.1"', 'type="box" size="0.1"', DescriptionError, "6: size in <geom>"),
    "no size": ('size="0.1"', "", DescriptionError, "6: a geom is a sphere and has no size"),
    "negative": ('size="0.1"', 'size="-1"', DescriptionError, "wanted more than 0"),
    "mass": ('size="0.1"', 'size="0.1" mass="-1"', DescriptionError, "6: mass of a geom"),
    "mesh": (WITHOUT, '<geom type="mesh" mesh="x"/>', DescriptionError, "names the mesh 'x'"),
    "class": ("<geom", '<geom class="clas"', DescriptionError, "6: no <default> has the class 'clas'"),
    "axis": ('"0 1 0"', '"0 0 0"', DescriptionError, "5: the axis of joint 'hinge' is zero"),
    "words": ('"0 1 0"', '"0 1"', DescriptionError, "wanted three numbers"),
    "number": ('"0 1 0"', '"0 1 up"', DescriptionError, "wanted three numbers"),
    "range": ('axis="0 1 0"', 'range="1 -1"', DescriptionError, "5: range of joint 'hinge'"),
    "limited": ('axis="0 1 0"', 'limited="true"', DescriptionError, "no range"),
    "orientations": ("<geom", '<geom quat="1 0 0 0" euler="0 0 0"', DescriptionError, "quat and euler"),
    "quat": ("<geom", '<geom quat="0 0 0 0"', DescriptionError, "6: quat of a geom is zero"),
    "twice": ("</body>", '</body><body name="link"/>', DescriptionError, "two bodies have the name 'link'"),
    "joints": (
        "</body>",
        '<body><joint name="hinge"/></body></body>',
        DescriptionError,
        "two joints have the name 'hinge'",
    ),
    "world joint": ("<worldbody>", "<worldbody><joint/>", DescriptionError, "the world has a joint"),
    "frame": (
        WITHOUT,
        '<frame><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></frame>',
        DescriptionError,
        "6: a <frame> has an <inertial>",
    ),
    "free and more": (
        '<joint name="hinge" axis="0 1 0"/>',
        '<freejoint/><joint name="hinge"/>',
        DescriptionError,
        "5: body 'link' moves freely and has another joint",
    ),
    "attribute": ('axis="0 1 0"', 'rnage="0 1"', DescriptionError, "'rnage'; did you mean 'range'"),
    "compiler": ('angle="radian"', 'angel="radian"', DescriptionError, "did you mean 'angle'"),
    "element": (WITHOUT, "<jiont/>", DescriptionError, "6: <body> has the unknown element <jiont>"),
    "default": (
        "<worldbody>",
        '<default><geom masss="1"/></default><worldbody>',
        DescriptionError,
        "did you mean 'mass'",
    ),
    "nested free": ("</body>", "<body><freejoint/></body></body>", DescriptionError, "is free"),
    "inertial": (WITHOUT, '<inertial pos="0 0 0" mass="1"/>', DescriptionError, "diaginertia"),
    "count": (
        WITHOUT,
        f'<replicate count="100000">{WITHOUT}</replicate>',
        DescriptionError,
        "count of <replicate>",
    ),
    "childclass": (
        "</body>",
        '<body childclass="clas">\n<joint/></body></body>',
        DescriptionError,
        "7: no <default> has the class 'clas'",
    ),
    "no asset": (WITHOUT, '<geom type="mesh" mesh="x"/>', DescriptionError, "which no <asset> has"),
    "composite": (
        WITHOUT,
        '<composite><joint kind="main"/></composite>',
        UnsupportedFeatureError,
        "6: dynx does not read <composite>",
    ),
    "motor": (
        "</worldbody>",
        '</worldbody><actuator><motor joint="hing"/></actuator>',
        DescriptionError,
        "8: <motor> acts on the joint 'hing'",
    ),
    "include": (WITHOUT, '<include file="x.xml"/>', DescriptionError, "not read from a file"),
    "end tag": ("</body>", "", DescriptionError, "8: not well-formed XML: mismatched tag"),
    "quote": ('"0 1 0"', '"0 1 0', DescriptionError, "6: not well-formed XML: invalid token"),
    "attribute twice": ('name="hinge"', 'name="hinge" name="x"', DescriptionError, "duplicate attribute"),
    "document type": ("<mujoco", '<!DOCTYPE a [<!ENTITY b "c">]><mujoco', DescriptionError, "not allowed"),
    "infinite": ('size="0.1"', 'size="1e999"', DescriptionError, "6: size in <geom> of a geom is '1e999'"),
    "kind": ('axis="0 1 0"', 'type="hinj"', DescriptionError, "5: type of a joint is 'hinj'"),
    "flag": ('"radian"', '"radian" autolimits="maybe"', DescriptionError, "2: autolimits of <compiler>"),
    "no mass": (
        WITHOUT,
        '<inertial pos="0 0 0" diaginertia="1 1 1"/>',
        DescriptionError,
        "6: <inertial> of body 'link' has no attribute mass",
    ),
    "classes": (
        "<worldbody>",
        '<default><default class="a"/><default class="a"/></default><worldbody>',
        DescriptionError,
        "3: the class 'a' of <default> is defined twice",
    ),
    "class without a name": (
        "<worldbody>",
        "<default><default/></default><worldbody>",
        DescriptionError,
        "3: a <default> inside another one has no class",
    ),
    "one point": (
        'size="0.1"',
        'type="capsule" size="0.1" fromto="0 0 0 0 0 0"',
        DescriptionError,
        "6: the two points of fromto of a geom are one",
    ),
    "sites": ("</body>", '<site name="a"/><site name="a"/></body>', DescriptionError, "7: two sites have"),
    "attach": (
        WITHOUT,
        '<attach model="other" body="b" prefix="p"/>',
        DescriptionError,
        "6: <attach> names the model 'other'",
    ),
    "armature": ('axis="0 1 0"', 'armature="x"', DescriptionError, "5: armature in <joint>"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_errors_with_the_line(fault: str) -> None:
    old, new, kind, message = FAULTS[fault]
    assert old in ARM
    with pytest.raises(kind) as raised:
        dynx.load(ARM.replace(old, new, 1))
    assert message in str(raised.value)
    assert raised.value.line is not None


@pytest.mark.parametrize("inside", ["<flexcomp/>", '<geom masss="1"/>', "<body><jiont/></body>"])
def test_faults_of_bodies_that_are_no_part_of_a_free_robot_are_errors(inside: str) -> None:
    text = "<mujoco><worldbody><body>{}</body><body>{}</body></worldbody></mujoco>"
    body = '<freejoint/><geom size="0.1"/>'
    assert dynx.load(text.format("", body)).floating
    with pytest.raises(DescriptionError):
        dynx.load(text.format(inside, body))


@pytest.mark.parametrize(
    ("flag", "joint", "noted"),
    [
        ("", "", False),
        (' alignfree="true"', "", True),
        ("", ' align="true"', True),
        (' alignfree="true"', ' align="false"', False),
    ],
)
def test_a_frame_that_mujoco_would_move_is_named(flag: str, joint: str, noted: bool) -> None:
    body = f'<body name="b"><freejoint{joint}/><geom size="0.1" pos="1 0 0"/></body>'
    model = dynx.load(f"<mujoco><compiler{flag}/><worldbody>{body}</worldbody></mujoco>")
    assert any("align: the frame of body 'b'" in note.message for note in model.notes) == noted
    assert any("align" in note.message for note in model.notes) == noted


@pytest.mark.parametrize("joints", ['<joint name="a"/>', '<joint name="a"/><joint name="b" axis="1 0 0"/>'])
def test_a_body_that_moves_without_mass_is_named(joints: str) -> None:
    inertial = '<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>'
    model = dynx.load(f'<mujoco><worldbody><body name="x">{inertial}{joints}</body></worldbody></mujoco>')
    assert ["'x' has no mass" in note.message for note in model.notes] == [True]


def test_a_part_that_a_file_includes_is_named_as_one() -> None:
    with pytest.raises(DescriptionError, match="<mujoco>"):
        dynx.load("<mujocoinclude><worldbody/></mujocoinclude>")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("joint", ["<freejoint/>", "<joint/>", ""])
def test_a_total_mass_is_that_of_all_bodies(joint: str) -> None:
    """Also of those that are no part of a free robot."""
    ball = '<geom size="0.1" mass="1"/>'
    world = f'<geom size="1" mass="9"/><body>{ball}</body><body name="b">{joint}{ball}{ball}</body>'
    text = f'<mujoco><compiler settotalmass="6"/><worldbody>{world}</worldbody></mujoco>'
    inertial = dynx.load(text).link("b").inertial
    assert inertial is not None
    assert inertial.mass == mujoco.MjModel.from_xml_string(text).body("b").mass[0] == 4.0


def test_the_prefix_of_copies_has_no_effect() -> None:
    text = ARM.replace("<body ", '<replicate count="1" prefix="x"><body ', 1).replace(
        "</world", "</replicate></world"
    )
    assert dynx.load(text).joint_names == dynx.load(text.replace(' prefix="x"', "")).joint_names
    assert any("prefix" in note.message for note in dynx.load(text).notes)


def test_copies_of_copies_are_bounded() -> None:
    bomb = WITHOUT
    for _ in range(6):
        bomb = f'<replicate count="1000">{bomb}</replicate>'
    with pytest.raises(DescriptionError, match="elements"):
        dynx.load(ARM.replace(WITHOUT, bomb))


def test_what_is_not_part_of_the_model_is_named() -> None:
    text = ARM.replace(
        "</worldbody>",
        '</worldbody><actuator><motor joint="hinge"/></actuator><sensor><user dim="1"/></sensor>'
        '<equality><weld body1="link"/><flex flex="f"/></equality><tendon><spatial/></tendon>'
        '<keyframe><key act="1"/></keyframe><contact><exclude body1="a" body2="b"/></contact>',
    ).replace('axis="0 1 0"', 'axis="0 1 0" stiffness="3 1" springref="0.1"')
    text = text.replace("<worldbody>", '<option viscosity="1"/><worldbody>').replace(
        '<body name="link"', '<body name="link" gravcomp="1"'
    )
    notes = "\n".join(map(str, dynx.load(text).notes))
    for word in ("<sensor>", "<equality>", "<tendon>", "<contact>"):
        assert f"not read: 1 element of {word}" in notes
    assert "1 element of <equality>: model.equalities has them as data" in notes
    assert "not read of <keyframe>: act" in notes
    assert "1 element of <actuator>: model.actuators has them as data" in notes
    for word in ("stiffness of joint 'hinge' is a polynomial", "viscosity", "gravcomp", "polynomial"):
        assert word in notes


def test_what_is_not_read_of_several_bodies_is_one_note() -> None:
    bodies = "".join(f'<body name="b{k}" gravcomp="1"/>' for k in range(4))
    (note,) = (each for each in dynx.load(ARM.replace("</body>", f"{bodies}</body>")).notes if each.line == 7)
    for word in ("gravcomp", "'b0'", "3 other bodies"):
        assert word in note.message


def test_robots_without_a_name_are_named_by_their_number() -> None:
    bodies = '<body><freejoint/><geom size="1"/><body/></body>' * 7
    with pytest.raises(UnsupportedFeatureError, match=r"'body_1', 'body_3', .* and 2 more"):
        dynx.load(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")


def test_files_outside_of_the_folder_are_read_from_package_dirs(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (tmp_path / "part.xml").write_text("<mujocoinclude><body name='more'/></mujocoinclude>")
    path = folder / "r.xml"
    path.write_text(ARM.replace("</worldbody>", '<include file="../part.xml"/></worldbody>'))
    with pytest.raises(DescriptionError, match="package_dirs="):
        dynx.load(path)
    assert "more" in [link.name for link in dynx.load(path, package_dirs=[tmp_path]).links]
    with pytest.raises(DescriptionError, match="outside"):
        dynx.load(path, package_dirs=[folder])


def test_names_that_are_made_up_keep_clear_of_those_of_the_file() -> None:
    two = '<joint name="a"/><joint name="b" axis="1 0 0"/>'
    below = '<body name="a_link"><geom size="0.1"/></body><body name="tip"><joint name="tip_fixed"/></body>'
    text = ARM.replace('<joint name="hinge" axis="0 1 0"/>', two).replace("</body>", f"{below}</body>")
    model = dynx.load(text)
    assert model.joint("a").child == "a_link_2"
    assert model.joint_names == ("a", "b", "tip_fixed")


def test_a_urdf_file_may_have_an_element_of_mujoco() -> None:
    model = dynx.load('<robot name="r"><mujoco><compiler/></mujoco><link name="base"/></robot>')
    assert model.root == "base"


def test_the_urdf_of_a_model_from_mjcf_is_the_same_robot() -> None:
    model = dynx.load(ARM.replace('axis="0 1 0"', 'axis="0 1 0" pos="0.1 0 0" ref="0.2" damping="0.5"'))
    again = dynx.load(model.to_urdf())
    q, v, a = np.array([0.3]), np.array([0.5]), np.array([-0.7])
    want = dynx.backend("reference", model).inverse_dynamics(q, v, a)
    require_close(dynx.backend("reference", again).inverse_dynamics(q, v, a), want)
    assert again.joint_names == model.joint_names
