"""Every rule on random robots in random spellings: no error occurs, and remedies remove their causes."""

from __future__ import annotations

from hypothesis import given, note
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import TILTED_GRAVITY
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Rule, all_rules
from dynx.testing.strategies import urdf_text
from tests.rules.readings import reading_difference

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
