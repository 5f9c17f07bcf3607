"""The mended file: elements of the second description replaced in its text, and nothing else changed."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import pytest

import dynx
from dynx.model.elements import Inertial, Joint, Link, Pose
from dynx.model.library import find
from dynx.same import same_robot
from dynx.same.text import vector_text

ARM = """<?xml version="1.0"?>
<!-- an arm -->
<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial>
      <origin xyz="0.2 0.05 0.1"/>
      <mass value="1.5"/>
      <inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.03" iyz="0.003" izz="0.04"/>
    </inertial>
  </link>
  <link name="lower">
    <inertial>
      <mass value="0.5"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.003" iyz="0" izz="0.004"/>
    </inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.3" rpy="0.3 0 0"/>
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
  </joint>
  <joint name="elbow" type="revolute">
    <origin xyz="0.5 0 0"/>
    <parent link="upper"/>
    <child link="lower"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="2"/>
  </joint>
</robot>
"""

BODIES = """<mujoco model="arm">
  <compiler angle="radian"/>
  <worldbody>
    <!-- an arm -->
    <body name="upper" pos="0 0 0.3" euler="0.3 0 0">
      <inertial pos="0.2 0.05 0.1" mass="1.5" fullinertia="0.02 0.03 0.04 0.001 0.002 0.003"/>
      <joint name="shoulder" axis="0 1 0" range="-1 1"/>
      <body name="lower" pos="0.5 0 0">
        <inertial pos="0 0 0" mass="0.5" diaginertia="0.002 0.003 0.004"/>
        <joint name="elbow" axis="0 0 1" range="-1 1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def lines_changed(one: str, other: str) -> list[str]:
    """Return the lines of `other` that are not those of `one`."""
    first, second = one.splitlines(), other.splitlines()
    assert len(first) == len(second)
    return [b.strip() for a, b in zip(first, second, strict=True) if a != b]


@pytest.mark.parametrize(
    ("old", "new", "element"),
    [
        ('<mass value="0.5"/>', '<mass value="0.6"/>', ("inertial", "lower")),
        ('xyz="0.2 0.05 0.1"', 'xyz="0.21 0.05 0.1"', ("inertial", "upper")),
        ('iyy="0.03"', 'iyy="0.031"', ("inertial", "upper")),
        ('xyz="0.5 0 0"', 'xyz="0.5 0 0.01"', ("origin", "elbow")),
        ('rpy="0.3 0 0"', 'rpy="0.31 0 0"', ("origin", "shoulder")),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0.1 1"/>', ("axis", "elbow")),
        ('<axis xyz="0 1 0"/>', '<axis xyz="1 0 0"/>', ("axis", "shoulder")),
    ],
)
def test_one_line_of_urdf_is_mended(old: str, new: str, element: tuple[str, str]) -> None:
    changed = ARM.replace(old, new)
    report = same_robot(ARM, changed)
    assert [(each.part, each.theirs) for each in report.differences] == [element]
    line = ARM[: ARM.index(old)].count("\n") + 1
    assert abs((report.differences[0].second_line or 0) - line) <= 3
    assert report.first != ""
    assert report.mended_text is not None
    mended = report.mended_text.decode()
    (written,) = lines_changed(changed, mended)
    assert written != ""
    again = same_robot(ARM, mended)
    assert again.same
    assert again.attributes == ()


@pytest.mark.parametrize(
    ("old", "new", "element"),
    [
        ('mass="0.5"', 'mass="0.6"', ("inertial", "lower")),
        ('pos="0.5 0 0"', 'pos="0.5 0.01 0"', ("origin", "elbow")),
        ('euler="0.3 0 0"', 'euler="0.31 0 0"', ("origin", "shoulder")),
        ('axis="0 0 1"', 'axis="0 0.1 1"', ("axis", "elbow")),
    ],
)
def test_one_element_of_mjcf_is_mended(old: str, new: str, element: tuple[str, str]) -> None:
    changed = BODIES.replace(old, new)
    report = same_robot(ARM, changed)
    assert [(each.part, each.theirs) for each in report.differences] == [element]
    assert report.not_mended is None
    assert report.mended_text is not None
    assert "<!-- an arm -->" in report.mended_text.decode()
    assert same_robot(ARM, report.mended_text).same


