"""Written models are read back equal, by dynx and by other readers."""

from __future__ import annotations

import math
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import DescriptionError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.library import robots
from dynx.model.loading import load
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.testing.strategies import models

LOADABLE = [entry.name for entry in robots() if entry.name != "ur_description_ur3"]


def read_back(model: Model) -> Model:
    return load(model.to_urdf())


@given(models(physical=False))
def test_a_random_model_is_read_back_equal(model: Model) -> None:
    assert read_back(model) == model
    assert read_back(model).to_urdf() == model.to_urdf()


@pytest.mark.parametrize("name", LOADABLE)
def test_a_robot_of_the_library_is_read_back_equal(name: str) -> None:
    model = load(name)
    assert read_back(model) == model


@pytest.mark.parametrize("name", ["ur5", "panda", "talos"])
def test_a_robot_with_half_its_joints_locked_is_read_back_equal(name: str) -> None:
    model = load(name)
    locked = load(name, lock={joint: 0.1 + 0.01 * k for k, joint in enumerate(model.joint_names[::2])})
    assert locked.nq == model.nq // 2
    back = read_back(locked)
    assert back == locked
    assert [joint.locked_at for joint in back.joints] == [joint.locked_at for joint in locked.joints]


odd_floats = st.one_of(
    st.sampled_from((-0.0, 5e-324, 2.2250738585072014e-308, 0.1, 1 / 3, -1e22, 0.99 * MAX_MAGNITUDE)),
    st.floats(-0.99 * MAX_MAGNITUDE, 0.99 * MAX_MAGNITUDE),
)
names = st.text(
    st.characters(exclude_categories=("Cc", "Cs", "Zl", "Zp"), exclude_characters="\ufffe\uffff"),
    min_size=1,
    max_size=40,
)


@given(st.lists(names, min_size=5, max_size=5, unique=True), st.lists(odd_floats, min_size=16, max_size=16))
def test_any_name_and_any_number_are_preserved(words: list[str], numbers: list[float]) -> None:
    robot, a, b, first, second = words
    n = iter(numbers)
    inertial = Inertial(abs(next(n)), Pose((next(n), next(n), next(n))), next(n), next(n), next(n))
    dynamics = JointDynamics(next(n), next(n), next(n))
    limits = Limits(next(n), next(n), next(n), next(n))
    joints = [
        Joint(first, "prismatic", a, b, Pose(), (0.0, 1.0, 0.0), limits, dynamics),
        Joint(second, "continuous", b, "end", mimic=Mimic(first, next(n), next(n))),
    ]
    model = Model.build(robot, [Link(a, inertial), Link(b), Link("end")], joints)
    assert read_back(model) == model


def test_limits_of_infinity_are_written_as_a_number_that_every_engine_reads() -> None:
    joint = Joint("j", "revolute", "a", "b", limits=Limits(-math.inf, 2.0, math.inf, math.inf))
    model = Model.build("r", [Link("a"), Link("b")], [joint])
    assert "inf" not in model.to_urdf()
    assert read_back(model) == model


def test_a_number_that_is_nan_is_refused() -> None:
    joint = Joint("j", "revolute", "a", "b", limits=Limits(-1.0, 2.0, 1.0, 1.0))
    model = Model.build("r", [Link("a"), Link("b")], [joint])
    # Bypasses the checks of the model.
    object.__setattr__(model.joints[0].limits, "upper", math.nan)
    with pytest.raises(DescriptionError, match="NaN"):
        model.to_urdf()


def test_frames_that_were_added_stay_frames_and_are_links_to_others() -> None:
    model = load("ur5").with_frame("tip", "tool0", Pose((0.0, 0.0, 0.1))).with_frame("tip_frame", "tool0")
    assert read_back(model) == model
    root = ElementTree.fromstring(model.to_urdf())
    assert model.geometry.links.keys() == read_back(model).geometry.links.keys()
    links = [element.get("name") for element in root.iter("link")]
    joints = [element.get("name") for element in root.iter("joint")]
    assert {"tip", "tip_frame"} <= set(links)
    assert len(links) == len(set(links)) == len(joints) + 1 == len(set(joints)) + 1


POSE = Pose((1.0, -2.0, 0.5), (0.3, -0.2, 2.0))


