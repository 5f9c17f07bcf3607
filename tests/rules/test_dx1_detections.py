"""DX101 to DX113: found where they were planted, on that link and in that line, and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from dynx.agreement.tolerances import BAR
from dynx.doctor import DoctorReport, diagnose
from dynx.doctor.report import results_document
from dynx.engines.pybullet.file_checks import diagonalisation_error
from dynx.loaded import installed_engines
from dynx.model.elements import Inertial, Pose
from dynx.model.library import DYNX_MODELS, robots
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, XmlSource
from dynx.rules import Case, all_rules, find_rule
from dynx.rules.inertia import NUMBERS_OF_THE_FILE, inertial_edits, rigid_groups, with_inertials
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import mended

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


DYNAMICS = {"mass_matrix", "inverse_dynamics", "forward_dynamics"}
ZERO = {"mass": 0.0, "moments": (0.0, 0.0, 0.0)}


def report_on(*links: str, base: Base = "fixed", **options: object) -> DoctorReport:
    """Diagnose a robot of three links in a row."""
    parts = *links, joint("elbow", "a", "b"), joint("wrist", "b", "c")
    return diagnose(case_of(*parts).source.text, base=base, **options)  # type: ignore[arg-type]


def bare(*names: str) -> list[str]:
    """Write links without inertial."""
    return [f'<link name="{name}"/>' for name in names]


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize(
    "links",
    [
        bare("a", "b", "c"),
        [link(name, mass=0.0, moments=(0.0, 0.0, 0.0)) for name in "abc"],
        [*bare("a", "b"), link("c", mass=0.0, moments=(0.0, 0.0, 0.0))],
    ],
)
def test_one_finding_and_no_invented_mass(links: Sequence[str], base: Base) -> None:
    report = report_on(*links, base=base)
    assert [each.rule for each in report.differences] == ["DX118"]
    assert report.kinematics_only
    assert report.explained
    assert not report.alike
    assert report.mended is None
    assert report.total_mass == 0.0
    assert report.verdict == "no inertial data: the dynamics cannot be compared"
    assert report.status == "massless"
    assert not report.variants_off
    for engine in report.engines:
        assert not DYNAMICS.intersection(engine.before)
        absent = engine.refused is not None or engine.not_used is not None
        assert absent or engine.before.keys() == {"forward_kinematics", "jacobian"}


@pytest.mark.parametrize(
    ("links", "words"),
    [
        (bare("a", "b"), "no link has an <inertial>"),
        (
            [*bare("a"), link("b", mass=0.0, moments=(0.0, 0.0, 0.0))],
            "of 2 links 1 have no <inertial>, and no ",
        ),
    ],
)
def test_the_finding_counts_the_links_without_inertial(links: Sequence[str], words: str) -> None:
    case = case_of(*links, joint("j", "a", "b"))
    (detection,) = find_rule("DX118").detect(case)
    assert words in detection.message


def test_the_plain_call_counts_the_links_without_a_collision_shape() -> None:
    shape = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    parts = [link("a"), link("b", shape), link("c"), joint("j", "a", "b"), joint("k", "b", "c")]
    (detection,) = find_rule("DX115").detect(case_of(*parts))
    words = (
        "the inertia of the 2 links that move is computed from collision shapes; 1 of them has no such shape"
    )
    assert detection.message.endswith(words)


def test_mass_that_cannot_move_is_none() -> None:
    assert report_on(link("a", mass=4.0), *bare("b", "c")).kinematics_only
    floating = report_on(link("a", mass=4.0), *bare("b", "c"), base="floating")
    assert not floating.kinematics_only
    assert "DX118" not in {each.rule for each in floating.findings}


@pytest.mark.parametrize("engines", [[each] for each in installed_engines()])
def test_no_engine_alone_makes_the_file_alike(engines: list[str]) -> None:
    report = report_on(*bare("a", "b", "c"), engines=engines)
    assert [each.rule for each in report.differences] == ["DX118"]
    assert report.explained
    assert not report.alike


def test_a_robot_that_cannot_move_needs_no_mass() -> None:
    parts = *bare("a", "b"), joint("glue", "a", "b", type="fixed")
    report = diagnose(case_of(*parts).source.text)
    assert not report.kinematics_only
    assert "DX118" not in {each.rule for each in report.findings}


def test_other_causes_are_still_found_and_mended() -> None:
    links = [each.replace("/>", ">" + SHAPE + "</link>") for each in bare("a")] + bare("b", "c")
    tabbed = joint("elbow", "a", "b", '<origin xyz="0.1 0.2,0.3"/>')
    report = diagnose(case_of(*links, tabbed, joint("wrist", "b", "c")).source.text)
    assert {"DX118", "DX402"} <= {each.rule for each in report.differences}
    assert report.mended is not None
    assert report.explained
    assert "further cause" in report.verdict
    after = diagnose(report.mended)
    assert [each.rule for each in after.differences] == ["DX118"]


SHAPE = '<collision><geometry><mesh filename="a.stl"/></geometry></collision>'


def test_the_least_inertia_is_a_choice_that_changes_the_physics() -> None:
    report = report_on(*bare("a", "b", "c"), choose={"DX118": "least"})
    assert not report.alike
    assert report.explained
    if "mujoco" in installed_engines():
        assert report.mended is not None
        assert any("DX118 changed the physics" in each for each in report.choices)
        assert all(each.refused_after is None for each in report.engines)


def test_the_summary_counts_such_robots_by_themselves() -> None:
    reports = [report_on(*bare("a", "b", "c")), report_on(*(link(name) for name in "abc"))]
    summary = results_document(reports)["summary"]
    assert summary["massless"] == 1
    assert summary["explained"] == sum(each.status == "explained" for each in reports)
    assert summary["robots"] == 2


@pytest.mark.parametrize("links_with_shape", [1, 2])
def test_a_cause_of_a_refusal_has_that_effect_without_masses_too(links_with_shape: int) -> None:
    if "mujoco" not in installed_engines():
        pytest.skip("needs mujoco")
    shape = '<collision><geometry><box size="0 0 0"/></geometry></collision>'
    flat = [f'<link name="{name}">{shape}</link>' for name in "abc"[3 - links_with_shape :]]
    report = report_on(*bare(*"abc"[: 3 - links_with_shape]), *flat, engines=("pinocchio", "mujoco"))
    refusals = [each for each in report.findings if each.rule == "DX425"]
    assert len(refusals) == links_with_shape
    for each in refusals:
        assert each.effect is not None
        assert (each.effect.quantity, each.engines, each.proved) == ("loading", ("mujoco",), True)
    assert report.mended is not None
    assert "collision" not in report.mended
    assert report.kinematics_only


mujoco = pytest.importorskip("mujoco")

NONE, SAME_FRAME, SAME_ROTATION = 0, 1, 3
RULE = find_rule("DX117")


def rotor(xyz: str = "0 0 0", rpy: str = "0 0 0", moments: str = "3 2 1.5", ixy: str = "0") -> Case:
    """Make the case of an arm with one inertial."""
    ixx, iyy, izz = moments.split()
    arm = (
        f'<link name="arm"><inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="2"/>'
        f'<inertia ixx="{ixx}" ixy="{ixy}" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/></inertial></link>'
    )
    return case_of(link("base"), arm, joint("elbow", "base", "arm"))


def mark(case: Case, folder: Path) -> int:
    """Return MuJoCo's mark of the last body: which parts of its inertial frame it does not use."""
    path = folder / "robot.urdf"
    path.write_text(case.source.text)
    return int(mujoco.MjModel.from_xml_path(str(path)).body_sameframe[-1])