def test_a_point_mass_of_mjcf_is_mended_as_mujoco_takes_it() -> None:
    """MuJoCo refuses zeros as a tensor, and takes them as principal moments."""
    mujoco = pytest.importorskip("mujoco")
    tip = '<body name="tip" pos="0.1 0 0"><inertial pos="{} 0 0" mass="0.1" diaginertia="0 0 0"/></body>'
    joint = '<joint name="elbow" axis="0 0 1" range="-1 1"/>'
    first, second = (BODIES.replace(joint, joint + tip.format(x)) for x in (0.0, 0.1))
    report = same_robot(first, second)
    assert [(each.part, each.theirs) for each in report.differences] == [("inertial", "tip")]
    assert report.mended_text is not None
    assert same_robot(first, report.mended_text).same
    assert mujoco.MjModel.from_xml_string(report.mended_text.decode()).nv == 2


def test_urdf_and_mjcf_of_one_robot_are_the_same() -> None:
    report = same_robot(ARM, BODIES)
    assert report.same
    assert {each.kind for each in report.attributes} == {"velocity limit", "effort limit"}


def test_the_joint_position_of_mjcf_moves_one_line() -> None:
    """A joint off the origin of its body: the axis is moved, and the body stays where it is."""
    changed = BODIES.replace('<joint name="elbow"', '<joint name="elbow" pos="0 0.02 0"')
    report = same_robot(ARM, changed)
    assert not report.same
    assert [each.theirs for each in report.differences] == ["elbow"]
    assert report.mended is not None
    assert same_robot(ARM, report.mended).same


def test_an_inertial_is_added_and_removed() -> None:
    start = ARM.index("    <inertial>", ARM.index('"lower"'))
    end = ARM.index("  </link>", start)
    without = ARM[:start] + ARM[end:]
    for first, second in ((ARM, without), (without, ARM)):
        report = same_robot(first, second)
        assert [(each.part, each.theirs) for each in report.differences] == [("inertial", "lower")]
        assert report.mended_text is not None
        assert same_robot(first, report.mended_text).same


def test_a_type_is_mended() -> None:
    fixed = ARM.replace('<joint name="elbow" type="revolute">', '<joint name="elbow" type="fixed">')
    for first, second in ((ARM, fixed), (fixed, ARM)):
        report = same_robot(first, second)
        assert [(each.part, each.theirs) for each in report.differences] == [("type", "elbow")]
        assert report.mended_text is not None
        assert same_robot(first, report.mended_text).same


def test_a_public_file_keeps_all_but_one_attribute() -> None:
    text = Path(find("ur5")).read_text(encoding="utf-8")
    changed = text.replace('<mass value="2.275"/>', '<mass value="2.3"/>')
    report = same_robot("ur5", changed)
    assert report.mended_text is not None
    assert report.mended_text.decode() == text


def test_what_mjcf_cannot_be_mended_for_is_said() -> None:
    slides = BODIES.replace('<joint name="elbow"', '<joint name="elbow" type="slide"')
    report = same_robot(ARM, slides)
    assert not report.same
    assert report.mended_text is None
    assert report.not_mended is not None
    assert "elbow" in report.not_mended


