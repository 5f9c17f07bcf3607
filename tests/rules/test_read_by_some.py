"""Elements, attributes and names that some engines read and others skip or refuse: DX218 to DX221, DX418 to
DX420, DX530, DX531, DX533."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import Examiner
from dynx.errors import DescriptionError
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.spatial.so3 import rotation_from_quat
from tests.rules.documents import LIMIT, case_of, joint, link
from tests.rules.trap_cases import assert_same_robot, changed_lines, mended, only, trap

numbers = st.floats(-1.0, 1.0)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: math.hypot(*q) > 1e-3)


def arm(*inside: str, type: str = "revolute", head: str = "") -> Case:
    """Return two links and a joint with these elements; `head` are attributes of the robot."""
    case = case_of(link("base"), link("arm"), joint("elbow", "base", "arm", *inside, type=type, limit=LIMIT))
    text = case.source.text.replace("<robot ", f"<robot {head} ")
    # An axis among the elements takes the place of the usual one.
    return Case(XmlSource(text.replace('<axis xyz="0 0 1"/>', "", 1) if "<axis" in "".join(inside) else text))


def found(rule: str, case: Case) -> list[str]:
    """Messages of a rule."""
    return [each.message for each in find_rule(rule).detect(case)]


# -- axes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("type", ["revolute", "continuous", "prismatic", "fixed", "floating"])
@pytest.mark.parametrize("name", ["xzy", "XYZ", "zyx", "rpy", "direction"])
def test_a_misspelled_attribute_wins_over_an_axis_without_numbers(name: str, type: str) -> None:
    case = arm(f'<axis {name}="0 0 1"/>', type=type)
    assert found("DX218", case) == [f"<axis> has its direction 0 0 1 in {name} instead of xyz"]
    assert found("DX202", case) == found("DX219", case) == []
    assert '<axis xyz="0 0 1"/>' in mended("DX218", case)[1].case.source.text


@pytest.mark.parametrize("type", ["revolute", "fixed"])
@pytest.mark.parametrize("attributes", ["", 'frame="base"', 'rpy="0 0 0"', 'xzy=""', 'xyz="" rpy="0 0 1"'])
def test_an_axis_without_numbers_has_no_misspelled_direction(attributes: str, type: str) -> None:
    case = arm(f"<axis {attributes}/>", type=type)
    assert found("DX218", case) == []
    assert len(found("DX202" if type == "revolute" else "DX219", case)) == 1


def test_the_error_of_a_misspelled_attribute_names_it() -> None:
    case = arm('<axis xzy="0 0 1"/>')
    assert isinstance(case.reading, DescriptionError)
    assert "<axis> of joint 'elbow' has no attribute xyz; it has 'xzy'" in str(case.reading)


@pytest.mark.parametrize("xyz", ["0 0", "0 0 1 0", "0,0,1", "a b c", "0 0 1e999", "0 0 1_0", "0 0 \u0661"])
def test_a_fixed_joint_keeps_no_axis_that_mujoco_cannot_read(xyz: str) -> None:
    case = arm(f'<axis xyz="{xyz}"/>', type="fixed")
    remedy = mended("DX219", case)[1]
    assert "<axis" not in remedy.case.source.text
    assert remedy.case.model == case.model


@pytest.mark.parametrize("xyz", ["0 0 1", " 0\t0 0 ", "0x1 0 0", "1e-400 0 inf", "nan 0 1"])
def test_a_fixed_joint_may_have_any_axis_that_mujoco_reads(xyz: str) -> None:
    assert found("DX219", arm(f'<axis xyz="{xyz}"/>', type="fixed")) == []


@pytest.mark.skipif("mujoco" not in installed_engines(), reason="says what MuJoCo does")
@pytest.mark.parametrize("xyz", ["0 0", "0 0 1 0", "0,0,1", "a b c", "0 0 1e999", "0x1 0 0", "1e-400 0 inf"])
def test_mujoco_reads_the_axis_of_a_fixed_joint(xyz: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    case = arm(f'<axis xyz="{xyz}"/>', type="fixed")
    if found("DX219", case):
        with pytest.raises(ValueError, match="attribute 'xyz'"):
            mujoco.MjModel.from_xml_string(case.source.text)
    else:
        assert mujoco.MjModel.from_xml_string(case.source.text).nv == 0


# -- loops and the world --------------------------------------------------------------------------


@pytest.mark.parametrize("rule", ["DX220", "DX227"])
def test_a_joint_that_is_not_of_urdf_is_removed_or_kept(rule: str) -> None:
    case = trap(rule)
    assert_same_robot(case.model, mended(rule, case)[1].case.model)
    kept = trap(rule, **{rule: "keep"})
    assert find_rule(rule).remedy(kept, find_rule(rule).detect(kept)) is None


def test_the_world_is_declared_once_for_all_joints_on_it() -> None:
    other = joint("mount_2", "world", "table", type="fixed", limit="")
    text = trap("DX221").source.text.replace("</robot>", f"{link('table')}{other}</robot>")
    each, remedy = mended("DX221", Case(XmlSource(text)))
    assert only(each).joint == "mount"
    model = remedy.case.model
    assert (model.root, model.inertial("world")) == ("world", model.inertial("world"))
    assert [joint.parent for joint in model.joints].count("world") == 2


def test_a_declared_world_and_another_parent_that_is_missing_are_no_matter() -> None:
    declared = trap("DX221").source.text.replace("</robot>", '<link name="world"/></robot>')
    assert found("DX221", Case(XmlSource(declared))) == []
    assert found("DX221", Case(XmlSource(declared.replace('"world"', '"map"', 1)))) == []


@pytest.mark.parametrize(
    ("choice", "links"), [("attach", ["base", "arm", "table", "leg"]), ("remove", ["base", "arm"])]
)
def test_trees_beside_the_robot_are_attached_or_removed(choice: str, links: list[str]) -> None:
    text = case_of(
        *(link("table"), link("leg"), link("base"), link("arm"), link("hand")),
        *(joint("elbow", "base", "arm"), joint("wrist", "arm", "hand"), joint("fold", "table", "leg")),
    ).source.text
    case = Case(XmlSource(text), choices={"DX223": choice})
    each, remedy = mended("DX223", case)
    assert only(each).link == "table"
    assert remedy.changes_physics
    assert {each.name for each in remedy.case.model.links} == {*links, "hand"}
    assert remedy.case.model.root == "base"


def test_parts_that_form_no_trees_have_no_second_root() -> None:
    cycle = case_of(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a"), link("c"))
    two_parents = case_of(link("a"), link("b"), link("c"), joint("j", "a", "c"), joint("k", "b", "c"))
    nowhere = case_of(link("a"), link("b"), joint("j", "c", "b"))
    for case in (two_parents, nowhere, case_of(link("a"), link("b"), joint("j", "a", "b"))):
        assert found("DX223", case) == []
    assert find_rule("DX223").detect(cycle) == []


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize("inside", ["", "<geometry/>", "<origin/><geometry><cone/></geometry>"])
def test_shapes_without_geometry_are_removed_or_kept(tag: str, inside: str) -> None:
    case = case_of(link("base", f"<{tag}>{inside}</{tag}>"))
    assert f"<{tag}" not in mended("DX424", case)[1].case.source.text
    kept = Case(case.source, choices={"DX424": "keep"})
    assert find_rule("DX424").remedy(kept, find_rule("DX424").detect(kept)) is None
    plane = case_of(link("base", f"<{tag}><geometry><plane/></geometry></{tag}>"))
    assert found("DX424", plane) == []


@pytest.mark.parametrize(
    "inside",
    [
        '<collision><origin/><origin/><geometry><box size="1 1 1"/></geometry></collision>',
        '<collision><geometry><box size="1 1 1"/><box size="2 1 1"/></geometry></collision>',
    ],
)
def test_elements_of_a_collision_are_not_repeated(inside: str) -> None:
    case = case_of(link("base", inside))
    assert mended("DX411", case)[1].case.model == case.model


def test_a_tensor_without_moments_is_none() -> None:
    text = case_of(link("base")).source.text.replace('iyy="0.01" ', "")
    remedy = mended("DX410", Case(XmlSource(text)))[1]
    inertial = remedy.case.model.inertial("base")
    assert inertial.mass == 1.0
    assert not inertial.tensor.any()


def test_settings_of_mujoco_that_change_nothing_are_left() -> None:
    for harmless in ('<compiler meshdir="m" fusestatic="false"/>', '<option gravity="0 0 -1"/>', ""):
        case = case_of(link("base"), f"<mujoco>{harmless}</mujoco>")
        assert found("DX224", case) == []
    flag = '<option wind="1 0 0"><flag gravity="disable"/></option>'
    case = case_of(link("base"), f"<mujoco>{flag}</mujoco>")
    assert found("DX224", case) == ["<option> of <mujoco> sets wind", "<flag> of <mujoco> sets gravity"]
    assert "<mujoco><option><flag/></option></mujoco>" in mended("DX224", case)[1].case.source.text
    assert '<compiler meshdir="meshes"/>' in mended("DX224", trap("DX224"))[1].case.source.text


# -- quaternions ----------------------------------------------------------------------------------


@given(quaternions)
def test_a_quaternion_becomes_the_angles_that_dynx_reads(quaternion: tuple[float, ...]) -> None:
    words = " ".join(map(repr, quaternion))
    case = arm(f'<origin xyz="1 2 3" quat_xyzw="{words}"/>', head='version="1.2"')
    remedy = mended("DX418", case)[1]
    assert "quat_xyzw" not in remedy.case.source.text
    assert remedy.case.model == case.model
    R = rotation_from_quat(np.array(quaternion) / math.hypot(*quaternion))
    got = remedy.case.model.joint("elbow").origin.matrix[:3, :3]
    assert np.max(np.abs(got - R)) <= 16 * np.finfo(float).eps


@pytest.mark.parametrize(
    ("written", "left"),
    [
        ('rpy="0.1 0 0" quat_xyzw="0 0 0 1"', 'rpy="0.1 0 0"'),
        ('quat_xyzw="0 0 1"', ""),
        ('quat_xyzw="0 0 0 0"', ""),
        ('quat_xyzw=""', ""),
        ('quat_xyzw="0, 0; 0,2"', 'rpy="0 0 0"'),
        ('quat_xyzw="0\t0 0 2"', 'rpy="0 0 0"'),
    ],
)
def test_a_bad_quaternion_is_removed_or_written_as_angles(written: str, left: str) -> None:
    case = arm(f'<origin xyz="1 2 3" {written}/>', head='version="1.2"')
    text = mended("DX419", case)[1].case.source.text
    assert f'<origin xyz="1 2 3" {left}'.rstrip() + "/>" in text
    assert found("DX419", arm(f'<origin xyz="1 2 3" {written}/>')) == []


def test_without_a_version_quaternions_are_practice() -> None:
    case = trap("DX530")
    assert only(list(find_rule("DX530").detect(case))).joint == "elbow"
    assert found("DX418", case) == found("DX419", case) == []
    chosen = mended("DX530", trap("DX530", DX530="rpy"))[1].case
    stated = Case(XmlSource(case.source.text.replace("<robot ", '<robot version="1.1" ')))
    assert_same_robot(stated.model, chosen.model)


def test_a_later_version_is_corrected_to_one_that_has_quaternions() -> None:
    case = arm('<origin quat_xyzw="0 0 1 1"/>', head='version="2.0"')
    remedy = mended("DX416", case)[1]
    assert 'version="1.2"' in remedy.case.source.text
    assert remedy.case.model == case.model


@pytest.mark.skipif("pinocchio" not in installed_engines(), reason="says what Pinocchio does")
@pytest.mark.parametrize("length", [1.0, 1e-3, 7.0])
def test_pinocchio_scales_a_quaternion_to_length_1(length: float) -> None:
    words = " ".join(repr(length * part) for part in (0.1, 0.3, -0.2, 0.9))
    turned = f'<origin xyz="0.1 0.2 0.3" quat_xyzw="{words}"/>'
    case = arm(turned, head='version="1.1"')
    text = case.source.text.replace('<origin xyz="0.0 0.0 0.0"/>', turned)
    text = text.replace('iyy="0.01"', 'iyy="0.015"')
    case = Case(XmlSource(text))
    examiner = Examiner(["pinocchio"], 3, 0)
    assert examiner.examine(case).max_error("pinocchio") <= BAR


@pytest.mark.skipif("pinocchio" not in installed_engines(), reason="says what Pinocchio does")
def test_pinocchio_drops_an_inertial_with_two_orientations() -> None:
    pin = pytest.importorskip("pinocchio")
    inertial = '<origin xyz="0 0 0" rpy="0 0 0" quat_xyzw="0 0 0 1"/>'
    text = arm(head='version="1.2"').source.text.replace('<origin xyz="0.0 0.0 0.0"/>', inertial)
    assert pin.buildModelFromXML(text).inertias[1].mass == 0.0
    zero = text.replace('rpy="0 0 0" quat_xyzw="0 0 0 1"', 'quat_xyzw="0 0 0 0"')
    assert pin.buildModelFromXML(zero).inertias[1].mass == 1.0


# -- names and numbers ----------------------------------------------------------------------------


def test_names_lose_their_blanks_wherever_they_are_mentioned() -> None:
    text = case_of(
        *(link(" "), link("arm "), link("arm"), link(" arm")),
        *(joint("j", " ", "arm "), joint(" k", "arm ", "arm"), joint("l", "arm", " arm")),
    ).source.text.replace('name="robot"', 'name=" "')
    case = Case(XmlSource(text))
    assert found("DX533", case) == [
        "the name of the <robot>, ' ', is blank",
        "the name of the <link>, ' ', is blank",
        "the name of the <link>, 'arm ', begins or ends with a blank",
        "the name of the <link>, ' arm', begins or ends with a blank",
        "the name of the <joint>, ' k', begins or ends with a blank",
    ]
    model = mended("DX533", Case(XmlSource(text), choices={"DX533": "trim"}))[1].case.model
    assert model.name == "robot"
    assert [each.name for each in model.links] == ["link", "arm_2", "arm", "arm_3"]
    assert [(each.name, each.parent, each.child) for each in model.joints] == [
        ("j", "link", "arm_2"),
        ("k", "arm_2", "arm"),
        ("l", "arm", "arm_3"),
    ]


@pytest.mark.parametrize(
    ("written", "left"),
    [
        ('<dynamics damping="" friction="0.1"/>', '<dynamics friction="0.1"/>'),
        ('<calibration rising="" falling="0"/>', '<calibration falling="0"/>'),
        (
            '<limit lower="-1" upper=" " effort="1" velocity="1"/>',
            '<limit lower="-1" effort="1" velocity="1"/>',
        ),
    ],
)
def test_an_empty_number_of_a_joint_is_removed(written: str, left: str) -> None:
    for type in ("continuous", "fixed"):
        assert left in mended("DX420", arm(written, type=type))[1].case.source.text


@pytest.mark.parametrize("mass", ["", "TODO", "inf"])
def test_a_mass_without_number_is_left_or_zero_by_choice(mass: str) -> None:
    case = case_of(link("base", mass=mass, moments=(0.0, 0.0, 0.0)))
    rule = find_rule("DX420")
    assert rule.remedy(case, rule.detect(case)) is None
    guess = replace(case, choices={"DX420": "guess"})
    assert mended("DX420", guess)[1].case.model.inertial("base").mass == 0.0


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ('\n<?xml version="1.0"?>\n<?a b?>\n<robot name="r"><link name="l"/></robot>', []),
        ('<?a b?>\n<robot name="r"><link name="l"/></robot>', []),
        ('\n<!-- c -->\n<?a b?><robot name="r"><link name="l"/></robot>', [3]),
        ('<robot name="r"><link name="l"/>\n<?a?><!-- <?b?> --></robot><?c d?>', [2, 2]),
    ],
)
def test_instructions_behind_anything_but_declarations_are_removed(text: str, lines: list[int]) -> None:
    case = Case(XmlSource(text))
    assert [each.line for each in find_rule("DX423").detect(case)] == lines
    if lines:
        assert mended("DX423", case)[1].case.model == case.model


# -- xacro ----------------------------------------------------------------------------------------


def test_xacro_elements_are_counted_by_tag_and_removed_where_that_is_chosen() -> None:
    case = trap("DX531")
    assert found("DX531", case) == [
        "engines skip <xacro:property>, which xacro did not expand",
        "engines skip <xacro:gripper>, which xacro did not expand",
    ]
    remedy = mended("DX531", trap("DX531", DX531="remove"))[1]
    assert remedy.case.model == case.model
    assert len(changed_lines(case, remedy.case)) == 2
    assert find_rule("DX531").remedy(case, find_rule("DX531").detect(case)) is None


def test_xacro_elements_within_others_are_not_counted() -> None:
    inside = '<xacro:if value="1"><link name="x"/><xacro:x/></xacro:if>'
    case = Case(XmlSource(arm(inside).source.text.replace("</robot>", f"{inside}<xacro:x/></robot>")))
    assert found("DX531", case) == [
        "engines skip <xacro:if> (2 times), which xacro did not expand",
        "engines skip <xacro:x>, which xacro did not expand",
    ]
    assert found("DX531", arm(head='xmlns:xacro="http://www.ros.org/wiki/xacro"')) == []


@pytest.mark.parametrize("engine", installed_engines())
@pytest.mark.parametrize("rule", ["DX530", "DX531", "DX532", "DX533"])
def test_every_engine_reads_what_dynx_reads(rule: str, engine: str) -> None:
    case = trap(rule)
    assert Examiner([engine], 3, 0).examine(case).max_error(engine) <= BAR
