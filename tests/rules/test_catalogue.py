"""Every rule of the catalogue: well formed, shown by its trap alone, and removed by its remedy."""

from __future__ import annotations

import re
from collections.abc import Sequence

import pytest
from hypothesis import given, note
from hypothesis import strategies as st
from packaging.specifiers import SpecifierSet

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import TILTED_GRAVITY
from dynx.errors import UnknownNameError
from dynx.loaded import ENGINES, VARIANTS
from dynx.model.tree import Base
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.rules import Case, Detection, Rule, all_rules, find_rule
from dynx.rules.inertia import rigid_groups
from dynx.rules.registry import find_trap, trap_case
from dynx.testing.strategies import urdf_text
from tests.rules.readings import reading_difference

RULES = all_rules()
every_rule = pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.id)

# Causes that occur only with another one: rule -> difference rules that its trap also has, and the reason.
ALSO_IN_TRAP: dict[str, dict[str, str]] = {
    "DX303": {"DX301": "a negative damping is a damping, however small"},
    "DX511": {"DX304": "followers of a follower are followers"},
    "DX512": {"DX304": "a follower that leaves its limits follows"},
    "DX601": {
        "DX610": "PyBullet computes the mass from the shapes, too",
        "DX621": "contacts would be a cause of their own",
        "DX622": "the class places the geom beside the origin",
    },
    "DX608": {"DX610": "the body that has the frame has other parts than a box"},
    "DX609": {
        "DX618": "the first body is a table that is fixed",
        "DX619": "the first body is a table that is fixed",
    },
    "DX611": {"DX610": "the moments of no box are those of the file"},
    "DX613": {"DX610": "a body of another file is not looked at for a box"},
    "DX620": {"DX308": "the shapes that touch are those of a robot"},
    "DX621": {"DX610": "a body without an inertial is not looked at for a box"},
    "DX624": {
        "DX308": "a geom that Pinocchio counts may touch others",
        "DX610": "PyBullet computes the mass from the shapes, too",
    },
    "DX622": {
        "DX308": "a geom that Pinocchio counts may touch others",
        "DX610": "PyBullet computes the mass from the shapes, too",
    },
    "DX623": {"DX613": "a file is included"},
    "DX618": {"DX619": "the base that is fixed floats in PyBullet"},
    "DX708": {"DX711": "what is included is named by a model"},
    "DX711": {"DX708": "a file is included"},
    "DX720": {
        "DX708": "a file is included",
        "DX711": "what is included is named by a model",
    },
    "DX722": {"DX701": "moments that are not 0 are those of no box of mass 0"},
    "DX715": {"DX701": "a link of a nested model is not looked at for a box"},
    "DX716": {"DX709": "PyBullet crashes on several roots"},
    "DX719": {"DX704": "the joint has a pose, and its axis is in the frame of the model"},
    "DX718": {"DX701": "moments of their own are those of no mesh"},
    "DX712": {"DX701": "moments of their own are those of no box"},
}

# Rules whose remedy changes more than the links, joints and lines of the detections: rule -> the reason.
CHANGES_ELSEWHERE: dict[str, str] = {
    "DX109": "a link has another name wherever the document names it",
    "DX118": "every moving link gets mass, if the user chose that",
    "DX212": "frames are removed, with their joints",
    "DX414": "a link has another name wherever the document names it",
    "DX440": "the first line declares the encoding",
}


SUFFIXES = {"urdf": "urdf", "mjcf": "xml", "sdf": "sdf"}


def test_numbers_and_names_are_unique() -> None:
    assert len({rule.id for rule in RULES}) == len(RULES)
    assert len({rule.name for rule in RULES}) == len(RULES)
    assert len(RULES) >= 20


@every_rule
def test_a_rule_is_well_formed(rule: Rule) -> None:
    assert re.fullmatch(r"DX[1-7][0-9]{2}", rule.id)
    assert re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)+", rule.name)
    assert rule.trap() == f"{rule.id.lower()}_{rule.name.replace('-', '_')}.{SUFFIXES[rule.formats[0]]}"
    assert type(rule).__name__.lower() == rule.name.replace("-", "")
    assert (rule.id[2] == "5") == (rule.kind == "practice")
    assert rule.kind == "practice" or rule.engines
    assert find_rule(rule.id.lower()) is find_rule(rule.name) is rule


