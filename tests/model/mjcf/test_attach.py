"""Models that are attached: MuJoCo compiles the same robot, and what cannot be attached is an error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings

import dynx
from dynx.engines.silence import silence
from dynx.errors import DescriptionError, UnsupportedFeatureError
from dynx.model.geometry import Mesh
from dynx.model.mjcf.extension import PREFIX
from dynx.world import read_scene
from tests.model.mjcf.models import compute, models

mujoco = pytest.importorskip("mujoco")

EXACT = 1e-12
"""Largest difference from MuJoCo, relative to the largest entry: both compute in double precision."""

CHILD = """<mujoco model="child">
  <compiler angle="radian" eulerseq="zyx" meshdir="parts"/>
  <option gravity="0 0 -1"/>
  <default><geom density="300"/>
    <default class="d"><joint damping="0.5" range="-1 1"/><geom density="700"/></default>
  </default>
  <asset><material name="m" rgba="1 0 0 1"/><mesh file="t.obj" scale="0.5 0.5 0.5"/></asset>
  <worldbody>
    <frame name="f" pos="0 0 3" euler="0.1 0.2 0.3" childclass="d">
      <body name="arm" pos="0.1 0 1" euler="0.3 0.2 0.1">
        <joint name="a" axis="0 1 0"/>
        <geom size="0.1" material="m"/>
        <body name="hand" pos="0.5 0 0" childclass="d">
          <joint name="h" axis="0 0 1" ref="0.3"/>
          <geom size="0.1 0.2 0.3" type="ellipsoid" euler="1 2 3"/>
          <site name="tip" pos="0 0 1"/>
          <body pos="0 0 0.3"><joint name="k" range="-2 2"/><geom size="0.1" pos="0.2 0 0"/></body>
        </body>
      </body>
    </frame>
  </worldbody>
  <contact><exclude body1="arm" body2="hand"/></contact>
  <equality><joint joint1="a" joint2="h"/></equality>
  <actuator><motor name="m1" joint="a"/><motor joint="h"/></actuator>
</mujoco>"""

PARENT = """<mujoco model="parent">
  <compiler angle="degree"/>
  <default><geom density="100"/><joint armature="0.2"/></default>
  <asset><model name="c" file="child.xml"/></asset>
  <worldbody>
    <body name="base" pos="0 0 1">
      <joint name="j" axis="0 0 1" range="-90 90"/><geom size="0.1"/>
      CONTENT
    </body>
  </worldbody>