@pytest.mark.parametrize(
    ("xyz", "rpy", "expected"),
    [
        ("9.999e-7 -9.999e-7 9.999e-7", "0 0 0", SAME_FRAME),
        ("1e-6 0 0", "0 0 0", SAME_ROTATION),
        ("0 0 -1e-6", "0 0 0", SAME_ROTATION),
        ("5e-7 0 0", "1.999e-6 -1.999e-6 0", SAME_FRAME),
        ("5e-7 0 0", "2.001e-6 0 0", NONE),
        ("5e-7 0 0", "0 0 -2.001e-6", NONE),
        ("0.3 0 0", "0 1.999e-6 0", SAME_ROTATION),
        ("0.3 0 0", "0 2.001e-6 0", NONE),
    ],
)
def test_thresholds(xyz: str, rpy: str, expected: int, tmp_path: Path) -> None:
    case = rotor(xyz, rpy)
    assert mark(case, tmp_path) == expected
    drops_center = expected == SAME_FRAME and xyz != "0 0 0"
    drops_axes = expected != NONE and rpy != "0 0 0"
    message = " ".join(each.message for each in RULE.detect(case))
    assert ("centre of mass" in message) == drops_center
    assert ("principal axes" in message) == drops_axes


@pytest.mark.parametrize(
    ("moments", "rpy", "ixy", "dropped"),
    [
        ("3 2 1.5", f"0 0 {math.pi}", "0", True),
        ("2 3 1.5", f"0 0 {math.pi / 2}", "0", True),
        ("2 3 1.5", "0 0 0", "0", False),
        ("1.5 2 3", "0 0 0", "0", False),
        ("2 2 2", "0.3 0.2 0.1", "0", True),
        ("2 2 1", "0 0 0", "1e-9", False),
        ("3 2 1.5", "0 0 0", "1e-3", False),
        ("3 2 1.5", "0 0 0", "1e-7", True),
    ],
)
def test_mujoco_orders_the_axes_itself(
    moments: str, rpy: str, ixy: str, dropped: bool, tmp_path: Path
) -> None:
    case = rotor("7e-7 0 0", rpy, moments, ixy)
    assert (mark(case, tmp_path) == SAME_FRAME) == dropped
    assert bool(RULE.detect(case)) == dropped


