"""Reading descriptions, ambiguous ones included, with a note for each ambiguity."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import DescriptionError, ModelError, UnsupportedFeatureError
from dynx.model import JointDynamics, Limits, Mimic, Model, Pose
from dynx.model.loading import load
from dynx.model.urdf.reader import reads_quaternions
from dynx.model.xml.values import MAX_NAME
from dynx.spatial.so3 import rotation_from_quat
from dynx.testing.strategies import models, unit_vectors, urdf_text
from tests.model.descriptions import INERTIAL, chain, joint, link, robot


def messages(model: Model) -> str:
    return "\n".join(str(note) for note in model.notes)


def test_everything_that_matters_is_read() -> None:
    text = robot(
        f'<link name="a">{INERTIAL}</link><link name="b"/><link name="c"/>'
        '<joint name="one" type="prismatic"><origin xyz="1 2 3" rpy=".1 -.2 3e-1"/><parent link="a"/>'
        '<child link="b"/><axis xyz="0 -1 0"/><limit lower="-1" upper="2" velocity="3" effort="4"/>'
        '<dynamics damping="5" friction="6" armature="7"/></joint>'
        '<joint name="two" type="continuous"><parent link="b"/><child link="c"/>'
        '<mimic joint="one" multiplier="8" offset="9"/></joint>'
    )
    model = load(text)
    inertial = model.inertial("a")
    assert (inertial.mass, inertial.origin) == (2.5, Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    assert (inertial.ixx, inertial.iyy, inertial.izz) == (0.03, 0.04, 0.05)
    assert (inertial.ixy, inertial.ixz, inertial.iyz) == (0.001, 0.002, 0.003)
    one, two = model.joints
    assert (one.type, one.parent, one.child) == ("prismatic", "a", "b")
    assert one.origin == Pose((1.0, 2.0, 3.0), (0.1, -0.2, 0.3))
    assert one.axis == (0.0, -1.0, 0.0)
    assert one.limits == Limits(-1.0, 2.0, 3.0, 4.0)
    assert one.dynamics == JointDynamics(5.0, 6.0, 7.0)
    assert (two.type, two.mimic, two.axis) == ("continuous", Mimic("one", 8.0, 9.0), (1.0, 0.0, 0.0))
    assert model.name == "test"
    assert [note.message for note in model.notes] == [
        "link 'b' has no <inertial>, so no mass, but 'one' moves it",
        "link 'c' has no <inertial>, so no mass, but 'two' moves it",
    ]


LIMIT = '<limit lower="-1" upper="2" velocity="1" effort="1"/>'


def test_the_longest_chain_and_the_longest_mimic_chain_are_read_quickly() -> None:
    start = time.process_time()
    assert load(chain(10_000)).nq == 9_999
    lines = chain(10_000).splitlines()
    following = [
        line.replace("</joint>", f'<mimic joint="j{k + 1}"/></joint>') if k < 9_998 else line
        for k, line in enumerate(lines[10_001:-1])
    ]
    model = load("\n".join([*lines[:10_001], *following, lines[-1]]))
    assert model.joint_names == ("j9998",)
    assert time.process_time() - start < 20.0


def test_a_name_of_the_greatest_length_is_read() -> None:
    name = "x" * MAX_NAME
    assert load(robot(f'<link name="{name}"/>')).root == name


PLAIN = load(joint('<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/>'))
UNTIDY: dict[str, tuple[str, str]] = {
    "undeclared prefixes": ('<drake:x y:z="1"/>', "unknown element <drake:x> in <joint> was ignored"),
    "an unknown element": ("<speed_of_light c='3'/>", "unknown element <speed_of_light>"),
    "left-over xacro": ("<xacro:x/>", "unknown element <xacro:x> in <joint> was ignored; xacro did not"),
    "comments": ("<!-- <axis xyz='1 0 0'/> -->", ""),
    "sensor calibration": ("<calibration rising='0'/><safety_controller k_velocity='1'/>", ""),
    "text between": ("stray text", ""),
    "a second axis": ("<axis xyz='1 0 0'/>", "<joint> has 2 <axis>; the first is used"),
}


@pytest.mark.parametrize("case", UNTIDY)
def test_a_badly_written_joint_is_read_as_meant(case: str) -> None:
    inside, note = UNTIDY[case]
    model = load(joint(f'<origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><axis xyz="0 0 1"/>{inside}'))
    assert model == PLAIN
    extra = set(messages(model).splitlines()) - set(messages(PLAIN).splitlines())
    assert (note in "\n".join(extra)) if note else not extra


@pytest.mark.parametrize(
    "vector",
    [
        "1 2 3",
        " 1  2 3 ",
        "1\t2\t3",
        "1\n 2\r\n3",
        "1&#10;2&#9;3",
        "+1 2. 3.0e0",
        "01 2e+0 .3E1",
        "1\u00a02 3",
    ],
)
def test_numbers_and_white_space_in_any_notation(vector: str) -> None:
    assert load(joint(f'<origin xyz="{vector}"/>')).joints[0].origin.xyz == (1.0, 2.0, 3.0)


@pytest.mark.parametrize("origin", ["", "<origin/>", '<origin xyz="" rpy=" "/>', '<origin xyz="0 0 0"/>'])
def test_an_origin_that_is_absent_or_empty_is_the_identity(origin: str) -> None:
    assert load(joint(origin)).joints[0].origin == Pose()


def test_an_empty_vector_of_an_origin_is_noted() -> None:
    assert "line 5: xyz in <origin> of joint 'j' is empty; it is read as zero" in messages(
        load(joint('<origin xyz=" "/>'))
    )


@pytest.mark.parametrize(
    ("element", "note"),
    [
        ('<xacro:property name="p" value="1"/>', "<xacro:property> in <robot> was ignored; xacro did not"),
        ("<Link/>", "<Link> in <robot> was ignored"),
        ('<loop_joint name="l"/>', "<loop_joint> in <robot> was ignored; the loop that it closes stays open"),
    ],
)
def test_elements_that_engines_skip_are_skipped_with_a_note(element: str, note: str) -> None:
    model = load(robot(f'<link name="a"/>{element}'))
    assert model == load(robot('<link name="a"/>'))
    assert note in messages(model)


def test_elements_of_other_programs_are_skipped() -> None:
    inside = (
        '<link name="a"><visual><geometry><mesh filename="package://gone/x.dae"/></geometry></visual>'
        '<collision/><contact><lateral_friction value="1"/></contact></link>'
        '<transmission><joint name="x"/></transmission><gazebo reference="a"><link name="y"/></gazebo>'
        '<material name="red"/><ros2_control><joint name="z"/></ros2_control>'
        '<plugin filename="x.so"/><static>true</static>'
    )
    model = load(robot(inside))
    assert (len(model.links), len(model.joints), model.notes) == (1, 0, ())


WITHOUT_DYNAMICS = (
    *("visual", "surface", "sensor", "gazebo", "gravity", "kinematic"),
    *("self_collide", "self_filter", "collision_checking"),
)


@pytest.mark.parametrize("tag", WITHOUT_DYNAMICS)
def test_elements_of_a_link_without_dynamics_are_passed_over(tag: str) -> None:
    assert load(robot(f'<link name="a"><{tag}>1</{tag}></link>')).notes == ()


def test_an_unknown_element_is_noted_once_for_all_its_occurrences() -> None:
    model = load(robot('<odd/>\n<odd/><link name="a"><strange/></link>'))
    assert [str(note) for note in model.notes] == [
        "line 2: unknown element <odd> in <robot> was ignored (2 times)",
        "line 3: unknown element <strange> in <link> was ignored",
    ]


def test_names_may_be_of_any_script_and_hold_markup() -> None:
    model = load(robot('<link name="Fuß &amp; &lt;脚&gt; &quot;1&quot; 100%"/>'))
    assert model.root == 'Fuß & <脚> "1" 100%'


@pytest.mark.parametrize("attribute", ["", 'name=""'])
def test_a_robot_without_a_name_is_noted(attribute: str) -> None:
    model = load(robot('<link name="a"/>', attribute))
    assert model.name == "robot"
    assert "no name" in messages(model)


NOTED = {
    "effort": (joint(limit='<limit lower="0" upper="1" velocity="1"/>'), "no effort limit; it is read as"),
    "velocity": (joint(limit='<limit lower="0" upper="1" effort="1"/>'), "no velocity limit; it is read as"),
    "lower": (joint(limit='<limit upper="1" effort="1"/>'), "no lower limit; URDF defines it as 0"),
    "both": (joint(limit="<limit/>"), "no lower and no upper limit"),
    "order": (joint(limit='<limit lower="2" upper="1"/>'), "lower limit 2.0 above upper limit 1.0"),
    "continuous": (joint(limit=LIMIT, kind="continuous"), "its lower and upper limits were ignored"),
    "negative velocity": (joint(limit='<limit velocity="-1"/>'), "velocity limit of joint 'j' is negative"),
    "negative damping": (joint('<dynamics damping="-1"/>'), "damping of joint 'j' is negative"),
    "axis": (joint('<axis xyz="0 0 2"/>'), "the axis of joint 'j' has length 2; it was scaled to 1"),
    "rounded axis": (joint('<axis xyz="0.7071 0 0.7071"/>'), "has length 0.999"),
    "second inertial": (link(INERTIAL * 2), "<link> has 2 <inertial>"),
    "negative moment": (link(INERTIAL.replace("0.05", "-0.05")), "principal moment -0.05"),
    "triangle": (link(INERTIAL.replace("0.05", "0.08")), "exceeds the sum of the others"),
    "inertia without mass": (link(INERTIAL.replace("2.5", "0")), "is not zero although its mass is"),
    "angle in degrees": (
        joint('<origin rpy="0 -90 10"/>'),
        "rpy in <origin> of joint 'j' holds -90, more than a",
    ),
    "inertial in degrees": (
        link(INERTIAL.replace("0.4 0.5 0.6", "0 0 45")),
        "in degrees it would be 0.785398",
    ),
    "mimic of nobody": (joint('<mimic joint="k"/>'), "mimics 'k', which does not exist"),
}


@pytest.mark.parametrize("case", NOTED)
def test_surprising_content_is_noted_with_its_line(case: str) -> None:
    text, message = NOTED[case]
    (note,) = [note for note in load(text).notes if message in note.message]
    assert note.line is not None


def test_limits_that_are_absent_or_the_largest_float_are_infinite() -> None:
    limits = load(joint(limit='<limit lower="-1.7976931348623157e308" upper="1"/>')).joints[0].limits
    assert limits == Limits(-math.inf, 1.0, math.inf, math.inf)


@pytest.mark.parametrize(
    ("limit", "ends"),
    [("<limit/>", (0.0, 0.0)), ('<limit upper="1"/>', (0.0, 1.0)), ('<limit lower="-1"/>', (-1.0, 0.0))],
)
def test_an_end_that_is_absent_is_zero_as_the_format_says(limit: str, ends: tuple[float, float]) -> None:
    limits = load(joint(limit=limit)).joints[0].limits
    assert (limits.lower, limits.upper) == ends


def test_an_impossible_inertia_is_not_changed() -> None:
    assert load(link(INERTIAL.replace("0.05", "-0.05"))).inertial("a").izz == -0.05


@pytest.mark.parametrize("exponent", [-320, -300, 0, 300, 307])
def test_an_axis_of_any_length_becomes_a_unit_vector(exponent: int) -> None:
    x, y, z = load(joint(f'<axis xyz="3e{exponent} 0 -4e{exponent}"/>')).joints[0].axis
    # A norm below the smallest normal float has lost digits.
    digits = 4.0 * 2.0**-52 if exponent > -308 else 1e-3
    assert y == 0.0
    assert max(abs(x - 0.6), abs(z + 0.8)) <= digits


def test_an_axis_of_unit_length_is_kept_to_the_last_digit() -> None:
    axis = (0.5773502691896258, -0.5773502691896258, 0.5773502691896257)
    assert load(joint(f'<axis xyz="{" ".join(map(repr, axis))}"/>')).joints[0].axis == axis


def test_a_fixed_joint_has_no_axis_limits_or_mimic() -> None:
    inside = '<axis xyz="0 0 0"/><limit lower="x"/><mimic joint="gone"/>'
    model = load(joint(inside, kind="fixed", limit=""))
    assert model == load(joint(kind="fixed", limit=""))
    assert model.nq == 0


FLOATING = robot(
    '<link name="world"/>\n'
    '<joint name="free" type="floating"><origin xyz="0 0 1"/>'
    '<parent link="world"/><child link="body"/></joint>\n'
    f'<link name="body">{INERTIAL}</link>'
)


def test_a_floating_joint_below_an_empty_root_is_left_to_base() -> None:
    fixed, floating = load(FLOATING), load(FLOATING, base="floating")
    assert (fixed.nq, fixed.nv, floating.nq, floating.nv) == (0, 0, 7, 6)
    assert fixed.frame_names == floating.frame_names == ("world", "body")
    (joint_read,) = fixed.joints
    assert (joint_read.type, joint_read.origin.xyz) == ("fixed", (0.0, 0.0, 1.0))
    assert "base='floating' lets the robot move freely" in messages(fixed)
    assert floating.mechanism.root.mass == 2.5


def test_a_floating_joint_elsewhere_is_refused() -> None:
    second = '<joint name="j" type="fixed"><parent link="world"/><child link="c"/></joint>'
    two_children = FLOATING.replace("</robot>", f'<link name="c"/>{second}</robot>')
    for text in (
        two_children,
        FLOATING.replace('<link name="world"/>', f'<link name="world">{INERTIAL}</link>'),
    ):
        with pytest.raises(UnsupportedFeatureError, match="joint 'free' is floating"):
            load(text)


@given(st.data())
def test_any_spelling_of_a_model_is_read_as_that_model(data: st.DataObject) -> None:
    model = data.draw(models(from_urdf=True, physical=False))
    assert load(data.draw(urdf_text(model)), base=model.base) == model


REAL = load("panda").to_urdf().encode()
ODD_BYTES = [
    b"<",
    b">",
    b'"',
    b"\0",
    b"\xff",
    b"&",
    b"nan",
    b"-",
    b"1e999",
    b"</robot>",
    b"<robot>",
    b"mimic",
]


@given(
    st.lists(
        st.tuples(
            st.integers(0, len(REAL) - 1),
            st.integers(0, 40),
            st.one_of(st.sampled_from(ODD_BYTES), st.binary(max_size=8)),
        ),
        min_size=1,
        max_size=6,
    ),
    st.sampled_from(["fixed", "floating"]),
)
def test_any_edit_of_a_real_file_gives_a_model_or_a_dynx_error(
    edits: list[tuple[int, int, bytes]], base: str
) -> None:
    data = REAL
    for start, removed, added in edits:
        data = data[:start] + added + data[start + removed :]
    fault = ""
    try:
        model = load(data, base="floating" if base == "floating" else "fixed")
    except ModelError as error:
        fault = str(error)
    else:
        assert load(model.to_urdf(), base=model.base) == model
    assert fault.isprintable()
    assert len(fault) < 1000


@given(st.one_of(st.text(), st.binary()))
def test_any_text_gives_a_dynx_error(data: str | bytes) -> None:
    with pytest.raises(ModelError):
        load(b"<" + data if isinstance(data, bytes) else "<" + data)


@pytest.mark.parametrize("tag", ["collision_checking", "self_collide", "kinematic", "surface"])
def test_an_element_without_dynamics_is_not_noted(tag: str) -> None:
    text = f'<robot name="r"><link name="a"><{tag}/></link></robot>'
    assert not load(text).notes
    assert load(text.replace(tag, "colision_checking")).notes


BAD: dict[str, tuple[str, int | None, str]] = {
    "semantic description": (
        "<robot name='r'>\n<group name='arm'/></robot>",
        1,
        "this is an SRDF file, which has groups of joints and no robot; wanted a URDF file",
    ),
    "no robot": ("\n<sdf/>", 2, "<sdf> of the file has no attribute version"),
    "two robots": (robot('<link name="a"/>') + "<robot", 4, "wanted one root element"),
    "no link": (robot(""), None, "the robot has no link"),
    "link in capitals": (robot("<Link name='a'/>"), 2, "did you mean 'link'?"),
    "two root links": (robot('<link name="a"/>\n<link name="b"/>'), 3, "2 links have no parent"),
    "two links of one name": (
        robot('<link name="a"/>\n<link name="a"/>'),
        3,
        "two links are named 'a'; the first is in line 2",
    ),
    "two joints of one name": (
        robot(
            '<link name="a"/><link name="b"/><link name="c"/>\n'
            '<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>\n'
            '<joint name="j" type="fixed"><parent link="a"/><child link="c"/></joint>'
        ),
        4,
        "two joints are named 'j'",
    ),
    "two parents": (
        robot(
            '<link name="a"/><link name="b"/><link name="c"/>\n'
            '<joint name="i" type="fixed"><parent link="a"/><child link="c"/></joint>\n'
            '<joint name="j" type="fixed"><parent link="b"/><child link="c"/></joint>'
        ),
        4,
        "link 'c' has two parents",
    ),
    "a cycle of all": (
        robot(
            '<link name="a"/><link name="b"/>\n'
            '<joint name="i" type="fixed"><parent link="a"/><child link="b"/></joint>\n'
            '<joint name="j" type="fixed"><parent link="b"/><child link="a"/></joint>'
        ),
        4,
        "form a cycle",
    ),
    "a cycle beside a root": (
        robot(
            '<link name="r"/><link name="a"/><link name="b"/>\n'
            '<joint name="i" type="fixed"><parent link="a"/><child link="b"/></joint>\n'
            '<joint name="j" type="fixed"><parent link="b"/><child link="a"/></joint>'
        ),
        4,
        "form a cycle",
    ),
    "a joint to itself": (
        robot('<link name="a"/>\n<joint name="j" type="fixed"><parent link="a"/><child link="a"/></joint>'),
        3,
        "joins link 'a' to itself",
    ),
    "a child that is no link": (
        robot('<link name="a"/>\n<joint name="j" type="fixed"><parent link="a"/><child link="A"/></joint>'),
        3,
        "child of joint 'j' is 'A', which is not a link; did you mean 'a'?",
    ),
    "no limit": (joint(limit=""), 4, "joint 'j' is revolute and has no <limit>; wanted <limit lower="),
    "no limit of a prismatic joint": (joint(limit="", kind="prismatic"), 4, 'upper="..."/> in m'),
    "zero axis": (joint('<axis xyz="0 0 -0.0"/>'), 5, "the axis of joint 'j' is zero; wanted a direction"),
    "axis without xyz": (joint("<axis/>"), 5, "<axis> of joint 'j' has no attribute xyz"),
    "two numbers": (joint('\n<axis xyz="0 1"/>'), 6, "xyz in <axis> of joint 'j' is '0 1'; wanted three"),
    "four numbers": (joint('<origin rpy="0 1 2 3"/>'), 5, "rpy in <origin> of joint 'j'"),
    "commas": (joint('<origin xyz="0,1,2"/>'), 5, "separated by white space"),
    "not a number": (joint('<origin xyz="0 nan 2"/>'), 5, "is '0 nan 2'; wanted three numbers"),
    "infinity": (joint('<origin xyz="0 inf 2"/>'), 5, "wanted three numbers"),
    "overflow": (joint('<origin xyz="0 1e999 2"/>'), 5, "wanted three numbers"),
    "python's underscore": (joint('<origin xyz="0 1_0 2"/>'), 5, "wanted three numbers"),
    "hexadecimal": (joint('<origin xyz="0 0x10 2"/>'), 5, "wanted three numbers"),
    "other digits": (joint('<origin xyz="0 ١ 2"/>'), 5, "wanted three numbers"),
    "xacro in a number": (joint('<origin xyz="${a} 0 0"/>'), 5, "xacro that was not expanded"),
    "decimal comma": (joint(limit='<limit lower="-1,5" upper="1"/>'), 4, "decimals take a point"),
    "a unit": (joint(limit='<limit lower="-1rad" upper="1"/>'), 4, "lower in <limit> of joint 'j'"),
    "two points": (joint(limit='<limit lower="-1.57." upper="1"/>'), 4, "is '-1.57.'; wanted a number"),
    "infinite limit": (joint(limit='<limit lower="-inf" upper="1"/>'), 4, "wanted a number"),
    "empty number": (joint(limit='<limit lower="" upper="1"/>'), 4, "is ''; wanted a number"),
    "damping in words": (joint('<dynamics damping="much"/>'), 5, "damping in <dynamics> of joint 'j'"),
    "mimic of nothing": (joint('<mimic multiplier="2"/>'), 5, "<mimic> of joint 'j' has no joint"),
    "mimic of itself": (joint('<mimic joint="j"/>'), 4, "follow each other in a cycle: 'j' -> 'j'"),
    "unknown type": (joint(kind="revolut"), 4, "unknown type 'revolut'; did you mean 'revolute'"),
    "no type": (joint().replace(' type="revolute"', ""), 4, "joint 'j' has no type; wanted one of"),
    "no parent": (joint().replace('<parent link="a"/>', ""), 4, "joint 'j' has no <parent>"),
    "no child link": (
        joint().replace('<child link="b"/>', "<child/>"),
        4,
        "<child> of joint 'j' has no link",
    ),
    "nameless link": (robot("<link/>"), 2, "a <link> has no name; wanted name="),
    "empty name": (robot('<link name=""/>'), 2, "the name of a <link> is empty"),
    "control character": (robot('<link name="a&#10;b"/>'), 2, r"is 'a\nb', which contains the control"),
    "control character of the second kind": (robot('<link name="a&#x85;"/>'), 2, "U+0085"),
    "long name": (robot(f'<link name="{"x" * 10_000}"/>'), 2, "has 10000 characters; at most 1000"),
    "long joint name": (joint().replace('"j"', f'"{"x" * 1001}"'), 4, "has 1001 characters"),
    "control character in the robot's name": (robot('<link name="a"/>', 'name="&#9;"'), 1, "U+0009"),
    "negative mass": (
        link(INERTIAL.replace("2.5", "-2.5")),
        5,
        "the mass of link 'a' is -2.5; wanted at least 0",
    ),
    "mass with a comma": (link(INERTIAL.replace("2.5", "2,5")), 5, "is '2,5'; wanted a number; decimals"),
    "mass without value": (link(INERTIAL.replace(' value="2.5"', "")), 5, "has no attribute value"),
    "mass as text": (link(INERTIAL.replace(' value="2.5"/>', ">2.5</mass>")), 5, "has no attribute value"),
    "no mass": (link(INERTIAL.replace('<mass value="2.5"/>', "")), 3, "<inertial> of link 'a' has no <mass>"),
    "empty inertial": (link("<inertial/>"), 3, "<inertial> of link 'a' has no <mass>"),
    "no inertia": (link('<inertial>\n<mass value="1"/></inertial>'), 3, "has no <inertia>"),
    "no ixy": (link(INERTIAL.replace('ixy="0.001"', "")), 6, "<inertia> of link 'a' has no attribute ixy"),
    "inertia not a number": (link(INERTIAL.replace("0.03", "NaN")), 6, "ixx in <inertia> of link 'a'"),
    "too many links": (chain(10_001), 10_002, "contains more than 10000 <link>, the limit"),
    "cut off": (joint()[:-30], 4, "ends too early"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_description_is_refused_with_line_and_reason(case: str) -> None:
    text, line, message = BAD[case]
    with pytest.raises(DescriptionError) as caught:
        load(text)
    assert message in str(caught.value)
    assert caught.value.line == line
    assert str(caught.value).startswith("<string>:" if line is None else f"<string>:{line}: ")
    assert len(str(caught.value)) < 600
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("kind", ["planar", "ball", "floating"])
def test_joints_of_several_degrees_of_freedom_raise(kind: str) -> None:
    with pytest.raises(UnsupportedFeatureError, match=f"joint 'j' is {kind}.*use") as caught:
        load(joint(kind=kind).replace('<link name="a"/>', f'<link name="a">{INERTIAL}</link>'))
    assert caught.value.line is not None


def test_a_spherical_joint_is_a_ball_joint_whose_axis_and_swings_are_not_read() -> None:
    inside = '<axis xyz="0 0 0"/><limit effort="5" velocity="2" lower="0.2" upper=".8" twist=".3"/>'
    model = load(joint('<dynamics damping="0.5"/>', "spherical", inside))
    (found,) = model.ball_joints
    assert (found.type, found.limits, found.dynamics.damping) == (
        "ball",
        Limits(0.0, math.inf, 2.0, 5.0),
        0.5,
    )
    assert [note.message for note in model.notes if "limits (lower, upper, twist)" in note.message]
    bare = load(joint("", "spherical", '<limit effort="5" velocity="2"/>'))
    assert not any("limits" in note.message for note in bare.notes)


@pytest.mark.parametrize(
    ("inside", "message"),
    [
        ("", "the robot has no link"),
        ('<link name="a"/><link name="b"/>', "2 links have no parent"),
        (
            '<link name="a"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>',
            "child of joint 'j' is 'b', which is not a link",
        ),
    ],
)
@pytest.mark.parametrize(
    ("element", "reason"),
    [
        ('<xacro:include filename="x"/>', "<xacro:include> is xacro that was not expanded"),
        ('<Link name="b"/>', "unknown element <Link>; did you mean 'link'?"),
    ],
)
def test_parts_that_form_no_tree_are_blamed_on_an_unread_element(
    inside: str, message: str, element: str, reason: str
) -> None:
    with pytest.raises(DescriptionError) as caught:
        load(robot(f"{inside}\n{element}"))
    assert caught.value.line == 3
    assert reason in str(caught.value)
    assert message in str(caught.value)


def test_a_chain_of_a_hundred_thousand_links_is_refused_quickly() -> None:
    text = chain(100_000)
    start = time.process_time()
    with pytest.raises(DescriptionError, match="contains more than 10000 <link>"):
        load(text)
    assert time.process_time() - start < 5.0


EPS = np.finfo(float).eps
HALF = math.sqrt(0.5)

numbers = st.floats(-1.0, 1.0)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: math.hypot(*q) > 1e-3)


def with_origin(attributes: str, version: str = ' version="1.2"') -> Model:
    text = joint(f'<origin {attributes}/><axis xyz="0 0 1"/>')
    return load(text.replace("<robot ", f"<robot{version} "))


@given(quaternions, st.sampled_from([1.0, 1e-6, 3.0, 1e6]))
def test_a_quaternion_of_any_length_is_its_rotation(quaternion: tuple[float, ...], scale: float) -> None:
    words = " ".join(repr(scale * part) for part in quaternion)
    pose = with_origin(f'xyz="1 2 3" quat_xyzw="{words}"').joints[0].origin
    R = rotation_from_quat(np.array(quaternion) / math.hypot(*quaternion))
    assert pose.xyz == (1.0, 2.0, 3.0)
    assert np.max(np.abs(pose.matrix[:3, :3] - R)) <= 16 * EPS


@given(unit_vectors(), st.sampled_from([-HALF, HALF]), st.floats(-1e-7, 1e-7))
def test_a_pitch_near_a_right_angle_loses_no_digits(
    axis: np.ndarray[tuple[int, ...], np.dtype[np.float64]], sine: float, off: float
) -> None:
    pitch = np.array([0.0, sine + off, 0.0, HALF])
    quaternion = pitch + 1e-9 * np.append(axis, 0.0)
    quaternion /= np.linalg.norm(quaternion)
    pose = with_origin(f'quat_xyzw="{" ".join(map(repr, quaternion.tolist()))}"').joints[0].origin
    assert np.max(np.abs(pose.matrix[:3, :3] - rotation_from_quat(quaternion))) <= 16 * EPS


def test_the_origin_of_an_inertial_has_a_quaternion_too() -> None:
    text = link(INERTIAL.replace('rpy="0.4 0.5 0.6"', f'quat_xyzw="0 0 {HALF!r} {HALF!r}"'))
    model = load(text.replace("<robot ", '<robot version="1.1" '))
    assert model.inertial("a").origin.rpy == pytest.approx((0.0, 0.0, math.pi / 2.0), abs=4 * EPS)
    assert load(model.to_urdf()) == model


def test_a_length_that_is_not_1_is_noted() -> None:
    assert "the quaternion in <origin> of joint 'j' has length 2; it was scaled to 1" in messages(
        with_origin('quat_xyzw="0 0 0 2"')
    )
    assert "length" not in messages(with_origin('quat_xyzw="0 0 0 1"'))


@pytest.mark.parametrize("version", ["", ' version="1.0"', ' version="one"'])
def test_without_a_version_of_urdf_that_has_quaternions_they_are_ignored(version: str) -> None:
    model = with_origin('xyz="1 0 0" rpy="0.1 0 0" quat_xyzw="x"', version)
    assert model.joints[0].origin == Pose((1.0, 0.0, 0.0), (0.1, 0.0, 0.0))
    assert "line 5: quat_xyzw in <origin> of joint 'j' is ignored: it is part of URDF 1.1" in messages(model)


@pytest.mark.parametrize("version", ["1.1", "1.2", " 1.2", "2.0", "3", "1.2.0"])
def test_versions_of_urdf_with_quaternions(version: str) -> None:
    assert reads_quaternions(version)


@pytest.mark.parametrize("version", ["1.0", "1", "0.9", "", "new", None])
def test_versions_of_urdf_without_quaternions(version: str | None) -> None:
    assert not reads_quaternions(version)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ('rpy="0 0 0" quat_xyzw="0 0 0 1"', "has both rpy and quat_xyzw; wanted one of them"),
        ('quat_xyzw="0 0 0 0"', "is '0 0 0 0', which is no rotation; wanted x y z w of length 1"),
        ('quat_xyzw="1e200 0 0 0"', "which is no rotation"),
        ('quat_xyzw="0 0 1"', "is '0 0 1'; wanted four numbers separated by white space"),
        ('quat_xyzw="0 0 0 0 1"', "wanted four numbers"),
        ('quat_xyzw="0,0,0,1"', "wanted four numbers"),
        ('quat_xyzw=""', "is ''; wanted four numbers"),
        ('quat_xyzw="nan 0 0 1"', "wanted four numbers"),
        ('quat_xyzw="${q}"', "xacro"),
    ],
)
def test_a_bad_quaternion_is_refused_with_its_line(attributes: str, message: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        with_origin(attributes)
    assert caught.value.line == 5
    assert message in str(caught.value)
