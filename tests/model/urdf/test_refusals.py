"""Malformed descriptions raise one error each, with line and reason."""

from __future__ import annotations

import time

import pytest

from dynx.errors import DescriptionError, UnsupportedFeatureError
from dynx.model.loading import load
from tests.model.descriptions import INERTIAL, chain, joint, link, robot

BAD: dict[str, tuple[str, int | None, str]] = {
    "semantic description": (
        "<robot name='r'>\n<group name='arm'/></robot>",
        1,
        "this is an SRDF file, which has groups of joints and no robot; wanted a URDF file",
    ),
    "no robot": ("\n<sdf/>", 2, "the root element is <sdf>; wanted <robot> (SDF is not read)"),
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


@pytest.mark.parametrize("kind", ["planar", "spherical", "ball", "floating"])
def test_joints_of_several_degrees_of_freedom_raise(kind: str) -> None:
    with pytest.raises(UnsupportedFeatureError, match=f"joint 'j' is {kind}.*use") as caught:
        load(joint(kind=kind).replace('<link name="a"/>', f'<link name="a">{INERTIAL}</link>'))
    assert caught.value.line is not None


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
    start = time.perf_counter()
    with pytest.raises(DescriptionError, match="contains more than 10000 <link>"):
        load(text)
    assert time.perf_counter() - start < 5.0
