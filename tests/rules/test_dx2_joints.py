"""Rules about joints: each finds its place in its trap, and mends it there and nowhere else."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.doctor import compare_as_loaded
from dynx.doctor.mending import mend
from dynx.loaded import installed_engines
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Case, find_rule
from dynx.rules.joints import TYPES
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies import unit_vectors
from tests.rules.documents import case_of, link
from tests.rules.trap_cases import assert_same_robot, changed_lines, mended, only, trap


def arm() -> str:
    from dynx.model.library import find

    return find("six_axis_arm").read_text(encoding="utf-8")


def test_an_axis_is_scaled_as_dynx_scales_it() -> None:
    case = trap("DX201")
    found, remedy = mended("DX201", case)
    assert [each.joint for each in found] == ["elbow", "slide"]
    assert remedy.case.model.joint("slide").axis == case.model.joint("slide").axis
    assert_same_robot(case.model, remedy.case.model)
    assert changed_lines(case, remedy.case) == ['<axis xyz="0 1e-9 0"/>', '<axis xyz="2 0 0"/>']


@pytest.mark.parametrize("index", [0, 1])
def test_one_axis_of_two_is_scaled_where_that_is_asked(index: int) -> None:
    case, rule = trap("DX201"), find_rule("DX201")
    found = list(rule.detect(case))
    remedy = rule.remedy(case, [found[index]])
    assert remedy is not None
    assert list(rule.detect(remedy.case)) == [found[1 - index]]


@given(unit_vectors(), st.floats(1e-6, 1e6).filter(lambda x: abs(x - 1.0) > 1e-9))
def test_any_length_is_found_and_scaled(direction: object, length: float) -> None:
    axis = np.asarray(direction) * length
    text = arm().replace('<axis xyz="0 0 1"/>', f'<axis xyz="{" ".join(map(repr, axis.tolist()))}"/>', 1)
    case = Case(XmlSource(text))
    found, remedy = mended("DX201", case)
    assert only(found).joint == case.model.joint_names[0]
    assert_same_robot(case.model, remedy.case.model)


@given(unit_vectors())
def test_a_unit_axis_is_left_alone(direction: object) -> None:
    axis = " ".join(map(repr, np.asarray(direction).tolist()))
    text = arm().replace('<axis xyz="0 0 1"/>', f'<axis xyz="{axis}"/>', 1)
    model = load(text)
    # A unit vector in doubles is unit to a rounding or two; what dynx scales is no unit vector to it.
    if model.joints[0].axis == tuple(np.asarray(direction).tolist()):
        assert not find_rule("DX201").detect(Case(XmlSource(text)))


@pytest.mark.parametrize(
    "written", ['<axis xyz="0 0 0"/>', '<axis xyz="0.0 -0 0e3"/>', "<axis/>", '<axis xyz=""/>']
)
def test_an_axis_without_direction(written: str) -> None:
    text = trap("DX202").source.text.replace('<axis xyz="0 0 0"/>', written)
    case = Case(XmlSource(text))
    assert not case.readable
    found, remedy = mended("DX202", case)
    assert only(found).joint == "elbow"
    assert remedy.case.model.joint("elbow").axis == (1.0, 0.0, 0.0)
    fixed = mended("DX202", Case(XmlSource(text), choices={"DX202": "fixed"}))[1].case.model
    assert fixed.joint_names == ("shoulder", "slide")


def test_an_axis_that_is_not_there_or_of_a_fixed_joint_is_no_matter() -> None:
    text = trap("DX202").source.text
    assert not find_rule("DX202").detect(Case(XmlSource(text.replace('<axis xyz="0 0 0"/>', ""))))
    fixed = text.replace('name="elbow" type="revolute"', 'name="elbow" type="fixed"')
    assert not find_rule("DX202").detect(Case(XmlSource(fixed)))


def test_a_joint_without_limit() -> None:
    case = trap("DX203")
    found, remedy = mended("DX203", case)
    assert only(found).joint == "elbow"
    assert remedy.case.model.joint("elbow").type == "continuous"
    limits = mended("DX203", trap("DX203", DX203="zero"))[1].case.model.joint("elbow").limits
    assert (limits.lower, limits.upper) == (0.0, 0.0)


def test_a_prismatic_joint_without_limit_gets_one_without_end() -> None:
    text = trap("DX204").source.text.replace('<limit lower="-1.5" upper="1.5" effort="20" velocity="2"/>', "")
    found, remedy = mended("DX203", Case(XmlSource(text)))
    assert only(found).joint == "slide"
    assert remedy.case.model.joint("slide").limits.upper == math.inf


@pytest.mark.parametrize("rule_id", ["DX204", "DX205", "DX206", "DX207"])
def test_limits_are_mended_and_the_robot_stays(rule_id: str) -> None:
    case = trap(rule_id)
    found, remedy = mended(rule_id, case)
    assert only(found).joint == "elbow"
    assert_same_robot(case.model, remedy.case.model)
    assert len(changed_lines(case, remedy.case)) == 1


def test_limits_in_order() -> None:
    limits = mended("DX205", trap("DX205"))[1].case.model.joint("elbow").limits
    assert (limits.lower, limits.upper) == (-3.2, 3.2)
    unlimited = mended("DX205", trap("DX205", DX205="unlimited"))[1].case.model.joint("elbow").limits
    assert (unlimited.lower, unlimited.upper) == (-math.inf, math.inf)


def test_negative_limits() -> None:
    limits = mended("DX206", trap("DX206"))[1].case.model.joint("elbow").limits
    assert (limits.effort, limits.velocity) == (1.0, 1.0)
    unlimited = mended("DX206", trap("DX206", DX206="unlimited"))[1].case.model.joint("elbow").limits
    assert (unlimited.effort, unlimited.velocity) == (math.inf, math.inf)


@pytest.mark.parametrize(
    ("mimic", "says"),
    [
        ('<mimic multiplier="0.5" offset="0.1"/>', "names no joint"),
        ('<mimic joint="elbow"/>', "mimics itself"),
        ('<mimic joint="wrist"/>', "does not exist"),
    ],
)
def test_a_mimic_of_nothing_is_taken_away(mimic: str, says: str) -> None:
    text = trap("DX208").source.text.replace('<mimic multiplier="0.5" offset="0.1"/>', mimic)
    found, remedy = mended("DX208", Case(XmlSource(text)))
    assert only(found).joint == "elbow"
    assert says in only(found).message
    assert remedy.case.model.joint_names == ("shoulder", "elbow", "slide")


def test_a_follower_of_a_fixed_joint_is_fixed_where_dynx_has_it() -> None:
    case = trap("DX209")
    found, remedy = mended("DX209", case)
    assert only(found).joint == "slide"
    assert_same_robot(case.model, remedy.case.model)
    free = mended("DX209", trap("DX209", DX209="free"))[1].case.model
    assert free.joint_names == ("shoulder", "slide")


def test_a_mimic_of_a_joint_that_moves_is_no_matter() -> None:
    case = trap("DX304")
    assert not find_rule("DX208").detect(case)
    assert not find_rule("DX209").detect(case)


@pytest.mark.parametrize("kind", TYPES)
def test_a_joint_of_several_freedoms_is_split(kind: str) -> None:
    text = trap("DX210").source.text.replace('type="planar"', f'type="{kind}"')
    case = Case(XmlSource(text))
    found, remedy = mended("DX210", case)
    assert only(found).joint == "slide"
    fixed = mended("DX210", Case(XmlSource(text), choices={"DX210": "fixed"}))[1].case.model
    # With every coordinate of the chain at zero the robot is the one whose joint is fixed.
    assert np.array_equal(_pose(remedy.case.model, np.zeros(remedy.case.model.nq)), _pose(fixed, np.zeros(2)))


def test_three_turns_are_those_of_the_moving_axes() -> None:
    text = trap("DX210").source.text.replace('type="planar"', 'type="spherical"')
    model = mended("DX210", Case(XmlSource(text)))[1].case.model
    zero = _pose(model, np.zeros(5))
    angles = np.array([0.3, -0.4, 0.9])
    turned = _pose(model, np.array([0.0, 0.0, *angles]))
    x, y, z = (rotation_from_rpy(np.eye(3)[k] * angles[k]) for k in range(3))
    wanted = zero[:3, :3] @ x @ y @ z
    # Three products of rotations in another order of association: a few roundings of entries at most 1.
    assert np.max(np.abs(turned[:3, :3] - wanted)) <= 16 * np.finfo(float).eps


def test_a_planar_joint_slides_across_its_normal_and_turns_about_it() -> None:
    model = mended("DX210", trap("DX210"))[1].case.model
    slides = [np.array(model.joint(name).axis) for name in model.joint_names[2:]]
    assert np.array_equal(slides[2], [1.0, 0.0, 0.0])
    assert np.array_equal(np.cross(slides[0], slides[1]), slides[2])


def test_a_floating_joint_at_the_root_is_made_what_dynx_reads() -> None:
    case = trap("DX211")
    found, remedy = mended("DX211", case)
    assert only(found).joint == "free"
    assert_same_robot(case.model, remedy.case.model)
    assert not find_rule("DX210").detect(case)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_floating_joint_at_the_root_is_made_fixed_before_the_root_gets_a_body(base: Base) -> None:
    case = trap("DX211")
    text = case.source.text
    frame = text[text.index('<link name="ground">') : text.index('<joint name="free"')]
    case = Case(XmlSource(text.replace(frame, '<link name="ground"/>')), base)
    after = mend(case).case
    assert after.model.joint_names == case.model.joint_names
    assert after.joints["free"].attributes["type"] == "fixed"


def test_frames_are_dropped_until_pybullet_can_hold_the_robot() -> None:
    case = trap("DX212")
    _, remedy = mended("DX212", case)
    assert len(remedy.case.joints) == 127
    assert set(case.links) - set(remedy.case.links) == {"frame_124"}
    assert_same_robot(case.model, remedy.case.model)
    kept = trap("DX212", DX212="keep")
    assert find_rule("DX212").remedy(kept, find_rule("DX212").detect(kept)) is None


def test_links_with_mass_are_never_dropped() -> None:
    text = trap("DX212").source.text.replace('<mass value="0"/>', '<mass value="0.1"/>')
    case = Case(XmlSource(text))
    found = find_rule("DX212").detect(case)
    assert len(found) == 1
    assert find_rule("DX212").remedy(case, found) is None


def test_the_joint_named_universe_is_renamed_everywhere() -> None:
    case = trap("DX213")
    found, remedy = mended("DX213", case)
    assert only(found).joint == "universe"
    assert "universe_joint" in remedy.case.joints
    assert_same_robot(case.model, remedy.case.model)


def test_the_joint_named_root_joint_is_renamed_where_the_base_floats() -> None:
    case = trap("DX217")
    found, remedy = mended("DX217", case)
    assert only(found).joint == "root_joint"
    assert "root_joint_1" in remedy.case.joints
    assert remedy.case.source.text.replace("root_joint_1", "root_joint") == case.source.text
    assert find_rule("DX217").detect(replace(case, base="fixed")) == []


def test_a_fixed_joint_or_a_link_named_root_joint_is_no_matter() -> None:
    text = trap("DX217").source.text
    fixed = text.replace('name="root_joint" type="revolute"', 'name="root_joint" type="fixed"')
    link = text.replace('name="root_joint"', 'name="elbow"').replace('"lower"', '"root_joint"')
    for harmless in (fixed, link):
        assert harmless != text
        assert find_rule("DX217").detect(Case(XmlSource(harmless), "floating")) == []


def test_pinocchio_welds_the_child_of_a_root_joint_to_the_base() -> None:
    pin = pytest.importorskip("pinocchio")
    case = trap("DX217")
    mended_text = mended("DX217", case)[1].case.source.text
    free = pin.JointModelFreeFlyer()

    def mass_matrix(text: str, *name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        model = pin.buildModelFromXML(text, free, *name)
        upper = np.triu(pin.crba(model, model.createData(), pin.neutral(model)))
        return np.asarray(upper + np.triu(upper, 1).T)

    right = mass_matrix(mended_text)
    lost = mass_matrix(case.source.text)
    assert np.max(np.abs(lost - right)) > 0.1 * np.max(np.abs(right))
    # The page names this way to keep the name of the joint.
    assert np.array_equal(mass_matrix(case.source.text, "free_flyer"), right)


@pytest.mark.parametrize("rule_id", ["DX214", "DX215"])
def test_transmissions(rule_id: str) -> None:
    case = trap(rule_id)
    found, remedy = mended(rule_id, case)
    only(found)
    assert case.model == remedy.case.model


def test_transmissions_that_drake_passes_over_are_no_matter() -> None:
    for rule_id in ("DX214", "DX215"):
        text = trap(rule_id).source.text.replace("/SimpleTransmission", "/FourBarTransmission")
        assert not find_rule(rule_id).detect(Case(XmlSource(text)))


def test_inertia_scaling_is_taken_away() -> None:
    case = trap("DX114")
    found, remedy = mended("DX114", case)
    assert only(found).link == "lower"
    assert case.model == remedy.case.model
    assert changed_lines(case, remedy.case) == ['<inertia_scaling value="3.0"/>']
    harmless = case.source.text.replace('value="3.0"', 'value="1.0"')
    assert not find_rule("DX114").detect(Case(XmlSource(harmless)))


def _pose(model: Model, q: object) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    with ReferenceBackend(model) as backend:
        return np.asarray(backend.forward_kinematics(np.asarray(q, dtype=float), "slider"))


RULE = find_rule("DX226")
LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def turning(axis: str, kind: str = "revolute") -> Case:
    """Make the case of an arm on one joint."""
    ends = '<parent link="base"/><child link="arm"/>'
    origin = '<origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/>'
    joint = f'<joint name="j" type="{kind}">{ends}{origin}<axis xyz="{axis}"/>{LIMIT}</joint>'
    return case_of(link("base"), link("arm", center=(0.1, 0.2, 0.3)), joint)


def error(case: Case, engine: str) -> float:
    """Return the error of the poses of links as an engine loads the file."""
    if engine not in installed_engines():
        pytest.skip(f"needs {engine}")
    report = compare_as_loaded(case.source.text, engines=[engine])
    assert report.error is None
    return float(report.engines[0].before["forward_kinematics"])


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic"])
@pytest.mark.parametrize(
    ("axis", "dropped"),
    [
        ("1e-10 0 1", True),
        ("0 1 -1.8e-8", True),
        ("1 1e-8 1e-8", True),
        ("0 1.85e-8 1", False),
        ("1.5e-8 1.5e-8 1", False),
        ("1e-10 0 -1", False),
    ],
)
def test_drake_drops_a_deviation_that_rounds_away(axis: str, dropped: bool, kind: str) -> None:
    case = turning(axis, kind)
    assert (error(case, "drake") > BAR) == dropped
    assert bool(RULE.detect(case)) == dropped


@pytest.mark.parametrize(("axis", "dropped"), [("9.9e-13 0 1", True), ("1.01e-12 0 1", False)])
def test_pinocchio_drops_a_deviation_up_to_its_precision(axis: str, dropped: bool) -> None:
    case = turning(axis)
    (found,) = RULE.detect(case)
    assert ("Pinocchio" in found.sentence(["pinocchio"])) == dropped
    assert (error(case, "pinocchio") > 0.1 * BAR) == dropped


def test_the_message_states_the_deviation_and_the_axis() -> None:
    (found,) = RULE.detect(turning("0 1 1e-9"))
    assert found.sentence(["drake", "pinocchio"]) == "the axis is 1e-09 rad off y: exactly y in Drake"


@pytest.mark.parametrize("axis", ["0 0 1", "1 6e-17 0", "0.6 0.8 0", "0 -1 1e-9", "1e-7 1 0"])
def test_other_axes_are_not_found(axis: str) -> None:
    assert not RULE.detect(turning(axis))


def test_the_remedy_writes_coordinate_axes_and_says_so() -> None:
    case = trap("DX226")
    found, remedy = mended("DX226", case)
    assert [each.joint for each in found] == ["shoulder", "elbow", "slide"]
    assert remedy.changes_physics
    axes = [remedy.case.model.joint(name).axis for name in ("shoulder", "elbow", "slide")]
    assert axes == [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
    assert all(math.hypot(*axis) == 1.0 for axis in axes)
    kept = trap("DX226", DX226="keep")
    assert RULE.remedy(kept, RULE.detect(kept)) is None
