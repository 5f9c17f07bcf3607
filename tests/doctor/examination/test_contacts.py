"""Links in contact are named, at states within limits in which mimic joints follow."""

from __future__ import annotations

import json

import numpy as np
import pytest

from dynx.doctor.diagnosis import compare_as_loaded, diagnose
from dynx.doctor.examination import (
    Examiner,
    deepest_contact,
    describe_contacts,
    following_positions,
    links_in_contact,
    model_without_mimics,
)
from dynx.doctor.formats import wording
from dynx.loaded import installed_engines
from dynx.model.tree import Base
from dynx.rules import Case
from dynx.rules.registry import trap_case
from tests.rules.documents import case_of, joint, link

pytestmark = pytest.mark.skipif("mujoco" not in installed_engines(), reason="MuJoCo is not installed")

BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'


def gripper(mimic: str) -> Case:
    """Make two fingers that meet only where the second does not follow the first."""
    fingers = [link(name, BALL) for name in ("left", "right")]
    slides = [
        joint("left_slide", "base", "left", '<origin xyz="0 0.5 0"/>', type="prismatic"),
        joint("right_slide", "base", "right", f'<origin xyz="0 -0.5 0"/>{mimic}', type="prismatic"),
    ]
    return case_of(link("base"), *fingers, *(each.replace("0 0 1", "0 1 0") for each in slides))


def test_mimic_joints_follow() -> None:
    case = gripper('<mimic joint="left_slide" multiplier="2" offset="0.1"/>')
    names = model_without_mimics(case.source, case.base).joint_names
    q = following_positions(case, 5, 0)
    left, right = (q[:, names.index(name)] for name in ("left_slide", "right_slide"))
    np.testing.assert_array_equal(right, 2.0 * left + 0.1)
    assert len(set(left)) == 5


def test_fingers_that_follow_do_not_touch() -> None:
    assert not links_in_contact(gripper('<mimic joint="left_slide"/>'), "mujoco", 0)
    assert {*links_in_contact(gripper(""), "mujoco", 0)} == {("left", "right")}
    assert "none touch" in describe_contacts(gripper('<mimic joint="left_slide"/>'), "mujoco", 0)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_the_links_of_the_shapes_are_named_and_not_those_they_are_merged_into(base: Base) -> None:
    hand = [link("hand"), link("pad", BALL, BALL), joint("grip", "hand", "pad", type="fixed")]
    ground = [link("world"), link("table", BALL), joint("stand", "world", "table", type="fixed")]
    slide = joint("slide", "table", "wrist", type="prismatic")
    turn = joint("turn", "wrist", "hand")
    case = case_of(*ground, link("wrist"), *hand, slide, turn, base=base)
    report = diagnose(case.source.text, base=base, counterexamples=False)
    (finding,) = (each for each in report.findings if each.rule == "DX308")
    assert finding.proved
    assert "pad and table touch in" in finding.message
    assert finding.message.count(" touch in ") == 1


def test_a_renamed_link_has_its_name_in_the_file() -> None:
    parts = [link("world", BALL, mass=2.0), link("wrist"), link("pad", BALL)]
    joints = [joint("slide", "world", "wrist", type="prismatic"), joint("turn", "wrist", "pad")]
    report = diagnose(case_of(*parts, *joints).source.text, base="floating", counterexamples=False)
    assert "DX109" in {each.rule for each in report.differences}
    (finding,) = (each for each in report.differences if each.rule == "DX308")
    assert "pad and world touch in" in finding.message


def test_an_engine_without_contacts_and_one_that_refuses_the_file_name_none() -> None:
    assert not links_in_contact(gripper(""), "pinocchio", 0)
    refused = case_of(link("base"), '<link name="a"/>', joint("j", "base", "a"))
    assert describe_contacts(refused, "mujoco", 0) == ""


def test_contacts_are_present_and_their_links_named() -> None:
    report = diagnose(trap_case("DX308").source.text, counterexamples=False)
    (finding,) = (each for each in report.differences if each.rule == "DX308")
    assert finding.proved
    assert "slider and upper touch in" in finding.message
    assert "mm deep" in finding.message
    assert wording.effect(finding.effect) == "contact forces present"
    assert json.loads(json.dumps(report.to_dict()))["findings"][0]["effect"]["relative_error"] is None


def swing(size: float, away: float = 0.0) -> Case:
    """Make an arm whose tip, a ball, meets a post beside its first joint in a few of 100 states.

    `away` lifts the post, so that they never meet.
    """
    ball = f'<geometry><sphere radius="{size}"/></geometry></collision>'
    return case_of(
        link("base"),
        link("column", mass=2.0),
        link("arm", f'<collision><origin xyz="1 0 0"/>{ball}', center=(0.3, 0.0, 0.0)),
        link("post", f'<collision><origin xyz="0.6 0.8 {away}"/>{ball}'),
        joint("lift", "base", "post"),
        joint("turn", "base", "column"),
        joint("bend", "column", "arm", '<origin xyz="0 0 0"/>'),
    )


@pytest.mark.parametrize("seed", range(3))
def test_contacts_at_rare_states_are_found_and_proved(seed: int) -> None:
    """The tip meets the post in 3 of 100 states; parent and child of a fixed joint are one body in MuJoCo."""
    case = swing(0.02)
    report = diagnose(case.source.text, seed=seed, counterexamples=False)
    (finding,) = report.differences
    assert (finding.rule, finding.engines, finding.proved) == ("DX308", ("mujoco",), True)
    assert "arm and post touch in" in finding.message
    assert not report.alike
    assert report.explained
    assert [call.engine for call in report.calls] == ["mujoco"]
    assert report.mended is None
    assert report.remaining <= report.tolerance


def test_comparing_without_causes_looks_for_rare_contacts_too() -> None:
    found = compare_as_loaded(swing(0.02).source.text)
    before = {each.engine: max(each.before.values()) for each in found.engines}
    assert not found.alike
    assert {engine for engine, error in before.items() if error > found.tolerance} == {"mujoco"}


def test_links_that_never_touch_are_alike() -> None:
    report = diagnose(swing(0.02, away=0.2).source.text, counterexamples=False)
    assert report.alike
    assert not report.differences
    assert compare_as_loaded(swing(0.02, away=0.2).source.text).alike


def test_a_rare_contact_is_found_beside_other_causes() -> None:
    text = swing(0.02).source.text.replace("<axis", '<dynamics damping="0.1"/><axis', 1)
    report = diagnose(text, counterexamples=False)
    assert {each.rule for each in report.differences} == {"DX301", "DX308"}
    assert all(each.proved for each in report.differences)


def test_positions_are_added_to_the_random_states() -> None:
    case = swing(0.02)
    plain = Examiner(["mujoco"], 3, 0)
    positions = deepest_contact(case, ["pinocchio", "mujoco"], 0)
    assert positions is not None
    reference = plain.at(positions).reference(case)
    names = reference.model.joint_names
    np.testing.assert_array_equal(reference.states.q[:3], plain.reference(case).states.q)
    np.testing.assert_array_equal(reference.states.q[3], [positions[name] for name in names])
    assert deepest_contact(swing(0.02, away=0.2), ["mujoco"], 0) is None