def test_a_model_is_mended_as_urdf() -> None:
    links = [Link("a"), Link("b", Inertial(1.0, Pose((0.1, 0.2, 0.3)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1))]
    model = dynx.Model.build("r", links, [Joint("j", "continuous", "a", "b", Pose((0.1, 0.0, 0.0)))])
    other = replace(model, joints=(replace(model.joints[0], origin=Pose((0.1, 0.1, 0.0))),))
    report = same_robot(model, other)
    assert report.mended == model
    assert report.mended_text is not None
    assert same_robot(model, report.mended_text).same


SDF = """<sdf version="1.7"><model name="arm"><link name="base"/><link name="upper">
      <pose>0 0 0.3 0.3 0 0</pose>
      <inertial><pose>0.2 0.05 0.1 0 0 0</pose><mass>1.5</mass><inertia>
        <ixx>0.02</ixx><ixy>0.001</ixy><ixz>0.002</ixz><iyy>0.03</iyy><iyz>0.003</iyz><izz>0.04</izz>
      </inertia></inertial></link>
      <!-- the forearm -->
      <link name="lower"><pose>0.4 0.1 0.5 0.1 0.2 0.3</pose>
      <inertial><pose>0.1 0.02 0.03 0 0 0</pose><mass>0.5</mass><inertia>
        <ixx>0.002</ixx><ixy>0.0001</ixy><ixz>0.0002</ixz><iyy>0.003</iyy><iyz>0.0003</iyz><izz>0.004</izz>
      </inertia></inertial></link>
      <joint name="fixed_base" type="fixed"><parent>world</parent><child>base</child></joint>
      <joint name="shoulder" type="revolute"><parent>base</parent><child>upper</child>
      <axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
      <joint name="elbow" type="revolute"><parent>upper</parent><child>lower</child>
      <axis><xyz>1 0 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
      </model></sdf>"""


@pytest.mark.parametrize(
    ("old", "new", "element"),
    [
        ("<xyz>0 1 0</xyz>", "<xyz>0 1 0.1</xyz>", ("shoulder", "axis")),
        ("<mass>1.5</mass>", "<mass>1.7</mass>", ("upper", "inertial")),
        ("0.4 0.1 0.5 0.1 0.2 0.3", "0.42 0.1 0.5 0.1 0.2 0.3", ("elbow", "origin")),
        ("0.4 0.1 0.5 0.1 0.2 0.3", "0.4 0.1 0.5 0.1 0.2 0.4", ("elbow", "origin")),
    ],
)
def test_sdf_is_mended(old: str, new: str, element: tuple[str, str]) -> None:
    assert same_robot(SDF, SDF).same
    other = SDF.replace(old, new)
    report = same_robot(SDF, other)
    assert [(each.theirs, each.part) for each in report.differences] == [element]
    assert report.not_mended is None
    assert report.mended_text is not None
    text = report.mended_text.decode()
    assert "<!-- the forearm -->" in text
    assert same_robot(SDF, text).same


SHOULDER = SDF[SDF.index('<joint name="shoulder"') : SDF.index('<joint name="elbow"')]


@pytest.mark.parametrize("axis", ["<xyz>0 1 0</xyz>", "<xyz>0 0.6 0.8</xyz>"])
@pytest.mark.parametrize("kinds", list(permutations(["revolute", "prismatic", "continuous", "fixed"], 2)))
def test_types_of_joints_of_sdf_are_mended(kinds: tuple[str, str], axis: str) -> None:
    texts = []
    for kind in kinds:
        shoulder = SHOULDER.replace('type="revolute"', f'type="{kind}"').replace("<xyz>0 1 0</xyz>", axis)
        if kind == "fixed":
            shoulder = shoulder[: shoulder.index("<axis>")] + "</joint>"
        texts.append(SDF.replace(SHOULDER, shoulder))
    report = same_robot(*texts)
    if set(kinds) == {"revolute", "continuous"}:
        assert report.same
        return
    assert [(each.theirs, each.part) for each in report.differences] == [("shoulder", "type")]
    assert report.mended_text is not None, report.not_mended
    again = same_robot(texts[0], report.mended_text.decode())
    assert again.same
    # The limits of a joint that moves in both files are no part of its type.
    assert again.attributes == () or "fixed" not in kinds


@pytest.mark.parametrize("kinds", [("ball", "revolute"), ("revolute", "ball")])
def test_ball_joints_of_sdf_are_not_mended_to_another_type(kinds: tuple[str, str]) -> None:
    texts = [SDF.replace('"elbow" type="revolute"', f'"elbow" type="{kind}"') for kind in kinds]
    report = same_robot(*texts)
    assert report.mended_text is None
    assert "elbow" in str(report.not_mended)


def test_a_joint_of_sdf_is_moved_with_the_links_below_it() -> None:
    # Both links are 0.1 m farther, so that only the first joint is elsewhere.
    other = SDF.replace("<pose>0 0 0.3 0.3", "<pose>0.1 0 0.3 0.3").replace("<pose>0.4 0.1", "<pose>0.5 0.1")
    report = same_robot(SDF, other)
    assert report.mended_text is not None
    assert same_robot(SDF, report.mended_text.decode()).same


@pytest.mark.parametrize("pose", ["0.4 0.1 0.5 0.1 0.2 0.4", "0.42 0.1 0.5 0.1 0.2 0.3"])
def test_axes_of_sdf_in_the_frame_of_the_model_are_turned_with_their_links(pose: str) -> None:
    frame = "<use_parent_model_frame>true</use_parent_model_frame><limit>"
    first = SDF.replace('version="1.7"', 'version="1.6"').replace("<limit>", frame)
    # With the pose alone the axis would be another one in the link, too.
    report = same_robot(first, first.replace("0.4 0.1 0.5 0.1 0.2 0.3", pose))
    assert not report.same
    assert report.mended_text is not None, report.not_mended
    assert same_robot(first, report.mended_text.decode()).same


def test_what_sdf_writes_in_another_frame_is_not_mended() -> None:
    other = SDF.replace("<xyz>0 1 0</xyz>", '<xyz expressed_in="upper">0 1 0.1</xyz>')
    report = same_robot(SDF, other)
    assert report.mended is not None
    assert report.mended_text is None
    assert "shoulder" in str(report.not_mended)


def test_values_of_merged_bodies_are_called_so() -> None:
    """A link merged into its parent: its mass is in the wanted value alone."""
    cap = """<link name="cap"><inertial><mass value="0.001"/>
      <inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/></inertial></link>
      <joint name="lid" type="fixed"><parent link="upper"/><child link="cap"/></joint></robot>"""
    report = same_robot(ARM.replace("</robot>", cap), ARM)
    (each,) = report.differences
    assert each.theirs == "upper"
    assert "merged" in each.message
    assert "cap" in each.first
    assert each.first != each.second != each.wanted


def test_values_that_differ_are_written_with_digits_that_differ() -> None:
    report = same_robot(
        ARM, ARM.replace('<mass value="0.5"/>', '<mass value="0.50000000001"/>'), tolerance=1e-12
    )
    (each,) = report.differences
    assert each.first != each.second


def test_rounding_is_written_as_zero() -> None:
    assert vector_text((2.298e-18, 0.0, -1.0)) == "0 0 -1"
    assert vector_text((1e-18, -2e-18, 0.0)) == "1e-18 -2e-18 0"


def test_the_place_of_a_joint_has_the_line_of_its_body() -> None:
    text = dynx.load("six_axis_arm").to_mjcf()
    lines = text.splitlines()
    moved = next(number for number, line in enumerate(lines, 1) if '<body name="wrist"' in line)
    pose = 'pos="0.42 0.0 0.0"'
    assert pose in lines[moved - 1]
    other = text.replace(lines[moved - 1], lines[moved - 1].replace(pose, 'pos="0.43 0.0 0.0"'))
    (each,) = same_robot(text, other).differences
    assert (each.part, each.first_line, each.second_line) == ("origin", moved, moved)
    other = SDF.replace("0.4 0.1 0.5 0.1 0.2 0.3", "0.42 0.1 0.5 0.1 0.2 0.3")
    (each,) = same_robot(SDF, other).differences
    number = next(number for number, line in enumerate(SDF.splitlines(), 1) if '<link name="lower">' in line)
    assert (each.part, each.second_line) == ("origin", number)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('name="elbow" axis="0 0 1"', 'name="elbow" pos="0 0.02 0" axis="0 0 1"'),
        ('name="shoulder" axis="0 1 0"', 'name="shoulder" pos="0.01 0 0.02" axis="0 1 0"'),
        ('name="shoulder" axis="0 1 0" range="-1 1"', 'name="shoulder" type="ball" pos="0 0.02 0"'),
        ('name="elbow" axis="0 0 1"', 'name="elbow" ref="0.3" pos="0.1 0.02 0" axis="0 0 1"'),
    ],
)
def test_the_point_of_a_joint_of_mjcf_is_mended_alone(old: str, new: str) -> None:
    """The joint is moved in its body, and the body and all other joints stay."""
    kind = ' type="ball"' if "ball" in new else ' ref="0.3"' if "ref" in new else ""
    point = new.partition('pos="')[2].partition('"')[0]
    first = BODIES.replace(old, new.replace(f' pos="{point}"', "") if kind else old)
    second = BODIES.replace(old, new)
    report = same_robot(first, second)
    assert [each.part for each in report.differences] == ["origin"]
    assert report.not_mended is None
    assert report.mended_text is not None
    (line,) = lines_changed(second, report.mended_text.decode())
    zeros = [abs(float(each)) for each in line.partition('pos="')[2].partition('"')[0].split()]
    assert zeros == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
    assert line.replace(line.partition('pos="')[2].partition('"')[0], point) in second
    assert same_robot(first, report.mended_text).same


