"""Texts of a rule name engines only where these take part in every examination that shows them."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from dynx.doctor import diagnose
from dynx.loaded import installed_engines
from dynx.rules import Rule, all_rules
from dynx.rules.registry import find_trap, trap_case
from dynx.rules.rule import Detection

ENGINES = re.compile(r"pinocchio|(?:py)?bullet|mujoco|drake", re.IGNORECASE)


def named(text: str) -> set[str]:
    """Return the engines that a text names."""
    return {f"py{name}" if name == "bullet" else name for name in map(str.lower, ENGINES.findall(text))}


def allowed(rule: Rule) -> set[str]:
    """Return the engine that a rule is about, if it is about one."""
    engines = {name.partition(":")[0] for name in rule.engines}
    return engines if len(engines) == 1 else set()


def require_own(detection: Detection, rule: Rule) -> None:
    """Check the message and the clauses of a detection."""
    assert named(detection.message) <= allowed(rule), detection.message
    for engine, clause in detection.engine_clauses:
        assert named(clause) == {engine.partition(":")[0]}


@pytest.mark.parametrize("rule", all_rules(), ids=lambda rule: rule.id)
def test_a_rule_names_an_engine_only_if_it_is_about_this_one_alone(rule: Rule) -> None:
    for text in (rule.title, rule.advice, *rule.choices.values()):
        assert named(text) <= allowed(rule), text
    case = trap_case(rule)
    found = rule.detect(case)
    for each in found:
        require_own(each, rule)
    for choice in rule.choices or {"": ""}:
        chosen = replace(case, choices={rule.id: choice} if choice else {})
        remedy = rule.remedy(chosen, found)
        if remedy is not None:
            assert named(f"{remedy.changed} {remedy.choice or ''}") <= allowed(rule)


@pytest.mark.parametrize("rule", ["DX101", "DX103", "DX108", "DX109"])
@pytest.mark.parametrize("engines", [("pinocchio", "pybullet"), ("mujoco", "drake"), ("pinocchio",)])
def test_a_report_names_the_engines_asked_for(rule: str, engines: tuple[str, ...]) -> None:
    if not set(engines) <= set(installed_engines()):
        pytest.skip(f"{engines} are not installed")
    report = diagnose(find_trap(rule), engines=engines, samples=1)
    texts = [*report.choices, report.verdict]
    texts += [text for each in report.findings for text in (each.message, each.remedy or "")]
    texts += [code for call in report.calls for code in (call.engine, call.code)]
    assert named(" ".join(texts)) <= set(engines)
