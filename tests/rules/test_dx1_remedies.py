"""The remedies of DX101 to DX113 change neither the robot nor other parts of the document."""

from __future__ import annotations

import difflib

import numpy as np
import pytest
from hypothesis import given, settings

import dynx
from dynx.doctor import diagnose
from dynx.errors import DescriptionError
from dynx.model import Inertial, Model
from dynx.model.documents import bare_urdf
from dynx.model.library import EXAMPLE_ROBOT_DATA, robots
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Remedy, all_rules, find_rule
from dynx.rules.inertia import CentralInertia, inertial_edits
from dynx.rules.registry import find_trap
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.rules.documents import case_of, joint, link
from tests.rules.test_dx1_detections import PLANTS

EPS = float(np.finfo(float).eps)
RULES = [rule for rule in all_rules() if "DX101" <= rule.id <= "DX113"]
ROUNDS = 4
MIN_CORRECTED_INERTIA = 1.5e-11
"""Smallest largest moment [kg m^2] of a robot that DX111 corrects: below it, the smallest moment that MuJoCo
accepts is more than a thousandth of it."""
FILES = {entry.name: entry.path for entry in robots() if entry.source == EXAMPLE_ROBOT_DATA}


def mended(case: Case) -> tuple[Case, list[tuple[str, Remedy]]]:
    """Apply all remedies in their order until nothing changes."""
    done: list[tuple[str, Remedy]] = []
    for _ in range(ROUNDS):
        before = case.source.data
        for rule in RULES:
            remedy = rule.remedy(case, found) if (found := rule.detect(case)) else None
            if remedy is not None:
                case = remedy.case
                done.append((rule.id, remedy))
                assert not rule.detect(case), f"{rule.id} left {rule.detect(case)}"
        if case.source.data == before:
            return case, done
    raise AssertionError(f"not settled after {ROUNDS} rounds: {[rule for rule, _ in done]}")


def equations(model: Model, seed: int = 0) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    backend = dynx.backend("reference", model)
    q, v, a = model.random(rng), *rng.uniform(-1.0, 1.0, (2, model.nv))
    return backend.mass_matrix(q), backend.inverse_dynamics(q, v, a)


def assert_same_robot(before: Model, after: Model, done: list[tuple[str, Remedy]]) -> None:
    """Check that the equations of motion are equal, up to rounding and the moments raised by DX102."""
    if not before.nv or any(remedy.changes_physics for _, remedy in done):
        return
    bodies = len(before.links)
    for was, now in zip(equations(before), equations(after), strict=True):
        size = max(float(np.max(np.abs(was))), 1e-300)
        # A lift is 16 eps of the body's inertia; the least inertia is 2e-15 kg and 1.5e-14 kg m^2, in
        # accelerations of up to 10 m/s^2 within a few metres.
        least = 1e-12 if {"DX107", "DX108", "DX110", "DX111"} & {rule for rule, _ in done} else 0.0
        assert float(np.max(np.abs(now - was))) <= 32 * EPS * size * max(bodies, 8) + least


def largest_inertia(model: Model) -> float:
    bodies = [CentralInertia.of(link.inertial) for link in model.links if link.inertial is not None]
    return max((float(np.max(np.diagonal(body.about_origin()))) for body in bodies), default=0.0)


@given(models(physical=False, max_links=5))
def test_any_robot_is_mended_and_stays_itself(model: Model) -> None:
    case = Case(XmlSource(bare_urdf(model)), base=model.base, gravity=model.gravity)
    after, done = mended(case)
    assert_same_robot(case.model, after.model, done)


@given(models(physical=False, max_links=5))
@settings(max_examples=50)  # the choices double the work of the test above
def test_every_choice_is_carried_out(model: Model) -> None:
    for choices in ({"DX103": "nearest", "DX104": "nearest"}, {"DX113": "keep", "DX107": "keep"}):
        source = XmlSource(bare_urdf(model))
        case = Case(source, base=model.base, gravity=model.gravity, choices=choices)
        after, _ = mended(case)
        assert after.readable
        kept = {rule.id for rule in RULES if rule.detect(after)} - {"DX112"}
        if largest_inertia(after.model) < MIN_CORRECTED_INERTIA:
            kept -= {"DX111"}
        assert kept <= {rule for rule, choice in choices.items() if choice == "keep"}


