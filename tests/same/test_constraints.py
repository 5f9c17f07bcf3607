"""Tendons, equality constraints, gravity compensation and configurations of two descriptions: what
`dynx.same` lists apart from the verdict."""

from __future__ import annotations

import pytest

import dynx
from dynx.same import same_robot
from dynx.same.attributes import Attribute, DescriptionFreedom

KINDS = ("tendon", "equality", "gravity compensation", "configuration", "actuator", "name")

TREE = """<mujoco>
  <compiler angle="radian"/>
  <worldbody><site name="wall" pos="1 0 0"/>
    <body name="a" pos="0 0 1" GRAVCOMP><joint name="i" axis="1 0 0" range="-1 1"/>
      <geom name="ga" size="0.1"/><site name="s" pos="0.5 0 0"/>
      <body name="b"><joint name="j" axis="0 0 AXIS" range="-1 1"/>
        <geom name="gb" size="0.11" pos="0.1 0 0"/>
        <body name="c" pos="0 1 0"><joint name="k" axis="1 0 0" range="-1 1"/><geom name="gc" size="0.12"/>
        </body></body></body></worldbody>
  SECTIONS
</mujoco>"""


def document(sections: str, axis: str = "1", gravcomp: str = "") -> str:
    return TREE.replace("SECTIONS", sections).replace("AXIS", axis).replace("GRAVCOMP", gravcomp)


def compared(first: str, second: str) -> tuple[list[Attribute], list[DescriptionFreedom]]:
    report = same_robot(first, second)
    assert report.same
    freedoms = [each for each in report.freedoms if each.kind == "constraint"]
    return [each for each in report.attributes if each.kind in KINDS], freedoms


def tendon(name: str = "t", coefficient: str = "2", rest: str = "") -> str:
    terms = f'<joint joint="i" coef="1"/><joint joint="j" coef="{coefficient}"/>'
    return f'<tendon><fixed name="{name}" {rest}>{terms}</fixed></tendon>'


EQUAL = {
    "the same": (document(tendon()), document(tendon())),
    "the axis of a joint reversed": (document(tendon()), document(tendon(coefficient="-2"), axis="-1")),
    "a spring length without stiffness": (document(tendon()), document(tendon(rest='springlength="3"'))),
    "a constraint of frames": (
        document('<equality><connect name="e" body1="a" anchor="0.5 0 0"/></equality>'),
        document('<equality><connect name="e" site1="s" site2="t"/></equality>').replace(
            '<site name="wall" pos="1 0 0"/>', '<site name="wall" pos="1 0 0"/><site name="t" pos="0.5 0 1"/>'
        ),
    ),
    "a coupling by a reversed axis": (
        document('<equality><joint joint1="j" joint2="k" polycoef="0.1 2 0.3 0 0"/></equality>'),
        document('<equality><joint joint1="j" joint2="k" polycoef="-0.1 -2 -0.3 0 0"/></equality>', "-1"),
    ),
    "a coupling to a reversed axis": (
        document('<equality><joint joint1="k" joint2="j" polycoef="0.1 2 0.3 0 0"/></equality>'),
        document('<equality><joint joint1="k" joint2="j" polycoef="0.1 -2 0.3 0 0"/></equality>', "-1"),
    ),
    "another pose of the file": (
        document('<equality><joint joint1="j" joint2="k" polycoef="0.1 2 0 0 0"/></equality>'),
        document('<equality><joint joint1="j" joint2="k" polycoef="0.5 2 0 0 0"/></equality>').replace(
            'name="k"', 'name="k" ref="0.2"'
        ),
    ),
    "rounding in a coefficient": (
        document('<equality><joint joint1="j" joint2="k" polycoef="-0.455 0.778 0 -0.181 0"/></equality>'),
        document(
            '<equality><joint joint1="j" joint2="k" polycoef="-0.455 0.778 2e-17 -0.181 0"/></equality>'
        ),
    ),
    "rounding where all coefficients are 0": (
        document('<equality><joint joint1="k" joint2="j" polycoef="0 0 0 0 0"/></equality>'),
        document(
            '<equality><joint joint1="k" joint2="j" polycoef="-0.30000000000000004 0 0 0 0"/></equality>'
        ).replace('name="k"', 'name="k" ref="0.3"'),
    ),
    "a keyframe by a reversed axis": (
        document('<keyframe><key name="home" qpos="0.1 0.2 0.3"/></keyframe>'),
        document('<keyframe><key name="home" qpos="0.1 -0.2 0.3"/></keyframe>', "-1"),
    ),
    "the compensation of one of two merged links": (
        document("", gravcomp='gravcomp="1"'),
        document("", gravcomp='gravcomp="1"').replace(
            '<site name="s"', '<body name="f" gravcomp="1"><geom size="0.1" mass="0"/></body><site name="s"'
        ),
    ),
}