@pytest.mark.parametrize(
    "model",
    [
        load("ur5", gravity=(0.1, -0.2, -1.62)),
        load("ur5", base="floating"),
        load("ur5", base="floating", gravity=(0.0, 0.0, 0.0)),
        load("ur5", base_pose=POSE),
        load("ur5", base_pose=POSE, gravity=(1.0, 2.0, 3.0)),
    ],
)
def test_gravity_and_the_base_are_read_back_and_arguments_replace_them(model: Model) -> None:
    assert read_back(model) == model
    text = model.to_urdf()
    assert load(text, gravity=(0.0, 0.0, -9.81)).gravity == (0.0, 0.0, -9.81)
    assert load(text, base="fixed").base == "fixed"
    assert load(text, base="floating").base_pose == Pose()


def test_only_what_differs_from_the_defaults_is_written() -> None:
    assert "dynx_robot" not in load("ur5").to_urdf()


@pytest.mark.parametrize(
    ("setting", "message"),
    [('base="free"', "base of <dynx_robot>"), ('gravity="0 0"', "gravity"), ('gravity="0 0 x"', "gravity")],
)
def test_faulty_settings_of_the_extension_are_refused_with_their_line(setting: str, message: str) -> None:
    text = f'<robot name="r">\n  <dynx_robot {setting}/>\n  <link name="a"/>\n</robot>'
    with pytest.raises(DescriptionError, match=message) as raised:
        load(text)
    assert raised.value.line == 2


INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'


def test_a_frame_may_state_that_it_has_no_mass() -> None:
    model = load("ur5").with_frame("tip", "tool0")
    zeros = INERTIAL.replace('"1"', '"0"')
    assert load(model.to_urdf().replace('<link name="tip"/>', f'<link name="tip">{zeros}</link>')) == model


@pytest.mark.parametrize("content", [INERTIAL, "<visual/>", "<collision/>"])
def test_a_frame_with_mass_or_shapes_is_refused(content: str) -> None:
    text = load("ur5").with_frame("tip", "tool0").to_urdf()
    line = text.split("\n").index('  <link name="tip"/>') + 1
    text = text.replace('<link name="tip"/>', f'<link name="tip">{content}</link>')
    with pytest.raises(DescriptionError, match=rf":{line}: .*'tip' has <\w+>.*frame"):
        load(text)


@pytest.mark.parametrize("bad", ["", "a\nb", "\x00", "\ud800", "x" * 1001, "\uffff"])
def test_a_name_that_urdf_cannot_express_raises(bad: str) -> None:
    model = Model.build("r", [Link("a")], [])
    with pytest.raises(DescriptionError, match="a name that URDF cannot express"):
        Model.build("r", [Link(bad)], []).to_urdf()
    with pytest.raises(DescriptionError, match="a name that URDF cannot express"):
        replace(model, name=bad).to_urdf()


def test_no_line_is_longer_than_pybullet_reads() -> None:
    long = "&" * 1000
    joint = Joint("j" + long[1:], "revolute", long, "b", limits=Limits(-1 / 3, 1 / 3, 1 / 3, 1 / 3))
    text = Model.build(long, [Link(long), Link("b")], [joint]).to_urdf()
    assert max(map(len, text.splitlines())) < 8191


def test_what_means_nothing_of_a_fixed_joint_is_not_kept() -> None:
    """Otherwise a model would differ from its own file, which cannot have it."""
    model = load("panda")
    joints = tuple(
        replace(
            joint,
            dynamics=JointDynamics(damping=0.1, friction=0.2, armature=0.3),
            axis=(0.0, 1.0, 0.0) if joint.type == "fixed" else joint.axis,
            limits=Limits(-1.0, 1.0, 2.0, 3.0) if joint.type == "fixed" else joint.limits,
        )
        for joint in model.joints
    )
    changed = replace(model, joints=joints)
    assert any(joint.type == "fixed" for joint in joints)
    assert read_back(changed) == changed
    assert [joint for joint in changed.joints if joint.type == "fixed"] == [
        joint for joint in model.joints if joint.type == "fixed"
    ]
    locked = load("panda", lock={"panda_joint3": 0.5})
    (kept,) = (joint for joint in locked.joints if joint.locked_at is not None)
    assert kept.limits == next(joint for joint in model.joints if joint.name == kept.name).limits