@pytest.mark.parametrize("name", sorted(set(FILES) - {"ur_description_ur3"}))
def test_a_robot_of_example_robot_data_is_mended_and_stays_itself(name: str) -> None:
    bases: tuple[Base, Base] = ("fixed", "floating")
    for base in bases:
        case = Case(XmlSource(FILES[name].read_bytes(), str(FILES[name])), base=base)
        after, done = mended(case)
        assert_same_robot(case.model, after.model, done)
        left = {rule.id for rule in RULES if rule.detect(after)}
        assert left <= {"DX112"}


def test_only_the_tensor_changes_in_the_text() -> None:
    text = (
        "<robot name='r'>\n\t<!-- a comment -->\n\t<link name='a' >\n\t\t<inertial>\n"
        "\t\t\t<mass value='1.50'/><!-- weighed -->\n\t\t\t<inertia ixx='0.025' ixy='-3e-5' ixz='-1e-5' "
        "iyy='0.022' iyz='0.00' izz='0.025'/>\n\t\t</inertial>\n\t</link>\n</robot>\n"
    )
    rule = find_rule("DX105")
    case = Case(XmlSource(text), base="floating")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    old, new = text.splitlines(), remedy.case.source.text.splitlines()
    changed = [line for line in difflib.ndiff(old, new) if line[:1] in "+-"]
    assert [line[:1] for line in changed] == ["+", "-", "+"]
    assert "<origin" in changed[0]
    assert "iyz='0.00'" in changed[1]
    assert "iyz='0.00'" in changed[2]


def test_a_tensor_that_is_a_body_with_its_neighbour_is_lumped_at_equal_dynamics() -> None:
    heavy = link("b", mass=5.0, moments=(0.3, 0.3, 0.3))
    case = case_of(*(link("a"), heavy, link("c")), joint("ab", "a", "b"), joint("bc", "b", "c", type="fixed"))
    case = with_inertial(case, "c", PLANTS["DX103"])
    after, done = mended(case)
    assert [rule for rule, _ in done] == ["DX103"]
    assert not done[0][1].changes_physics
    assert_same_robot(case.model, after.model, done)
    inertials = {each.name: each.inertial for each in after.model.links}
    lump, rest = inertials["b"], inertials["c"]
    assert lump is not None
    assert lump.mass == 6.0
    assert rest is not None
    assert rest.mass == 0.0
    assert not rest.tensor.any()


def test_a_tensor_of_no_body_without_neighbours_becomes_the_nearest_one() -> None:
    case = with_inertial(case_of(link("a"), link("b"), joint("ab", "a", "b")), "b", PLANTS["DX103"])
    after, done = mended(case)
    assert [(rule, remedy.changes_physics) for rule, remedy in done] == [("DX103", True)]
    nearest = {each.name: each.inertial for each in after.model.links}["b"]
    assert nearest is not None
    # (0.01, 0.02, 0.05) less (-1, -1, 1) (0.05 - 0.03) / 3.
    wanted = np.array([0.01, 0.02, 0.05]) + np.array([1.0, 1.0, -1.0]) * 0.02 / 3.0
    # and then off the edge, by at most 16 eps of the largest.
    np.testing.assert_allclose(np.diagonal(nearest.tensor), wanted, rtol=0, atol=20 * EPS * wanted[2])


def test_the_root_becomes_the_body_it_carries_through_a_chain_of_fixed_joints() -> None:
    nothing = (0.0, 0.0, 0.0)
    case = case_of(
        *(link("root", mass=0, moments=nothing), link("frame", mass=0, moments=nothing)),
        *(link("body", mass=3.0, center=(0.1, 0.2, 0.3)), link("arm")),
        joint("one", "root", "frame", type="fixed"),
        joint("two", "frame", "body", type="fixed"),
        joint("three", "body", "arm"),
        base="floating",
    )
    after, done = mended(case)
    assert [rule for rule, _ in done] == ["DX107"]
    masses = {each.name: each.inertial.mass for each in after.model.links if each.inertial}
    assert masses == {"root": 3.0, "frame": 0.0, "body": 0.0, "arm": 1.0}
    assert_same_robot(case.model, after.model, done)