@pytest.mark.parametrize("case", list(EQUAL))
def test_equal_parts_are_not_listed(case: str) -> None:
    first, second = EQUAL[case]
    if case == "another pose of the file":
        # A joint at 0.2 in the file is turned back by its reference.
        second = second.replace('<body name="c" pos="0 1 0">', '<body name="c" pos="0 1 0" euler="0.2 0 0">')
    assert compared(first, second) == ([], [])


SWAPPED = {
    "weld": '<weld name="e" body1="{}" body2="{}"/>',
    "connect": '<connect name="e" site1="{}" site2="{}"/>',
    "joint": '<joint name="e" joint1="{}" joint2="{}" polycoef="{} 0 0 0"/>',
}


@pytest.mark.parametrize("case", list(SWAPPED))
def test_the_order_of_two_parts_is_a_freedom(case: str) -> None:
    text = SWAPPED[case]
    parts = {
        "weld": ("a", "c", "", ""),
        "connect": ("s", "wall", "", ""),
        "joint": ("j", "k", "1 2", "-0.5 0.5"),
    }
    one, two, forth, back = parts[case]
    first, second = text.format(one, two, forth), text.format(two, one, back)
    attributes, freedoms = compared(
        document(f"<equality>{first}</equality>"), document(f"<equality>{second}</equality>")
    )
    assert attributes == []
    assert [each.message for each in freedoms] == ["constraint e couples the same parts in the other order"]


def equality(text: str) -> str:
    return document(f"<equality>{text}</equality>")


def keyframe(text: str) -> str:
    return document(f"<keyframe>{text}</keyframe>")


DIFFERENT = {
    "coefficient": (document(tendon()), document(tendon(coefficient="2.1")), "tendon", "2 j", "2.1 j"),
    "joint": (document(tendon()), document(tendon().replace('"j"', '"k"')), "tendon", "2 j", "2 k"),
    "range": (document(tendon()), document(tendon(rest='range="0 1"')), "tendon", "2 j", "range 0 to 1"),
    "stiffness": (
        document(tendon(rest='stiffness="3"')),
        document(tendon(rest='stiffness="4"')),
        "tendon",
        "stiffness 3 at length 0",
        "stiffness 4 at length 0",
    ),
    "spring length": (
        document(tendon(rest='stiffness="3"')),
        document(tendon(rest='stiffness="3" springlength="1 2"')),
        "tendon",
        "at length 0",
        "at length 1 to 2",
    ),
    "no tendon": (document(tendon()), document(""), "tendon", "1 i + 2 j", "none"),
    "name of a tendon": (document(tendon()), document(tendon("u")), "name", "t", "u"),
    "motor of a tendon": (
        document(tendon() + '<actuator><motor tendon="t" gear="2"/></actuator>'),
        document(tendon() + '<actuator><motor tendon="t" gear="3"/></actuator>'),
        "actuator",
        "gear 2",
        "gear 3",
    ),
    "anchor": (
        equality('<connect name="e" body1="a" anchor="0.5 0 0"/>'),
        equality('<connect name="e" body1="a" anchor="0.6 0 0"/>'),
        "equality",
        "connect a to world, at 0.5 0 0",
        "connect a to world, at 0.6 0 0",
    ),
    "type": (
        equality('<connect name="e" body1="a" anchor="0 0 0"/>'),
        equality('<weld name="e" body1="a"/>'),
        "equality",
        "connect a to world",
        "weld a to world",
    ),
    "pose": (
        equality('<weld name="e" body1="a" body2="c"/>'),
        equality('<weld name="e" body1="a" body2="c" relpose="0 1 0 1 0.1 0 0"/>'),
        "equality",
        "weld a to c",
        "placed otherwise: weld a to c",
    ),
    "torque scale": (
        equality('<weld name="e" body1="a" body2="c"/>'),
        equality('<weld name="e" body1="a" body2="c" torquescale="2"/>'),
        "equality",
        "weld a to c",
        "torque scale 2",
    ),
    "polynomial": (
        equality('<joint name="e" joint1="j" joint2="k"/>'),
        equality('<joint name="e" joint1="j" joint2="k" polycoef="0 1.5"/>'),
        "equality",
        "joint j to k",
        "polynomial 0 1.5 0 0 0",
    ),
    "softness": (
        equality('<joint name="e" joint1="j" joint2="k"/>'),
        equality('<joint name="e" joint1="j" joint2="k" solref="0.1 1"/>'),
        "equality",
        "joint j to k",
        "solref 0.1 1",
    ),
    "not active": (
        equality('<joint name="e" joint1="j" joint2="k"/>'),
        equality('<joint name="e" joint1="j" joint2="k" active="false"/>'),
        "equality",
        "joint j to k",
        "not active",
    ),
    "compensation": (
        document("", gravcomp='gravcomp="1"'),
        document("", gravcomp='gravcomp="0.9"'),
        "gravity compensation",
        "1",
        "0.9",
    ),
    "no compensation": (
        document("", gravcomp='gravcomp="1"'),
        document(""),
        "gravity compensation",
        "1",
        "0",
    ),
    "keyframe": (
        keyframe('<key name="home" qpos="0.1 0.2 0.3"/>'),
        keyframe('<key name="home" qpos="0.1 0.25 0.3"/>'),
        "configuration",
        "j 0.2",
        "j 0.25",
    ),
    "no keyframe": (
        keyframe('<key name="home" qpos="0.1 0.2 0.3"/>'),
        keyframe(""),
        "configuration",
        "stated",
        "none",
    ),
    "name of a keyframe": (
        keyframe('<key name="home" qpos="0.1 0.2 0.3"/>'),
        keyframe('<key name="rest" qpos="0.1 0.2 0.3"/>'),
        "name",
        "home",
        "rest",
    ),
}


