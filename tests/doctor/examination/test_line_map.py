"""Lines of findings in the user's file where dynx reads a mended one."""

from __future__ import annotations

from dynx.doctor.examination import with_original_lines
from dynx.doctor.mending import detections, readable
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.registry import trap_case


def test_lines_behind_an_inserted_chain_of_joints_are_those_of_the_file() -> None:
    text = trap_case("DX210").source.text.replace("</robot>", '  <link name="frame"/>\n</robot>')
    text = text.replace(
        "</robot>",
        '  <joint name="f" type="fixed"><parent link="slider"/><child link="frame"/></joint>\n</robot>',
    )
    case, rules = Case(XmlSource(text)), [find_rule("DX101"), find_rule("DX210")]
    sound = readable(case).case
    found = detections(case, rules)
    right = text.splitlines().index('  <link name="frame"/>') + 1
    assert [each.line for rule, each in found if rule.id == "DX101"] != [right]
    placed = with_original_lines(found, case.source, sound.source)
    assert [each.line for rule, each in placed if rule.id == "DX101"] == [right]
    assert [each for rule, each in placed if rule.id == "DX210"] == [
        each for rule, each in found if rule.id == "DX210"
    ]