HAND = """<mujoco>
  <worldbody>
    <body name="palm">
      <geom size="0.1" pos="0.05 0.02 0"/>
      <joint name="turn" axis="0 1 0"/>
      <body name="finger" pos="0.5 0 0.1" euler="20 0 0">
        <geom type="box" size="0.1 0.05 0.02" pos="0.05 0.03 0.02"/>
        <joint name="hinge" axis="0.6 0.8 0" pos="0.01 0.02 0.03"/>
        <joint name="slide" type="slide" axis="1 0 0" ref="0.1"/>
        <joint name="ball" type="ball" pos="{}"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("last", ["0 0 0", "0 0.1 0"])
@pytest.mark.parametrize("shift", [1e-6, 1e-2])
def test_the_point_of_one_of_several_joints_of_a_body_is_one_element(last: str, shift: float) -> None:
    """The bodies and all other joints stay where they are."""
    first = HAND.format(last)
    second = first.replace("0.01 0.02 0.03", f"0.01 0.02 {0.03 + shift}")
    report = same_robot(first, second)
    assert [(each.part, each.theirs) for each in report.differences] == [("origin", "hinge")]
    assert report.mended_text is not None
    assert report.mended_text.decode() == first
    second = HAND.format(last.replace("0 0", f"{shift} 0", 1))
    report = same_robot(first, second)
    assert [(each.part, each.theirs) for each in report.differences] == [("origin", "ball")]
    assert report.mended_text is not None
    (line,) = lines_changed(second, report.mended_text.decode())
    assert 'name="ball"' in line
    assert same_robot(first, report.mended_text).same


def test_a_joint_beside_its_body_in_one_file_alone_is_no_difference() -> None:
    """Also where joints have other names: the fixed joint that the reader adds has no counterpart."""
    other = BODIES.replace('pos="0.5 0 0">', 'pos="0.4 0.1 0.2">').replace(
        'pos="0 0 0" mass', 'pos="0.1 -0.1 -0.2" mass'
    )
    other = other.replace('"elbow"', '"other" pos="0.1 -0.1 -0.2"').replace('"shoulder"', '"another"')
    for one, two in ((BODIES, other), (other, BODIES)):
        report = same_robot(one, two)
        assert report.same, (report.differences, report.unmatched)
        # The link that the reader adds stands in no file, and has no name to differ.
        assert {(each.kind, each.tag) for each in report.attributes} == {("name", "joint")}


def test_joints_on_one_line_are_matched_by_the_bodies_of_the_file() -> None:
    """Two like hinges on one axis have other names; in one file the joints lie beside their bodies."""
    leg = (
        '<body name="{0}" pos="{1} 0 0"><inertial pos="{2} 0.1 -0.1" mass="1" diaginertia="0.1 0.2 0.25"/>'
        '<joint name="{3}" axis="1 0 0"/></body>'
    )
    base = '<body name="base"><freejoint/><inertial pos="0 0 0.05" mass="5" diaginertia="1 2 2.5"/>'
    text = f"<mujoco><worldbody>{base}{{}}{{}}</body></worldbody></mujoco>"
    first = text.format(leg.format("front", 0.2, 0.1, "a"), leg.format("rear", -0.2, -0.1, "b"))
    beside = leg.replace('pos="{1} 0 0"', 'pos="{1} 0.3 0"').replace("0.1 -0.1", "-0.2 -0.1")
    beside = beside.replace('axis="1 0 0"', 'pos="0 -0.3 0" axis="1 0 0"')
    second = text.format(beside.format("rear", -0.2, -0.1, "j_b"), beside.format("front", 0.2, 0.1, "j_a"))
    report = same_robot(first, second)
    assert report.same, (report.differences, report.unmatched)
    assert {(each.ours, each.theirs) for each in report.coordinates} == {("a", "j_a"), ("b", "j_b")}


def test_a_link_without_mass_between_a_joint_and_its_link_is_no_difference() -> None:
    """A file states the links and the fixed joint that a reader of MJCF would add; the joints are renamed."""
    between = """<link name="between"/>
  <joint name="place" type="fixed">
    <origin xyz="0.1 0.2 0.3"/> <parent link="between"/> <child link="lower"/>
  </joint>