@every_rule
def test_title_and_advice_are_one_sentence(rule: Rule) -> None:
    for sentence in (rule.title, rule.advice):
        assert re.fullmatch(r"[A-Z<`\"].*[.]", sentence)
        assert not re.search(r"[.!?] [A-Z]", sentence)
        assert len(sentence) <= 120


@every_rule
def test_the_page_begins_with_the_rule(rule: Rule) -> None:
    heading, _, body = rule.page().partition("\n\n")
    assert " ".join(heading.split()) == f"{rule.id} {rule.name}: {rule.title}"
    assert len(body.split()) >= 40
    assert all(f"--choose {rule.id}={choice}" in body for choice in list(rule.choices)[1:])


@every_rule
def test_a_decision_says_what_was_chosen_and_how_to_choose_otherwise(rule: Rule) -> None:
    trap = trap_case(rule)
    for choice, meaning in rule.choices.items():
        case = Case(trap.source, trap.base, choices={rule.id: choice})
        decision = rule.decision(case)
        assert decision is not None
        assert decision.startswith(f"{rule.id}={choice}: {meaning}; otherwise ")
        assert {other for other in rule.choices if f"--choose {rule.id}={other}" in decision} == {
            *rule.choices
        } - {choice}
        remedy = rule.remedy(case, rule.detect(case))
        # DX107 states no choice where no link is rigidly connected to the root, so that there is none.
        unused = rule.id == "DX107" and choice == "lump"
        assert remedy is None or remedy.choice == (None if unused else decision)


@every_rule
def test_engines_are_known_and_have_versions(rule: Rule) -> None:
    for engine, versions in rule.engines.items():
        assert engine in {*ENGINES, *VARIANTS}
        assert str(SpecifierSet(versions))


def test_each_trap_has_the_cause_of_its_rule_until_it_is_mended() -> None:
    """Of all rules, where the tests of single rules are a sample."""
    for rule in RULES:
        case = trap_case(rule)
        found = rule.detect(case)
        assert found, rule.id
        remedy = rule.remedy(case, found)
        assert remedy is None or not rule.detect(remedy.case), rule.id


@every_rule
def test_the_trap_is_in_the_rule_alone(rule: Rule) -> None:
    case = trap_case(rule)
    assert rule.detect(case)
    others = {}
    for other in RULES:
        if other is rule or not (other.kind == "difference" or rule.kind == "practice"):
            continue
        if other.engines and set(other.engines) <= set(VARIANTS):  # a matter of the call, not of the trap
            continue
        if (other.stage == "reading" or case.readable) and (found := other.detect(case)):
            others[other.id] = [each.message for each in found]
    assert others.keys() == ALSO_IN_TRAP.get(rule.id, {}).keys(), others


@every_rule
def test_detections_say_where_and_what(rule: Rule) -> None:
    case = trap_case(rule)
    text = case.source.text.splitlines()
    for each in rule.detect(case):
        links, joints = set(case.links), set(case.joints)
        if case.form != "urdf":
            links = {link.name for link in case.model.links}
            joints = {joint.name for joint in case.model.joints}
        assert each.link is None or each.link in links
        assert each.joint is None or each.joint in joints
        assert each.line is None or 1 <= each.line <= len(text)
        assert each.message
        assert "\n" not in each.message
        assert "None" not in each.message


def mended_trap(rule: Rule) -> tuple[Case, Case, bool] | None:
    """Return the trap, the mended trap (by the first choice that has a remedy), and whether the remedy
    changes the physics; None where the cause has no remedy."""
    for choice in [None, *rule.choices]:
        trap = trap_case(rule)
        choices = None if choice is None else {rule.id: choice}
        case = Case(trap.source, trap.base, TILTED_GRAVITY, choices=choices)
        remedy = rule.remedy(case, rule.detect(case))
        if remedy is not None:
            assert remedy.changed
            return case, remedy.case, remedy.changes_physics
    return None