def merged(offset: float) -> Case:
    """Make a robot whose arm and its counterweight balance but for `offset` [m]."""
    arm = link("arm", mass=1.0, moments=(0.3, 0.2, 0.1), center=(0.0, 0.0, 0.2))
    weight = link("weight", mass=1.0, moments=(0.3, 0.2, 0.1), center=(2 * offset, 0.0, -0.2))
    fixed = joint("holder", "arm", "weight", type="fixed")
    return case_of(link("base"), arm, weight, joint("elbow", "base", "arm"), fixed, base="fixed")


@pytest.mark.parametrize(("offset", "dropped"), [(1e-7, True), (1e-5, False), (0.0, False)])
def test_rigidly_connected_links_count_together(offset: float, dropped: bool, tmp_path: Path) -> None:
    case = merged(offset)
    assert (mark(case, tmp_path) == SAME_FRAME) == (abs(offset) < 1e-6)
    assert [each.link for each in RULE.detect(case)] == ["arm"] * dropped
    if not dropped:
        return
    zero = replace(case, choices={"DX117": "zero"})
    _, remedy = mended("DX117", zero)
    assert remedy.changes_physics
    inertial = remedy.case.model.inertial("arm")
    assert inertial.origin.xyz == (0.0, 0.0, 0.0)
    assert inertial.mass == pytest.approx(2.0)
    assert inertial.ixx == pytest.approx(0.68)


@pytest.mark.parametrize("choice", ["call", "zero"])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_both_remedies_are_proved(choice: str, base: str) -> None:
    text = rotor("7e-7 0 3e-7", "1e-6 0 0").source.text
    report = diagnose(text, base=base, engines=["mujoco"], choose={"DX117": choice})  # type: ignore[arg-type]
    assert [(each.rule, each.proved) for each in report.differences] == [("DX117", True)]
    assert report.residual <= BAR
    assert bool(report.calls) == (choice == "call")
    assert (report.mended is None) == (choice == "call")


def test_a_single_floating_body_gets_zero_because_the_call_does_not_help() -> None:
    text = case_of(link("ball", center=(7e-7, 0.0, 0.0)), base="floating").source.text
    report = diagnose(text, base="floating", engines=["mujoco"])
    assert [(each.rule, each.proved) for each in report.differences] == [("DX117", True)]
    assert report.residual <= BAR
    assert not report.calls
