"""Rules in files with other defects: regressions that the planted defects have found."""

from __future__ import annotations

import re

import pytest

from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.registry import trap_case
from tests.rules.documents import case_of, joint, link


def changed_trap(rule: str, old: str, new: str, count: int = 1) -> Case:
    """Return the trap of a rule with some text replaced."""
    case = trap_case(rule)
    text = case.source.text.replace(old, new, count)
    assert text != case.source.text
    return Case(XmlSource(text), case.base)


def test_a_floating_joint_at_the_root_is_no_joint_of_several_freedoms_in_an_unreadable_file() -> None:
    case = changed_trap("DX211", 'upper="3.2"', 'upper="inf"')
    assert not case.readable
    assert not find_rule("DX210").detect(case)
    inside = Case(XmlSource(case.source.text.replace('<mass value="0"/>', '<mass value="1"/>')))
    assert [each.joint for each in find_rule("DX210").detect(inside)] == ["free"]


@pytest.mark.parametrize("kind", ["spherical", "planar", "floating"])
def test_links_between_the_joints_of_a_split_one_weigh_what_every_engine_takes(kind: str) -> None:
    text = trap_case("DX210").source.text.replace('type="planar"', f'type="{kind}"')
    case = Case(XmlSource(text))
    rule = find_rule("DX210")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert not find_rule("DX110").detect(remedy.case)


def test_a_range_without_upper_end_pushes_in_no_engine() -> None:
    rule = find_rule("DX306")
    text = trap_case(rule).source.text
    assert rule.detect(trap_case(rule))
    open_ended = re.sub(r' lower="[^"]*" upper="[^"]*"', "", text)
    assert not rule.detect(Case(XmlSource(open_ended)))


@pytest.mark.parametrize("rule", ["DX215", "DX307"])
def test_a_joint_without_effort_has_no_actuator(rule: str) -> None:
    text = re.sub(r'effort="[^"]*"', 'effort="0"', trap_case(rule).source.text)
    assert find_rule(rule).detect(trap_case(rule))
    assert not find_rule(rule).detect(Case(XmlSource(text)))


def test_a_tensor_of_dust_is_raised_unless_the_whole_robot_is_dust() -> None:
    rule = find_rule("DX111")
    dust = '<inertia ixx="1e-15" ixy="0" ixz="0" iyy="1e-15" iyz="0" izz="1e-15"/>'
    body = '<link name="{}"><inertial><mass value="{}"/>{}</inertial></link>'
    heavy = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    hinge = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>'
    for other, mends in ((heavy, True), (dust, False)):
        links = body.format("a", 1, other) + body.format("b", 2, dust)
        case = Case(XmlSource(f'<robot name="r">{links}{hinge}</robot>'))
        found = [each for each in rule.detect(case) if each.link == "b"]
        assert len(found) == 1
        remedy = rule.remedy(case, found)
        assert (remedy is not None) == mends
        if remedy is not None:
            assert remedy.changes_physics
            assert not rule.detect(remedy.case)


def test_point_masses_at_their_joints_are_raised_where_the_joints_are_apart() -> None:
    rule = find_rule("DX111")
    for apart, mends in (("0.1 0 0", True), ("0 0 0", False)):
        points = (link(name, moments=(0.0, 0.0, 0.0)) for name in "ab")
        case = case_of(*points, joint("ab", "a", "b", f'<origin xyz="{apart}"/>'))
        found = rule.detect(case)
        assert [each.link for each in found] == ["b"]
        remedy = rule.remedy(case, found)
        assert (remedy is not None) == mends
        if remedy is not None:
            assert not rule.detect(remedy.case)


def test_a_point_mass_on_a_link_without_inertial_is_merged_with_it_beside_another_point_mass() -> None:
    point = (0.0, 0.0, 0.0)
    case = case_of(
        *(link("base"), '<link name="empty"/>', link("tip", moments=point), link("end", moments=point)),
        *(joint("a", "base", "empty"), joint("b", "empty", "tip", type="fixed"), joint("c", "tip", "end")),
    )
    rule = find_rule("DX111")
    assert [each.link for each in rule.detect(case)] == ["empty", "end"]
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    assert not rule.detect(remedy.case)
