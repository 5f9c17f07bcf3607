"""JUnit XML: parsed again, with every cause and quantity, whatever the names."""

from __future__ import annotations

from xml.etree import ElementTree

from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.formats import Baseline, junit_xml, read_baseline
from dynx.doctor.formats.baseline import differences
from tests.doctor.formats.reports import alike, differing, hostile, refused


def cases(text: str) -> dict[str, list[str]]:
    """Return the outcomes of every test case of the document, by name."""
    root = ElementTree.fromstring(text)
    return {str(case.get("name")): [child.tag for child in case] for case in root.iter("testcase")}


def test_a_case_for_each_rule_quantity_and_refusal() -> None:
    assert cases(junit_xml([differing()])) == {
        "mujoco loads the file": ["failure"],
        "mass matrix as loaded": ["failure"],
        "inverse dynamics as loaded": ["failure"],
        "DX901 planted-cause": ["failure"],
        "DX902 planted-rounding": ["failure"],
        "DX903 planted-practice": ["system-out"],
        "unexplained: inverse dynamics of pybullet": ["failure"],
    }
    assert cases(junit_xml([alike()])) == {"mass matrix as loaded": []}
    assert cases(junit_xml([refused()])) == {"the file can be examined": ["error"]}


def test_the_counts_are_those_of_the_cases() -> None:
    root = ElementTree.fromstring(junit_xml([differing(), alike(), refused()]))
    for element in [root, *root]:
        for key, tag in (("tests", "testcase"), ("failures", "failure"), ("errors", "error")):
            assert int(element.get(key, "-1")) == len(list(element.iter(tag)))
    assert [root.get(key) for key in ("tests", "failures", "errors")] == ["9", "6", "1"]


def test_a_failure_says_where_and_how_much() -> None:
    root = ElementTree.fromstring(junit_xml([differing()]))
    [failure] = [case[0] for case in root.iter("testcase") if case.get("name") == "DX901 planted-cause"]
    assert failure.text is not None
    assert "arm.urdf:3: link base" in failure.text
    assert "mass matrix off by 1900 %" in failure.text


def test_what_is_known_is_skipped_and_what_is_new_fails() -> None:
    report = differing()
    known = differences(report, "")
    assert {tag for tags in cases(junit_xml([report], Baseline("", known))).values() for tag in tags} == {
        "skipped",
        "system-out",
    }
    part = Baseline("", tuple(each for each in known if each.place.rule != "DX902"))
    found = cases(junit_xml([report], part))
    assert found["DX902 planted-rounding"] == ["failure"]
    assert found["DX901 planted-cause"] == ["skipped"]
    assert found["inverse dynamics as loaded"] == ["failure"]
    empty = read_baseline('{"schema": 1, "known": []}', "x.json")
    assert cases(junit_xml([report], empty)) == cases(junit_xml([report]))


@given(st.text())
def test_any_name_gives_a_document(text: str) -> None:
    report = differing(text, link=text, joint=text, message=text)
    assert len(cases(junit_xml([report, hostile()]))) >= 7
