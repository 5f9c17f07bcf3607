"""Line ends: lines are counted as XML counts them, and text that PyBullet loses is found."""

from __future__ import annotations

import pytest

from dynx.doctor import diagnose
from dynx.loaded import installed_engines
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.registry import trap_case

TEXT = trap_case("DX101").source.text
RULE = find_rule("DX422")


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r", "\r\r\n", "\r \t\n"])
def test_a_line_end_is_reported_where_text_follows_a_lone_carriage_return(end: str) -> None:
    case = Case(XmlSource(TEXT.replace("\n", end), "robot.urdf"))
    found = RULE.detect(case)
    assert bool(found) == (end == "\r")
    if not found:
        return
    assert [(each.link, each.joint, each.line) for each in found] == [(None, None, 1)]
    remedy = RULE.remedy(case, found)
    assert remedy is not None
    assert remedy.case.source.text == TEXT
    assert not RULE.detect(remedy.case)


def test_a_single_place_is_reported_at_its_line() -> None:
    lines = TEXT.splitlines(keepends=True)
    lines[4] = lines[4].replace("\n", "\r")
    [found] = RULE.detect(Case(XmlSource("".join(lines))))
    assert (found.line, found.message) == (5, "a line ends with a carriage return alone")


def test_faults_of_a_file_with_carriage_returns_have_the_lines_of_the_file_with_line_feeds() -> None:
    engines = [name for name in ("pinocchio", "pybullet") if name in installed_engines()]
    right, found = (diagnose(text, engines=engines, samples=1) for text in (TEXT, TEXT.replace("\n", "\r")))
    places = {(each.rule, each.link, each.line) for each in found.findings if each.rule != "DX422"}
    assert places == {(each.rule, each.link, each.line) for each in right.findings}
    assert found.explained
    if "pybullet" in engines:
        assert found.mended is not None
        assert "\r" not in found.mended
        assert [each.level for each in found.changes if each.rule == "DX422"] == ["safe"]
