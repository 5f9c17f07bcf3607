"""Keyframes of MJCF are named configurations: MuJoCo places every body alike, and writing keeps them."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, DescriptionError, ShapeError, UnknownNameError
from dynx.model import Joint, Link, Model, NamedConfiguration
from dynx.model.conversion import convert, robot_differences
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.model.mjcf.models import models as documents

ROUNDING = 1e-13
"""Largest difference by rounding of a pose, relative to the largest entry; each has a few roundings."""

CRANE = """<mujoco model="crane">
  <worldbody>
    <body name="base" pos="0 0 1" quat="1 1 0 0">BASE<geom size="0.1"/>
      <body name="arm"><joint name="turn" ref="30"/><geom size="0.1" pos="1 0 0"/>
        <body name="hand" pos="2 0 0"><joint name="wrist" type="ball"/><geom size="0.1" pos="0.3 0 0"/>
          <body name="finger"><joint name="slide" type="slide" ref="0.25"/><geom size="0.1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <keyframe>KEYS</keyframe>
</mujoco>"""


def crane(keys: str, base: str = "") -> str:
    return CRANE.replace("KEYS", keys).replace("BASE", base)


def require_same_poses(mujoco: Any, compiled: Any, model: Model) -> None:
    """Compare the poses of all bodies at every keyframe with those of MuJoCo, which knows nothing of dynx."""
    engine, data = dynx.backend("reference", model), mujoco.MjData(compiled)
    names = [compiled.key(k).name or f"keyframe_{k}" for k in range(compiled.nkey)]
    assert list(model.configurations) == names
    for k, name in enumerate(names):
        mujoco.mj_resetDataKeyframe(compiled, data, k)
        mujoco.mj_kinematics(compiled, data)
        poses = dict(
            zip(model.frame_names, engine.forward_kinematics(model.configurations[name]), strict=True)
        )
        for body in range(1, compiled.nbody):
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
            size = max(1.0, np.abs(T).max())
            assert np.abs(poses[compiled.body(body).name] - T).max() <= ROUNDING * size


@given(documents(), st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_mujoco_places_the_bodies_of_random_robots_alike(text: str, seed: int, count: int) -> None:
    mujoco = pytest.importorskip("mujoco")
    nq = mujoco.MjModel.from_xml_string(text).nq
    rng = np.random.default_rng(seed)
    keys = "".join(
        f'<key name="k{k}" qpos="{" ".join(map(repr, rng.uniform(-2.0, 2.0, nq).tolist()))}"/>'
        for k in range(count)
    )
    text = text.replace("</mujoco>", f"<keyframe>{keys}<key/></keyframe></mujoco>")
    require_same_poses(mujoco, mujoco.MjModel.from_xml_string(text), dynx.load(text))


@pytest.mark.parametrize("base", ["", "<freejoint/>", '<joint name="lift" type="slide"/>'])
@pytest.mark.parametrize(
    ("key", "short"),
    [
        ("", False),
        ('qpos=""', False),
        ('qpos="0.5"', True),
        ('qpos="0.1 0.2 0.3 0.4 0.5"', True),
        ('qpos="0.1 0 0 0 0"', True),
        ('qvel="1"', True),
    ],
)
def test_few_numbers_and_zero_quaternions_mean_what_they_mean_to_mujoco(
    base: str, key: str, short: bool
) -> None:
    mujoco = pytest.importorskip("mujoco")
    text = crane(f'<key name="k" {key}/>', base)
    model = dynx.load(text)
    require_same_poses(mujoco, mujoco.MjModel.from_xml_string(text), model)
    assert any("the pose of the file" in note.message for note in model.notes) == short


def test_the_numbers_are_in_the_conventions_of_dynx() -> None:
    keys = '<key name="home" qpos="0.5 0 0 3 0 0.125"/><key/><key name="keyframe_2"/>'
    model = dynx.load(crane(keys))
    assert list(model.configurations) == ["home", "keyframe_1", "keyframe_2"]
    assert model.configurations["home"].tolist() == [0.5, 0.0, 1.0, 0.0, 0.0, 0.125]
    start = model.configurations["keyframe_1"].tolist()
    assert start == [math.radians(30.0), 0.0, 0.0, 0.0, 1.0, 0.25]
    assert not model.configurations["home"].flags.writeable
    assert pickle.loads(pickle.dumps(model)).configurations["home"].tolist()[0] == 0.5
    assert not any("keyframe" in note.message for note in model.notes)


def test_more_numbers_and_unknown_parts_are_refused_with_their_line() -> None:
    mujoco = pytest.importorskip("mujoco")
    for keys, message in (
        ('<key name="k" qpos="1 2 3 4 5 6 7"/>', "qpos in <key> of keyframe 'k'"),
        ('<key name="k" qvel="1 2 3 4 5 6"/>', "qvel in <key> of keyframe 'k'"),
        ('<key name="k"/><key name="k"/>', "two keyframes have the name 'k'"),
        ('<pose name="k"/>', "wanted <key>"),
        ('<key name="k" qpso="1"/>', "qpos"),
        ('<key name="k" qpos="1 2 x"/>', "qpos"),
    ):
        with pytest.raises(ValueError, match=r"XML|keyframe|Schema"):
            mujoco.MjModel.from_xml_string(crane(keys))
        with pytest.raises(DescriptionError, match=message) as caught:
            dynx.load(crane(keys))
        assert caught.value.line == 11


def test_what_a_keyframe_states_besides_positions_is_one_note() -> None:
    (note,) = dynx.load(crane('<key name="a" time="1"/><key qvel="0 0 0 0 1" ctrl=""/>')).notes
    assert "not read of <keyframe>: time, qvel, ctrl" in note.message


def test_keyframes_of_an_aligned_free_body_are_not_read() -> None:
    body = '<body name="b"><freejoint align="true"/><geom size="0.1" pos="1 0 0"/></body>'
    text = f'<mujoco><worldbody>{body}</worldbody><keyframe><key name="k"/></keyframe></mujoco>'
    model = dynx.load(text)
    assert dict(model.configurations) == {}
    assert any(
        "1 element of <keyframe>, which state the pose of the principal axes" in str(n) for n in model.notes
    )


def test_locked_joints_leave_the_configurations() -> None:
    model = dynx.load(crane('<key name="k" qpos="0.5 1 0 0 0 0.125"/>'), lock={"turn": 1.0})
    assert model.configurations["k"].tolist() == [0.0, 0.0, 0.0, 1.0, 0.125]
    again = dynx.load(dynx.load(crane('<key name="k" qpos="0.5 1 0 0 0 0.125"/>')), lock={"slide": 0.0})
    assert again.configurations["k"].tolist() == [0.5, 0.0, 0.0, 0.0, 1.0]
    free = dynx.load(crane('<key name="k" qpos="1 2 3 1 0 0 0 0.5"/>', "<freejoint/>"))
    assert free.configurations["k"][:8].tolist() == [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0, 0.5]
    assert free.with_base("fixed").configurations["k"][0] == 0.5


def configurations(model: Model) -> st.SearchStrategy[list[Floats]]:
    return st.lists(st.integers(0, 2**32 - 1).map(lambda seed: model.random(seed)), max_size=3)


@given(models(), st.data())
def test_writing_keeps_the_configurations(model: Model, data: st.DataObject) -> None:
    given_ = data.draw(configurations(model))
    for k, q in enumerate(given_):
        model = model.with_configuration(f"q{k}", q)
    back = dynx.load(model.to_mjcf())
    assert list(back.configurations) == [f"q{k}" for k in range(len(given_))]
    for k, q in enumerate(given_):
        assert np.abs(back.configurations[f"q{k}"] - q).max(initial=0.0) <= 4.0 * np.finfo(float).eps
    assert convert(model, "mjcf").differences == ()


@given(
    models(mimics=True, solvable=True, joint_types=["revolute", "prismatic", "continuous"]),
    st.integers(0, 999),
)
def test_mujoco_places_the_bodies_of_what_is_written_alike(model: Model, seed: int) -> None:
    mujoco = pytest.importorskip("mujoco")
    assume(model.root != "world")
    model = model.with_configuration("k", model.random(seed))
    require_same_poses(mujoco, mujoco.MjModel.from_xml_string(model.to_mjcf()), model)


def test_a_configuration_that_differs_is_found() -> None:
    model = dynx.load(crane('<key name="k" qpos="0.5"/>'))
    other = dynx.load(crane('<key name="k" qpos="0.6"/><key name="l"/>'))
    assert list(robot_differences(model, other)) == [
        "configuration 'l' is added",
        "configuration 'k' differs",
    ]


@pytest.mark.parametrize("format", ["urdf", "sdf"])
def test_formats_without_configurations_have_a_note(format: Any) -> None:
    links = [Link("a"), Link("b")]
    model = Model.build("r", links, [Joint("j", "revolute", "a", "b")]).with_configuration("home", [0.5])
    assert dynx.load(model.to_urdf()).stated_configurations is None
    assert any(
        "no named configurations" in note and "'home'" in note for note in convert(model, format).notes
    )


def test_programs_name_configurations() -> None:
    model = Model.build("r", [Link("a"), Link("b")], [Joint("j", "revolute", "a", "b")])
    named = model.with_configuration("home", [0.5])
    assert named == model  # as models that differ in shapes alone
    assert named.configurations["home"].tolist() == [0.5]
    with pytest.raises(ArgumentError, match="exists already"):
        named.with_configuration("home", [0.5])
    with pytest.raises(ArgumentError, match="not empty"):
        model.with_configuration("", [0.5])
    with pytest.raises(ShapeError, match="one configuration"):
        model.with_configuration("home", [[0.5]])
    with pytest.raises(UnknownNameError, match="'hom' of r; did you mean 'home'"):
        named.configurations["hom"]
    with pytest.raises(UnknownNameError, match="its description has none"):
        model.configurations["home"]
    assert named.configurations.get("hom") is None
    unknown = replace(model, stated_configurations=(NamedConfiguration("k", (("x", (0.0,)),)),))
    with pytest.raises(UnknownNameError, match="no joint 'x'"):
        unknown.configurations["k"]


def test_keyframes_of_files_around_an_included_one(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(crane('<key name="inside" qpos="0.5"/>'))
    path = tmp_path / "scene.xml"
    path.write_text('<mujoco><include file="robot.xml"/><keyframe><key name="k"/></keyframe></mujoco>')
    assert list(dynx.load(path).configurations) == ["inside", "k"]


def test_names_of_configurations_stand_for_q() -> None:
    text = """<mujoco>
      <worldbody><body name="b"><joint name="j"/><geom size="0.1" pos="1 0 0"/></body></worldbody>
      <keyframe><key name="home" qpos="0.5"/></keyframe></mujoco>"""
    model = dynx.load(text)
    for name in ("reference", "compiled"):
        engine = dynx.backend(name, model)
        assert np.array_equal(engine.forward_kinematics("home"), engine.forward_kinematics([0.5]))
        with pytest.raises(UnknownNameError, match="did you mean 'home'"):
            engine.gravity_torque("hom")
    assert dynx.simulate(model, duration=0.01, q0="home").q[0] == 0.5
    assert model.integrate("home", [0.25]) == 0.75
    with pytest.raises(AttributeError, match=r"Model\.configurations"):
        model.keyframes  # type: ignore[attr-defined]  # noqa: B018
    with pytest.raises(UnknownNameError, match="its description has none"):
        dynx.backend("reference", dynx.load("planar_2r")).gravity_torque("home")