@every_rule
def test_the_remedy_removes_the_cause(rule: Rule) -> None:
    cured = mended_trap(rule)
    if cured is not None:
        case, after, _ = cured
        assert not rule.detect(after)
        assert after.source.data != case.source.data or after.calls != case.calls


@every_rule
def test_the_remedy_leaves_the_rest_of_the_text_as_it_is(rule: Rule) -> None:
    cured = mended_trap(rule)
    if cured is None or rule.id in CHANGES_ELSEWHERE:
        return
    case, after, _ = cured
    untouched = untouched_lines(case, rule.detect(case))
    remaining = iter(after.source.text.splitlines())
    for line in untouched:
        assert line in remaining, f"lost or moved: {line}"


@every_rule
def test_the_mended_trap_is_the_same_robot(rule: Rule) -> None:
    cured = mended_trap(rule)
    if cured is None or rule.stage == "reading":
        return
    case, after, changes_physics = cured
    assert after.readable
    if not changes_physics:
        assert reading_difference(case, after) <= BAR


def untouched_lines(case: Case, detections: Sequence[Detection]) -> list[str]:
    """List the lines outside of the links (with those rigidly connected to them), joints and other elements
    in which something was detected."""
    names = {("link", each.link) for each in detections} | {("joint", each.joint) for each in detections}
    if case.readable:
        groups = rigid_groups(case)
        named = [each.link for each in detections if each.link in groups]
        names |= {("link", link) for name in named if name is not None for link in groups[name].links}
    taken = {each.line for each in detections}
    for element in case.source.root.children:
        lines = set(lines_of(case.source, element))
        if (element.tag, element.attributes.get("name")) in names or lines & taken:
            taken |= lines
    text = case.source.text.splitlines()
    return [line for number, line in enumerate(text, start=1) if number not in taken]


def lines_of(source: XmlSource, element: SourceElement) -> range:
    """Return the numbers of the lines of an element."""
    within = source.data[element.span.start : element.span.end].count(b"\n")
    return range(element.line, element.line + within + 1)


def test_a_rule_is_found_by_id_or_name_in_any_case() -> None:
    for name in ("DX501", "dx501", "Inertia-Beyond-Geometry"):
        assert find_rule(name).id == "DX501"
    with pytest.raises(UnknownNameError, match="did you mean 'inertia-beyond-geometry'"):
        find_rule("inertia-behind-geometry")


def test_a_trap_is_found_by_its_rule() -> None:
    path = find_trap("inertia-beyond-geometry")
    assert path == find_trap("dx501") == find_trap(find_rule("DX501"))
    assert path.name == "dx501_inertia_beyond_geometry.urdf"


def test_every_trap_belongs_to_a_rule() -> None:
    folder = find_trap("DX501").parent
    # A folder holds what a trap includes.
    assert {path.name for path in folder.iterdir() if path.is_file()} == {rule.trap() for rule in RULES}


BASES: tuple[Base, ...] = ("fixed", "floating")


@given(urdf_text(), st.sampled_from(BASES))
def test_a_remedy_removes_its_cause_from_any_robot(text: str, base: Base) -> None:
    case = Case(XmlSource(text), base, TILTED_GRAVITY)
    for rule in all_rules():
        detections = rule.detect(case)
        assert len(set(detections)) == len(detections)
        for choice in rule.choices or [None] if detections else []:
            note(f"{rule.id}, choice {choice}: {detections}")
            check_remedy(rule, case if choice is None else with_choice(case, rule, choice))


def with_choice(case: Case, rule: Rule, choice: str) -> Case:
    """Return the case with a user's choice for one rule."""
    return Case(case.source, case.base, case.gravity, choices={rule.id: choice})


def check_remedy(rule: Rule, case: Case) -> None:
    """Check that the remedy, if there is one, removes the cause and leaves the robot unchanged."""
    remedy = rule.remedy(case, rule.detect(case))
    if remedy is None:
        return
    assert not rule.detect(remedy.case)
    assert remedy.case.readable, remedy.case.reading
    if not remedy.changes_physics and rule.stage == "model":
        assert reading_difference(case, remedy.case) <= BAR
