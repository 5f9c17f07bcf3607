"""Which remedies are applied, and what is said of them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor.diagnosis import diagnose
from dynx.doctor.examination import Examiner
from dynx.doctor.mending import all_except, mend, place_of, refusal
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.doctor.test_attribution import Replacement
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import trap


@pytest.mark.parametrize(("rule_id", "choice"), [("DX509", "drop"), ("DX511", "direct"), ("DX514", "full")])
def test_bad_practice_is_mended_where_the_user_chose_so(rule_id: str, choice: str) -> None:
    kept, rule = trap(rule_id), find_rule(rule_id)
    assert mend(kept).case.source.data == kept.source.data
    mended = mend(trap(rule_id, **{rule_id: choice}))
    assert not rule.detect(mended.case)
    assert f"{rule_id}={choice}: {rule.choices[choice]}" in mended.choices[0]


class Opinion(Replacement):
    """A rule about practice that would edit if it were asked."""

    kind = "practice"


def test_practice_is_left_alone_whatever_its_rule_could_do() -> None:
    rule, case = Opinion("old", "new"), case_of(link("base"), "<!-- old -->")
    assert mend(case, [rule]).case is case
    asked = mend(replace(case, choices={rule.id: "edit"}), [rule])
    assert "<!-- new -->" in asked.case.source.text


def test_a_change_of_the_physics_is_said() -> None:
    replaced = mend(trap("DX103", DX103="nearest"))
    assert [said for said in replaced.choices if said.startswith("DX103 changed the physics of the robot")]
    assert not [said for said in mend(trap("DX101")).choices if "physics" in said]


@pytest.mark.parametrize("rule_id", ["DX103", "DX104"])
def test_the_numbers_of_the_file_are_kept_by_calls(rule_id: str) -> None:
    kept = mend(trap(rule_id, **{rule_id: "keep"}))
    engines = [engine for engine in ("pinocchio", "pybullet", "drake") if engine in installed_engines()]
    after = Examiner(engines, 3, 0).examine(kept.case)
    assert all(after.max_error(engine) <= BAR for engine in engines)


def test_a_place_that_is_left_out_stays_as_it_is() -> None:
    case, rule = trap("DX101"), find_rule("DX101")
    (found,) = rule.detect(case)
    assert mend(case, wanted=all_except({place_of(rule, found)})).case.source.data == case.source.data
    assert not rule.detect(mend(case).case)


def test_a_refusal_names_the_first_fault_that_has_no_remedy_at_its_line() -> None:
    unlimited = joint("elbow", "base", "arm", limit="")
    lost = joint("wrist", "hand", "tool")
    case = case_of(link("base"), link("arm"), unlimited, link("tool"), lost)
    assert "no <limit>" in str(case.reading)
    assert str(refusal(case)) == (
        "<string>:6: parent of joint 'wrist' is 'hand', which is not a link; known: base, arm, tool"
    )
    shifted = Case(XmlSource("\n\n" + case.source.text))
    assert str(refusal(shifted)).startswith("<string>:8: parent of joint 'wrist'")
    assert refusal(case_of(link("base"), link("arm"), unlimited)) is None


@pytest.mark.skipif(
    not {"pinocchio", "drake"} <= set(installed_engines()), reason="engines that refuse second roots"
)
def test_causes_that_show_after_the_remedy_of_others_are_found_and_proved() -> None:
    """The tree falls apart without Drake's joint, and has two roots once the world is declared."""
    ball = '<drake:joint name="ball" type="ball"><parent link="a"/><child link="b"/></drake:joint>'
    case = case_of(
        *(link("a"), link("b"), link("c"), link("d")),
        joint("mount", "world", "a", type="fixed"),
        ball,
        joint("j", "b", "c"),
        joint("k", "c", "d"),
    )
    assert not find_rule("DX223").detect(case)
    report = diagnose(case.source.text, counterexamples=False)
    assert report.explained, report.unexplained
    assert {each.rule for each in report.differences} >= {"DX109", "DX223", "DX227"}
    assert all(each.proved for each in report.differences)
    (second_root,) = (each for each in report.findings if each.rule == "DX223")
    assert (second_root.link, second_root.line) == ("world", 1)
    assert report.mended is not None
    assert diagnose(report.mended, counterexamples=False).alike