</robot>"""
    other = ARM.replace('name="elbow"', 'name="other"').replace(
        '<child link="lower"/>', '<child link="between"/>'
    )
    other = other.replace('<mass value="0.5"/>', '<origin xyz="-0.1 -0.2 -0.3"/><mass value="0.5"/>')
    other = other.replace("</robot>", between)
    for one, two in ((ARM, other), (other, ARM)):
        report = same_robot(one, two)
        assert report.same, (report.differences, report.unmatched)
        assert {(each.kind, each.tag) for each in report.attributes} == {("name", "joint")}


def test_a_body_and_a_joint_in_frames_are_mended_in_the_frames() -> None:
    framed = BODIES.replace('<body name="lower"', '<frame pos="0.1 0 0" euler="0 0 0.5"><body name="lower"')
    framed = framed.replace("</body>\n    </body>", "</body></frame>\n    </body>")
    joint = '<joint name="elbow" axis="0 0 1" range="-1 1"/>'
    framed = framed.replace(joint, f'<frame pos="0 0.2 0" euler="0.4 0 0">{joint}</frame>')
    for old, new in (
        ('pos="0.5 0 0"', 'pos="0.5 0 0.01"'),
        ('axis="0 0 1"', 'axis="0 0.1 1"'),
        ('axis="0 0 1"', 'pos="0 0.03 0" axis="0 0 1"'),
    ):
        assert old in framed
        report = same_robot(framed, framed.replace(old, new))
        assert not report.same
        assert report.mended_text is not None, report.not_mended
        assert len(lines_changed(framed.replace(old, new), report.mended_text.decode())) == 1
        assert same_robot(framed, report.mended_text).same


def test_numbers_that_do_not_differ_stay_as_they_are_written() -> None:
    first = BODIES.replace('pos="0.5 0 0"', 'pos="5e-1 +0.25 0.0"').replace('mass="0.5"', 'mass="5.0e-1"')
    second = first.replace("+0.25", "0.26").replace('mass="1.5"', 'mass="1.6"')
    report = same_robot(first, second)
    assert report.mended_text is not None
    assert report.mended_text.decode() == second.replace("0.26", "0.25").replace('mass="1.6"', 'mass="1.5"')


def test_the_reason_names_a_body_of_the_file() -> None:
    bodies = '<body name="upper" pos="0 0 0.3" euler="0.3 0 0">', '<body name="lower" pos="0.5 0 0">'
    held = BODIES.replace(bodies[1], f'<replicate count="1">{bodies[1]}')
    held = held.replace("</body>\n    </body>", "</body></replicate>\n    </body>")
    report = same_robot(held, held.replace("0.5 0 0", "0.6 0 0"))
    assert report.mended_text is None
    assert "the place of joint elbow0 " in str(report.not_mended)
