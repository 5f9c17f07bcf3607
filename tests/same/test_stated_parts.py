"""Tendons, equality constraints and keyframes that differ have an effect, and a mended text without them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.same import SameReport, same_robot

KINDS = ("tendon", "equality", "configuration")

ROBOT = """<mujoco><compiler angle="radian"/><worldbody><!-- kept -->
<body name="a" pos="0 0 1"><inertial pos="0.1 0 0.05" mass="1" diaginertia="0.1 0.2 0.25"/>
<joint name="i" axis="0 1 0" range="-1 1"/>
<body name="b" pos="0 0 -0.3"><inertial pos="0.1 0.2 0.3" mass="2" diaginertia="0.1 0.2 0.25"/>
<joint name="j" axis="{axis}" range="-1 1"/>
<body name="c" pos="0.1 0.2 0.3" quat="{turned}"><inertial pos="{com}" mass="1" diaginertia="{moments}"/>
<joint name="k" type="ball"/></body></body></body></worldbody>
{sections}</mujoco>"""


def robot(*sections: str, other: bool = False) -> str:
    """Write the robot; the `other` one has a reversed axis, and a turned frame of its last link."""
    values = {"axis": "1 0 0", "turned": "1 0 0 0", "com": "0.1 0 0.05", "moments": "0.1 0.2 0.25"}
    if other:
        # A quarter turn about z: x of the new frame is y of the old one.
        half = "0.7071067811865476 0 0 0.7071067811865476"
        values = {"axis": "-1 0 0", "turned": half, "com": "0 -0.1 0.05", "moments": "0.2 0.1 0.25"}
    return ROBOT.format(sections="\n".join(sections), **values)


def tendon(coefficient: float = 2.0, attributes: str = 'stiffness="10" springlength="0.5"') -> str:
    joints = f'<joint joint="i" coef="1"/><joint joint="j" coef="{coefficient}"/>'
    return f'<tendon><fixed name="t" {attributes}>{joints}</fixed></tendon>'


def equality(text: str) -> str:
    return f"<equality>{text}</equality>"


def keyframe(qpos: str) -> str:
    return f'<keyframe><key name="home" qpos="{qpos}"/></keyframe>'


def assert_mended(first: str, report: SameReport, second: str) -> None:
    mujoco = pytest.importorskip("mujoco")
    assert report.same
    assert report.mended_text is not None
    again = same_robot(first, report.mended_text)
    assert again.same
    assert [each for each in again.attributes if each.kind in KINDS] == []
    assert "<!-- kept -->" in report.mended_text.decode()
    assert mujoco.MjModel.from_xml_string(report.mended_text.decode()).nv == dynx.load(second).nv


CONNECT = '<connect name="e" body1="c" anchor="{} 0 0"/>'
WELD = '<weld name="w" body1="a" body2="c" relpose="0 0 {} 1 0 0 0"/>'
COUPLING = '<joint name="e" joint1="i" joint2="j" polycoef="0.1 {} 0 0 0"/>'

CASES = {
    "stiffness": (tendon(), tendon(-2.0, 'stiffness="12" springlength="0.5"')),
    "coefficient": (tendon(), tendon(-2.5)),
    "no tendon": (tendon(), ""),
    "another tendon": ("", tendon()),
    "a range": (tendon(2.0, 'range="-1 2"'), tendon(-2.0, 'range="-1 3"')),
    "anchor": (equality(CONNECT.format("0.1")), equality(CONNECT.format("0.2"))),
    "weld": (equality(WELD.format("0.1")), equality(WELD.format("0.2"))),
    "coupling": (equality(COUPLING.format("2")), equality(COUPLING.format("3"))),
    "no constraint": (equality(COUPLING.format("2")), ""),
    "another constraint": ("", equality(COUPLING.format("2"))),
    "keyframe": (keyframe("0.1 0.2 1 0 0 0"), keyframe("0.1 -0.4 1 0 0 0")),
    "attitude of a ball": (keyframe("0.1 0.2 0.8 0.6 0 0"), keyframe("0.1 -0.2 1 0 0 0")),
    "no keyframe": (keyframe("0.1 0.2 1 0 0 0"), ""),
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("other", [False, True])
def test_a_difference_is_mended_in_the_coordinates_of_the_second(case: str, other: bool) -> None:
    one, two = CASES[case]
    first, second = robot(one), robot(two, other=other)
    report = same_robot(first, second)
    assert any(each.kind in KINDS for each in report.attributes)
    assert_mended(first, report, second)


def test_all_parts_are_mended_at_once_beside_an_element() -> None:
    one = [tendon(), equality(COUPLING.format("2")), keyframe("0.1 0.2 1 0 0 0")]
    two = [tendon(3.0), equality(COUPLING.format("3")), keyframe("0.1 0.4 1 0 0 0")]
    first, second = robot(*one), robot(*two).replace('mass="2"', 'mass="2.5"')
    report = same_robot(first, second)
    assert [each.theirs for each in report.differences] == ["b"]
    assert report.mended_text is not None
    again = same_robot(first, report.mended_text)
    assert again.same
    assert again.attributes == ()


def effects(first: str, second: str) -> dict[str, float]:
    (attribute,) = (each for each in same_robot(first, second).attributes if each.kind in KINDS)
    return {each.quantity: each.size for each in attribute.effects}


def test_effects_are_those_of_closed_forms() -> None:
    q = dynx.load(robot()).random(np.random.default_rng(0), 4)
    changed = effects(robot(tendon(2.0, "")), robot(tendon(2.5, "")))
    assert changed["length of the tendon"] == pytest.approx(0.5 * np.max(np.abs(q[:, 1])))
    assert changed["effort of a joint"] == 0.0
    stiffer = effects(robot(tendon()), robot(tendon(2.0, 'stiffness="12" springlength="0.5"')))
    stretch = np.abs(q[:, 0] + 2.0 * q[:, 1] - 0.5)
    assert stiffer["effort of a joint"] == pytest.approx(2.0 * 2.0 * float(np.max(stretch)))
    coupling = effects(robot(equality(COUPLING.format("2"))), robot(equality(COUPLING.format("3"))))
    assert coupling == {"error of the coupling": pytest.approx(float(np.max(np.abs(q[:, 1]))))}
    weld = effects(robot(equality(WELD.format("0.1"))), robot(equality(WELD.format("0.2"))))
    assert weld == {"gap of the constraint": pytest.approx(0.1), "rotation of the constraint": 0.0}
    home = effects(robot(keyframe("0.1 0.2 1 0 0 0")), robot(keyframe("0.1 0.4 1 0 0 0")))
    assert home["position of a joint"] == pytest.approx(0.2)
    # The link c is at (0.1, 0.2, 0.3) from the axis x of j.
    assert home["position of a link"] == pytest.approx(2.0 * np.sin(0.1) * np.hypot(0.2, 0.3))


@pytest.mark.parametrize(
    ("first", "second", "mended"),
    [
        ("0.1 0.2 1 0 0 0", "1e-1 -.40  2 0 0 0", "1e-1 0.2  2 0 0 0"),
        ("0.1 0.2 0.8 0.6 0 0", "1.0E-1 .2 1 0 0 0", "1.0E-1 .2 0.8 0.6 0 0"),
        ("0.1 0.2 1 0 0 0", "0.3", "0.1 0.2"),
    ],
)
def test_only_the_entries_of_a_keyframe_that_differ_are_changed(first: str, second: str, mended: str) -> None:
    text = robot(keyframe(second).replace("/></key", ' qvel="1 2 3 4 5" ctrl=""/></key'))
    report = same_robot(robot(keyframe(first)), text)
    assert report.mended_text is not None
    assert report.mended_text.decode() == text.replace(f'"{second}"', f'"{mended}"')


def test_only_the_attributes_of_a_tendon_that_differ_are_changed() -> None:
    given = 'stiffness="{}" springlength="+0.5" range="-1.0 {}" limited="true"'
    text = robot(tendon(2.0, given.format("12.0", "2")))
    for stiffness, end, factor in (("10.0", "2", 2.0), ("12.0", "3", 2.0), ("12.0", "2", 2.5)):
        report = same_robot(robot(tendon(factor, given.format(stiffness, end))), text)
        assert report.mended_text is not None
        wanted = tendon(factor, given.format(float(stiffness), end if end == "2" else float(end)))
        assert report.mended_text.decode() == robot(wanted)


@pytest.mark.parametrize("stiffness", [0, 3])
def test_the_length_of_a_spring_of_a_tendon_follows_its_coefficients(stiffness: float) -> None:
    spring = f'name="j" stiffness="{stiffness}" springref="0.5"'
    one, two = (robot(tendon(factor, 'stiffness="10"')) for factor in (2.0, 3.0))
    first, second = (each.replace('name="j"', spring) for each in (one, two))
    report = same_robot(first, second)
    assert report.mended_text is not None
    assert same_robot(first, report.mended_text).attributes == ()
    # Without a spring at the joint, a model does not keep its reference.
    if stiffness:
        assert report.mended_text.decode() == first


def test_settings_of_a_constraint_are_mended_alone() -> None:
    site = '<site name="s" pos="0.1 0 0"/><joint name="k"'
    text = robot(equality('<connect name="e" site1="s" site2="w" solref="0.02 1"/>'))
    text = text.replace('<joint name="k"', site).replace("<body", '<site name="w"/><body', 1)
    report = same_robot(text, text.replace("0.02 1", "0.03 1"))
    assert report.mended_text is not None
    assert report.mended_text.decode() == text


def test_a_part_of_a_file_that_is_included_is_named_in_a_note(tmp_path: Path) -> None:
    (tmp_path / "parts.xml").write_text(f"<mujoco>{tendon(3.0)}</mujoco>")
    (tmp_path / "robot.xml").write_text(robot('<include file="parts.xml"/>'))
    report = same_robot(robot(tendon()), tmp_path / "robot.xml")
    assert report.mended_text is None
    assert any("tendon t is not mended" in each for each in report.notes)


def test_notes_on_parts_that_are_not_mended_leave_those_on_the_texts(tmp_path: Path) -> None:
    text = robot('<include file="parts.xml"/>')
    (tmp_path / "parts.xml").write_text(f"<mujoco>{tendon(3.0)}</mujoco>")
    (tmp_path / "robot.xml").write_text(text.replace("<joint ", '<joint margin="0.1" ', 1))
    report = same_robot(robot(tendon()), tmp_path / "robot.xml")
    for words in ("tendon t is not mended", "not read of <joint>: margin"):
        assert any(words in each for each in report.notes)
