"""The effect at a place is that of the place alone, whatever other places have the same cause."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.doctor.attribution import AttributedCause, CauseAttributor
from dynx.doctor.diagnosis import diagnose
from dynx.doctor.examination import ACCELERATION, TORQUE, Examiner
from dynx.doctor.mending import mend, place_of
from dynx.loaded import installed_engines, loader_class
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Rule, all_rules, find_rule
from dynx.rules.registry import trap_case
from tests.examples import PROFILE
from tests.rules.documents import case_of, joint, link

_VERSIONS = {engine: loader_class(engine).engine_version() for engine in installed_engines()}
BAR = 1e-12
SAMPLES, SEED = 3, 0


def attributions(case: Case, rule: Rule) -> list[AttributedCause]:
    """Attribute the differences in a case to one rule, all causes of other rules being there too."""
    examiner = Examiner(installed_engines(), SAMPLES, SEED)
    rules = [each for each in all_rules() if each.kind == "difference"]
    full = mend(case, rules)
    sound = examiner.reference(mend(case, [each for each in rules if each.stage == "reading"]).case)
    before, after = examiner.examine(case, reference=sound), examiner.examine(full.case)
    attributor = CauseAttributor(examiner, case, rules, before, after, BAR, lambda step: None)
    return list(attributor.attribute(rule, rule.detect(case)))


def twin(case: Case) -> Case:
    """Return the robot with a second one beside it, whose links and joints have names of their own."""
    names = sorted({*case.links, *case.joints}, key=len, reverse=True)
    text = re.sub(r"<\?xml[^>]*\?>", "", case.source.text)
    inside = text[text.index(">", text.index("<robot")) + 1 : text.rindex("</robot>")]
    other = re.sub(
        '"(' + "|".join(map(re.escape, names)) + ')"', lambda found: f'"second_{found.group(1)}"', inside
    )
    root = case.model.root if case.readable else next(iter(case.links))
    bolt = joint("bolt", root, f"second_{root}", '<origin xyz="0.3 -1 0.2"/>', type="fixed")
    head = text[: text.index(">", text.index("<robot")) + 1]
    return Case(XmlSource(f"{head}{inside}{other}{bolt}</robot>"), case.base)


@cache
def rules_at_two_places() -> tuple[str, ...]:
    """Name the rules whose trap beside itself has the cause at two places, of which each can be mended."""
    found = []
    for rule in all_rules():
        # A second floating base is a joint of six degrees of freedom; a twin is written in URDF.
        if rule.kind != "difference" or rule.id == "DX211" or rule.formats[0] != "urdf":
            continue
        case = twin(trap_case(rule))
        if not rule.holds_for(_VERSIONS):
            continue
        detected = rule.detect(case)
        if len({place_of(rule, each) for each in detected}) < 2:
            continue
        # The remedy of a few rules is one call for the whole robot.
        remedy = rule.remedy(case, detected[:1])
        if remedy is not None and rule.detect(remedy.case):
            found.append(rule.id)
    return tuple(found)


@pytest.mark.long_cases
@pytest.mark.parametrize("rule_id", rules_at_two_places())
def test_the_effect_is_that_of_a_file_in_which_only_this_place_has_the_cause(rule_id: str) -> None:
    rule, case = find_rule(rule_id), twin(trap_case(rule_id))
    measured = attributions(case, rule)
    assert any(each.effects for each in measured)
    # The number of the rule chooses one of the places, which are alike.
    each = measured[int(rule_id[2:]) % len(measured)]
    others = [one for one in rule.detect(case) if place_of(rule, one) != place_of(rule, each.detection)]
    remedy = rule.remedy(case, others)
    assert remedy is not None
    here = [one for one in measured if place_of(rule, one.detection) == place_of(rule, each.detection)]
    found = attributions(remedy.case, rule)
    assert len(found) == len(here)
    alone = found[here.index(each)].effects
    assert each.effects.keys() == alone.keys()
    for engine, effect in each.effects.items():
        expected = alone[engine]
        if effect.relative_error == expected.relative_error:
            continue
        if effect.quantity == expected.quantity == ACCELERATION:
            # The error of an acceleration is not the sum of those of its causes.
            assert 0.3 < effect.relative_error / expected.relative_error < 3.0
        elif {effect.quantity, expected.quantity} != {ACCELERATION, TORQUE}:
            assert effect.quantity == expected.quantity
            # Remedies that change the physics change what errors are relative to.
            assert effect.relative_error == pytest.approx(expected.relative_error, rel=1e-2)


def chain(*dynamics: str) -> Case:
    """Make a chain of bodies whose joints have these ``<dynamics>``."""
    links = [link(f"l{k}", mass=1.0, center=(0.1, 0.2, 0.3)) for k in range(len(dynamics) + 1)]
    joints = [
        joint(f"j{k}", f"l{k}", f"l{k + 1}", each, f'<origin xyz="0.2 {0.1 * k} 0.3" rpy="0.4 {k} 0.1"/>')
        for k, each in enumerate(dynamics)
    ]
    return case_of(*links, *joints)


few = settings(max_examples=min(PROFILE, max(10, PROFILE // 4)))
"""Every example has several joints, which all engines load together and alone."""

dampings = st.lists(st.floats(-6.0, 4.0).map(lambda power: 10.0**power), min_size=2, max_size=5)


@few
@given(dampings)
def test_the_effect_of_damping_is_the_torque_of_its_own_joint(values: list[float]) -> None:
    case = chain(*(f'<dynamics damping="{value!r}"/>' for value in values))
    reference = Examiner(installed_engines(), SAMPLES, SEED).reference(case)
    scale = np.max(np.abs(reference.torque))
    speeds = np.max(np.abs(reference.states.v), axis=0)
    proofs = attributions(case, find_rule("DX301"))
    assert [each.detection.joint for each in proofs] == [f"j{k}" for k in range(len(values))]
    for each, value, speed in zip(proofs, values, speeds, strict=True):
        assert each.proved
        for engine in {"drake", "mujoco"}.intersection(each.effects):
            effect = each.effects[engine]
            expected = value * speed / scale
            assert effect.relative_error >= expected * (1.0 - 1e-6)
            if effect.quantity == TORQUE:
                assert effect.relative_error == pytest.approx(expected, rel=1e-6)


@few
@given(dampings)
def test_the_effect_of_friction_is_the_force_of_its_own_joint(values: list[float]) -> None:
    if "mujoco" not in installed_engines():
        pytest.skip("MuJoCo is not installed")
    # Far below the speed at which the constraint could hold the joint.
    small = [min(value, 1e-2) for value in values]
    case = chain(*(f'<dynamics friction="{value!r}"/>' for value in small))
    scale = np.max(np.abs(Examiner(installed_engines(), SAMPLES, SEED).reference(case).torque))
    for each, value in zip(attributions(case, find_rule("DX302")), small, strict=True):
        effect = each.effects["mujoco"]
        if effect.quantity == TORQUE:
            assert effect.relative_error == pytest.approx(value / scale, rel=1e-6)
        else:
            assert effect.relative_error > value / scale


def test_a_mimic_joint_is_charged_with_its_own_constraint() -> None:
    case = chain("", '<mimic joint="j0"/>', '<mimic joint="j0" multiplier="0.5"/>')
    proofs = attributions(case, find_rule("DX304"))
    assert [each.detection.joint for each in proofs] == ["j1", "j2"]
    numbers = [each.effects["mujoco"].relative_error for each in proofs if "mujoco" in each.effects]
    assert len(set(numbers)) == len(numbers)
    for each in proofs:
        if "drake" in each.effects:
            assert each.effects["drake"].quantity == ACCELERATION


def test_a_report_charges_each_joint_with_its_own_damping() -> None:
    case = chain('<dynamics damping="100"/>', '<dynamics damping="1e-4"/>')
    large, small = (
        each.effect.relative_error
        for each in diagnose(case.source.text, counterexamples=False).differences
        if each.rule == "DX301" and each.effect is not None
    )
    assert small < 1e-4 * large


@pytest.mark.skipif("mujoco" not in installed_engines(), reason="MuJoCo is not installed")
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_places_that_one_remedy_mends_together_all_have_their_effect(base: Base) -> None:
    rods = [link(name, mass=1.0, moments=(0.1, 0.0, 0.1)) for name in ("rod", "end")]
    fixed = joint("bolt", "rod", "end", '<origin xyz="0 0 0.5"/>', type="fixed")
    text = case_of(
        link("base", moments=(0.2, 0.2, 0.3)), *rods, joint("turn", "base", "rod"), fixed
    ).source.text
    report = diagnose(text, base=base, engines=["mujoco"], counterexamples=False)
    found = [each for each in report.differences if each.rule == "DX111"]
    assert [(each.link, each.proved) for each in found] == [("rod", True), ("end", True)]
    assert report.explained