</mujoco>"""

CONTENTS = {
    "a body": '<attach model="c" body="arm" prefix="p_"/>',
    "in a frame": '<frame pos="1 0 0" euler="0 90 0"><attach model="c" body="arm" prefix="p_"/></frame>',
    "a frame": '<attach model="c" frame="f" prefix="p_"/>',
    "everything": '<attach model="c" prefix="p_"/>',
    "twice": '<attach model="c" body="hand" prefix="p_"/><attach model="c" body="hand" prefix="q_"/>',
    "a copy of a copy": '<attach model="c" body="hand" prefix="p_"/>'
    '<frame pos="0 1 0"><attach body="p_hand" prefix="q_"/></frame>',
    "replicated": '<replicate count="3" offset="0 1 0"><attach model="c" body="arm" prefix="p_"/>'
    "</replicate>",
    "of the same model": '<frame name="g" pos="0 0 1"><body name="x"><joint name="y"/>'
    '<geom size="0.2"/></body></frame><frame euler="90 0 0"><attach frame="g" prefix="again_"/></frame>',
}


def write(folder: Path, content: str, child: str = CHILD) -> Path:
    """Write a model that attaches another one, and return its path."""
    (folder / "package.xml").write_text("<package/>")
    (folder / "parts").mkdir(exist_ok=True)
    (folder / "parts" / "t.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (folder / "child.xml").write_text(child)
    path = folder / "parent.xml"
    path.write_text(PARENT.replace("CONTENT", content))
    return path


def require_same(path: Path, *, free: bool = False) -> dynx.Model:
    """Compare a robot with the one that MuJoCo compiles."""
    with silence():
        model, compiled = dynx.load(path), mujoco.MjModel.from_xml_path(str(path))
    want = compute(mujoco, compiled, 0, free=free)
    engine = dynx.backend("reference", model)
    pairs = [
        (engine.mass_matrix(want.q), want.mass_matrix),
        (engine.inverse_dynamics(want.q, want.v, want.a), want.torques),
    ]
    poses = dict(zip(model.frame_names, engine.forward_kinematics(want.q), strict=True))
    pairs += [(poses[name], pose) for name, pose in (want.bodies | want.sites).items() if name]
    for got, wanted in pairs:
        np.testing.assert_allclose(got, wanted, rtol=0.0, atol=EXACT * (np.abs(wanted).max(initial=1.0)))
    joints = [joint for joint in model.joints if joint.moves]
    rates = [each.dynamics for each in joints for _ in range(each.n_rates)]
    np.testing.assert_array_equal([each.damping for each in rates], compiled.dof_damping)
    np.testing.assert_array_equal([each.armature for each in rates], compiled.dof_armature)
    for k, each in enumerate(joints):
        if compiled.jnt_limited[k]:
            np.testing.assert_allclose((each.limits.lower, each.limits.upper), compiled.jnt_range[k])
    return model


@pytest.mark.parametrize("content", CONTENTS.values(), ids=CONTENTS)
def test_the_robot_is_the_one_of_mujoco(tmp_path: Path, content: str) -> None:
    require_same(write(tmp_path, content))


@given(models())
@settings(max_examples=15)
def test_random_models_are_attached(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    folder = tmp_path_factory.mktemp("attach")
    if "freejoint" in text or 'type="free"' in text:
        return
    # The texts of a random model stand in its own units, under its own classes.
    (folder / "child.xml").write_text(text)
    try:
        mujoco.MjModel.from_xml_string(text)
    except ValueError:
        return
    path = folder / "parent.xml"
    attach = '<frame euler="0 0 30"><attach model="c" prefix="p_"/></frame>'
    asset = '<asset><model name="c" file="child.xml"/></asset>'
    path.write_text(f"<mujoco>{asset}<worldbody>{attach}</worldbody></mujoco>")
    require_same(path)


def test_materials_meshes_and_what_is_not_read(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        '<attach model="c" body="hand" prefix="p_"/>',
        CHILD.replace(
            '<geom size="0.1" pos="0.2 0 0"/>', '<geom type="mesh" mesh="t" mass="1" material="m"/>'
        ).replace("</mujoco>", '<keyframe><key name="home"/></keyframe></mujoco>'),
    )
    model = dynx.load(path)
    (visual,) = model.geometry.visuals("body_3")
    assert visual.material is not None
    assert visual.material.rgba == (1.0, 0.0, 0.0, 1.0)
    (shape,) = model.geometry.collisions("body_3")
    assert isinstance(shape.shape, Mesh)
    assert shape.shape.triangles[0].max() == 0.5
    notes = [note.message for note in model.notes]
    assert any("<option> of the attached model 'c'" in note for note in notes)
    assert any("<keyframe> of the attached model 'c'" in note for note in notes)
    # One motor of the child acts on a joint that came along.
    assert any("1 element of <actuator>" in note for note in notes)


def test_exclusions_come_along_for_each_copy(tmp_path: Path) -> None:
    free = CHILD.replace('<joint name="a" axis="0 1 0"/>', "<freejoint/>").replace(
        '<equality><joint joint1="a" joint2="h"/></equality>', ""
    )
    free = free.replace('<motor name="m1" joint="a"/>', "")
    path = write(tmp_path, "", free)
    text = path.read_text().replace(
        "<worldbody>",
        '<worldbody><replicate count="2" offset="0 3 0"><frame pos="0 0 9">'
        '<attach model="c" body="arm" prefix="p_"/></frame></replicate>',
    )
    path.write_text(text)
    scene, compiled = read_scene(path), mujoco.MjModel.from_xml_path(str(path))
    assert compiled.nexclude == 2
    assert [robot.name for robot in scene.robots] == ["p_arm0", "p_arm1", "base"]
    for k in range(2):
        assert not scene.may_collide(f"p_arm{k}/p_arm{k}", f"p_arm{k}/p_hand{k}")


def test_what_dynx_states_of_a_robot_comes_along(tmp_path: Path) -> None:
    written = dynx.load("six_axis_arm").to_mjcf()
    assert PREFIX in written
    path = write(tmp_path, '<attach model="c" prefix="p_"/>', written)
    attached = {joint.name: joint for joint in dynx.load(path).joints}
    for joint in dynx.load(written).joints:
        assert attached[f"p_{joint.name}"].limits == joint.limits


@pytest.mark.parametrize(
    ("content", "line", "named"),
    [
        ('<attach model="d" body="arm" prefix="p_"/>', 8, "names the model 'd'"),
        ('<attach model="c" body="harm" prefix="p_"/>', 8, "has no body 'harm'"),
        ('<attach model="c" body="arm" frame="f" prefix="p_"/>', 8, "wanted one of them"),
        ('<attach model="c" body="arm"/>', 8, "prefix"),
        ('<attach prefix="p_"/>', 8, "no body and no frame"),
        ('<attach body="later" prefix="p_"/><body name="later"/>', 8, "no body 'later' stands before"),
        ('<attach model="c" bdy="arm" prefix="p_"/>', 8, "did you mean 'body'"),
    ],
)
def test_what_cannot_be_attached_is_an_error_with_its_line(
    tmp_path: Path, content: str, line: int, named: str
) -> None:
    with pytest.raises(DescriptionError, match=named) as caught:
        dynx.load(write(tmp_path, content))
    assert caught.value.line == line
    with pytest.raises(ValueError, match=r".+"):
        mujoco.MjModel.from_xml_path(str(tmp_path / "parent.xml"))


def test_a_body_that_attaches_itself_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnsupportedFeatureError, match=":8: body 'base' attaches itself"):
        dynx.load(write(tmp_path, '<attach body="base" prefix="p_"/>'))


def test_models_that_attach_one_another_and_files_outside_are_errors(tmp_path: Path) -> None:
    attach = '<attach model="c" body="arm" prefix="p_"/>'
    path = write(tmp_path, attach)
    circle = CHILD.replace("<asset>", '<asset><model name="up" file="parent.xml"/>')
    circle = circle.replace('<geom size="0.1" material="m"/>', '<attach model="up" body="base" prefix="x_"/>')
    write(tmp_path, attach, circle)
    with pytest.raises(DescriptionError, match=r"child\.xml:7: the model 'parent\.xml' attaches itself"):
        dynx.load(path)
    for file in ("../child.xml", "/etc/passwd", "none.xml"):
        path.write_text(PARENT.replace("CONTENT", attach).replace("child.xml", file))
        with pytest.raises(DescriptionError, match="is not read"):
            dynx.load(path)
    path.write_text(PARENT.replace("CONTENT", attach))
    (tmp_path / "child.xml").write_text("<robot/>")
    with pytest.raises(DescriptionError, match="no model in MJCF"):
        dynx.load(path)


def test_the_number_of_copies_is_bounded(tmp_path: Path) -> None:
    # Each body holds two copies of the one before it.
    bodies = '<body name="b0"><geom size="0.1"/></body>'
    for k in range(1, 40):
        bodies += f'<body name="b{k}">' + "".join(
            f'<attach body="b{k - 1}" prefix="{side}{k}_"/>' for side in "lr"
        )
        bodies += "</body>"
    with pytest.raises(DescriptionError, match="makes more than"):
        dynx.load(write(tmp_path, bodies))