def test_a_root_without_inertial_gets_that_of_the_body_welded_to_it() -> None:
    case = case_of(
        *('<link name="root"/>', '<link name="frame"/>', '<link name="tool"/>'),
        *(link("body", mass=3.0, center=(0.1, 0.2, 0.3)), link("arm")),
        joint("one", "root", "frame", '<origin xyz="0.3 0 0.1" rpy="1 0 0.5"/>', type="fixed"),
        joint("two", "frame", "body", '<origin xyz="0 0.2 0.1" rpy="0 1 0.5"/>', type="fixed"),
        joint("three", "body", "arm"),
        joint("four", "arm", "tool", type="fixed"),
        base="floating",
    )
    rule = find_rule("DX101")
    assert [each.link for each in rule.detect(case)] == ["root", "frame", "tool"]
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    masses = {each.name: each.inertial.mass for each in remedy.case.model.links if each.inertial}
    assert masses == {"root": 3.0, "frame": 0.0, "body": 0.0, "arm": 1.0, "tool": 0.0}
    assert_same_robot(case.model, remedy.case.model, [("DX101", remedy)])


def test_a_body_on_the_edge_is_put_inside_by_what_nobody_can_measure() -> None:
    clean = case_of(link("a"), link("b"), joint("ab", "a", "b"))
    case = with_inertial(clean, "b", PLANTS["DX102"])
    rule = find_rule("DX102")
    remedy = rule.remedy(case, rule.detect(case))
    assert remedy is not None
    before, after = case.inertials["b"], remedy.case.inertials["b"]
    assert before is not None
    assert after is not None
    added = [getattr(after, name) - getattr(before, name) for name in ("ixx", "iyy", "izz")]
    # The largest moment about the origin of the link is 0.14, and each sum is rounded once.
    assert all(0.0 < each <= 32 * EPS * 0.14 for each in added)
    assert max(added) - min(added) <= EPS * 0.01
    assert_same_robot(case.model, remedy.case.model, [("DX102", remedy)])


def test_a_tensor_without_mass_goes_to_the_link_it_is_welded_to() -> None:
    case = case_of(*(link(n) for n in "abc"), joint("ab", "a", "b"), joint("bc", "b", "c", type="fixed"))
    case = with_inertial(case, "c", PLANTS["DX108"])
    after, done = mended(case)
    assert [rule for rule, _ in done] == ["DX108"]
    assert_same_robot(case.model, after.model, done)
    assert not any(
        each.inertial.mass == 0 and each.inertial.tensor.any() for each in after.model.links if each.inertial
    )


def test_a_link_named_world_is_renamed_wherever_it_is_named() -> None:
    case = case_of(
        *(link("world"), link("world_link"), joint("j", "world", "world_link")),
        '<gazebo reference="world"/>',
        base="floating",
    )
    after, done = mended(case)
    assert [rule for rule, _ in done] == ["DX109"]
    assert after.model.root == "world_link_2"
    assert 'gazebo reference="world_link_2"' in after.source.text
    assert '"world"' not in after.source.text


def with_inertial(case: Case, name: str, inertial: Inertial) -> Case:
    """Return the case with another inertial in one link."""
    element = case.links[name]
    old = {each.name: each.inertial for each in case.model.links}[name]
    assert old is not None
    return case.with_source(case.source.apply(*inertial_edits(case.source, element, old, inertial)))


@pytest.mark.parametrize(("choice", "mass"), [(None, 1.5), ("absolute", 1.5), ("zero", 0.0)])
def test_the_sign_is_removed_or_the_mass_zero(choice: str | None, mass: float) -> None:
    with pytest.raises(DescriptionError, match="wanted at least 0"):
        dynx.load(find_trap("DX120"))
    choose = None if choice is None else {"DX120": choice}
    report = diagnose(find_trap("DX120"), engines=["pinocchio"], samples=1, choose=choose)
    [finding] = [each for each in report.findings if each.rule == "DX120"]
    assert (finding.link, finding.line, finding.proved) == ("lower", 20, True)
    assert report.explained
    assert report.mended is not None
    assert dynx.load(report.mended).inertial("lower").mass == mass
    assert any("DX120=" in each and "otherwise --choose" in each for each in report.choices)