@pytest.mark.parametrize("case", list(DIFFERENT))
def test_each_difference_is_listed_with_its_lines(case: str) -> None:
    first, second, kind, one, two = DIFFERENT[case]
    for (a, b), words in (((first, second), (one, two)), ((second, first), (two, one))):
        (found,), freedoms = compared(a, b)
        assert freedoms == []
        assert found.kind == kind
        texts = found.first.replace("placed otherwise: ", ""), found.second
        assert words[0].replace("placed otherwise: ", "") in texts[0]
        assert words[1].replace("placed otherwise: ", "") in texts[1]
        for line, text in ((found.first_line, found.first), (found.second_line, found.second)):
            assert (line is None) == (text == "none") or (line or 0) > 3


def test_the_base_of_a_keyframe_counts_in_the_frame_of_the_other_base() -> None:
    free = document('<keyframe><key name="up" qpos="1 2 3 1 0 0 0 0.2 0.3"/></keyframe>').replace(
        '<joint name="i" axis="1 0 0" range="-1 1"/>', "<freejoint/>"
    )
    moved = free.replace("1 2 3 1 0 0 0", "1 2 3.5 1 0 0 0")
    (found,), _ = compared(free, moved)
    assert "base" in found.first
    assert compared(free, free.replace('qpos="1 2 3 1 0 0 0', 'qpos="1 2 3 -1 0 0 0')) == ([], [])


def test_what_one_format_leaves_open_is_a_note() -> None:
    text = document(
        tendon() + '<equality><weld body1="a"/></equality><keyframe><key/></keyframe>',
        gravcomp='gravcomp="1"',
    )
    report = same_robot(text, dynx.load(text).to_urdf())
    notes = " ".join(report.notes)
    for words in ("states no tendons", "no equality constraints", "no gravity compensation", "no named conf"):
        assert words in notes


def test_a_mimic_joint_and_a_coupling_of_joints_are_named_together() -> None:
    coupled = document('<equality><joint name="e" joint1="j" joint2="k" polycoef="0.1 2"/></equality>')
    mimic = (
        dynx.load(coupled)
        .to_urdf()
        .replace(
            '<joint name="j" type="revolute">',
            '<joint name="j" type="revolute"><mimic joint="k" multiplier="2" offset="0.1"/>',
        )
    )
    report = same_robot(mimic, coupled)
    assert not report.same
    assert any("equality constraint" in each and "mimic" in each for each in report.notes)


MASSES = """<mujoco><worldbody><body name="b"><freejoint/>
<inertial mass="{}" pos="0 {} 0" fullinertia="{} 1 {} 0 0 0"/>
<body name="c" pos="0.1 0 0" gravcomp="0.5"><inertial mass="1" pos="0 0 0" diaginertia="0.1 0.1 0.1"/></body>
<body name="l" pos="0 0.3 0" gravcomp="{}"><joint name="j" axis="0 0 1"/>
<inertial mass="{}" pos="0.1 0 0" diaginertia="0.5 0.5 0.5"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("factor", ["0", "0.5"])
def test_mass_on_an_axis_is_compensated_at_either_body(factor: str) -> None:
    """Half a kilogram on the axis of j belongs to the body l or to its parent; both have the factor."""
    first = MASSES.format(4.0, 0.0, 1.0, 1.0, factor, 2.0)
    center = 0.5 * 0.3 / 4.5
    moment = 1.0 + 4.0 * center**2 + 0.5 * (0.3 - center) ** 2
    second = MASSES.format(4.5, center, moment, moment, factor, 1.5)
    # The child keeps its first moment about the axis, and its moment about the axis.
    second = second.replace('pos="0.1 0 0" diag', f'pos="{0.2 / 1.5} 0 0" diag')
    about = 0.5 + 2.0 * 0.01 - 1.5 * (0.2 / 1.5) ** 2
    second = second.replace('"0.5 0.5 0.5"', f'"0.5 {about} {about}"')
    if factor != "0":
        first, second = (
            each.replace('name="b"', f'name="b" gravcomp="{factor}"') for each in (first, second)
        )
    report = same_robot(first, second)
    assert report.same
    assert [each for each in report.attributes if each.kind == "gravity compensation"] == []
    stated = f'name="l" pos="0 0.3 0" gravcomp="{factor}"'
    other = second.replace(stated, stated.replace(f'"{factor}"', '"0.7"'))
    found = [each for each in same_robot(first, other).attributes if each.kind == "gravity compensation"]
    assert [each.theirs for each in found] == ["l"]
