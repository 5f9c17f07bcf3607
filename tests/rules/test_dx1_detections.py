"""DX101 to DX113: found where they were planted, on that link and in that line, and nowhere else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from dynx.agreement.tolerances import BAR
from dynx.engines.pybullet.file_checks import diagonalisation_error
from dynx.model.elements import Inertial, Pose
from dynx.model.library import DYNX_MODELS, robots
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, XmlSource
from dynx.rules import Case, all_rules, find_rule
from dynx.rules.inertia import NUMBERS_OF_THE_FILE, inertial_edits, rigid_groups, with_inertials
from tests.rules.documents import case_of, joint, link

RULES = [rule for rule in all_rules() if "DX101" <= rule.id <= "DX113"]
OWN = [entry.path for entry in robots() if entry.source == DYNX_MODELS and "dx" not in entry.name]

SOLID = Inertial(1.5, Pose((0.1, 0.02, 0.05)), ixx=0.02, iyy=0.03, izz=0.025)
"""Inertial without any of the causes."""


def clean(case: Case) -> Case:
    """Put the inertial `SOLID` into every link."""
    edits: list[Edit] = []
    for each in case.model.links:
        edits += inertial_edits(case.source, case.links[each.name], each.inertial, SOLID)
    return case.with_source(case.source.apply(*edits))


def robot(name: str, base: Base) -> Case:
    path = next(path for path in OWN if path.stem == name)
    return clean(Case(XmlSource(path.read_bytes()), base=base))


def findings(case: Case) -> list[tuple[str, str | None, int | None]]:
    return [(rule.id, found.link, found.line) for rule in RULES for found in rule.detect(case)]


def without_inertial(case: Case, name: str) -> Case:
    element = case.links[name].first("inertial")
    assert element is not None
    return case.with_source(case.source.apply(case.source.removal(element)))


PLANTS: dict[str, Inertial] = {
    # 0.001 + 0.009 < 0.01 in binary.
    "DX102": Inertial(1.0, Pose((0.1, 0.2, 0.3)), ixx=0.001, iyy=0.009, izz=0.01),
    "DX103": Inertial(1.0, ixx=0.01, iyy=0.02, izz=0.05),
    "DX104": Inertial(1.0, ixx=0.01, iyy=0.02, izz=0.015, ixy=0.03),
    "DX105": Inertial(1.0, ixx=0.025, iyy=0.022, izz=0.025, ixy=-3e-5, ixz=-1e-5),
    "DX108": Inertial(0.0, ixx=0.01, iyy=0.01, izz=0.01),
    "DX111": Inertial(1.0, ixx=0.01, iyy=0.01),
    "DX112": Inertial(1.0, Pose(rpy=(0.5, 0.0, 0.0)), ixx=0.01, iyy=0.02, izz=0.015),
}
TENSOR_TAG = {"DX108": "inertial", "DX112": "origin"}


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", [path.stem for path in OWN])
def test_a_clean_robot_has_no_finding(name: str, base: Base) -> None:
    assert findings(robot(name, base)) == []


@pytest.mark.parametrize("rule", PLANTS)
@pytest.mark.parametrize("name", [path.stem for path in OWN])
def test_a_planted_tensor_is_found_alone_on_its_link_and_line(name: str, rule: str) -> None:
    clean = robot(name, "fixed")
    moving = [joint.child for joint in clean.model.joints if joint.moves]
    for link_name in moving:
        case = with_inertials(clean, {link_name: PLANTS[rule]})
        element = case.links[link_name].first("inertial")
        assert element is not None
        inner = element.first(TENSOR_TAG.get(rule, "inertia")) or element
        assert findings(case) == [(rule, link_name, inner.line)]


@pytest.mark.parametrize("product", [1e-5, 1e-4, 5e-4, 1e-3, 2e-3, 3e-3, 0.0])
def test_a_tensor_is_found_where_what_bullet_makes_of_it_could_show(product: float) -> None:
    tensor = Inertial(1.5, SOLID.origin, 0.02, product, -product / 3.0, 0.03, product / 7.0, 0.025)
    error = diagonalisation_error(tensor)
    case = with_inertials(robot("six_axis_arm", "fixed"), {"forearm": tensor})
    found = [entry[:2] for entry in findings(case)]
    # A tenth of what counts as a difference: torques are sums over the links beyond a joint.
    assert found == [("DX105", "forearm")] if error > 0.1 * BAR else found in ([], [("DX105", "forearm")])
    assert product or not found


@pytest.mark.parametrize("name", [path.stem for path in OWN])
def test_a_link_without_inertial_is_found_where_it_can_move(name: str) -> None:
    bases: tuple[Base, Base] = ("fixed", "floating")
    for base in bases:
        clean = robot(name, base)
        for each in clean.model.links:
            case = without_inertial(clean, each.name)
            found = [entry for entry in findings(case) if entry[0] == "DX101"]
            moves = not rigid_groups(clean)[each.name].static
            wanted = [("DX101", each.name, case.links[each.name].line)]
            assert found == (wanted if moves and each.name != "world" else [])


@pytest.mark.parametrize(
    ("rule", "plant"),
    [(rule, plant) for rule, plant in PLANTS.items() if rule in ("DX103", "DX104", "DX111")],
)
def test_tensors_that_mujoco_refuses_are_found_in_static_links_too(rule: str, plant: Inertial) -> None:
    case = robot("six_axis_arm", "fixed")
    root = case.model.root
    assert [entry[:2] for entry in findings(with_inertials(case, {root: plant}))] == [(rule, root)]


def test_a_static_tensor_without_mass_that_no_body_has_is_found_and_cleared() -> None:
    case = robot("six_axis_arm", "fixed")
    root = case.model.root
    impossible = replace(PLANTS["DX103"], mass=0.0)
    for plant, found in ((PLANTS["DX108"], []), (impossible, [("DX108", root)])):
        planted = with_inertials(case, {root: plant})
        assert [entry[:2] for entry in findings(planted)] == found
    rule = find_rule("DX108")
    remedy = rule.remedy(planted, rule.detect(planted))
    assert remedy is not None
    assert findings(remedy.case) == []


def test_the_rotation_of_the_root_counts_on_the_fixed_base_alone() -> None:
    turned = Inertial(1.5, Pose((0.1, 0.02, 0.05), (0.0, 0.0, 0.3)), ixx=0.02, iyy=0.03, izz=0.025)
    expected: dict[Base, list[str]] = {"fixed": ["DX106"], "floating": ["DX112"]}
    for base, wanted in expected.items():
        case = robot("six_axis_arm", base)
        case = with_inertials(case, {case.model.root: turned})
        assert [entry[:2] for entry in findings(case)] == [(rule, case.model.root) for rule in wanted]


def test_a_massless_root_counts_on_the_floating_base_alone() -> None:
    expected: dict[Base, list[tuple[str, str]]] = {"fixed": [], "floating": [("DX107", "a")]}
    for base, wanted in expected.items():
        weld = joint("ab", "a", "b", type="fixed")
        bodies = (link("a", mass=0.0, moments=(0.0, 0.0, 0.0)), link("b"))
        case = case_of(*bodies, weld, base=base)
        assert [entry[:2] for entry in findings(case)] == wanted


def root_named_world(base: Base) -> Case:
    return case_of(link("world"), link("a"), joint("j", "world", "a"), base=base)


def link_named_world(base: Base) -> Case:
    return case_of(link("a"), link("world"), joint("j", "a", "world"), base=base)


@pytest.mark.parametrize(
    ("make", "base", "found"),
    [
        (root_named_world, "fixed", False),
        (root_named_world, "floating", True),
        (link_named_world, "fixed", True),
        (link_named_world, "floating", True),
    ],
)
def test_the_name_world_is_found_unless_it_is_the_root_of_a_fixed_robot(
    make: Callable[[Base], Case], base: Base, found: bool
) -> None:
    assert findings(make(base)) == (
        [("DX109", "world", 2 if make is root_named_world else 3)] if found else []
    )


EMPTY = (0.0, 0.0, 0.0)


def test_a_massless_link_in_the_middle_of_a_chain_is_not_one_at_its_end() -> None:
    between = case_of(
        *(link("a"), link("b", mass=0, moments=EMPTY), link("c")),
        joint("ab", "a", "b"),
        joint("bc", "b", "c"),
    )
    assert findings(between) == [("DX110", "b", 3)]
    end = case_of(
        *(link("a"), link("b"), link("c", mass=0, moments=EMPTY)),
        joint("ab", "a", "b"),
        joint("bc", "b", "c"),
    )
    assert findings(end) == [("DX113", "c", 4)]
    # Another branch has mass; a robot that has none anywhere is DX118.
    both = case_of(
        *(link("a"), link("b", mass=0, moments=EMPTY), link("c", mass=0, moments=EMPTY), link("d")),
        joint("ab", "a", "b"),
        joint("bc", "b", "c"),
        joint("ad", "a", "d"),
    )
    assert findings(both) == [("DX113", "b", 3), ("DX113", "c", 4)]


def test_what_is_welded_to_a_massless_link_counts_as_its_mass() -> None:
    case = case_of(
        *(link("a"), link("b", mass=0, moments=EMPTY), link("c")),
        joint("ab", "a", "b"),
        joint("bc", "b", "c", type="fixed"),
    )
    assert findings(case) == []


def test_two_points_welded_together_are_a_rod() -> None:
    points = link("b", moments=EMPTY), link("c", moments=EMPTY, center=(0.1, 0.2, 0.3))
    case = case_of(link("a"), *points, joint("ab", "a", "b"), joint("bc", "b", "c", type="fixed"))
    assert ("DX111", "b", 3) in findings(case)


def test_a_body_that_is_kept_is_not_found_again() -> None:
    case = robot("six_axis_arm", "fixed")
    moving = next(joint.child for joint in case.model.joints if joint.moves)
    case = with_inertials(case, {moving: PLANTS["DX103"]})
    kept = Case(case.source, choices={"DX103": "keep"})
    rule = find_rule("DX103")
    mended = rule.remedy(kept, rule.detect(kept))
    assert mended is not None
    assert mended.case.calls == set(NUMBERS_OF_THE_FILE)
    assert "--choose DX103=nearest" in (mended.choice or "")
    assert rule.detect(mended.case) == []


def test_tensors_of_two_rules_are_both_kept() -> None:
    bodies = case_of(*(link(name) for name in "abc"), joint("ab", "a", "b"), joint("bc", "b", "c"))
    source = with_inertials(bodies, {"b": PLANTS["DX103"], "c": PLANTS["DX104"]}).source
    case = Case(source, choices={"DX103": "keep", "DX104": "keep"})
    for name in ("DX103", "DX104"):
        rule = find_rule(name)
        remedy = rule.remedy(case, rule.detect(case))
        assert remedy is not None
        assert not remedy.changes_physics
        case = remedy.case
    for each in case.model.links[1:]:
        inertial = each.inertial
        assert inertial is not None
        assert (inertial.ixy, inertial.ixz, inertial.iyz) == (0.0, 0.0, 0.0)
        assert inertial.iyy == max(inertial.ixx, inertial.iyy, inertial.izz)
    assert [entry for entry in findings(case) if entry[0] != "DX112"] == []
